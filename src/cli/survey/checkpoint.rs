//! Checkpoint file of a survey that runs or ended early, kept in the output folder.
//!
//! The first line identifies the survey, the second has the scores of the plans tried so far. The
//! same command continues from them and gives the result of an uninterrupted survey.

use std::{
    fs, io,
    path::Path,
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use serde::{Deserialize, Serialize};

use super::{Args, Input};
use crate::{
    cli::{
        Failure, Outcome,
        digest::digest,
        output::{Overwrite, Product, make_folder},
    },
    survey::{PlanScores, SurveyOptions},
};

/// File name in the output folder.
const NAME: &str = "unfinished.jsonl";
/// Keys of the first line.
const HEAD_KEYS: Product = Product::List(&["survey_sha256", "version"]);

/// First line: identity of the survey.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Head {
    /// SHA-256 of all inputs that determine the search. Its budget only ends it, and the next view
    /// follows it.
    survey_sha256: String,
    version: String,
}

impl Head {
    pub(super) fn new(args: &Args, input: &Input) -> Self {
        let options = SurveyOptions { max_scenes: 0, view_reach_m: 0.0, ..args.options() };
        let survey_sha256 =
            digest(format_args!("{:?} {:?} {options:?}", input.world, input.course));
        Self { survey_sha256, version: env!("CARGO_PKG_VERSION").to_owned() }
    }
}

/// Reads the scores of a survey that ended early; `None` without a file, or for another survey if
/// overwriting is forced.
///
/// # Errors
///
/// The file belongs to another survey or version, is invalid, or can't be read.
pub(super) fn load(
    folder: &Path,
    overwrite: Overwrite,
    head: &Head,
) -> Result<Option<PlanScores>, Failure> {
    let path = folder.join(NAME);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        _ if overwrite.is_forced() => return Ok(None),
        text => {
            text.map_err(|error| Failure::input(format!("{}: {error}", path.display()), HELP))?
        }
    };
    let scores = read(&text, head);
    scores.map(Some).map_err(|why| Failure::input(format!("{}: {why}", path.display()), HELP))
}

/// Advice for a file that can't be resumed from.
const HELP: &str =
    "give another folder with --out; or delete the file, or start again with --force";

fn read(text: &str, head: &Head) -> Result<PlanScores, String> {
    let (first, second) = text.split_once('\n').unwrap_or((text, ""));
    let first: Head = serde_json::from_str(first)
        .map_err(|error| format!("line 1 does not identify a survey: {error}"))?;
    if first != *head {
        return Err(
            "it belongs to another survey: readings, sensor, air, options or version differ"
                .to_owned(),
        );
    }
    let entries: Vec<(u64, f64)> =
        serde_json::from_str(second).map_err(|error| format!("line 2 is invalid: {error}"))?;
    Ok(entries.into_iter().collect())
}

/// Writes the scores of a survey, as a whole or not at all.
///
/// # Errors
///
/// Write errors.
pub(super) fn save(
    folder: &Path,
    overwrite: Overwrite,
    head: &Head,
    scores: &PlanScores,
) -> Outcome {
    let lines = [serde_json::to_string(head), serde_json::to_string(&scores.entries())];
    let lines = lines.map(|line| line.unwrap_or_default() + "\n");
    overwrite.save(&folder.join(NAME), HEAD_KEYS, lines.concat().as_bytes())
}

/// Longest time between saved checkpoints.
const LONGEST_INTERVAL: Duration = Duration::from_secs(30);

/// Runs a search and saves its scores meanwhile, after 1, 2, 4, ... seconds, and every 30 seconds
/// then. A write error ends the saving with a warning; the search continues.
pub(super) fn while_saving<T>(
    folder: &Path,
    overwrite: Overwrite,
    head: &Head,
    scores: &PlanScores,
    search: impl FnOnce() -> T,
) -> T {
    let (running, is_running) = channel::<()>();
    thread::scope(|scope| {
        scope.spawn(move || {
            let mut interval = Duration::from_secs(1);
            while is_running.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                let saved =
                    make_folder(folder).and_then(|()| save(folder, overwrite, head, scores));
                if saved.is_err() {
                    notice!(
                        "warning: {}: checkpoints can't be written: a killed survey begins again",
                        folder.join(NAME).display()
                    );
                    break;
                }
                interval = (2 * interval).min(LONGEST_INTERVAL);
            }
        });
        // Dropped at the end of the search, also by a panic.
        let _running = running;
        search()
    })
}

/// Deletes the file of a survey that is complete; a file of another kind remains.
///
/// # Errors
///
/// The file can't be deleted.
pub(super) fn remove(folder: &Path) -> Outcome {
    let path = folder.join(NAME);
    let text = fs::read_to_string(&path).unwrap_or_default();
    if serde_json::from_str::<Head>(text.lines().next().unwrap_or_default()).is_err() {
        return Ok(());
    }
    match fs::remove_file(&path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(Failure::unwritable(&path.display(), &error))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_read_as_written() {
        let head =
            |digest: &str| Head { survey_sha256: digest.to_owned(), version: "1".to_owned() };
        let folder = tempfile::tempdir().expect("a folder");
        let own = Overwrite::default();
        assert!(load(folder.path(), own, &head("a")).expect("no file").is_none());
        let entries = vec![(7, -1e9), (u64::MAX, -1.0 / 3.0)];
        let scores: PlanScores = entries.iter().copied().collect();
        save(folder.path(), own, &head("a"), &scores).expect("written");
        let read = load(folder.path(), own, &head("a")).expect("the same").expect("scores");
        assert_eq!(read.entries(), entries);
        assert!(load(folder.path(), own, &head("b")).is_err());
        assert!(load(folder.path(), own.or_forced(true), &head("b")).expect("forced").is_none());
        remove(folder.path()).expect("deleted");
        assert!(load(folder.path(), own, &head("a")).expect("no file").is_none());
    }
}
