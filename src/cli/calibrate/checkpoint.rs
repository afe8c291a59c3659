//! Checkpoint file of a calibration, kept in the output folder until the results are written.
//!
//! The first line identifies the calibration; one line per completed search follows. Each line is
//! appended by a single write, so after a crash at most the last line is incomplete and the same
//! command resumes.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, Read as _, Write as _},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use serde::{Deserialize, Serialize};

use crate::{
    cli::{
        Failure, Outcome,
        digest::digest,
        output::{Overwrite, Product, make_folder},
    },
    inverse::{FitOptions, FitSweep, SearchResult, World},
    store::open_no_follow,
};

/// File name in the output folder.
const NAME: &str = "unfinished.jsonl";
/// Keys of the first line.
const HEAD_KEYS: Product = Product::List(&["calibration_sha256", "version"]);
/// First bytes of the first line.
const HEAD_START: &[u8] = br#"{"calibration_sha256":""#;
/// Line after which the folder's other files are results of this calibration.
const RESULTS: &str = r#"{"results":"begun"}"#;
/// Advice for a file that can't be resumed from.
pub(super) const HELP: &str =
    "give another folder with --out; or delete the file, or start again with --force";

/// First line: identity of the calibration.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Head {
    /// SHA-256 of all inputs that determine the result.
    calibration_sha256: String,
    version: String,
}

impl Head {
    /// Digest of a fit's readings, scene, sensor, air, model and priors.
    pub(super) fn new(world: &World, sweeps: &[FitSweep], fit: &FitOptions) -> Self {
        let calibration_sha256 = digest(format_args!("{world:?} {sweeps:?} {fit:?}"));
        Self { calibration_sha256, version: env!("CARGO_PKG_VERSION").to_owned() }
    }
}

/// Contents of the lines after the first.
#[derive(Debug, Clone, PartialEq, Default)]
struct Saved {
    found: Vec<SearchResult>,
    has_results: bool,
    /// Length of the complete lines, bytes.
    complete: usize,
}

/// Checkpoint file of a calibration, locked by this process.
pub(super) struct Checkpoint {
    path: PathBuf,
    saved: Saved,
    /// `None` after a failed write: later lines would be useless.
    file: Mutex<Option<File>>,
}

/// Checks, before any work, that the file may be written in a folder. Returns `true` if the results
/// in the folder belong to the calibration of the checkpoint.
///
/// # Errors
///
/// Another file has this name.
pub(super) fn check(folder: &Path, overwrite: Overwrite) -> Result<bool, Failure> {
    let text = fs::read(folder.join(NAME)).unwrap_or_default();
    // An incomplete first line identifies no calibration yet.
    let is_cut = text.starts_with(HEAD_START) || HEAD_START.starts_with(&text);
    let is_cut = is_cut && !text.contains(&b'\n');
    overwrite.or_forced(is_cut).check_in(folder, NAME, HEAD_KEYS)?;
    Ok(text.split(|byte| *byte == b'\n').any(|line| line == RESULTS.as_bytes()))
}

impl Checkpoint {
    /// Opens or creates the file in a folder, which is created if missing.
    ///
    /// # Errors
    ///
    /// The file is locked by another process, belongs to another calibration or version, has an
    /// invalid line, or can't be written.
    pub(super) fn open(folder: &Path, overwrite: Overwrite, head: &Head) -> Result<Self, Failure> {
        make_folder(folder)?;
        check(folder, overwrite)?;
        let path = folder.join(NAME);
        let fail = |error: io::Error| Failure::unwritable(&path.display(), &error);
        let options = &mut OpenOptions::new();
        let mut file =
            open_no_follow(options.read(true).append(true).create(true), &path).map_err(fail)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let error = format!("{}: another process runs this calibration", path.display());
                return Err(Failure::input(
                    error,
                    "wait for it, or give another folder with --out",
                ));
            }
            Err(TryLockError::Error(error)) => return Err(fail(error)),
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(fail)?;
        let saved = match read(&text, head) {
            Err(_) if overwrite.is_forced() => None,
            saved => {
                saved.map_err(|why| Failure::input(format!("{}: {why}", path.display()), HELP))?
            }
        };
        let complete = saved.as_ref().map_or(0, |saved| saved.complete);
        if complete < text.len() {
            file.set_len(complete as u64).map_err(fail)?;
        }
        if saved.is_none() {
            write_line(&mut file, &json(head)).map_err(fail)?;
        }
        Ok(Self { path, saved: saved.unwrap_or_default(), file: Mutex::new(Some(file)) })
    }

    /// Returns the saved searches.
    pub(super) fn saved(&self) -> &[SearchResult] {
        &self.saved.found
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends the result of a search; logs a warning on failure.
    pub(super) fn save(&self, found: &SearchResult) {
        let line = json(found);
        // A non-finite number would not survive the round trip.
        let is_right = serde_json::from_str::<SearchResult>(&line).is_ok_and(|read| read == *found);
        self.append(is_right.then_some(line));
    }

    /// Marks the folder's other files as results of this calibration. Returns `true` if they were
    /// marked before.
    pub(super) fn begin_results(&self) -> bool {
        if !self.saved.has_results {
            self.append(Some(RESULTS.to_owned()));
        }
        self.saved.has_results
    }

    /// Deletes the file, when results are written or no results are possible.
    ///
    /// # Errors
    ///
    /// The file can't be deleted.
    pub(super) fn remove(&self) -> Outcome {
        fs::remove_file(&self.path)
            .map_err(|error| Failure::unwritable(&self.path.display(), &error))
    }

    fn append(&self, line: Option<String>) {
        // No code panics while it holds this lock, so a poisoned lock guards consistent data.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let written = match (file.as_mut(), line) {
            (Some(file), Some(line)) => write_line(file, &line).map_err(|error| error.to_string()),
            (Some(_), None) => Err("it contains a non-finite number".to_owned()),
            (None, _) => Ok(()),
        };
        if let Err(why) = written {
            let path = self.path.display();
            notice!(
                "warning: cannot append to {path}: {why}; an interrupted calibration will resume from the last saved search"
            );
            *file = None;
        }
    }
}

