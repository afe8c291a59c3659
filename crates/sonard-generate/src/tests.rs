use std::{
    collections::BTreeMap,
    io::{self, Write},
    sync::{Arc, Mutex},
};

use parquet::{
    file::reader::{FileReader as _, SerializedFileReader},
    record::Field,
};
use proptest::prelude::*;
use sonard_model::scene::Scene;

use crate::{
    DataSetManifest, Generator, ManifestError, ShardCounts, ShardError, ShardFacts, ShardTable,
    SpecError,
};

const EVERYTHING: &str = r#"
[set]
name = "everything"
shards = 2
scenes = 3
poses = 2
[[scene]]
shape = "l"
width_m = [4, 6]
depth_m = [3, 5]
notch = 0.4
turn_deg = [0, 90]
[[scene]]
weight = 2
shape = "polygon"
width_m = [5, 7]
depth_m = 6
corners = [4, 7]
walls = ["plaster"]
[[scene]]
shape = "t"
width_m = 6
depth_m = 5
[[scene]]
shape = "file"
file = "two-surface-room"
[materials]
plaster = { reflectance = [0.9, 0.98] }
felt = { reflectance = { mean = 0.4, sigma = 0.1, min = 0.1, max = 0.7 }, roughness = [0, 0.3] }
[furniture]
boxes = [0, 2]
box_m = [0.2, 0.5]
cylinders = 1
partitions = [0, 1]
partition_m = [0.3, 0.6]
height_m = [0.4, 1.2]
gap_m = 0.2
[heights]
ceiling_m = [2.2, 2.6]
sensor_m = [0.3, 1.0]
[plan]
step_deg = 30
[sensor]
any_of = ["senscomp-6500", "hc-sr04"]
[air]
temperature_c = { mean = 20, sigma = 4, min = 5, max = 35 }
[noise]
floor = [0, 0.001]
jitter_us = { any_of = [0, 5] }
[model]
max_range_m = 4
[keep]
strength = true
path = true
min_echo_amplitude = 0.05
envelope_range_m = 1
envelope_step_us = 100
ideal_range = true
features = true
occupancy_m = 0.1
"#;

fn no_files(name: &str) -> io::Result<String> {
    Err(io::Error::new(io::ErrorKind::NotFound, format!("no {name} here")))
}

fn generator(text: &str) -> Generator {
    Generator::from_toml("set.toml", text, &no_files).unwrap_or_else(|error| panic!("{error}"))
}

/// Shared buffer of the written bytes.
#[derive(Debug, Clone, Default)]
struct Memory(Arc<Mutex<Vec<u8>>>);

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("not poisoned").write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

type Files = BTreeMap<ShardTable, Vec<u8>>;

fn shard(generator: &Generator, number: u32) -> (ShardCounts, Files) {
    let mut files: BTreeMap<ShardTable, Memory> = BTreeMap::new();
    let mut create = |table| {
        let memory = files.entry(table).or_default();
        Ok(Box::new(memory.clone()) as Box<dyn Write + Send>)
    };
    let made = generator.shard(number, &mut create, &|_| {}).expect("it fits");
    let bytes = |memory: Memory| std::mem::take(&mut *memory.0.lock().expect("not poisoned"));
    (made, files.into_iter().map(|(table, memory)| (table, bytes(memory))).collect())
}

fn rows(bytes: &[u8]) -> Vec<BTreeMap<String, Field>> {
    let bytes = bytes::Bytes::copy_from_slice(bytes);
    let reader = SerializedFileReader::new(bytes).expect("Parquet");
    let rows = reader.get_row_iter(None).expect("rows").map(|row| row.expect("a row"));
    rows.map(|row| row.into_columns().into_iter().collect()).collect()
}

fn number(field: &Field) -> Option<f64> {
    match field {
        Field::Null => None,
        Field::Float(number) => Some((*number).into()),
        Field::Double(number) => Some(*number),
        Field::Long(number) => Some(*number as f64),
        other => panic!("{other:?}"),
    }
}

