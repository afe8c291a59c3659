use std::{
    fs, io,
    os::unix::fs::PermissionsExt as _,
    path::Path,
    sync::atomic::{AtomicU64, Ordering},
};

use sonard_generate::Generator;

use super::*;

const SPEC: &str = "[set]\nname = \"small\"\nshards = 3\nscenes = 2\nposes = 3\n[[scene]]\nshape = \"l\"\n\
                    width_m = [3, 5]\ndepth_m = 4\n[furniture]\nboxes = 1\n[plan]\nstep_deg = 18\n[keep]\nfeatures = true\n";

fn generator(text: &str) -> Generator {
    let none = |name: &str| Err(io::Error::other(format!("no file {name}")));
    Generator::from_toml("small.toml", text, &none).expect("a specification")
}

fn make_all(set: &DataSet<'_>) -> Vec<ShardOutcome> {
    (1..=3).map(|shard| set.generate(shard, &|_| {}).expect("it can be made")).collect()
}

fn names(root: &Path) -> Vec<String> {
    let entries = fs::read_dir(root).expect("a folder");
    let name = |entry: io::Result<fs::DirEntry>| entry.expect("an entry").file_name();
    let mut names: Vec<String> =
        entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn generates_and_seals_a_set() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("set");
    let generator = generator(SPEC);
    let set = DataSet::open(&root, &generator).expect("a new folder");
    let readings = AtomicU64::new(0);
    let count = |more: u64| {
        readings.fetch_add(more, Ordering::Relaxed);
    };
    assert_eq!(set.generate(2, &count).expect("made"), ShardOutcome::Generated);
    assert_eq!((readings.into_inner(), generator.readings()), (120, 120));
    assert_eq!(set.missing().expect("readable"), [1, 3]);
    assert_eq!(set.write_manifest().expect("readable"), None);
    assert_eq!(names(&root), ["shard-00002", "spec.json"]);
    assert_eq!(
        make_all(&set),
        [ShardOutcome::Generated, ShardOutcome::Existed, ShardOutcome::Generated]
    );
    let manifest = set.write_manifest().expect("writable").expect("whole");
    assert_eq!(manifest.shards, 3);
    assert_eq!(
        names(&root),
        ["README.md", "manifest.json", "shard-00001", "shard-00002", "shard-00003", "spec.json"]
    );
    // Folders are readable like files.
    let mode = |path: &str| fs::metadata(root.join(path)).expect("there").permissions().mode();
    assert_eq!(mode("shard-00001") & 0o444, mode("spec.json") & 0o444);
    // Another process and another order produce the same set.
    let other_root = folder.path().join("other");
    let specification = DataSet::specification(&root).expect("as it was written");
    let other = DataSet::open(&other_root, &specification).expect("a new folder");
    for shard in [3, 1, 2] {
        other.generate(shard, &|_| {}).expect("made");
    }
    assert_eq!(other.write_manifest().expect("writable"), Some(manifest));
    let text = |root: &Path| fs::read_to_string(root.join(MANIFEST)).expect("there");
    assert_eq!(text(&root), text(&other_root));
    // An edited card is kept.
    fs::write(root.join(CARD), "mine").expect("writable");
    set.write_manifest().expect("writable");
    assert_eq!(fs::read_to_string(root.join(CARD)).expect("there"), "mine");
}

#[test]
fn removes_stale_drafts() {
    let folder = tempfile::tempdir().expect("a folder");
    let generator = generator(SPEC);
    let set = DataSet::open(folder.path(), &generator).expect("an empty folder");
    // Killed within a table, and just before the rename.
    let whole = set.draft(1, &|_| {}).expect("made");
    let (cut, last) =
        (folder.path().join(".shard-00001.a.draft"), folder.path().join(".shard-00001.b.draft"));
    fs::create_dir(&cut).expect("writable");
    fs::write(cut.join("readings.parquet"), b"PAR1sonard").expect("writable");
    fs::create_dir(&last).expect("writable");
    for name in names(whole.path()) {
        fs::copy(whole.path().join(&name), last.join(&name)).expect("writable");
    }
    assert_eq!(set.missing().expect("readable"), [1, 2, 3]);
    // The draft of a running process is kept.
    assert_eq!(set.generate(1, &|_| {}).expect("made"), ShardOutcome::Generated);
    assert!(!cut.exists() && !last.exists());
    assert!(whole.path().exists());
    let late = whole.rename_to(&folder.path().join("shard-00001"));
    assert!(late.is_err(), "an existing shard was replaced");
    assert_eq!(set.check_digests(1), [] as [&str; 0]);
}

