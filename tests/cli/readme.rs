//! Commands of the documents, run as pasted in an empty folder.
//!
//! Blocks marked `sh` in README.md and in the pages of the book (docs/) are run, less the lines of [`EXCEPTIONS`]. Blocks
//! marked `sh,ignore` are not; the line before them states the reason, as `<!-- not run: REASON -->`.

use std::{
    collections::BTreeSet,
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use crate::common::{run, stderr};

/// Starts of lines that build, install, or need hardware, data of others or the rights of root.
const EXCEPTIONS: [&str; 9] = [
    "cargo ",
    "./test.sh",
    "docs/build.sh",
    "packaging/build.sh",
    "pip ",
    "python3 docs/",
    "sudo ",
    "sudoedit ",
    "web/build.sh",
];

/// Languages of blocks. Others, such as `bash`, could hide commands from this test.
const LANGUAGES: [&str; 8] = ["", "ini", "json", "python", "sh", "sh,ignore", "sql", "toml"];

/// Bound of the running time of a block, so that a program that stays in the foreground fails its
/// test: far above that of any block on a busy computer.
const MAX_BLOCK_S: u32 = 600;

/// Folder of the book.
fn book() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")
}

/// Path of README.md within docs/.
const README: &str = "../README.md";

/// Text of a page of the book, by its path within docs/.
fn page(name: &str) -> String {
    fs::read_to_string(book().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Paths of all pages within docs/.
fn all_pages() -> Vec<String> {
    fn collect(folder: &Path, pages: &mut Vec<String>) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                collect(&path, pages);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                let name = path.strip_prefix(book()).expect("within the book");
                pages.push(name.to_str().expect("a plain path").to_owned());
            }
        }
    }
    let mut pages = Vec::new();
    collect(&book(), &mut pages);
    pages.sort();
    pages
}

/// Shell blocks of a document without the lines of [`EXCEPTIONS`].
fn shell_blocks(document: &str) -> Vec<String> {
    let exception = |line: &&str| !EXCEPTIONS.iter().any(|start| line.starts_with(start));
    let block = |rest: &str| {
        let block = rest.split("```").next().unwrap_or_default();
        block.lines().filter(exception).map(|line| format!("{line}\n")).collect()
    };
    let blocks = document.split("```sh\n").skip(1).map(block);
    blocks.filter(|block: &String| !block.trim().is_empty()).collect()
}

/// Runs a block in `folder` with `sonard` on the path; its background processes end with it.
fn run_block(block: &str, folder: &Path) {
    let program = Path::new(env!("CARGO_BIN_EXE_sonard")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), env::var("PATH").unwrap_or_default());
    let script = format!("set -e\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{block}");
    let output = Command::new("timeout")
        .args([&MAX_BLOCK_S.to_string(), "bash", "-c", &script])
        .current_dir(folder)
        .env("PATH", &path)
        .env("NO_COLOR", "1")
        .output()
        .expect("bash starts");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), stderr(&output));
    assert!(output.status.success(), "{block}\n{out}\n{err}");
    assert!(!err.contains("panicked"), "{block}\n{err}");
}

/// Runs the blocks of a document in one empty folder.
fn run_document(document: &str) -> tempfile::TempDir {
    require("curl");
    let folder = tempfile::tempdir().expect("a folder");
    shell_blocks(document).iter().for_each(|block| run_block(block, folder.path()));
    folder
}

/// A test for each page, so that they run in parallel.
macro_rules! pages {
    ($($test:ident: $page:literal,)*) => {
        /// Pages with commands that are run, by their paths within docs/.
        const PAGES: &[&str] = &[$($page),*];

        mod pages {
            $(
                #[test]
                fn $test() {
                    super::run_document(&super::page($page));
                }
            )*
        }
    };
}

pages! {
    api: "api.md",
    arrays: "arrays.md",
    calibration: "calibration.md",
    collection: "collection.md",
    command_line: "command-line.md",
    compare: "compare.md",
    configuration: "configuration.md",
    daemon: "daemon.md",
    engines: "engines.md",
    export: "export.md",
    first_scan: "first-scan.md",
    generate: "generate.md",
    import: "import.md",
    install: "install.md",
    localisation: "localisation.md",
    log: "log.md",
    mapping: "mapping.md",
    mock: "mock.md",
    model: "model.md",
    reality: "reality.md",
    survey: "survey.md",
    teaching: "teaching.md",
}

/// The page that a test of its own runs.
const COPYING_LOGS: &str = "copying-logs.md";

#[test]
fn all_pages_with_commands_are_run() {
    let with_commands =
        all_pages().into_iter().filter(|name| !shell_blocks(&page(name)).is_empty());
    let mut expected: Vec<_> = PAGES.iter().copied().chain([COPYING_LOGS]).collect();
    expected.sort_unstable();
    assert_eq!(with_commands.collect::<Vec<_>>(), expected, "the list of this test");
}