fn text(field: &Field) -> Option<&str> {
    match field {
        Field::Null => None,
        Field::Str(text) => Some(text),
        other => panic!("{other:?}"),
    }
}

#[test]
fn shards_are_reproducible() {
    let one = generator(EVERYTHING);
    // Another process, which generates the shards in another order from the saved specification.
    let other = Generator::from_json("spec.json", one.text()).expect("as it was written");
    assert_eq!((one.sha256(), one.text()), (other.sha256(), other.text()));
    let first = shard(&one, 1);
    let (second, again) = (shard(&other, 2), shard(&other, 1));
    assert_eq!(first, again);
    assert_ne!(first.1, second.1);
    // Comments do not change the set; a seed changes all of it.
    let commented = EVERYTHING.replace("[heights]", "# as rooms are\n[heights]");
    assert_eq!(generator(&commented).sha256(), one.sha256());
    let reseeded = generator(&EVERYTHING.replace("shards = 2", "shards = 2\nseed = 1"));
    assert_ne!(shard(&reseeded, 1).1[&ShardTable::Scenes], first.1[&ShardTable::Scenes]);
}

#[test]
fn recorded_columns_match_the_scene() {
    let generator = generator(EVERYTHING);
    let (made, files) = shard(&generator, 2);
    assert_eq!(generator.tables().len(), 5);
    let read: BTreeMap<ShardTable, _> =
        files.iter().map(|(table, bytes)| (*table, rows(bytes))).collect();
    for (table, rows) in &read {
        assert_eq!(made.rows(*table), rows.len() as u64, "{table:?}");
        assert!(!rows.is_empty(), "{table:?}");
    }
    assert_eq!(made.rows(ShardTable::Scenes), 3);
    assert_eq!(made.rows(ShardTable::Readings), 3 * 2 * 12);
    let scenes: BTreeMap<i64, Scene> = read[&ShardTable::Scenes]
        .iter()
        .map(|row| {
            let scene = Scene::from_json(text(&row["scene_text"]).expect("text")).expect("a scene");
            (number(&row["scene"]).expect("a number") as i64, scene)
        })
        .collect();
    assert_eq!(scenes.keys().copied().collect::<Vec<_>>(), [4, 5, 6]);
    let mut echoes = 0;
    for row in &read[&ShardTable::Readings] {
        let of = |name: &str| number(&row[name]);
        let scene = &scenes[&(of("scene").expect("a number") as i64)];
        let at = [of("x_m"), of("y_m")].map(|place| place.expect("a number"));
        assert!(scene.clearance_m(at.into()) >= 0.1);
        let is_echo = text(&row["status"]) == Some("echo");
        assert_eq!(of("range_m").is_some(), text(&row["status"]) != Some("no_echo"));
        if is_echo {
            echoes += 1;
            assert!(of("amplitude").is_some() && of("margin_db").is_some());
            let path = text(&row["path"]).expect("an echo has a path");
            assert!(!path.is_empty());
            assert!(text(&row["feature"]).is_some());
            // The path is longer than twice the minimum clearance.
            let (length_m, ideal_m) = (of("path_length_m").expect("a length"), of("range_m"));
            assert!(length_m > 0.2 && ideal_m.is_some());
        }
        assert!(matches!(&row["envelope"], Field::ListInternal(list) if list.len() > 40));
    }
    assert!(echoes > 20, "{echoes}");
    for row in &read[&ShardTable::Occupancy] {
        let Field::ListInternal(cells) = &row["cells"] else { panic!("a list") };
        let all = number(&row["width"]).expect("cells") * number(&row["height"]).expect("cells");
        assert_eq!(cells.len() as f64, all);
        let count = |value: u32| {
            cells.elements().iter().filter(|cell| **cell == Field::UInt(value)).count()
        };
        assert!(count(0) > 100 && count(1) > 50, "{} {}", count(0), count(1));
    }
}

