//! Outputs of verbs: they never replace an input, nor foreign files without --force, and are complete
//! or not at all.

mod added;
mod daemon;
mod failing;

use std::{
    collections::BTreeSet,
    fs,
    os::unix::fs::{FileTypeExt as _, PermissionsExt as _, symlink},
    path::{Path, PathBuf},
    process::{Output, Stdio},
};

use tempfile::TempDir;

use crate::{
    collect::joined_stderr,
    common::{Log, mock_scan, run, sonard, stderr},
};

const LOG: &str = include_str!("../fixtures/small.jsonl");
const SCENE: &str = include_str!("../../scenes/simple-room.json");

/// A command whose output is its own input: the option of the output, the input by its name and
/// content, and the arguments, in which `IN` is replaced by the input, `DIR` by its folder.
struct Case {
    output: &'static str,
    input: (&'static str, &'static str),
    arguments: &'static str,
}

const fn case(
    output: &'static str,
    input: (&'static str, &'static str),
    arguments: &'static str,
) -> Case {
    Case { output, input, arguments }
}

const CASES: [Case; 40] = [
    case("plot --output", ("a.svg", LOG), "plot IN -o IN"),
    case("plot --output", ("a.png", LOG), "plot IN -o IN --force"),
    case("plot --output", ("a.svg", SCENE), "plot LOG --scene IN -o IN"),
    case("trace --output", ("a.png", SCENE), "trace --scene IN --pose fig9 -o IN"),
    case("interpret --output", ("a.svg", LOG), "interpret IN -o IN"),
    case("lines --output", ("a.svg", LOG), "lines IN -o IN"),
    case("scene draw --output", ("a.svg", SCENE), "scene draw IN -o IN"),
    case(
        "scene from-dxf --output",
        ("a.json", CAD_DRAWING),
        "scene from-dxf IN --unit-m 1 -o IN --force",
    ),
    case("scene from-sdf --output", ("a.json", WORLD), "scene from-sdf IN -o IN --force"),
    case(
        "scene from-grid --output",
        ("map.yaml", MAP),
        "scene from-grid IN --min-length-m 0 -o IN --force",
    ),
    case(
        "scene from-svg --output",
        ("a.json", DRAWING),
        "scene from-svg IN --width-m 3 -o IN --force",
    ),
    case("simulate --output", ("a.json", SCENE), "simulate --scene IN --pose fig9 -o IN --force"),
    case(
        "simulate --output",
        ("a", POSES),
        "simulate --scene simple-room --poses IN -o IN --force",
    ),
    case(
        "simulate --output",
        ("a", POSES),
        "simulate --scene simple-room --poses IN --array ring-12 -o IN --force",
    ),
    case("map --out", ("map.pgm", LOG), "map IN --out DIR --force"),
    case("map --out", ("map.mcap", LOG), "map IN --out DIR --force"),
    case("map --out", ("map.png", SCENE), "map LOG --scene IN --out DIR --force"),
    case("map --confidences", ("c.jsonl", LOG), "map IN --out DIR/map --confidences IN --force"),
    case("import --output", ("a", TABLE), "import IN -o IN --force"),
    case("import --picture", ("a.svg", TABLE), "import IN --dry-run --picture IN --force"),
    case("export --output", ("a.csv", LOG), "export IN -o IN --force"),
    case("export --output", ("a.mcap", LOG), "export IN -o IN --force"),
    case("export --output", ("a.parquet", LOG), "export IN -o IN --force"),
    case("export --output", ("log.csv", LOG), "export IN --to csv -o IN --force"),
    case("generate --out", ("README.md", DATA_SET), "generate IN --out DIR"),
    case("report --output", ("a", LOG), "report IN -o IN --force"),
    case("calibrate --out", ("residuals.svg", LOG), "calibrate IN --out DIR --force"),
    case("calibrate --out", ("sensor.json", LOG), "calibrate IN --out DIR --force"),
    case("calibrate --out", ("scene.json", SCENE), "calibrate LOG --scene IN --out DIR --force"),
    case("calibrate --out", ("unfinished.jsonl", LOG), "calibrate IN --out DIR --force"),
    case("survey --out", ("survey.json", LOG), "survey IN --out DIR --force"),
    case("predict --output", ("a.jsonl", LOG), "predict IN -o IN --force"),
    case("predict --output", ("a.json", SCENE), "predict LOG --scene IN -o IN --force"),
    case("log annotate --output", ("a.jsonl", LOG), "log annotate IN -o IN --force"),
    case(
        "scan --out",
        ("scan.jsonl", SCENE),
        "scan --mock --scene IN --pose fig9 --to-deg 9 --out DIR",
    ),
    case(
        "scan --out",
        ("scan.svg", SCENE),
        "scan --mock --scene IN --pose fig9 --to-deg 9 --out DIR",
    ),
    case("collect --out", ("journal.jsonl", PLAN), "collect IN --mock --out DIR"),
    case("mock --link", ("a.json", SCENE), "mock --scene IN --pose fig9 --link IN"),
    case("board --link", ("a.json", SCENE), "board --link IN"),
    case(
        "run --socket",
        ("a.json", SCENE),
        "run --mock --scene IN --pose fig9 --log DIR/log --socket IN",
    ),
];

