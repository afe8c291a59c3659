//! A plan of `sonard collect` in a temporary folder, and checks of the resulting collection.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Output,
};

use serde_json::Value;

use crate::{Log, run, stderr};

/// A plan of short scans of a quarter turn, 25 beams each, and further lines.
pub const SHORT: &str = "\
[place]
scene = \"simple-room\"
[plan]
to_deg = 90
step_deg = 3.6
[sensor]
max_range_m = 1.5
";

/// Returns standard error with line breaks and repeated blanks joined.
pub fn joined_stderr(output: &Output) -> String {
    stderr(output).replace('\u{2502}', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A folder with a plan in it.
pub struct Case {
    folder: tempfile::TempDir,
}

impl Case {
    pub fn new(plan: &str) -> Self {
        let case = Self { folder: tempfile::tempdir().expect("a folder") };
        case.write("plan.toml", &format!("{SHORT}{plan}"));
        case
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        let path = self.path(name);
        fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("writable");
    }

    /// The arguments of a collection on the mock, with further ones.
    pub fn arguments(&self, further: &[&str]) -> Vec<String> {
        let (plan, out) = (self.path("plan.toml"), self.path("out"));
        let path = |path: &Path| path.to_str().expect("plain path").to_owned();
        let mut arguments = vec!["collect".into(), path(&plan), "--out".into(), path(&out)];
        arguments.extend(further.iter().map(|&one| one.to_owned()));
        if !further.contains(&"--port") && !further.contains(&"--daemon") {
            arguments.push("--mock".into());
        }
        arguments
    }

    pub fn collect(&self, further: &[&str]) -> Output {
        let arguments = self.arguments(further);
        run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// Runs a collection that must complete every scan.
    pub fn collect_all(&self, further: &[&str]) -> Output {
        let output = self.collect(further);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        output
    }

    pub fn manifest(&self) -> Value {
        serde_json::from_str(&self.text("out/manifest.json")).expect("JSON")
    }

    /// The entries of a kind in the journal.
    pub fn entries(&self, kind: &str) -> Vec<Value> {
        let text = self.text("out/journal.jsonl");
        let entries = text.lines().map(|line| serde_json::from_str(line).expect("JSON"));
        entries.filter(|entry: &Value| entry["entry"] == kind).collect()
    }

    /// Names of the files in a part of the folder.
    pub fn files(&self, part: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path("out").join(part)).expect("a folder").flatten();
        let mut names: Vec<_> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub fn scan(&self, name: &str) -> Log {
        Log::read(&self.path("out/scans").join(name))
    }

    /// Returns the output of `--verify` and its exit code.
    pub fn verify(&self) -> (Option<i32>, String) {
        let out = self.path("out");
        let output = run(&["collect", "--verify", out.to_str().expect("plain path")]);
        let printed = String::from_utf8_lossy(&output.stdout).into_owned() + &stderr(&output);
        (output.status.code(), printed)
    }

    /// Fails unless every pose has every repeat exactly once, whole, under its own name.
    pub fn assert_each_scan_once(&self, poses: u64, repeats: u64, beams: u64) {
        let mut ids = BTreeMap::new();
        let mut names = Vec::new();
        for pose in 1..=poses {
            for repeat in 1..=repeats {
                let name = format!("p{pose:03}-r{repeat:02}.jsonl");
                let log = self.scan(&name);
                log.assert_each_beam_once(beams);
                assert_eq!(log.of_type("scan_start").count(), 1, "{name}");
                let of = &log.of_type("session").next().expect("a session")["collection"];
                assert_eq!((&of["pose"], &of["repeat"]), (&pose.into(), &repeat.into()));
                let id = log.end()["scan"].as_str().expect("an id").to_owned();
                assert_eq!(ids.insert(id, name.clone()), None, "{name}: a scan twice");
                names.push(name);
            }
        }
        assert_eq!(self.files("scans"), names);
        assert_eq!(self.files("in-progress"), Vec::<String>::new());
        let (code, printed) = self.verify();
        assert_eq!(code, Some(0), "{printed}");
        let manifest = self.manifest();
        assert_eq!(
            (&manifest["complete"], &manifest["counts"]["accepted"]),
            (&true.into(), &(poses * repeats).into())
        );
    }
}
