//! Data sets, through the whole program: parts, kills, damage, and the environment of array jobs.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    thread,
    time::Duration,
};

use crate::common::{run, sonard, stderr};

/// 6 shards of 3600 readings in simple rooms, a fraction of a second each.
const SPEC: &str = "\
[set]
name = \"test rooms\"
shards = 6
scenes = 3
poses = 3
[[scene]]
shape = \"rectangle\"
width_m = [3, 5]
depth_m = [2.5, 4]
[furniture]
boxes = [0, 1]
gap_m = 0.2
[model]
max_range_m = 4
[keep]
features = true
occupancy_m = 0.2
";

struct Case {
    folder: tempfile::TempDir,
}

impl Case {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("spec.toml"), SPEC).expect("writable");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text_path(&self, name: &str) -> String {
        self.path(name).to_str().expect("a plain path").to_owned()
    }

    fn command(&self, out: &str, further: &[&str]) -> Command {
        let (spec, out) = (self.text_path("spec.toml"), self.text_path(out));
        let mut command = sonard(&["generate", &spec, "--out", &out]);
        for name in ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX"] {
            command.env_remove(name);
        }
        command.args(further);
        command
    }

    fn generate(&self, out: &str, further: &[&str]) -> Output {
        self.command(out, further).output().expect("it starts")
    }

    fn verify(&self, out: &str, further: &[&str]) -> Output {
        let out = self.text_path(out);
        run(&[&["generate", "--verify", &out], further].concat())
    }
}

/// Every file that is not hidden, with its content.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.strip_prefix(folder).expect("below it").to_path_buf();
            if name.to_string_lossy().starts_with('.') {
                continue;
            }
            match path.is_dir() {
                true => open.push(path),
                false => drop(all.insert(name, fs::read(&path).expect("readable"))),
            }
        }
    }
    all
}

