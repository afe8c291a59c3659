//! Command line.

use std::path::PathBuf;

use lexopt::{Arg, Parser, ValueExt as _};

use crate::Failure;

pub(crate) const HELP: &str = "\
Build the artefacts of a release into target/dist.

Usage: cargo xtask dist [--only KIND,...] [--target TRIPLE,...] [--out DIR] [--program FILE]
                        [--wheel FILE]

  --only KIND,...      binary, deb, wheel, source, sbom, installer [default: all]
  --target TRIPLE,...  x86_64-unknown-linux-musl, aarch64-unknown-linux-musl, x86_64-unknown-linux-gnu,
                       aarch64-unknown-linux-gnu [default: all]; a wheel takes its program from the musl
                       target of its processor
  --out DIR            output folder [default: target/dist]
  --program FILE       pack this program instead of building one, for tests of the packing; requires one
                       --target
  --wheel FILE         add the program to this wheel instead of building one; requires one --target";

/// Part of a release.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Artefact {
    Binary,
    Deb,
    Wheel,
    Source,
    Sbom,
    Installer,
}

const ARTEFACTS: [(&str, Artefact); 6] = [
    ("binary", Artefact::Binary),
    ("deb", Artefact::Deb),
    ("wheel", Artefact::Wheel),
    ("source", Artefact::Source),
    ("sbom", Artefact::Sbom),
    ("installer", Artefact::Installer),
];

/// Targets of the program, each with its C library.
pub(crate) const TARGETS: [&str; 4] = [
    "x86_64-unknown-linux-musl",
    "aarch64-unknown-linux-musl",
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
];

/// Requested artefacts.
#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) artefacts: Vec<Artefact>,
    pub(crate) targets: Vec<&'static str>,
    pub(crate) out: Option<PathBuf>,
    pub(crate) program: Option<PathBuf>,
    pub(crate) wheel: Option<PathBuf>,
}

impl Options {
    /// Parses the arguments after the verb; `None` if help is requested.
    ///
    /// # Errors
    /// Unknown arguments, artefacts or targets.
    pub(crate) fn parse(mut arguments: Parser) -> Result<Option<Self>, Failure> {
        let mut options = Self {
            artefacts: ARTEFACTS.map(|(_, artefact)| artefact).into(),
            targets: TARGETS.into(),
            out: None,
            program: None,
            wheel: None,
        };
        while let Some(argument) = arguments.next()? {
            match argument {
                Arg::Long("only") => {
                    options.artefacts = chosen(&arguments.value()?.string()?, &ARTEFACTS)?;
                }
                Arg::Long("target") => {
                    let targets = TARGETS.map(|target| (target, target));
                    options.targets = chosen(&arguments.value()?.string()?, &targets)?;
                }
                Arg::Long("out") => options.out = Some(arguments.value()?.into()),
                Arg::Long("program") => options.program = Some(arguments.value()?.into()),
                Arg::Long("wheel") => options.wheel = Some(arguments.value()?.into()),
                Arg::Short('h') | Arg::Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        let is_given = options.program.is_some() || options.wheel.is_some();
        if is_given && options.targets.len() != 1 {
            return Err("--program and --wheel are for one --target".into());
        }
        Ok(Some(options))
    }
}

/// Looks up names that are separated by commas.
fn chosen<T: Copy>(names: &str, known: &[(&str, T)]) -> Result<Vec<T>, Failure> {
    let find = |name: &str| {
        let found = known.iter().find(|(known, _)| *known == name);
        let names = || known.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        found.map(|(_, value)| *value).ok_or_else(|| format!("{name}: none of {}", names()).into())
    };
    names.split(',').map(find).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &[&str]) -> Result<Option<Options>, Failure> {
        Options::parse(Parser::from_args(arguments))
    }

    #[test]
    fn names_are_checked() {
        let options = parse(&["--only", "deb,sbom"]).expect("valid").expect("no help");
        assert_eq!(options.artefacts, [Artefact::Deb, Artefact::Sbom]);
        assert_eq!(options.targets, TARGETS);
        assert!(parse(&["--only", "rpm"]).is_err());
        assert!(parse(&["--target", "riscv64gc-unknown-linux-gnu"]).is_err());
        assert!(parse(&["--program", "a"]).is_err(), "of which target?");
        assert!(parse(&["--help"]).expect("help").is_none());
        assert!(parse(&["dist"]).is_err(), "a verb twice");
    }
}