#[test]
fn ranges_take_three_bytes_each() {
    let generator = generator(
        "[set]\nname = \"ranges\"\nshards = 1\nscenes = 1\nposes = 60\n[[scene]]\nshape = \"file\"\n\
         file = \"simple-room\"\n[model]\nmax_range_m = 3",
    );
    let (made, files) = shard(&generator, 1);
    let all: usize = files.values().map(Vec::len).sum();
    let bytes = all as f64 / made.rows(ShardTable::Readings) as f64;
    assert!(bytes < 3.5, "{bytes} bytes per reading");
}

#[test]
fn counts_rejected_draws() {
    let crowded = "[set]\nname = \"crowded\"\nshards = 1\nscenes = 4\nposes = 5\n[[scene]]\nshape = \"l\"\n\
                   width_m = 3\ndepth_m = 3\n[furniture]\nboxes = 2\nbox_m = 0.5\ngap_m = 0.1\n[plan]\nstep_deg = 90";
    let generator = generator(crowded);
    let (made, _) = shard(&generator, 1);
    assert_eq!((made.rows(ShardTable::Scenes), made.rows(ShardTable::Readings)), (4, 4 * 5 * 4));
    assert!(made.redrawn.furniture > 0 && made.redrawn.poses > 0, "{:?}", made.redrawn);
    // A scene without any acceptable draw is an error.
    let never = self::generator(&crowded.replace("box_m = 0.5", "box_m = 3"));
    let error = never.shard(1, &mut |_| Ok(Box::new(io::sink())), &|_| {}).expect_err("no place");
    assert!(matches!(&error, ShardError::DoesNotFit { scene: 1, .. }), "{error}");
    assert!(error.to_string().contains("fewer or smaller pieces"), "{error}");
    let error = never.shard(2, &mut |_| Ok(Box::new(io::sink())), &|_| {}).expect_err("no shard");
    assert!(error.to_string().contains("no shard 2"), "{error}");
}

fn fault(text: &str) -> SpecError {
    Generator::from_toml("set.toml", text, &no_files).map(|_| ()).expect_err(text)
}

#[test]
fn faults_have_position_and_advice() {
    let right = "[set]\nname = \"a\"\nshards = 1\nscenes = 1\nposes = 1\n[[scene]]\nshape = \"rectangle\"\n\
                 width_m = 3\ndepth_m = [2, 3]\n";
    assert_eq!(generator(right).spec().set.name, "a");
    for (from, to, place, part, help) in [
        ("poses = 1", "poses = 1\npose = 2", "set.toml:6:1: set.pose", "unknown field", "shards"),
        ("width_m = 3", "width = 3", "set.toml:8:1: scene[0].width", "unknown field", "width_m"),
        (
            "shape = \"rectangle\"",
            "shape = \"round\"",
            "set.toml:7:9: scene[0].shape",
            "round",
            "polygon",
        ),
        (
            "width_m = 3",
            "width_m = \"wide\"",
            "set.toml:8:11: scene[0].width_m",
            "invalid type",
            "[min, max]",
        ),
        (
            "depth_m = [2, 3]",
            "depth_m = [3, 2]",
            "set.toml:9:11: scene[0].depth_m",
            "comes first",
            "",
        ),
        ("width_m = 3", "width_m = 0", "set.toml:8:11: scene[0].width_m", "it is 0", "0.1 to 1000"),
        ("width_m = 3", "", "set.toml:7:9: scene[0].shape", "needs width_m", "give width_m"),
        (
            "width_m = 3",
            "width_m = 3\nnotch = 0.2",
            "set.toml:9:9: scene[0].notch",
            "has no notch",
            "leave it out",
        ),
        (
            "width_m = 3",
            "width_m = 3\nwalls = [\"wood\"]",
            "set.toml:9:10: scene[0].walls[0]",
            "no material `wood`",
            "plaster",
        ),
        ("poses = 1", "poses = 0", "set.toml:5:9: set.poses", "it is 0", "1 to"),
        (
            "[[scene]]",
            "[model]\nmax_order = 2\nmax_rang_m = 3\n[[scene]]",
            "set.toml:8:14: model.max_rang_m",
            "unknown field",
            "max_range_m",
        ),
        (
            "[[scene]]",
            "[model]\naperture_deg = 2\n[[scene]]",
            "set.toml:7:16: model.aperture_deg",
            "not an option of the engine paths",
            "cone",
        ),
        (
            "[[scene]]",
            "[sensor]\nany_of = [\"senscomp\"]\n[[scene]]",
            "set.toml:7:11: sensor.any_of[0]",
            "no senscomp here",
            "senscomp-6500",
        ),
        ("[[scene]]", "[plan]\nstep_deg = 0\n[[scene]]", "set.toml:6:1: plan", "step_deg is 0", ""),
        (
            "[[scene]]",
            "[furniture]\nboxes = [0.5, 2]\n[[scene]]",
            "set.toml:7:9: furniture.boxes",
            "counts things",
            "whole",
        ),
        (
            "[[scene]]",
            "[furniture]\nheight_m = 1\n[[scene]]",
            "set.toml:7:12: furniture.height_m",
            "no heights",
            "[heights]",
        ),
        (
            "[[scene]]",
            "[keep]\nenvelope_range_m = 90\nenvelope_step_us = 1\n[[scene]]",
            "set.toml:7:20: keep.envelope_range_m",
            "samples",
            "steps",
        ),
        ("name = \"a\"", "name = ", "set.toml:2:", "", "TOML"),
        ("name = \"a\"\n", "", "set.toml:1:1: set", "missing field `name`", ""),
    ] {
        let text = right.replacen(from, to, 1);
        assert_ne!(text, right, "{to}");
        let error = fault(&text);
        let message = error.to_string();
        assert!(message.starts_with(place), "{to}: {message}");
        assert!(
            message.contains(part) && error.help.contains(help),
            "{to}: {message}; {}",
            error.help
        );
    }
}

