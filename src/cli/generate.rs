//! `sonard generate`.

mod part;

use std::{
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use super::{
    Failure, Outcome,
    failure::is_wrong_place,
    output::{OutPath, register_input},
    progress,
};
use crate::{
    dataset::{DataSet, DataSetError, PartOutcome},
    generate::{DataSetManifest, Generator, SetPart, ShardTable},
};

/// Options of `sonard generate`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
#[command(group(clap::ArgGroup::new("instead").args(["example", "check", "verify"])))]
pub(super) struct Args {
    /// The specification, a TOML file, or spec.json of a data set
    #[arg(value_name = "SPEC.toml", required_unless_present_any = ["example", "verify"])]
    spec: Option<PathBuf>,
    /// Output folder; one subfolder per shard
    #[arg(long, value_name = "DIR", required_unless_present = "instead")]
    out: Option<OutPath>,
    /// Part of the set to make: every N-th shard starting from the I-th, I from 1 [default: from an
    /// array job's environment, else all]
    #[arg(long, value_name = "I/N", conflicts_with = "instead")]
    shard: Option<SetPart>,
    /// Print an example file with all keys explained, and exit; a specification
    #[arg(long)]
    example: bool,
    /// Validate the file and all that it names, and exit
    #[arg(long)]
    check: bool,
    /// Check files against their digests, and exit; those of a data set's folder
    #[arg(long, value_name = "DIR", conflicts_with = "spec")]
    verify: Option<PathBuf>,
    /// Also recompute this number of shards and compare them with the existing ones
    #[arg(long, value_name = "SHARDS", requires = "verify", default_value_t = 0)]
    recheck: u32,
}

pub(super) const ABOUT: &str = "\
Generate random training data for machine learning.

A specification states the size of the set, the distributions of scenes, furniture, materials, \
poses, sensors, air and noise, and what is stored: readings, their paths, every echo, traces, \
ideal ranges, features as labels, true maps. Invalid samples are redrawn and counted.

A shard depends only on the specification and its number, so any job system can make a set: each \
process makes its part (--shard I/N), in any order. Existing shards are skipped, so an interrupted \
set resumes when the command is repeated; a killed process leaves no shard that looks complete. \
The process that completes the set writes manifest.json (counts, digests) and README.md \
(description of the set and its columns).

Without --shard the index of an array job is taken from its environment: SLURM_ARRAY_TASK_ID with its count, or \
JOB_COMPLETION_INDEX (Kubernetes) or AWS_BATCH_JOB_ARRAY_INDEX out of the number of shards. The command reports \
which it used. --shard takes precedence; --shard 1/1 makes all.";

const EXAMPLES: &str = "\
Examples:
  sonard generate --example > rooms.toml        # every key, explained
  sonard generate rooms.toml --check
  sonard generate rooms.toml --out rooms        # all shards, on all cores
  sonard generate rooms.toml --out rooms --shard 3/20
  parallel sonard generate rooms.toml --out rooms --shard {#}/20 ::: $(seq 20)
  sbatch --array=1-20 --wrap 'sonard generate rooms.toml --out /shared/rooms'
  sonard generate --verify rooms --recheck 2    # digests, and two shards recomputed

It uses all cores, or RAYON_NUM_THREADS threads. docs/generate.md explains how to read a set.

Exit codes: 0 done (or already complete), 1 --verify found a fault, 2 wrong usage, specification or folder, 3 write \
error; run the same command to resume.";

const EXAMPLE: &str = include_str!("../../config/generate.toml");

pub(super) fn run(args: &Args) -> Outcome {
    if args.example {
        return io::stdout()
            .write_all(EXAMPLE.as_bytes())
            .or_else(|error| Failure::from_write("to standard output", &error));
    }
    if let Some(folder) = &args.verify {
        return verify(folder, args.recheck);
    }
    // Required unless one of those options is given.
    let Some(spec) = &args.spec else { return Ok(()) };
    let generator = read(spec)?;
    let Some(out) = args.out.as_deref().filter(|_| !args.check) else {
        print_line!("{}", describe_size(&generator));
        return Ok(());
    };
    let shards = generator.spec().set.shards;
    let part = part::part(args.shard, &|name| std::env::var(name).ok(), shards)?;
    make(&generator, out, part)
}

fn read(path: &Path) -> Result<Generator, Failure> {
    DataSet::read_specification(path, &register_input).map_err(|error| match error.io_error() {
        Some(_) => {
            let help = "give a readable specification: `sonard generate --example` prints one";
            Failure::input(&error, help)
        }
        None => failure_from(&error),
    })
}

fn failure_from(error: &DataSetError) -> Failure {
    match error.io_error() {
        Some(disk) if !is_wrong_place(disk) => Failure::device(error, error.help()),
        _ => Failure::input(error, error.help()),
    }
}

/// Describes the size of a set in one line.
fn describe_size(generator: &Generator) -> String {
    let set = &generator.spec().set;
    let readings = generator.readings() * u64::from(set.shards);
    format!(
        "{}: {} shards of {} scenes with {} poses each, {readings} readings; specification {}",
        set.name,
        set.shards,
        set.scenes,
        set.poses,
        &generator.sha256()[..12]
    )
}

fn make(generator: &Generator, out: &Path, part: SetPart) -> Outcome {
    let set = DataSet::open(out, generator).map_err(|error| failure_from(&error))?;
    let shards = part.shards(generator.spec().set.shards).count() as u64;
    let bar = progress::bar(generator.readings() * shards, "readings");
    let made = set.generate_part(part, &|readings| bar.inc(readings));
    bar.finish_and_clear();
    let PartOutcome { generated: made, existed: were_there } =
        made.map_err(|error| failure_from(&error))?;
    notice!("{made} shards made, {were_there} already complete");
    match set.write_manifest().map_err(|error| failure_from(&error))? {
        Some(manifest) => notice!("{}: {}", out.display(), describe_complete(&manifest)),
        None => {
            let missing = set.missing().map_err(|error| failure_from(&error))?;
            let total = generator.spec().set.shards;
            notice!("{}: {} of {total} shards missing", out.display(), missing.len());
        }
    }
    Ok(())
}

/// Describes a complete set in one line.
fn describe_complete(manifest: &DataSetManifest) -> String {
    let totals = &manifest.totals;
    let readings = totals.rows.get(&ShardTable::Readings).copied().unwrap_or_default();
    let redrawn = &totals.rejected_draws;
    format!(
        "complete: {} shards, {readings} readings, {:.2} bytes per reading; redrawn: {} poses, {} pieces of furniture, {} \
         scenes; SHA-256 {}",
        manifest.shards,
        totals.bytes as f64 / readings.max(1) as f64,
        redrawn.poses + redrawn.costly,
        redrawn.furniture,
        redrawn.scenes,
        manifest.sha256,
    )
}

/// Maximum number of listed problems; further ones are counted.
const MAX_LISTED: usize = 20;

fn verify(folder: &Path, recheck: u32) -> Outcome {
    let generator = DataSet::specification(folder).map_err(|error| match error.io_error() {
        Some(_) => Failure::input(&error, "give the folder of a data set, with its spec.json"),
        None => failure_from(&error),
    })?;
    let set = DataSet::existing(folder, &generator);
    let shards = generator.spec().set.shards;
    let all: Vec<u32> = (1..=shards).collect();
    let bar = progress::bar(shards.into(), "shards");
    let of_shards: Vec<Vec<String>> = all
        .par_iter()
        .map(|shard| {
            let problems = set.check_digests(*shard);
            bar.inc(1);
            problems
        })
        .collect();
    bar.finish_and_clear();
    let mut problems: Vec<String> = of_shards.into_iter().flatten().collect();
    problems.extend(set.check_manifest().map_err(|error| failure_from(&error))?);
    let sample = sample(shards, recheck);
    if problems.is_empty() {
        let bar = progress::bar(generator.readings() * sample.len() as u64, "readings");
        let drawn: Result<Vec<_>, _> = sample
            .par_iter()
            .map(|shard| set.check_regenerated(*shard, &|readings| bar.inc(readings)))
            .collect();
        bar.finish_and_clear();
        problems.extend(drawn.map_err(|error| failure_from(&error))?.into_iter().flatten());
    }
    if problems.is_empty() {
        print_line!("{}; verified, {} recomputed", describe_size(&generator), sample.len());
        return Ok(());
    }
    for problem in problems.iter().take(MAX_LISTED) {
        print_line!("{problem}");
    }
    let hint = "delete damaged shards and run `sonard generate` again to make missing ones";
    Err(Failure::Found(Some(format!("{}: {} problems; {hint}", folder.display(), problems.len()))))
}

/// Selects `count` shards, evenly over the set.
fn sample(shards: u32, count: u32) -> Vec<u32> {
    let count = count.min(shards);
    let at = |number: u32| (u64::from(number) * u64::from(shards) / u64::from(count.max(1))) as u32;
    (0..count).map(|number| 1 + at(number)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn example_has_every_key() {
        let none = |name: &str| Err(io::Error::other(format!("no file {name}")));
        let generator = Generator::from_toml("generate.toml", EXAMPLE, &none);
        let generator = generator.unwrap_or_else(|error| panic!("{error}: {}", error.help));
        let written: serde_json::Value =
            serde_json::from_str(generator.text()).expect("it is JSON");
        let specification = written["specification"].as_object().expect("an object");
        for (section, keys) in specification {
            assert!(EXAMPLE.contains(&format!("[{section}]")), "[{section}]");
            let keys = match keys {
                serde_json::Value::Array(kinds) => kinds[0].as_object(),
                keys => keys.as_object(),
            };
            for key in keys.into_iter().flat_map(serde_json::Map::keys) {
                let is_there = |line: &str| {
                    line.trim_start_matches(['#', ' ']).starts_with(&format!("{key} = "))
                };
                assert!(EXAMPLE.lines().any(is_there), "[{section}] {key}");
            }
        }
    }

    #[test]
    fn sample_is_spread_evenly() {
        assert_eq!(sample(10, 0), [] as [u32; 0]);
        assert_eq!(sample(10, 2), [1, 6]);
        assert_eq!(sample(3, 9), [1, 2, 3]);
    }
}
