//! Builds what a release consists of: `cargo xtask dist`.
//!
//! Each artefact depends on the commit and on the pinned tools only: times are the commit's, paths
//! of the building computer are replaced, archives are sorted. Two builds of a commit are equal
//! byte for byte.

mod archive;
mod binary;
mod command;
mod deb;
mod options;
mod release;
mod sbom;
mod source;
mod tools;
mod wheel;

use std::{fs, process::ExitCode};

use options::{Artefact, Options};
use release::Release;

/// Description of the first failure.
pub(crate) type Failure = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    let outcome = Options::parse().and_then(|options| match options {
        Some(options) => build(&options),
        None => {
            println!("{}", options::HELP);
            Ok(())
        }
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("xtask: {failure}");
            ExitCode::FAILURE
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