/// Outputs of verbs that read no file.
const WITHOUT_INPUT: [&str; 2] = ["package-files DIR", "tour --out"];

const POSES: &str = "{\"x_m\":0.774,\"y_m\":0.085,\"heading_deg\":0.0}\n";
const TABLE: &str = "azimuth_deg,range_m\n0,1\n";
const DRAWING: &str = "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'><path d='M0 0h9v9z' stroke='red'/></svg>";
const CAD_DRAWING: &str =
    "0\nSECTION\n2\nENTITIES\n0\nLINE\n8\n0\n10\n0\n20\n0\n11\n1\n21\n0\n0\nENDSEC\n0\nEOF\n";
const WORLD: &str = "<sdf><model name='m'><link><collision><geometry><box><size>1 1 1</size></box>\
                     </geometry></collision></link></model></sdf>";
const MAP: &str = "image: map.pgm\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n\
                   occupied_thresh: 0.65\nfree_thresh: 0.196\n";
const DATA_SET: &str = "[set]\nname = \"a\"\nshards = 1\nscenes = 1\nposes = 1\n[[scene]]\nshape = \"file\"\n\
                        file = \"simple-room\"\n";
const PLAN: &str = "[collection]\nfolder = \"out\"\n[place]\nscene = \"simple-room\"\n\
                    poses = [\"fig9\"]\n";

/// A folder with an input of this name and content, and what else commands need.
fn folder_with((name, content): (&str, &str)) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("log.jsonl"), LOG).expect("writable");
    if content == MAP {
        fs::write(folder.path().join("map.pgm"), b"P5\n2 2\n255\n\0\xff\0\xff").expect("writable");
    }
    let input = folder.path().join(name);
    fs::write(&input, content).expect("writable");
    (folder, input)
}