#[test]
fn ignored_blocks_state_a_reason() {
    let mut faults = Vec::new();
    for name in all_pages().into_iter().chain([README.to_owned()]) {
        let text = page(&name);
        let (mut within, mut before) = (false, "");
        for line in text.lines() {
            if let Some(language) = line.trim_start().strip_prefix("```") {
                let reason = before.strip_prefix("<!-- not run: ").unwrap_or_default();
                if !within && !LANGUAGES.contains(&language) {
                    faults.push(format!("{name}: a block of language {language}"));
                }
                if !within && language == "sh,ignore" && !reason.ends_with(" -->") {
                    faults.push(format!("{name}: no reason before a block that is not run"));
                }
                within = !within;
            }
            before = line;
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Panics unless `program`, of the Debian package of that name, can be run.
fn require(program: &str) {
    let version = Command::new(program).arg("--version").stdout(Stdio::null()).status();
    assert!(version.is_ok(), "{program} is missing: sudo apt-get install {program}");
}

#[test]
fn readme() {
    let folder = run_document(&page(README));
    for file in ["out/fig7/scan.png", "path.png"] {
        assert!(fs::metadata(folder.path().join(file)).is_ok_and(|file| file.len() > 0), "{file}");
    }
}

/// The tour shows most verbs.
#[test]
fn verbs_of_the_tour() {
    let text = page("first-scan.md");
    let lines = text.lines().filter(|line| line.starts_with("sonard "));
    let verbs: BTreeSet<_> = lines.filter_map(|line| line.split(' ').nth(1)).collect();
    assert!(verbs.len() >= 12, "{verbs:?}");
}

/// Logs in a folder, ordered by name.
fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("read").path());
    let mut logs: Vec<_> =
        entries.filter(|log| log.extension().is_some_and(|e| e == "jsonl")).collect();
    logs.sort();
    logs
}

#[test]
fn copying_logs() {
    require("rsync");
    let folder = tempfile::tempdir().expect("a folder");
    let blocks = shell_blocks(&page(COPYING_LOGS));
    let [first, again] = &blocks[..] else { panic!("{blocks:?}") };
    run_block(first, folder.path());
    run_block(again, folder.path());
    let copies = |robot: &str| logs_in(&folder.path().join("history").join(robot));
    let same = || {
        ["kiwi", "lime"].iter().all(|robot| {
            let sources = logs_in(&folder.path().join("robots").join(robot));
            let copies = copies(robot);
            let bytes = |logs: &[PathBuf]| -> Vec<_> {
                logs.iter().map(|log| fs::read(log).expect("readable")).collect()
            };
            !sources.is_empty() && bytes(&sources) == bytes(&copies)
        })
    };
    assert!(same());
    let readings = |robot: &str| -> usize {
        let pings = |log: &PathBuf| {
            fs::read_to_string(log).expect("readable").matches("\"type\":\"ping\"").count()
        };
        copies(robot).iter().map(pings).sum()
    };
    let table = fs::read_to_string(folder.path().join("history.csv")).expect("written");
    let expected = readings("kiwi") + readings("lime");
    assert!(expected > 0);
    assert_eq!(table.lines().count(), expected + 1);
    assert!(table.contains("kiwi/sonard-") && table.contains("lime/sonard-"));

    // An interrupted transfer: the copy ends within a line.
    let copy = copies("kiwi").remove(0);
    let whole = fs::read(&copy).expect("readable");
    fs::write(&copy, &whole[..whole.len() / 2]).expect("written");
    run_block(again, folder.path());
    assert!(same(), "continued");
    // A copy that differs, of a log that has grown since.
    let mut damaged = whole[..whole.len() / 2].to_vec();
    damaged[..100].fill(b'x');
    fs::write(&copy, &damaged).expect("written");
    let verified = run(&["log", "verify", copy.to_str().expect("a plain path")]);
    assert_eq!(verified.status.code(), Some(1));
    run_block(again, folder.path());
    assert!(same(), "transferred again");
}

#[test]
fn curl_options_of_old_versions() {
    // --json came with 7.82; Debian 11 has 7.74.
    let help = ("run.rs".to_owned(), include_str!("../../src/cli/run.rs").to_owned());
    let names = all_pages().into_iter().chain([README.to_owned()]);
    let documents = names.map(|name| (name.clone(), page(&name)));
    for (name, text) in documents.chain([help]) {
        let newer = text.lines().find(|line| line.contains("curl") && line.contains("--json"));
        assert_eq!(newer, None, "{name}");
    }
}
