//! Data card of a set, in Markdown.

use std::fmt::Write as _;

use sonard_export::ColumnKind;

use super::DataSetManifest;
use crate::{
    distribution::NumberDistribution,
    shard::Generator,
    spec::{RoomShape, Spec, SpecSceneKeys},
    table::ShardTable,
};

/// Writes the card. Writing to a string cannot fail.
pub(super) fn card(manifest: &DataSetManifest, generator: &Generator) -> String {
    let spec = generator.spec();
    let mut text = format!("# {}\n\n", manifest.name);
    if !manifest.about.is_empty() {
        let _ = writeln!(text, "{}\n", manifest.about);
    }
    let rows = |table: ShardTable| manifest.totals.rows.get(&table).copied().unwrap_or_default();
    let readings = rows(ShardTable::Readings);
    let _ = writeln!(
        text,
        "{readings} simulated readings of ultrasonic rangers in {} scenes, {} poses in each; {} shards, {} bytes, \
         {:.1} bytes per reading.\n",
        rows(ShardTable::Scenes),
        spec.set.poses,
        manifest.shards,
        manifest.totals.bytes,
        manifest.totals.bytes as f64 / readings.max(1) as f64,
    );
    write_distributions(&mut text, spec);
    write_generation(&mut text, manifest);
    write_tables(&mut text, generator);
    text.push_str(USE);
    text
}

const USE: &str = "\
## Use

```python
import duckdb
duckdb.sql(\"select avg(range_m) from 'shard-*/readings.parquet' where status = 'echo'\")
```

Split by scene, not by reading: readings of one scene are correlated. All readings are simulated; effects that the model \
omits are not in the data.
";

fn write_distributions(text: &mut String, spec: &Spec) {
    text.push_str("## Distributions\n\n");
    let weights: f64 = spec.scene.iter().map(|kind| kind.weight).sum();
    for kind in &spec.scene {
        let share = 100.0 * kind.weight / weights;
        let _ = writeln!(text, "- {share:.0} % of scenes: {}", scene(kind));
    }
    let furniture = &spec.furniture;
    let _ = writeln!(
        text,
        "- In each generated scene: {} boxes, {} cylinders, {} partitions",
        distribution_text(&furniture.boxes, ""),
        distribution_text(&furniture.cylinders, ""),
        distribution_text(&furniture.partitions, "")
    );
    for (name, material) in &spec.materials {
        let _ = writeln!(
            text,
            "- Material {name}: reflectance {}, roughness {}",
            distribution_text(&material.reflectance, ""),
            distribution_text(&material.roughness, "")
        );
    }
    match &spec.heights {
        None => text.push_str("- Generated scenes are plans, without floor and ceiling\n"),
        Some(heights) => {
            let _ = writeln!(
                text,
                "- Ceiling at {}, transducer at {}",
                distribution_text(&heights.ceiling_m, " m"),
                distribution_text(&heights.sensor_m, " m")
            );
        }
    }
    write_measurement(text, spec);
}

/// Writes poses, azimuths, sensors, air and noise.
fn write_measurement(text: &mut String, spec: &Spec) {
    let _ = writeln!(
        text,
        "- Poses uniform over the free space, at least {} m from all surfaces, heading {}",
        spec.poses.clearance_m,
        distribution_text(&spec.poses.heading_deg, " degrees")
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
        distribution_text(&spec.air.temperature_c, " degrees Celsius"),
        distribution_text(&spec.air.humidity_percent, " %"),
        distribution_text(&spec.air.pressure_kpa, " kPa")
    );
    let _ = writeln!(
        text,
        "- Noise: floor {}, jitter {}",
        distribution_text(&spec.noise.floor, ""),
        distribution_text(&spec.noise.jitter_us, " us")
    );
    let _ = writeln!(text, "- Engine: {}\n", spec.model.engine.name());
}

fn scene(kind: &SpecSceneKeys) -> String {
    match (kind.shape, &kind.file) {
        (RoomShape::File, Some(name)) => format!("`{name}`"),
        (shape, _) => {
            let side = |spread: &Option<NumberDistribution>| {
                spread.as_ref().map_or_else(String::new, |spread| distribution_text(spread, " m"))
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

fn distribution_text(spread: &NumberDistribution, unit: &str) -> String {
    match spread {
        NumberDistribution::Fixed(number) => format!("{number}{unit}"),
        NumberDistribution::Uniform([min, max]) => format!("{min} to {max}{unit}"),
        NumberDistribution::Normal { mean, sigma, min, max } => {
            format!("{mean} ± {sigma}{unit} (within {min} to {max})")
        }
        NumberDistribution::AnyOf(numbers) => {
            let numbers: Vec<_> = numbers.iter().map(ToString::to_string).collect();
            format!("one of {}{unit}", numbers.join(", "))
        }
    }
}

fn write_generation(text: &mut String, manifest: &DataSetManifest) {
    let rejected = &manifest.totals.rejected_draws;
    let _ = writeln!(
        text,
        "## Generation\n\n\
                 Generated by `sonard generate`, version {}, from the specification in `spec.json` (SHA-256 {}). The same \
                 specification and version give the same bytes, regardless of which process generates which shard. \
                 `sonard generate --verify` checks digests, with `--recheck` by regenerating shards. The digest of the set is {}.\n\n\
                 Draws were rejected and repeated: {} poses without free space, {} positions of furniture, {} scenes, {} \
                 poses with too many echo paths. Poses are therefore uniform over the free space, and crowded rooms rarer than \
                 drawn.\n",
        manifest.sonard,
        manifest.spec_sha256,
        manifest.sha256,
        rejected.poses,
        rejected.furniture,
        rejected.scenes,
        rejected.costly,
    );
}

fn write_tables(text: &mut String, generator: &Generator) {
    text.push_str("## Tables\n\nEach shard is a folder, `shard-00001` and so on, with one file per table (Parquet).\n");
    for table in generator.tables() {
        let _ = writeln!(text, "\n### {}\n\nOne row per {}.\n", table.file(), table.row());
        text.push_str("| column | type | meaning |\n| --- | --- | --- |\n");
        for column in table.columns(&generator.spec().keep) {
            let kind = match column.field.kind {
                ColumnKind::Text => "text",
                ColumnKind::Integer => "integer",
                ColumnKind::Number if column.field.is_single => "float",
                ColumnKind::Number => "double",
                ColumnKind::Flag => "boolean",
                ColumnKind::Time => "time",
                ColumnKind::Integers => "list of integers",
                ColumnKind::Numbers => "list of floats",
            };
            let _ = writeln!(text, "| `{}` | {kind} | {} |", column.field.name, column.about);
        }
    }
    text.push('\n');
}