#[test]
fn rejects_foreign_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let (own, other) = (generator(SPEC), generator(&SPEC.replace("poses = 3", "poses = 2")));
    let set = DataSet::open(folder.path(), &own).expect("an empty folder");
    set.generate(1, &|_| {}).expect("made");
    let error = DataSet::open(folder.path(), &other).expect_err("another set's");
    assert!(error.to_string().contains("of another specification"), "{error}");
    assert!(error.help().contains("new folder"));
    // Shard copied from another set.
    let elsewhere = tempfile::tempdir().expect("a folder");
    DataSet::open(elsewhere.path(), &other).expect("empty").generate(2, &|_| {}).expect("made");
    fs::rename(elsewhere.path().join("shard-00002"), folder.path().join("shard-00002"))
        .expect("one disk");
    let error = set.generate(2, &|_| {}).expect_err("foreign").to_string();
    assert!(error.contains("shard-00002: different specification"), "{error}");
    fs::rename(folder.path().join("shard-00001"), folder.path().join("shard-00003"))
        .expect("one disk");
    let error = set.generate(3, &|_| {}).expect_err("renamed").to_string();
    assert!(error.contains("shard 1 instead of 3"), "{error}");
    let facts = folder.path().join("shard-00003").join(FACTS);
    let text = fs::read_to_string(&facts).expect("there");
    fs::write(&facts, text.replace("\"sampling_version\": ", "\"sampling_version\": 9"))
        .expect("writable");
    let error = set.generate(3, &|_| {}).expect_err("older").to_string();
    assert!(error.contains("readings may differ"), "{error}");
    // Folder with other files.
    let error =
        DataSet::open(folder.path().join("shard-00003").as_path(), &own).expect_err("strange");
    assert!(matches!(error, DataSetError::NotADataSet { .. }), "{error}");
}

#[test]
fn reports_damage() {
    let folder = tempfile::tempdir().expect("a folder");
    let generator = generator(SPEC);
    let set = DataSet::open(folder.path(), &generator).expect("an empty folder");
    make_all(&set);
    assert_eq!(set.check_manifest().expect("readable"), ["manifest.json is missing"]);
    set.write_manifest().expect("writable");
    assert_eq!(set.check_manifest().expect("readable"), [] as [&str; 0]);
    assert_eq!(set.check_regenerated(2, &|_| {}).expect("drawn"), [] as [&str; 0]);
    let readings = folder.path().join("shard-00002/readings.parquet");
    let whole = fs::read(&readings).expect("there");
    // A flipped bit, which keeps the size.
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    fs::write(&readings, &flipped).expect("writable");
    let problems = set.check_digests(2);
    assert_eq!(problems.len(), 1);
    assert!(problems[0].starts_with("shard-00002/readings.parquet: its SHA-256"), "{problems:?}");
    fs::write(&readings, &whole[..whole.len() - 9]).expect("writable");
    assert!(
        set.check_digests(2)[0].contains("lacks readings.parquet of"),
        "{:?}",
        set.check_digests(2)
    );
    assert!(matches!(set.generate(2, &|_| {}), Err(DataSetError::Incomplete { .. })));
    fs::remove_dir_all(folder.path().join("shard-00002")).expect("writable");
    assert_eq!(set.check_digests(2), ["shard-00002 is missing"]);
    set.generate(2, &|_| {}).expect("made");
    // Digests adapted to a changed file.
    let facts = folder.path().join("shard-00001").join(FACTS);
    let scenes = folder.path().join("shard-00001/scenes.parquet");
    let other = fs::read(folder.path().join("shard-00003/scenes.parquet")).expect("there");
    fs::write(&scenes, &other).expect("writable");
    let (bytes, sha256) = sync_and_digest(&scenes).expect("there");
    let mut facts_json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&facts).expect("there")).expect("JSON");
    facts_json["files"]["scenes.parquet"]["bytes"] = bytes.into();
    facts_json["files"]["scenes.parquet"]["sha256"] = sha256.into();
    fs::write(&facts, facts_json.to_string()).expect("writable");
    assert_eq!(set.check_digests(1), [] as [&str; 0]);
    assert_eq!(set.check_manifest().expect("readable"), ["manifest.json: differs from the shards"]);
    let problems = set.check_regenerated(1, &|_| {}).expect("drawn");
    assert_eq!(problems, ["shard-00001/scenes.parquet: differs from the regenerated file"]);
    fs::write(folder.path().join("notes.txt"), "mine").expect("writable");
    let problems = set.check_manifest().expect("readable");
    assert!(problems.contains(&"notes.txt: not part of the set".to_owned()), "{problems:?}");
}