/// Parses the file; `None` if no line is complete.
fn read(text: &[u8], head: &Head) -> Result<Option<Saved>, String> {
    let lines: Vec<&[u8]> =
        text.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n")).collect();
    let Some((head_line, rest)) = lines.split_first() else { return Ok(None) };
    let first: Head = serde_json::from_slice(head_line)
        .map_err(|error| format!("line 1 does not identify a calibration: {error}"))?;
    if first.version != head.version {
        let [had, is] = [&first.version, &head.version];
        return Err(format!("started by sonard {had}; this is sonard {is}"));
    }
    if first != *head {
        return Err(
            "it belongs to another calibration: readings, scene, sensor, air or options differ"
                .to_owned(),
        );
    }
    let mut saved = Saved { complete: head_line.len(), ..Saved::default() };
    for (at, line) in rest.iter().enumerate() {
        if line.trim_ascii_end() == RESULTS.as_bytes() {
            saved.has_results = true;
        } else {
            match serde_json::from_slice(line) {
                Ok(found) => saved.found.push(found),
                // Incomplete, although the length is right, after a power failure.
                Err(_) if at + 1 == rest.len() => break,
                Err(error) => return Err(format!("line {} is invalid: {error}", at + 2)),
            }
        }
        saved.complete += line.len();
    }
    Ok(Some(saved))
}

/// Serializes a value; numbers and strings never fail.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Appends a line with a single write, so that it is either complete or cut off.
fn write_line(file: &mut File, line: &str) -> io::Result<()> {
    file.write_all(format!("{line}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(digest: &str) -> Head {
        Head { calibration_sha256: digest.to_owned(), version: "1".to_owned() }
    }

    fn place(value: f64) -> SearchResult {
        SearchResult::Place { values: vec![value, -1.0 / 3.0], log_posterior: 1e-300 }
    }

    fn has_results(folder: &Path) -> bool {
        check(folder, Overwrite::default()).expect("it is a calibration's")
    }

    fn open(folder: &Path, digest: &str) -> Result<Checkpoint, Failure> {
        Checkpoint::open(folder, Overwrite::default(), &head(digest))
    }

    #[test]
    fn resumes_after_cut_at_any_byte() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = &folder.path().join("out");
        let found: Vec<SearchResult> =
            [0.1, f64::MIN_POSITIVE, 5e-324, -0.0, 1.0 / 7.0].map(place).into();
        let begun = open(folder, "a").expect("it is new");
        found.iter().for_each(|found| begun.save(found));
        assert!(open(folder, "a").is_err(), "two at a time");
        drop(begun);
        let path = folder.join(NAME);
        let text = fs::read(&path).expect("there");
        let head_bytes = text.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
        for cut in 0..=text.len() {
            fs::write(&path, &text[..cut]).expect("writable");
            let again = open(folder, "a").expect("it is the same");
            let complete = text[..cut].iter().filter(|byte| **byte == b'\n').count();
            assert_eq!(again.saved(), &found[..complete.saturating_sub(1)], "{cut}");
            again.save(&found[0]);
            drop(again);
            let written = fs::read(&path).expect("there");
            assert!(written.ends_with(b"}\n") && written.len() > head_bytes, "{cut}");
            assert_eq!(
                open(folder, "a").expect("the same").saved().len(),
                complete.max(1),
                "{cut}"
            );
        }
    }

    #[test]
    fn foreign_file_is_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(NAME);
        let begun = open(folder.path(), "a").expect("it is new");
        [0.1, 0.2].map(place).iter().for_each(|found| begun.save(found));
        drop(begun);
        let text = fs::read_to_string(&path).expect("there");
        let wrong_line = text.replacen("place", "palace", 1);
        let other_version = text.replacen(r#""version":"1""#, r#""version":"0""#, 1);
        for (text, digest) in [(&text, "b"), (&wrong_line, "a"), (&other_version, "a")] {
            fs::write(&path, text).expect("writable");
            assert!(matches!(open(folder.path(), digest), Err(Failure::Input(_))), "{text}");
            assert_eq!(&fs::read_to_string(&path).expect("kept"), text);
        }
    }

    #[test]
    fn stops_at_non_finite_number() {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = open(folder.path(), "a").expect("it is new");
        [0.1, f64::NAN, 0.2].map(place).iter().for_each(|found| begun.save(found));
        assert!(!begun.begin_results());
        drop(begun);
        let again = open(folder.path(), "a").expect("the same");
        assert_eq!(again.saved(), [place(0.1)]);
        assert!(!again.begin_results() && has_results(folder.path()));
        drop(again);
        let again = open(folder.path(), "a").expect("the same");
        assert!(again.begin_results());
        again.remove().expect("it can be");
        assert!(
            !has_results(folder.path())
                && folder.path().read_dir().expect("a folder").next().is_none()
        );
    }
}
