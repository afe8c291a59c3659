//! The data card of a set.

use std::fmt::Write as _;

use sonard_export::Kind;

use super::Manifest;
use crate::{
    shard::Generator,
    spec::{SceneKeys, Shape, Spec},
    spread::Spread,
    table::Table,
};

/// The card. Writing to a text can't fail.
pub(super) fn card(manifest: &Manifest, generator: &Generator) -> String {
    let spec = generator.spec();
    let mut text = format!("# {}\n\n", manifest.name);
    if !manifest.about.is_empty() {
        let _ = writeln!(text, "{}\n", manifest.about);
    }
    let rows = |table: Table| manifest.totals.rows.get(&table).copied().unwrap_or_default();
    let readings = rows(Table::Readings);
    let _ = writeln!(
        text,
        "{readings} simulated readings of ultrasonic rangers in {} scenes, {} poses in each; {} shards, {} bytes, \
         {:.1} bytes a reading.\n",
        rows(Table::Scenes),
        spec.set.poses,
        manifest.shards,
        manifest.totals.bytes,
        manifest.totals.bytes as f64 / readings.max(1) as f64,
    );
    drawn(&mut text, spec);
    made(&mut text, manifest);
    tables(&mut text, generator);
    text.push_str(USE);
    text
}

const USE: &str = "\
## Use

```python
import duckdb
duckdb.sql(\"select avg(range_m) from 'shard-*/readings.parquet' where status = 'echo'\")
```

Split by scene, not by reading: readings of a scene tell of one another. All readings are simulated; what the model \
leaves out, no learner can find here.
";

fn drawn(text: &mut String, spec: &Spec) {
    text.push_str("## What is drawn\n\n");
    let weights: f64 = spec.scene.iter().map(|kind| kind.weight).sum();
    for kind in &spec.scene {
        let share = 100.0 * kind.weight / weights;
        let _ = writeln!(text, "- {share:.0} % of scenes: {}", scene(kind));
    }
    let furniture = &spec.furniture;
    let _ = writeln!(
        text,
        "- In each that is of no file: {} boxes, {} cylinders, {} partitions",
        words(&furniture.boxes, ""),
        words(&furniture.cylinders, ""),
        words(&furniture.partitions, "")
    );
    for (name, material) in &spec.materials {
        let _ = writeln!(
            text,
            "- Material {name}: reflectance {}, roughness {}",
            words(&material.reflectance, ""),
            words(&material.roughness, "")
        );
    }
    match &spec.heights {
        None => text.push_str("- Scenes of no file are plans, without floor and ceiling\n"),
        Some(heights) => {
            let _ = writeln!(
                text,
                "- Ceiling at {}, transducer at {}",
                words(&heights.ceiling_m, " m"),
                words(&heights.sensor_m, " m")
            );
        }
    }
    measured(text, spec);
}

/// From where readings are taken, and with what.
fn measured(text: &mut String, spec: &Spec) {
    let _ = writeln!(
        text,
        "- Poses anywhere, at least {} m from everything, heading {}",
        spec.poses.clearance_m,
        words(&spec.poses.heading_deg, " degrees")
    );
    let plan = &spec.plan;
    let _ = writeln!(
        text,
        "- Azimuths from {} to {} degrees in steps of {}, {} firings each",
        plan.from_deg, plan.to_deg, plan.step_deg, plan.pings_per_stop
    );
    let _ = writeln!(text, "- Sensors: {}", spec.sensor.any_of.join(", "));
    let _ = writeln!(
        text,
        "- Air: {}, {} relative humidity, {}",
        words(&spec.air.temperature_c, " degrees Celsius"),
        words(&spec.air.humidity_percent, " %"),
        words(&spec.air.pressure_kpa, " kPa")
    );
    let _ = writeln!(
        text,
        "- Noise: floor {}, jitter {}",
        words(&spec.noise.floor, ""),
        words(&spec.noise.jitter_us, " us")
    );
    let _ = writeln!(text, "- Engine: {}\n", spec.model.engine.name());
}

fn scene(kind: &SceneKeys) -> String {
    match (kind.shape, &kind.file) {
        (Shape::File, Some(name)) => format!("`{name}`"),
        (shape, _) => {
            let side = |spread: &Option<Spread>| {
                spread.as_ref().map_or_else(String::new, |spread| words(spread, " m"))
            };
            format!(
                "rooms of shape {}, {} wide, {} deep",
                format!("{shape:?}").to_lowercase(),
                side(&kind.width_m),
                side(&kind.depth_m)
            )
        }
    }
}

fn words(spread: &Spread, unit: &str) -> String {
    match spread {
        Spread::Fixed(number) => format!("{number}{unit}"),
        Spread::Even([least, most]) => format!("{least} to {most}{unit}"),
        Spread::Normal { mean, sigma, least, most } => {
            format!("{mean} ± {sigma}{unit} (within {least} to {most})")
        }
        Spread::AnyOf(numbers) => {
            let numbers: Vec<_> = numbers.iter().map(ToString::to_string).collect();
            format!("one of {}{unit}", numbers.join(", "))
        }
    }
}

fn made(text: &mut String, manifest: &Manifest) {
    let again = &manifest.totals.redrawn;
    let _ = writeln!(
        text,
        "## How it was made\n\n\
         By `sonard generate`, version {}, of the specification in `spec.json` (SHA-256 {}). The same \
         specification and version give the same bytes, whoever makes which shard; `sonard generate --verify` checks \
         digests, with `--recheck` by making shards anew. The digest of the set is {}.\n\n\
         What did not fit was drawn again: {} poses where nothing could stand, {} places of furniture, {} scenes, {} \
         poses with too many echo paths. So poses are even over the free space, and crowded rooms rarer than drawn.\n",
        manifest.sonard,
        manifest.spec_sha256,
        manifest.sha256,
        again.poses,
        again.furniture,
        again.scenes,
        again.costly,
    );
}

fn tables(text: &mut String, generator: &Generator) {
    text.push_str("## Tables\n\nEach shard is a folder, `shard-00001` and so on, with a file a table (Parquet).\n");
    for table in generator.tables() {
        let _ = writeln!(text, "\n### {}\n\nA row a {}.\n", table.file(), table.row());
        text.push_str("| column | type | meaning |\n| --- | --- | --- |\n");
        for column in table.columns(&generator.spec().keep) {
            let kind = match column.field.kind {
                Kind::Text => "text",
                Kind::Integer => "integer",
                Kind::Number if column.field.is_single => "float",
                Kind::Number => "double",
                Kind::Flag => "yes or no",
                Kind::Time => "time",
                Kind::Integers => "list of integers",
                Kind::Numbers => "list of floats",
            };
            let _ = writeln!(text, "| `{}` | {kind} | {} |", column.field.name, column.about);
        }
    }
    text.push('\n');
}
