//! Calibrations that are stopped or killed, and go on.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Output, Stdio},
};

use crate::common::{interrupt, run, sonard, stderr, wait_until};

/// Three sweeps of a room, and a fit of their poses and the room's walls that takes some seconds.
struct Case {
    folder: tempfile::TempDir,
    log: String,
}

impl Case {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
        let (way, log) = (path("trajectory.csv"), path("room.jsonl"));
        fs::write(&way, "x_m,y_m,heading_deg\n0.8,0.05,92\n0.4,0.3,10\n0.2,0.3,200\n")
            .expect("room on the disk");
        let simulate = ["simulate", "--scene", "simple-room", "--poses", &way];
        let noise = ["--jitter-us", "6", "--temperature-c", "15"];
        let output = run(&[&simulate[..], &noise, &["--step-deg", "3.6", "-o", &log]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        Self { folder, log }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn out(&self, name: &str) -> String {
        self.path(name).to_str().expect("a plain path").to_owned()
    }

    fn command(&self, out: &str) -> std::process::Command {
        let fit = ["--fit", "pose,air,threshold,walls", "--temperature-c", "20"];
        sonard(&[&["calibrate", &self.log, "--out", &self.out(out)][..], &fit].concat())
    }

    fn calibrate(&self, out: &str) -> Output {
        self.command(out).output().expect("it starts")
    }

    /// Waits until so many lines are kept and the results are not there yet.
    fn wait_for_lines(&self, out: &str, lines: usize) {
        wait_until("what is kept", || self.lines(out) >= lines);
    }

    fn lines(&self, out: &str) -> usize {
        let kept = fs::read(self.path(out).join(UNFINISHED)).unwrap_or_default();
        kept.iter().filter(|byte| **byte == b'\n').count()
    }
}

const UNFINISHED: &str = "unfinished.jsonl";

/// The files of a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    entries
        .map(|entry| entry.path())
        .map(|path| (name(&path), fs::read(&path).expect("readable")))
        .collect()
}

/// Returns the number of searches after which a calibration continued, from its output.
fn known(output: &Output) -> usize {
    let printed = stderr(output);
    let words = printed.split("resuming after ").nth(1).unwrap_or_else(|| panic!("{printed}"));
    words.split(' ').next().and_then(|count| count.parse().ok()).expect("a number")
}

#[test]
fn resumes_after_kill() {
    let case = Case::new();
    let whole = case.calibrate("whole");
    assert_eq!(whole.status.code(), Some(0), "{}", stderr(&whole));
    let wanted = files(&case.path("whole"));
    assert!(wanted.contains_key("estimates.jsonl") && !wanted.contains_key(UNFINISHED));
    let mut kept = 0;
    for _ in 0..2 {
        let mut child = case.command("killed").stderr(Stdio::null()).spawn().expect("it starts");
        case.wait_for_lines("killed", kept + 4);
        child.kill().expect("its own child");
        child.wait().expect("it ends");
        kept = case.lines("killed");
        assert_eq!(files(&case.path("killed")).len(), 1, "it was killed too late");
    }
    let done = case.calibrate("killed");
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    // All but the first line are searches that were not made again.
    assert_eq!(known(&done), kept - 1);
    assert_eq!(files(&case.path("killed")), wanted);
    assert_eq!(done.stdout, whole.stdout);
}

#[test]
fn interrupt_and_lock() {
    let case = Case::new();
    let child = case.command("out").stderr(Stdio::piped()).spawn().expect("it starts");
    case.wait_for_lines("out", 3);
    interrupt(child.id());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("run the same command to resume"), "{}", stderr(&output));
    let unfinished = case.path("out").join(UNFINISHED);
    let kept = fs::read(&unfinished).expect("it is kept");
    // Other beliefs, and other readings.
    let other = case.path("other.jsonl");
    let text = fs::read_to_string(&case.log).expect("a log");
    let last = text.trim_end().rfind("\n{\"type\":\"scan_start\"").expect("several scans");
    fs::write(&other, &text[..=last]).expect("room on the disk");
    let other = other.to_str().expect("a plain path");
    let believed = ["--temperature-c", "20", "--out", &case.out("out")];
    let fit = ["--fit", "pose,air,threshold,walls"];
    let less = ["--fit", "pose,air"];
    for (log, fit) in [(&*case.log, less), (other, fit)] {
        let refused = run(&[&["calibrate", log][..], &fit, &believed].concat());
        let message = stderr(&refused);
        assert_eq!(refused.status.code(), Some(2), "{message}");
        assert!(message.contains(UNFINISHED) && message.contains("--force"), "{message}");
        assert_eq!(fs::read(&unfinished).expect("it is kept"), kept);
    }
    // What a killed one has begun to write it may write again.
    let begun = [&kept[..], b"{\"results\":\"begun\"}\n{\"search\":\"pl"].concat();
    fs::write(&unfinished, begun).expect("it is ours");
    fs::write(case.path("out").join("poses.jsonl"), "{").expect("it is ours");
    let done = case.calibrate("out");
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    assert!(known(&done) >= 2, "{}", stderr(&done));
    let names: Vec<String> = files(&case.path("out")).into_keys().collect();
    assert_eq!(names.len(), 9, "{names:?}");
}