fn printed(output: &Output) -> String {
    let printed = stderr(output);
    assert!(!printed.contains("panicked"), "{printed}");
    printed.replace('\u{2502}', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn identical_for_any_parallelism() {
    let case = Case::new();
    let one = case.command("one", &[]).env("RAYON_NUM_THREADS", "1").output().expect("it starts");
    assert!(
        one.status.success() && printed(&one).contains("complete: 6 shards, 21600 readings"),
        "{}",
        printed(&one)
    );
    let wanted = files(&case.path("one"));
    assert!(
        wanted.contains_key(Path::new("manifest.json"))
            && wanted.contains_key(Path::new("README.md"))
    );
    let all =
        case.command("threads", &[]).env("RAYON_NUM_THREADS", "5").output().expect("it starts");
    assert!(all.status.success());
    assert_eq!(files(&case.path("threads")), wanted);
    // Four processes at once, two of which have the same part.
    let parts = ["1/3", "2/3", "3/3", "2/3"];
    let running = parts.map(|part| {
        let mut command = case.command("parts", &["--shard", part]);
        command.stderr(std::process::Stdio::piped()).spawn().expect("it starts")
    });
    for child in running {
        let output = child.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{}", printed(&output));
    }
    // The last process may have counted a part that was not complete yet.
    let last = case.generate("parts", &[]);
    assert!(printed(&last).contains("0 shards made, 6 already complete"), "{}", printed(&last));
    assert_eq!(files(&case.path("parts")), wanted);
    let verified = case.verify("parts", &["--recheck", "2"]);
    let reported = String::from_utf8_lossy(&verified.stdout).into_owned();
    assert!(verified.status.success() && reported.contains("verified, 2 recomputed"), "{reported}");
    // From the specification that the set itself holds, in another folder.
    let (spec, out) = (case.text_path("one/spec.json"), case.text_path("again"));
    assert!(run(&["generate", &spec, "--out", &out, "--shard", "1/1"]).status.success());
    assert_eq!(files(&case.path("again")), wanted);
}

#[test]
fn resumes_after_kill() {
    let case = Case::new();
    assert!(case.generate("whole", &[]).status.success());
    let wanted = files(&case.path("whole"));
    let mut killed_midway = 0;
    for wait_ms in [30, 60, 90, 120, 180, 240, 350, 500] {
        let mut child = case
            .command("killed", &[])
            .stderr(std::process::Stdio::null())
            .spawn()
            .expect("it starts");
        thread::sleep(Duration::from_millis(wait_ms));
        child.kill().expect("its own child");
        child.wait().expect("it ends");
        if !case.path("killed").exists() {
            continue;
        }
        let left = files(&case.path("killed"));
        killed_midway += u32::from(!left.contains_key(Path::new("manifest.json")));
        // What is there is as it should be.
        assert!(
            left.iter().all(|(name, bytes)| wanted.get(name) == Some(bytes)),
            "{:?}",
            left.keys()
        );
    }
    assert!(killed_midway > 0, "none was killed before its end");
    let done = case.generate("killed", &[]);
    assert!(done.status.success(), "{}", printed(&done));
    assert_eq!(files(&case.path("killed")), wanted);
    let hidden = fs::read_dir(case.path("killed")).expect("a folder").filter(|entry| {
        entry.as_ref().is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with(".shard"))
    });
    assert_eq!(hidden.count(), 0, "what killed processes left is cleared away");
}

#[test]
fn array_jobs() {
    let case = Case::new();
    let in_array = |variables: &[(&str, &str)], further: &[&str]| {
        let mut command = case.command("array", further);
        command.envs(variables.iter().copied()).output().expect("it starts")
    };
    let slurm = [
        ("SLURM_ARRAY_TASK_ID", "2"),
        ("SLURM_ARRAY_TASK_MIN", "1"),
        ("SLURM_ARRAY_TASK_MAX", "3"),
        ("SLURM_ARRAY_TASK_COUNT", "3"),
        ("SLURM_ARRAY_TASK_STEP", "1"),
    ];
    let second = in_array(&slurm, &[]);
    assert!(
        printed(&second).starts_with("part 2/3, from SLURM_ARRAY_TASK_ID"),
        "{}",
        printed(&second)
    );
    assert!(printed(&second).contains("4 of 6 shards missing"), "{}", printed(&second));
    let first = in_array(&[("JOB_COMPLETION_INDEX", "0")], &[]);
    assert!(
        printed(&first).contains("part 1/6") && printed(&first).contains("1 shards made"),
        "{}",
        printed(&first)
    );
    let by_option = in_array(&slurm, &["--shard", "6/6"]);
    assert!(printed(&by_option).contains("from --shard; SLURM_ARRAY_TASK_ID is ignored"));
    let there: Vec<_> =
        (1..=6).filter(|n| case.path(&format!("array/shard-0000{n}")).exists()).collect();
    assert_eq!(there, [1, 2, 5, 6]);
    for (variables, further, part) in [
        (&[("JOB_COMPLETION_INDEX", "6")][..], &[][..], "no part 7 of 6"),
        (&[], &["--shard", "0/4"], "parts count from 1/4"),
        (&[], &["--shard", "3"], "as in 3/20"),
    ] {
        let output = in_array(variables, further);
        assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
        assert!(printed(&output).contains(part), "{}", printed(&output));
    }
}

#[test]
fn wrong_specifications_and_damage() {
    let case = Case::new();
    let reported = case.generate("set", &["--check"]);
    let size = String::from_utf8_lossy(&reported.stdout).into_owned();
    assert!(
        reported.status.success() && size.contains("6 shards of 3 scenes with 3 poses each, 21600"),
        "{size}"
    );
    assert!(!case.path("set").exists());
    assert!(case.generate("set", &["--shard", "1/2"]).status.success());
    let missing = case.verify("set", &[]);
    let reported = String::from_utf8_lossy(&missing.stdout).into_owned();
    assert_eq!(
        (missing.status.code(), reported.matches("is missing").count()),
        (Some(1), 3),
        "{reported}"
    );
    // A foreign set's folder, a wrong key, no file, no room.
    fs::write(case.path("spec.toml"), SPEC.replace("poses = 3", "poses = 4")).expect("writable");
    let foreign = case.generate("set", &[]);
    assert_eq!(foreign.status.code(), Some(2));
    assert!(
        printed(&foreign).contains("contains the data set of another specification"),
        "{}",
        printed(&foreign)
    );
    for (from, to, part) in [
        ("poses = 3", "pose = 3", "spec.toml:5:1: set.pose: unknown field `pose`"),
        ("boxes = [0, 1]", "boxes = 90", "no free position for its furniture"),
        ("[model]", "[sensor]\nany_of = [\"mine.json\"]\n[model]", "mine.json: No such file"),
    ] {
        fs::write(case.path("spec.toml"), SPEC.replace(from, to)).expect("writable");
        let output = case.generate("other", &[]);
        assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
        assert!(printed(&output).contains(part), "{part}: {}", printed(&output));
    }
    // Sensors and scenes beside the specification.
    let sensor = run(&["sensor", "show", "hc-sr04"]).stdout;
    fs::write(case.path("mine.json"), sensor).expect("writable");
    let with_sensor = SPEC.replace("[model]", "[sensor]\nany_of = [\"mine.json\"]\n[model]");
    fs::write(case.path("spec.toml"), with_sensor).expect("writable");
    let output = case.generate("mine", &["--shard", "1/6"]);
    assert!(output.status.success(), "{}", printed(&output));
    let empty = case.verify("nowhere", &[]);
    assert_eq!(empty.status.code(), Some(2), "{}", printed(&empty));
    let example = run(&["generate", "--example"]);
    fs::write(case.path("spec.toml"), &example.stdout).expect("writable");
    assert!(case.generate("example", &["--check"]).status.success());
}
