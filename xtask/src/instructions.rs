//! Instruction counts of fixed workloads: `cargo xtask instructions PROGRAM`.
//!
//! Callgrind counts the instructions of `measured_workload` in the benchmarks' program
//! `instructions`. Unlike times, counts are the same on a busy computer, so a change of more than
//! [`MAX_INCREASE`] is one of the code or of the compiler.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use lexopt::{Arg, Parser};
use serde_json::{Value, json};

use crate::{
    Failure,
    command::{read, read_errors},
};

pub(crate) const HELP: &str = "\
Count the instructions of fixed workloads by callgrind and compare them with benches/instructions.json.
Fails if one takes over 1 % more. Counts of another compiler are printed, not compared.

Usage: cargo xtask instructions PROGRAM [--record]

  PROGRAM    target/debug/instructions of the crate sonard-benches
  --record   write the counts to benches/instructions.json";

/// Maximum increase of a count, as a share.
const MAX_INCREASE: f64 = 0.01;
/// Instruction sets that glibc chooses its functions by: without them, each processor runs the same.
const TUNABLES: &str = "glibc.cpu.hwcaps=-AVX,-AVX2,-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ,-FMA,\
                        -FMA4,-BMI1,-BMI2,-ERMS,-FSRM,-SSE4_1,-SSE4_2,-SSSE3,-RTM,\
                        -AVX_Fast_Unaligned_Load,-AVX2_Usable,-FMA_Usable";

/// Counts with the compiler that they hold for.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Counts {
    compiler: String,
    of: BTreeMap<String, u64>,
}

/// Requested comparison.
#[derive(Debug)]
pub(crate) struct InstructionOptions {
    program: PathBuf,
    is_recorded: bool,
}

impl InstructionOptions {
    /// Parses the arguments after the verb; `None` if help is requested.
    ///
    /// # Errors
    /// An unknown argument or no program.
    pub(crate) fn parse(mut arguments: Parser) -> Result<Option<Self>, Failure> {
        let (mut program, mut is_recorded) = (None, false);
        while let Some(argument) = arguments.next()? {
            match argument {
                Arg::Value(path) if program.is_none() => program = Some(path.into()),
                Arg::Long("record") => is_recorded = true,
                Arg::Short('h') | Arg::Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        let program = program.ok_or("no program; see cargo xtask instructions --help")?;
        Ok(Some(Self { program, is_recorded }))
    }
}

/// Counts all workloads, and compares or records the counts.
///
/// # Errors
/// No callgrind, a workload that fails, or a count that has increased.
pub(crate) fn check(options: &InstructionOptions) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../benches/instructions.json");
    let counted = count_all(&options.program)?;
    if options.is_recorded {
        counted.print(None);
        return Ok(fs::write(path, counted.to_json()?)?);
    }
    let recorded = Counts::from_json(&fs::read_to_string(&path)?)?;
    if recorded.compiler != counted.compiler {
        counted.print(None);
        println!("not compared: recorded with {}, this is {}", recorded.compiler, counted.compiler);
        return Ok(());
    }
    counted.print(Some(&recorded));
    let increased = counted.increased(&recorded);
    if increased.is_empty() {
        return Ok(());
    }
    let names = increased.join(", ");
    Err(format!(
        "over {:.0} % more instructions: {names}; if the change is worth it, record the counts: \
         cargo xtask instructions {} --record",
        100.0 * MAX_INCREASE,
        options.program.display()
    )
    .into())
}

fn count_all(program: &Path) -> Result<Counts, Failure> {
    let compiler = read(Command::new("rustc").arg("--version"))?;
    let names = read(Command::new(program).arg("--list"))?;
    let count = |name: &str| Ok((name.to_owned(), count(program, name)?));
    let of = names.lines().map(count).collect::<Result<_, Failure>>()?;
    Ok(Counts { compiler, of })
}

/// Instructions of a workload.
fn count(program: &Path, name: &str) -> Result<u64, Failure> {
    let printed = read_errors(
        Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--collect-atstart=no"])
            .arg("--toggle-collect=*measured_workload*")
            .arg(program)
            .arg(name)
            .env("GLIBC_TUNABLES", TUNABLES)
            .env("RAYON_NUM_THREADS", "1"),
    )?;
    let total = printed.lines().find_map(|line| line.split_once("Collected :"));
    let count = total.and_then(|(_, count)| count.trim().parse().ok()).filter(|&count| count > 0);
    count.ok_or_else(|| format!("{name}: callgrind counted nothing: {printed}").into())
}

impl Counts {
    fn from_json(text: &str) -> Result<Self, Failure> {
        let value: Value = serde_json::from_str(text)?;
        let compiler = value["compiler"].as_str().ok_or("no compiler")?.to_owned();
        let entries = value["instructions"].as_object().ok_or("no instructions")?;
        let number = |(name, count): (&String, &Value)| {
            let count = count.as_u64().ok_or_else(|| format!("{name}: no count"))?;
            Ok((name.clone(), count))
        };
        Ok(Self { compiler, of: entries.iter().map(number).collect::<Result<_, Failure>>()? })
    }

    fn to_json(&self) -> Result<String, Failure> {
        let value = json!({"compiler": self.compiler, "instructions": self.of});
        Ok(serde_json::to_string_pretty(&value)? + "\n")
    }

    /// Workloads that take over the limit more than recorded.
    fn increased(&self, recorded: &Self) -> Vec<&str> {
        let is_more = |name: &str, count: u64| {
            let before = recorded.of.get(name);
            before.is_some_and(|&before| count as f64 > (1.0 + MAX_INCREASE) * before as f64)
        };
        let names = self.of.iter().filter(|(name, count)| is_more(name, **count));
        names.map(|(name, _)| name.as_str()).collect()
    }

    fn print(&self, recorded: Option<&Self>) {
        for (name, &count) in &self.of {
            let change = match recorded.map(|recorded| recorded.of.get(name)) {
                Some(Some(&before)) => {
                    format!("{:+.2} %", 100.0 * (count as f64 / before as f64 - 1.0))
                }
                Some(None) => "not recorded".to_owned(),
                None => String::new(),
            };
            println!("{name:24} {count:>12} {change}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(of: &[(&str, u64)]) -> Counts {
        let of = of.iter().map(|&(name, count)| (name.to_owned(), count)).collect();
        Counts { compiler: "rustc 1".to_owned(), of }
    }

    #[test]
    fn increase_beyond_limit() {
        let recorded = counts(&[("a", 1000), ("b", 1000), ("c", 1000)]);
        let counted = counts(&[("a", 1010), ("b", 1011), ("c", 500), ("new", 9)]);
        assert_eq!(counted.increased(&recorded), ["b"]);
    }

    #[test]
    fn json_round_trip() {
        let recorded = counts(&[("a", 1), ("b", u64::MAX)]);
        let text = recorded.to_json().expect("JSON");
        assert_eq!(Counts::from_json(&text).expect("whole"), recorded);
        assert!(Counts::from_json("{}").is_err());
    }
}
