//! Tasks of the repository: releases, instruction counts, mutation tests, coverage, costs of builds.
//!
//! Each artefact of a release depends on the commit and on the pinned tools only: times are the commit's, paths
//! of the building computer are replaced, archives are sorted. Two builds of a commit are equal
//! byte for byte.

mod archive;
mod binary;
mod build_cost;
mod command;
mod coverage;
mod deb;
mod folders;
mod instructions;
mod mutants;
mod options;
mod release;
mod sbom;
mod source;
mod tools;
mod wheel;

use std::{fs, process::ExitCode};

use build_cost::CostOptions;
use coverage::CoverageOptions;
use instructions::InstructionOptions;
use lexopt::{Parser, ValueExt as _};
use mutants::MutantOptions;
use options::{Artefact, Options};
use release::Release;

/// Description of the first failure.
pub(crate) type Failure = Box<dyn std::error::Error>;

const HELP: &str = "\
Usage: cargo xtask dist | instructions | mutants | coverage | build-cost

  dist           build the artefacts of a release
  instructions   compare the instruction counts of fixed workloads
  mutants        find changes of the pure core that its unit tests do not notice
  coverage       share of lines that the tests execute, by crate
  build-cost     measure builds of commits, and rebuilds after a changed line

`cargo xtask TASK --help` lists the options of a task.";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("xtask: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Failure> {
    let mut arguments = Parser::from_env();
    let task = match arguments.next()? {
        Some(lexopt::Arg::Value(task)) => task.string()?,
        None | Some(lexopt::Arg::Short('h') | lexopt::Arg::Long("help")) => {
            println!("{HELP}");
            return Ok(());
        }
        Some(other) => return Err(other.unexpected().into()),
    };
    match task.as_str() {
        "dist" => perform(Options::parse(arguments)?, options::HELP, build),
        "instructions" => {
            let options = InstructionOptions::parse(arguments)?;
            perform(options, instructions::HELP, instructions::check)
        }
        "mutants" => perform(MutantOptions::parse(arguments)?, mutants::HELP, mutants::test),
        "coverage" => {
            perform(CoverageOptions::parse(arguments)?, coverage::HELP, coverage::measure)
        }
        "build-cost" => {
            perform(CostOptions::parse(arguments)?, build_cost::HELP, build_cost::measure)
        }
        other => Err(format!("{other}: no task; see cargo xtask --help").into()),
    }
}

/// Performs a task with its options, or prints its help.
fn perform<T>(
    options: Option<T>,
    help: &str,
    task: fn(&T) -> Result<(), Failure>,
) -> Result<(), Failure> {
    match options {
        Some(options) => task(&options),
        None => {
            println!("{help}");
            Ok(())
        }
    }
}

/// Builds the requested artefacts, and lists all files of the folder with their digests.
fn build(options: &Options) -> Result<(), Failure> {
    let release = Release::of_checkout(options)?;
    fs::create_dir_all(&release.dist)?;
    for artefact in &options.artefacts {
        match artefact {
            Artefact::Binary => binary::pack_all(&release)?,
            Artefact::Deb => deb::build_all(&release)?,
            Artefact::Wheel => wheel::build_all(&release)?,
            Artefact::Source => source::pack(&release)?,
            Artefact::Sbom => sbom::write(&release)?,
            Artefact::Installer => release.write_installer()?,
        }
    }
    release.write_digests()
}
