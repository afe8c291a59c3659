//! Arrays of rangers named on the command line.

use std::{fs, io};

use super::Failure;
use crate::array::{ArrayError, RangerArray};

/// Loads an array from a file, or else from the preset of that name.
pub(super) fn load_array(name: &str) -> Result<RangerArray, Failure> {
    let array = match fs::read_to_string(name) {
        Ok(text) => RangerArray::from_json(&text),
        Err(error) if error.kind() == io::ErrorKind::NotFound => RangerArray::preset(name),
        Err(error) => {
            return Err(Failure::input(
                format!("cannot read the array {name}: {error}"),
                "give a readable text file, or the name of a preset",
            ));
        }
    };
    array.map_err(|error| {
        let message = match &error {
            ArrayError::UnknownPreset { .. } => {
                format!("no array file `{name}` and no preset of that name")
            }
            ArrayError::Malformed { line, column, field, message } => {
                format!("{name}:{line}:{column}: {field}: {message}")
            }
            other => format!("{name}: {other}"),
        };
        Failure::input(message, error.help())
    })
}

/// Option that rejects `--array` where one ranger turns on a stepper.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct NoArray {
    #[arg(long, hide = true, value_name = "NAME|FILE", value_parser = reject_array)]
    array: Option<String>,
}

fn reject_array(_name: &str) -> Result<String, String> {
    Err("a stepper turns a single ranger: arrays work with `sonard simulate --array` and \
     `sonard run --simulate --array`"
        .into())
}
