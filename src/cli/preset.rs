//! `sonard sensor` and `sonard array`: presets shipped with the program.

use std::io::{self, Write as _};

use super::{Failure, Outcome, table};
use crate::{
    acoustics::Sensor,
    array::RangerArray,
    scene::{shipped, suggest},
};

/// Verbs of `sonard sensor`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum SensorVerb {
    /// List the shipped sensors
    List,
    /// Print the file of a shipped sensor, with the source of each value, as a template
    #[command(after_help = "Examples:\n  sonard sensor show senscomp-6500 > my-sensor.json\n  \
                            sonard simulate --sensor my-sensor.json --scene simple-room --pose fig9")]
    Show(Name),
}

/// Verbs of `sonard array`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum ArrayVerb {
    /// List the shipped arrays of rangers
    List,
    /// Print the file of a shipped array, as a template
    #[command(after_help = "Examples:\n  sonard array show pioneer-8 > my-robot.json\n  \
                            sonard simulate --array my-robot.json --scene mcgill-lab --pose fig4")]
    Show(Name),
}

/// Name of a preset.
#[derive(Debug, clap::Args)]
pub(super) struct Name {
    /// Name in the list
    #[arg(value_name = "NAME")]
    name: String,
}

pub(super) fn sensor(verb: &SensorVerb) -> Outcome {
    match verb {
        SensorVerb::List => {
            let described = |name| Sensor::preset(name).map(|sensor| sensor.description);
            list(
                Sensor::preset_names()
                    .map(|name| [name.into(), described(name).unwrap_or_default()]),
            )
        }
        SensorVerb::Show(Name { name }) => {
            show("sensor", name, Sensor::preset_text(name), Sensor::preset_names())
        }
    }
}

pub(super) fn array(verb: &ArrayVerb) -> Outcome {
    match verb {
        ArrayVerb::List => {
            let described = |name| RangerArray::preset(name).map(|array| array.description);
            let names = RangerArray::preset_names();
            list(names.map(|name| [name.into(), described(name).unwrap_or_default()]))
        }
        ArrayVerb::Show(Name { name }) => {
            show("array", name, RangerArray::preset_text(name), RangerArray::preset_names())
        }
    }
}

/// Prints the file of a shipped scene.
pub(super) fn scene(Name { name }: &Name) -> Outcome {
    show("scene", name, shipped::text(name), shipped::names())
}

/// Prints names with their descriptions.
pub(super) fn list(rows: impl IntoIterator<Item = [String; 2]>) -> Outcome {
    print(&format!("{}\n", table::fit(table::list(rows))))
}

fn show<'a>(
    kind: &str,
    name: &str,
    text: Option<&str>,
    names: impl Iterator<Item = &'a str>,
) -> Outcome {
    let Some(text) = text else {
        let known: Vec<String> = names.map(str::to_owned).collect();
        return Err(Failure::input(
            format!("no shipped {kind} `{name}`"),
            suggest(name, &known, &format!("{kind}s")),
        ));
    };
    print(&format!("{}\n", text.trim_end()))
}

fn print(text: &str) -> Outcome {
    let written = io::stdout().lock().write_all(text.as_bytes());
    written.or_else(|error| Failure::from_write("to standard output", &error))
}