fn facts(generator: &Generator, number: u32) -> ShardFacts {
    let (made, files) = shard(generator, number);
    let sized = files.iter().map(|(table, bytes)| (*table, (bytes.len() as u64, "00".to_owned())));
    ShardFacts::new(generator, number, &made, &sized.collect())
}

#[test]
fn facts_match_only_their_shard() {
    let small = EVERYTHING.replace("scenes = 3", "scenes = 1");
    let own = generator(&small);
    let text = facts(&own, 1).to_text();
    assert_eq!(ShardFacts::read(&own, 1, &text).map(|facts| facts.to_text()), Ok(text.clone()));
    let different = generator(&small.replace("poses = 2", "poses = 3"));
    let read = |generator: &Generator, number: u32, text: &str| {
        ShardFacts::read(generator, number, text).expect_err(text)
    };
    assert!(matches!(read(&different, 1, &text), ManifestError::Specification { .. }));
    assert_eq!(read(&own, 2, &text), ManifestError::Number { found: 1, expected: 2 });
    let older = text.replace("\"sampling_version\": 1", "\"sampling_version\": 0");
    assert!(matches!(read(&own, 1, &older), ManifestError::Version { .. }));
    let fewer = text.replace("echoes.parquet", "echos.parquet");
    assert_eq!(read(&own, 1, &fewer), ManifestError::Files);
    assert!(matches!(read(&own, 1, &text[..40]), ManifestError::Form(_)));
    let manifest = DataSetManifest::new(&own, &[facts(&own, 1), facts(&own, 2)]);
    assert_eq!(manifest.totals.rows[&ShardTable::Scenes], 2);
    let card = manifest.card(&own);
    for column in rows(&shard(&own, 1).1[&ShardTable::Readings])[0].keys() {
        assert!(card.contains(&format!("| `{column}` |")), "{column}\n{card}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_specification_panics(
        from in 0..EVERYTHING.len(), length in 0_usize..40, put in "[-0-9a-z.\\[\\]={}\"\n ]{0,12}"
    ) {
        let mut text = EVERYTHING.to_owned();
        let to = (from + length).min(text.len());
        text.replace_range(from..to, &put);
        if let Err(error) = Generator::from_toml("set.toml", &text, &no_files) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