fn run_case(arguments: &str, input: &Path, folder: &Path) -> Output {
    let input = input.to_str().expect("plain path");
    let folder = folder.to_str().expect("plain path");
    let log = format!("{folder}/log.jsonl");
    let arguments: Vec<String> = arguments
        .split(' ')
        .map(|word| match word {
            "IN" => input.to_owned(),
            "LOG" => log.clone(),
            word => word.replace("DIR", folder),
        })
        .collect();
    run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn every_output_is_tested() {
    let known: BTreeSet<String> = sonard::cli::outputs().into_iter().collect();
    let reported: BTreeSet<String> = CASES.iter().map(|case| case.output.to_owned()).collect();
    let is_built = |output: &&str| cfg!(feature = "manual") || !output.starts_with("package-files");
    let without: BTreeSet<String> =
        WITHOUT_INPUT.into_iter().filter(is_built).map(str::to_owned).collect();
    let mut expected = &reported | &without;
    // A socket is configuration, and no path of the command line alone.
    assert!(expected.remove("run --socket"));
    assert_eq!(known, expected, "a verb that writes needs a case here");
}

#[test]
fn inputs_are_not_overwritten() {
    for Case { input, arguments, .. } in CASES {
        let (folder, path) = folder_with(input);
        let output = run_case(arguments, &path, folder.path());
        let message = stderr(&output);
        let code = output.status.code();
        assert!(matches!(code, Some(2 | 3)), "{arguments}: {code:?} {message}");
        assert_eq!(fs::read_to_string(&path).expect("kept"), input.1, "{arguments}: {message}");
        let place = folder.path().file_name().and_then(|name| name.to_str()).expect("plain path");
        assert!(message.contains(place) || input.0 == "a.json", "{arguments}: {message}");
    }
}

#[test]
fn links_to_inputs() {
    let (folder, input) = folder_with(("room.json", SCENE));
    let place = |name: &str| folder.path().join(name);
    fs::hard_link(&input, place("hard.svg")).expect("same file system");
    symlink(&input, place("soft.svg")).expect("writable");
    symlink(place("soft.svg"), place("softer.svg")).expect("writable");
    let at_stdin = |name: &str| {
        let mut plot =
            sonard(&["plot", "-", "--force", "-o", place(name).to_str().expect("plain")]);
        plot.stdin(fs::File::open(&input).expect("there")).output().expect("starts")
    };
    for name in ["hard.svg", "soft.svg", "softer.svg"] {
        let message = joined_stderr(&run_case(
            &format!("scene draw IN --force -o DIR/{name}"),
            &input,
            folder.path(),
        ));
        assert!(message.contains("is read by this command"), "{name}: {message}");
        let output = at_stdin(name);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr(&output));
        assert_eq!(fs::read_to_string(&input).expect("kept"), SCENE, "{name}");
    }
    // The shell opened it to append.
    let out = fs::OpenOptions::new().append(true).open(&input).expect("there");
    let path = input.to_str().expect("plain path");
    let draw = sonard(&["scene", "draw", path]).stdout(out).stderr(Stdio::piped()).output();
    let output = draw.expect("starts");
    assert!(joined_stderr(&output).contains("standard output goes to"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(&input).expect("kept"), SCENE);
}

#[test]
fn pictures_replace_pictures_only() {
    let (folder, scene) = folder_with(("room.json", SCENE));
    let draw = |name: &str, further: &str| {
        run_case(&format!("scene draw IN -o DIR/{name}{further}"), &scene, folder.path())
    };
    let place = |name: &str| folder.path().join(name);
    assert!(draw("a.svg", "").status.success());
    fs::set_permissions(place("a.svg"), fs::Permissions::from_mode(0o600)).expect("ours");
    assert!(draw("a.svg", "").status.success(), "again");
    let mode = fs::metadata(place("a.svg")).expect("there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600, "what was kept from others stays so");
    assert!(draw("a.png", "").status.success());
    assert!(draw("a.png", "").status.success(), "again");
    fs::write(place("empty.svg"), "").expect("writable");
    assert!(draw("empty.svg", "").status.success(), "as mktemp leaves it");
    for (name, content, kind) in [
        ("log.svg", LOG, "a log"),
        ("room.svg", SCENE, "a scene"),
        ("thesis.svg", "\\documentclass{book}\n", "text"),
        ("plan.png", "[plan]\nstep_deg = 1\n", "TOML"),
        ("a2.png", "<svg xmlns=\"http://www.w3.org/2000/svg\"/>", "an SVG image"),
    ] {
        fs::write(place(name), content).expect("writable");
        let refused = draw(name, "");
        let message = joined_stderr(&refused);
        assert_eq!(refused.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(kind) && message.contains("--force"), "{name}: {message}");
        assert_eq!(fs::read_to_string(place(name)).expect("kept"), content);
        assert!(draw(name, " --force").status.success(), "{name}");
        assert_ne!(fs::read(place(name)).expect("there"), content.as_bytes());
    }
    symlink(place("b.svg"), place("link.svg")).expect("writable");
    assert_eq!(draw("link.svg", "").status.code(), Some(2), "a link to nothing");
    assert!(draw("b.svg", "").status.success());
    assert!(draw("link.svg", "").status.success(), "the file behind the link");
    assert!(fs::symlink_metadata(place("link.svg")).expect("there").is_symlink());
}

#[test]
fn logs_need_force() {
    let (folder, log) = folder_with(("measured.jsonl", LOG));
    let to_log = "simulate --scene simple-room --pose fig9 --to-deg 9 -o IN";
    let refused = run_case(to_log, &log, folder.path());
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(joined_stderr(&refused).contains("is a log"), "{}", stderr(&refused));
    assert_eq!(fs::read_to_string(&log).expect("kept"), LOG);
    let new = to_log.replace("IN", "DIR/new.jsonl");
    assert!(run_case(&new, &log, folder.path()).status.success());
    assert_eq!(run_case(&new, &log, folder.path()).status.code(), Some(2), "again");
    assert!(run_case(&format!("{new} --force"), &log, folder.path()).status.success());
    assert_eq!(Log::read(&folder.path().join("new.jsonl")).pings().len(), 10);
}

#[test]
fn maps_replace_maps_only() {
    let (folder, log) = folder_with(("scan.jsonl", LOG));
    let simulate = "simulate --scene simple-room --pose fig9 -o DIR/fig9.jsonl";
    assert!(run_case(simulate, &log, folder.path()).status.success());
    let map = "map DIR/fig9.jsonl --out DIR/map --confidences DIR/c.jsonl";
    for again in ["", " again"] {
        let output = run_case(map, &log, folder.path());
        assert!(output.status.success(), "{again} {}", stderr(&output));
    }
    for name in ["map/map.yaml", "map/map.pgm", "map/map.mcap", "map/map.png", "c.jsonl"] {
        let path = folder.path().join(name);
        let was = fs::read(&path).expect("written");
        fs::write(&path, "{\"mine\": 1}\n").expect("writable");
        let refused = run_case(map, &log, folder.path());
        assert_eq!(refused.status.code(), Some(2), "{name}: {}", stderr(&refused));
        assert_eq!(fs::read_to_string(&path).expect("kept"), "{\"mine\": 1}\n");
        fs::write(&path, was).expect("writable");
    }
}

/// A scan into `folder` of a few beams, with further options.
fn short_scan(pose: &str, folder: &Path, further: &[&str]) -> Output {
    let mut options = vec!["--to-deg", "9", "--max-range", "1.5"];
    options.extend(further);
    mock_scan(pose, folder, &options)
}
