//! What a calibration has found so far, kept beside its results until these are there.
//!
//! The first line says of what; then one line follows for each search of the fit that is done, each by one write. So
//! whenever the program was killed, all but a last line can be read, and the same command goes on from there.

use std::{
    fmt::{self, Write as _},
    fs::{self, File, OpenOptions},
    io::{self, Read as _, Write as _},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use rustix::{
    fs::{FlockOperation, flock},
    io::Errno,
};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::{
    cli::{
        Failure, Outcome,
        output::{Overwrite, Product, make_folder},
    },
    inverse::{Fit, Found, Sweep, World},
    store::{hexadecimal, open_own},
};

/// Its name in the folder.
const NAME: &str = "unfinished.jsonl";
/// What its first line has.
const PRODUCT: Product = Product::List(&["calibration_sha256", "version"]);
/// How that begins.
const BEGINNING: &[u8] = br#"{"calibration_sha256":""#;
/// The line after which the folder's other files are this calibration's own.
const RESULTS: &str = r#"{"results":"begun"}"#;
/// What to do where the file is of no use.
pub(super) const HELP: &str =
    "give another folder with --out; or delete the file, or begin anew with --force";

/// The first line: what is calibrated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Head {
    /// Of everything that decides the answer.
    calibration_sha256: String,
    /// The program's.
    version: String,
}

impl Head {
    /// Of a fit: readings, scene, sensor, air, model, and what is believed beforehand.
    pub(super) fn of(world: &World, sweeps: &[Sweep], fit: &Fit) -> Self {
        let mut digest = Hashed(Sha256::new());
        // All fields of all of them, also of those that are yet to come; digits of numbers are enough to have them back.
        let _ = write!(digest, "{world:?} {sweeps:?} {fit:?}");
        let calibration_sha256 = hexadecimal(&digest.0.finalize());
        Self { calibration_sha256, version: env!("CARGO_PKG_VERSION").to_owned() }
    }
}

/// Text that only its digest is kept of.
struct Hashed(Sha256);

impl fmt::Write for Hashed {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text);
        Ok(())
    }
}

/// What the lines after the first say.
#[derive(Debug, Clone, PartialEq, Default)]
struct Known {
    found: Vec<Found>,
    has_results: bool,
    /// Bytes of the lines that are whole.
    whole: usize,
}

/// The file of a calibration, held by this process alone.
pub(super) struct Unfinished {
    path: PathBuf,
    known: Known,
    /// `None` once something could not be kept: what follows it is of no use.
    file: Mutex<Option<File>>,
}

/// Checks before any work that the file may be written in a folder. Returns whether the results in the folder are those
/// of the calibration that it holds unfinished.
///
/// # Errors
/// When something else is in the file's place.
pub(super) fn check(folder: &Path, overwrite: Overwrite) -> Result<bool, Failure> {
    let text = fs::read(folder.join(NAME)).unwrap_or_default();
    // A first line that was cut off says nothing yet.
    let is_cut = text.starts_with(BEGINNING) || BEGINNING.starts_with(&text);
    let is_cut = is_cut && !text.contains(&b'\n');
    overwrite.or_forced(is_cut).check_in(folder, NAME, PRODUCT)?;
    Ok(text.split(|byte| *byte == b'\n').any(|line| line == RESULTS.as_bytes()))
}

impl Unfinished {
    /// Opens or begins the file in a folder, which is made if it is not there.
    ///
    /// # Errors
    /// When another process has it, it is of another calibration or version, a line in it is wrong, or the disk
    /// refuses.
    pub(super) fn open(folder: &Path, overwrite: Overwrite, head: &Head) -> Result<Self, Failure> {
        make_folder(folder)?;
        check(folder, overwrite)?;
        let path = folder.join(NAME);
        let fail = |error: io::Error| Failure::unwritable(&path.display(), &error);
        let options = &mut OpenOptions::new();
        let mut file =
            open_own(options.read(true).append(true).create(true), &path).map_err(fail)?;
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => {
                let error = format!("{}: another process is at this calibration", path.display());
                return Err(Failure::input(
                    error,
                    "wait for it, or give another folder with --out",
                ));
            }
            Err(error) => return Err(fail(error.into())),
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(fail)?;
        let known = match read(&text, head) {
            Err(_) if overwrite.is_forced() => None,
            known => {
                known.map_err(|why| Failure::input(format!("{}: {why}", path.display()), HELP))?
            }
        };
        let whole = known.as_ref().map_or(0, |known| known.whole);
        if whole < text.len() {
            file.set_len(whole as u64).map_err(fail)?;
        }
        if known.is_none() {
            write_line(&mut file, &json(head)).map_err(fail)?;
        }
        Ok(Self { path, known: known.unwrap_or_default(), file: Mutex::new(Some(file)) })
    }

