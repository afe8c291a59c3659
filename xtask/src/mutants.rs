//! Mutation test of the pure core: `cargo xtask mutants COUNT`.
//!
//! A sample of mutants (single changes of the code, by cargo-mutants) is spread evenly over the
//! pure core; `.cargo/mutants.toml` defines the core. A mutant is caught if the unit tests of the
//! changed crate fail. Outcomes are kept in `target/mutants`, so that an interrupted run continues
//! and missed mutants are tried again.

use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use lexopt::{Arg, Parser, ValueExt as _};

use crate::{
    Failure,
    command::{read, run},
    folders,
};

pub(crate) const HELP: &str = "\
Change the pure core in places spread evenly over it, one at a time, and print which changes the
unit tests of the changed crate do not notice. Takes hours; the same command continues where it was
interrupted, and tries missed changes again.

Usage: cargo xtask mutants COUNT [--from N] [--jobs N]

  COUNT      number of changes
  --from N   number of the first change; samples of different N have none in common [default: 0]
  --jobs N   copies of the repository that are tested at once [default: 1]";

const VERSION: &str = "27.0.0";
/// Outcomes of a mutant that need no other attempt, and their files.
const SETTLED: [&str; 3] = ["caught", "timeout", "unviable"];

/// Requested sample.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct MutantOptions {
    count: usize,
    from: usize,
    jobs: usize,
}

impl MutantOptions {
    /// Parses the arguments after the task; `None` if help is requested.
    ///
    /// # Errors
    /// An unknown argument, or no positive count.
    pub(crate) fn parse(mut arguments: Parser) -> Result<Option<Self>, Failure> {
        let mut options = Self { count: 0, from: 0, jobs: 1 };
        while let Some(argument) = arguments.next()? {
            match argument {
                Arg::Value(count) if options.count == 0 => options.count = count.parse()?,
                Arg::Long("from") => options.from = arguments.value()?.parse()?,
                Arg::Long("jobs") => options.jobs = arguments.value()?.parse()?,
                Arg::Short('h') | Arg::Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        if options.count == 0 {
            return Err("how many changes? see cargo xtask mutants --help".into());
        }
        Ok(Some(options))
    }
}

/// Names of mutants by outcome.
type Outcomes = BTreeMap<&'static str, BTreeSet<String>>;

/// Tries the mutants of a sample that are not settled, and prints the missed ones and a table.
///
/// # Errors
/// A tool that can't be installed or fails.
pub(crate) fn test(options: &MutantOptions) -> Result<(), Failure> {
    let target = folders::target()?;
    let tool = installed_tool(&target)?;
    let folder = target.join(format!("mutants/{}-{}", options.count, options.from));
    fs::create_dir_all(folder.join("mutants.out"))?;
    let list = ["mutants", "--workspace", "--list", "--line-col=true", "--colors=never"];
    let listed = read(Command::new(&tool).args(list))?;
    let listed: Vec<&str> = listed.lines().collect();
    let sample = sample(&listed, options);
    let mut settled = settled(&folder, &sample)?;
    println!(
        "{} of {} mutants, {} left to try",
        sample.len(),
        listed.len(),
        missed(&sample, &settled).count()
    );
    if missed(&sample, &settled).next().is_some() {
        let is_tried = |name: &&&str| missed(&sample, &settled).any(|left| left == **name);
        let others: Vec<&str> = listed.iter().filter(|name| !is_tried(name)).copied().collect();
        fs::write(folder.join("mutants.out/previously_caught.txt"), others.join("\n"))?;
        try_mutants(&tool, &folder, options.jobs)?;
        settled = self::settled(&folder, &sample)?;
    }
    println!("\nmissed:");
    missed(&sample, &settled).for_each(|name| println!("{name}"));
    print!("\n{}", table(&sample, &settled));
    Ok(())
}

/// Path of cargo-mutants, which is built if it is not installed.
fn installed_tool(target: &Path) -> Result<PathBuf, Failure> {
    let path = env::var_os("PATH").unwrap_or_default();
    let root = target.join("tools");
    let folders = env::split_paths(&path).chain([root.join("bin")]);
    let found = folders.map(|folder| folder.join("cargo-mutants")).find(|tool| tool.exists());
    if let Some(tool) = found {
        return Ok(tool);
    }
    let version = format!("cargo-mutants@{VERSION}");
    let install = ["install", "--quiet", "--locked", "--debug", "--root"];
    run(Command::new("cargo").args(install).arg(&root).arg(version))?;
    Ok(root.join("bin/cargo-mutants"))
}

/// Every n-th mutant, about as many as requested. By name, because a run by shards can't continue.
fn sample(listed: &[&str], options: &MutantOptions) -> BTreeSet<String> {
    let every = (listed.len() / options.count).max(1);
    let chosen = listed.iter().skip(options.from % every).step_by(every);
    chosen.map(|name| (*name).to_owned()).collect()
}

/// Runs cargo-mutants on what `previously_caught.txt` does not list.
fn try_mutants(tool: &Path, folder: &Path, jobs: usize) -> Result<(), Failure> {
    let has_nextest = Command::new("cargo").args(["nextest", "--version"]).output();
    let runner = if has_nextest.is_ok_and(|of| of.status.success()) { "nextest" } else { "cargo" };
    let status = Command::new(tool)
        .args(["mutants", "--workspace", "--iterate", "--colors=never", "--no-times"])
        .args([format!("--test-tool={runner}"), format!("--jobs={jobs}")])
        .arg("--output")
        .arg(folder)
        .status()?;
    // 2: some were missed; 3: some ran out of time.
    match status.code() {
        Some(0 | 2 | 3) => Ok(()),
        _ => Err(format!("cargo-mutants: {status}; see {}", folder.display()).into()),
    }
}

/// Settled mutants of the sample from earlier runs and the last one, which are kept.
fn settled(folder: &Path, sample: &BTreeSet<String>) -> Result<Outcomes, Failure> {
    let mut settled = Outcomes::new();
    for kind in SETTLED {
        let kept = folder.join(kind);
        let last = folder.join("mutants.out").join(kind).with_extension("txt");
        let text = [&kept, &last].map(|path| fs::read_to_string(path).unwrap_or_default()).concat();
        let names = text.lines().filter(|name| sample.contains(*name));
        let names: BTreeSet<String> = names.map(str::to_owned).collect();
        let lines: String = names.iter().map(|name| format!("{name}\n")).collect();
        fs::write(kept, lines)?;
        settled.insert(kind, names);
    }
    Ok(settled)
}

/// Mutants of the sample that are not settled.
fn missed<'a>(
    sample: &'a BTreeSet<String>,
    settled: &'a Outcomes,
) -> impl Iterator<Item = &'a str> {
    let is_left = |name: &&String| !settled.values().any(|names| names.contains(*name));
    sample.iter().filter(is_left).map(String::as_str)
}

