//! Places that can not be written to.

use super::*;

#[test]
fn full_disk_keeps_the_old_file() {
    let (folder, scene) = folder_with(("room.json", SCENE));
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (old, new) = (path("old.png"), path("new.png"));
    assert!(run_case("scene draw IN -o DIR/old.png", &scene, folder.path()).status.success());
    let was = fs::read(&old).expect("written");
    let course = path("course.jsonl");
    let fine = "simulate --scene simple-room --pose fig9 -o DIR/fig9.jsonl";
    assert!(run_case(fine, &scene, folder.path()).status.success());
    for (out, arguments) in [
        (&old, vec!["scene", "draw", "simple-room", "-o", &old]),
        (&new, vec!["scene", "draw", "simple-room", "-o", &new]),
        (&new, vec!["plot", &path("fig9.jsonl"), "-o", &new]),
        (&course, vec!["simulate", "--scene", "simple-room", "--pose", "fig9", "-o", &course]),
        (&path("t.jsonl"), vec!["log", "annotate", &path("fig9.jsonl"), "-o", &path("t.jsonl")]),
        (&path("t.csv"), vec!["export", &path("fig9.jsonl"), "-o", &path("t.csv")]),
        (&path("t.parquet"), vec!["export", &path("fig9.jsonl"), "-o", &path("t.parquet")]),
        (&path("t.mcap"), vec!["export", &path("fig9.jsonl"), "-o", &path("t.mcap")]),
        (&path("map/map.pgm"), vec!["map", &path("fig9.jsonl"), "--out", &path("map")]),
    ] {
        // Blocks of 512 bytes: less than any of these files. Signals are not mentioned.
        let limited = sonard(&arguments);
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", "ulimit -f 1; exec \"$0\" \"$@\""]).arg(limited.get_program());
        let output = shell.args(limited.get_args()).output().expect("starts");
        let message = stderr(&output).replace(['\n', '\u{2502}', ' '], "");
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {:?} {message}", output.status);
        assert!(message.contains(out.as_str()), "{arguments:?}: {message}");
        assert_eq!(Path::new(out).exists(), *out == old, "{arguments:?}");
        let left = fs::read_dir(folder.path()).expect("there").flatten();
        let litter: Vec<_> =
            left.filter(|entry| entry.file_name().to_string_lossy().ends_with(".new")).collect();
        assert!(litter.is_empty(), "{arguments:?}: {litter:?}");
    }
    assert_eq!(fs::read(&old).expect("kept"), was);
}

#[test]
fn unwritable_outputs() {
    let (folder, scene) = folder_with(("room.json", SCENE));
    let fine = "simulate --scene simple-room --pose fig9 --to-deg 9 -o DIR/fig9.jsonl";
    assert!(run_case(fine, &scene, folder.path()).status.success());
    for line in [
        "simulate --scene simple-room --pose fig9 --to-deg 9 -o DIR/none/a.jsonl",
        "plot DIR/fig9.jsonl -o DIR/none/a.svg",
        "plot DIR/fig9.jsonl -o DIR/fig9.jsonl/a.svg",
        "trace --scene simple-room --pose fig9 -o DIR/none/a.png",
        "scene draw IN -o DIR/none/a.svg",
        "lines DIR/fig9.jsonl -o DIR/none/a.svg",
        "interpret DIR/fig9.jsonl -o DIR/none/a.svg",
        "log annotate DIR/fig9.jsonl -o DIR/none/a.jsonl",
        "export DIR/fig9.jsonl -o DIR/none/a.csv",
        "map DIR/fig9.jsonl --out DIR/fig9.jsonl/map",
        "scan --mock --scene IN --pose fig9 --to-deg 9 --out DIR/fig9.jsonl/scan",
        "run --mock --scene IN --pose fig9 --log DIR/fig9.jsonl/log --socket DIR/s",
        "generate DIR/fig9.jsonl/generated",
    ] {
        let output = run_case(line, &scene, folder.path());
        assert_eq!(output.status.code(), Some(2), "{line}: {}", stderr(&output));
    }
}