    /// What was found before.
    pub(super) fn known(&self) -> &[Found] {
        &self.known.found
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Keeps what a search came to; says so if it can't.
    pub(super) fn keep(&self, found: &Found) {
        let line = json(found);
        // A figure that is no number would not come back as it is.
        let is_right = serde_json::from_str::<Found>(&line).is_ok_and(|read| read == *found);
        self.add(is_right.then_some(line));
    }

    /// Remembers that the folder's other files are this calibration's from here on. Gives whether they were before.
    pub(super) fn begin_results(&self) -> bool {
        if !self.known.has_results {
            self.add(Some(RESULTS.to_owned()));
        }
        self.known.has_results
    }

    /// Takes it away: the results are there, or there will be none.
    ///
    /// # Errors
    /// What the disk refuses.
    pub(super) fn remove(&self) -> Outcome {
        fs::remove_file(&self.path)
            .map_err(|error| Failure::unwritable(&self.path.display(), &error))
    }

    fn add(&self, line: Option<String>) {
        // Nothing under this lock can panic, so a poisoned one holds what it should.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let written = match (file.as_mut(), line) {
            (Some(file), Some(line)) => write_line(file, &line).map_err(|error| error.to_string()),
            (Some(_), None) => Err("a figure in it is no number".to_owned()),
            (None, _) => Ok(()),
        };
        if let Err(why) = written {
            let path = self.path.display();
            notice!(
                "warning: cannot add to {path}: {why}; if it is stopped, it will go on from before this"
            );
            *file = None;
        }
    }
}

/// What the file says; `None` of one that was hardly begun.
fn read(text: &[u8], head: &Head) -> Result<Option<Known>, String> {
    let lines: Vec<&[u8]> =
        text.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n")).collect();
    let Some((first, rest)) = lines.split_first() else { return Ok(None) };
    let of: Head = serde_json::from_slice(first)
        .map_err(|error| format!("line 1 does not say of which calibration it is: {error}"))?;
    if of.version != head.version {
        let [had, is] = [&of.version, &head.version];
        return Err(format!("begun by version {had} of sonard, and this is {is}"));
    }
    if of != *head {
        return Err(
            "the calibration that it was begun for is another one: other readings, scene, \
                    sensor, air or options"
                .to_owned(),
        );
    }
    let mut known = Known { whole: first.len(), ..Known::default() };
    for (at, line) in rest.iter().enumerate() {
        if line.trim_ascii_end() == RESULTS.as_bytes() {
            known.has_results = true;
        } else {
            match serde_json::from_slice(line) {
                Ok(found) => known.found.push(found),
                // Cut off by a power cut that left the file its length.
                Err(_) if at + 1 == rest.len() => break,
                Err(error) => return Err(format!("line {} is wrong: {error}", at + 2)),
            }
        }
        known.whole += line.len();
    }
    Ok(Some(known))
}

/// Numbers and texts can always be written.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// By one write, so that it is there whole or cut off.
fn write_line(file: &mut File, line: &str) -> io::Result<()> {
    file.write_all(format!("{line}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(digest: &str) -> Head {
        Head { calibration_sha256: digest.to_owned(), version: "1".to_owned() }
    }

    fn place(value: f64) -> Found {
        Found::Place { values: vec![value, -1.0 / 3.0], log_posterior: 1e-300 }
    }

    fn has_results(folder: &Path) -> bool {
        check(folder, Overwrite::default()).expect("it is a calibration's")
    }

    fn open(folder: &Path, digest: &str) -> Result<Unfinished, Failure> {
        Unfinished::open(folder, Overwrite::default(), &head(digest))
    }

    #[test]
    fn what_was_found_is_there_again_and_what_was_cut_off_is_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = &folder.path().join("out");
        let found: Vec<Found> = [0.1, f64::MIN_POSITIVE, 5e-324, -0.0, 1.0 / 7.0].map(place).into();
        let begun = open(folder, "a").expect("it is new");
        found.iter().for_each(|found| begun.keep(found));
        assert!(open(folder, "a").is_err(), "two at a time");
        drop(begun);
        let path = folder.join(NAME);
        let text = fs::read(&path).expect("there");
        let head_bytes = text.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
        for cut in 0..=text.len() {
            fs::write(&path, &text[..cut]).expect("writable");
            let again = open(folder, "a").expect("it is the same");
            let whole = text[..cut].iter().filter(|byte| **byte == b'\n').count();
            assert_eq!(again.known(), &found[..whole.saturating_sub(1)], "{cut}");
            again.keep(&found[0]);
            drop(again);
            let written = fs::read(&path).expect("there");
            assert!(written.ends_with(b"}\n") && written.len() > head_bytes, "{cut}");
            assert_eq!(open(folder, "a").expect("the same").known().len(), whole.max(1), "{cut}");
        }
    }

    #[test]
    fn a_file_that_does_not_go_with_it_is_refused_and_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(NAME);
        let begun = open(folder.path(), "a").expect("it is new");
        [0.1, 0.2].map(place).iter().for_each(|found| begun.keep(found));
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
    fn what_would_not_come_back_is_not_kept_nor_what_follows() {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = open(folder.path(), "a").expect("it is new");
        [0.1, f64::NAN, 0.2].map(place).iter().for_each(|found| begun.keep(found));
        assert!(!begun.begin_results());
        drop(begun);
        let again = open(folder.path(), "a").expect("the same");
        assert_eq!(again.known(), [place(0.1)]);
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