/// Counts by crate and module, and in all.
fn table(sample: &BTreeSet<String>, settled: &Outcomes) -> String {
    // Caught, timeout, unviable, missed.
    let mut counts: BTreeMap<String, [usize; 4]> = BTreeMap::new();
    for name in sample {
        let kind = SETTLED.iter().position(|kind| settled[kind].contains(name)).unwrap_or(3);
        counts.entry(module(name)).or_default()[kind] += 1;
    }
    let all = counts.values().fold([0; 4], |all, of| std::array::from_fn(|at| all[at] + of[at]));
    let head = format!(
        "{:32} {:>7} {:>7} {:>7} {:>9} {:>7}\n",
        "", "caught", "timeout", "missed", "unviable", "share"
    );
    let rows = counts.iter().map(|(name, of)| row(name, of)).chain([row("all", &all)]);
    rows.fold(head, |table, row| table + &row)
}

fn row(name: &str, &[caught, timeout, unviable, missed]: &[usize; 4]) -> String {
    let viable = caught + timeout + missed;
    let share = (100 * (caught + timeout)).checked_div(viable);
    let share = share.map_or_else(|| "-".to_owned(), |share| format!("{share} %"));
    format!("{name:32} {caught:7} {timeout:7} {missed:7} {unviable:9} {share:>7}\n")
}

/// Crate and module of a mutant's name, such as `crates/sonard-model/src/air.rs:3:9: ...`.
fn module(name: &str) -> String {
    let parts = name.strip_prefix("crates/").and_then(|rest| rest.split_once("/src/"));
    let Some((package, path)) = parts else { return "other".to_owned() };
    let end = path.find(|char: char| !char.is_ascii_lowercase() && char != '_');
    format!("{package}::{}", &path[..end.unwrap_or(path.len())])
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTED: [&str; 6] = [
        "crates/a/src/air.rs:1:1: replace + with -",
        "crates/a/src/air.rs:2:1: replace + with -",
        "crates/a/src/beam/map.rs:1:1: replace + with -",
        "crates/b/src/lib.rs:1:1: replace + with -",
        "crates/b/src/lib.rs:2:1: replace + with -",
        "crates/b/src/lib.rs:3:1: replace + with -",
    ];

    #[test]
    fn samples_are_disjoint() {
        let sample = |from| sample(&LISTED, &MutantOptions { count: 2, from, jobs: 1 });
        assert_eq!(sample(0).len(), 2);
        let all: BTreeSet<String> = (0..3).flat_map(sample).collect();
        assert_eq!(all.len(), LISTED.len());
        assert_eq!(sample(3), sample(0));
    }

    #[test]
    fn outcomes_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir(folder.path().join("mutants.out")).expect("a folder");
        let sample: BTreeSet<String> = LISTED.map(str::to_owned).into();
        let last = folder.path().join("mutants.out/caught.txt");
        fs::write(&last, format!("{}\nnot of the sample\n", LISTED[0])).expect("written");
        let first = settled(folder.path(), &sample).expect("readable");
        assert_eq!(missed(&sample, &first).count(), 5);
        // The next run of the tool replaces its files.
        fs::write(&last, LISTED[3]).expect("written");
        let second = settled(folder.path(), &sample).expect("readable");
        assert_eq!(missed(&sample, &second).count(), 4);
        let table = table(&sample, &second);
        let words: Vec<&str> = table.lines().last().expect("a total").split_whitespace().collect();
        assert_eq!(words, ["all", "2", "0", "4", "0", "33", "%"]);
        assert!(table.contains("a::beam") && table.contains("b::lib"), "{table}");
    }

    #[test]
    fn count_is_required() {
        let parse = |arguments: &[&str]| MutantOptions::parse(Parser::from_args(arguments));
        assert!(parse(&[]).is_err() && parse(&["0"]).is_err() && parse(&["many"]).is_err());
        let options = parse(&["30", "--from", "7"]).expect("valid").expect("no help");
        assert_eq!(options, MutantOptions { count: 30, from: 7, jobs: 1 });
    }
}
