//! Archive of the source with all dependencies, which builds without a network.

use std::{fs, io::Write as _, path::Path, process::Command};

use crate::{
    Failure,
    archive::{self, Format},
    command::{read, run},
    release::Release,
};

/// Selects the crates in the archive. `cargo vendor` prints its settings only if it is not quiet, and
/// they would name a mirror that the computer uses.
const SETTINGS: &str = "
[source.crates-io]
replace-with = \"vendored-sources\"

[source.vendored-sources]
directory = \"vendor\"
";

/// Manifests of the program and of the Python package, each with a lock file.
const MANIFESTS: [&str; 2] = ["Cargo.toml", "python/Cargo.toml"];

/// Packs the commit and the crates of the lock files of program and Python package.
///
/// # Errors
/// A missing crate, or a file that can't be written.
pub(crate) fn pack(release: &Release) -> Result<(), Failure> {
    let name = format!("sonard-{}-source", release.version);
    let work = release.work_folder("source")?;
    let (folder, plain) = (work.join(&name), work.join("commit.tar"));
    let mut git = Command::new("git");
    git.args(["archive", "--prefix", &format!("{name}/"), "--output"]).arg(&plain).arg("HEAD");
    run(git.current_dir(&release.root))?;
    run(Command::new("tar").arg("--extract").arg("--file").arg(&plain).current_dir(&work))?;
    let mut vendor = Command::new("cargo");
    vendor.args([
        "vendor",
        "--quiet",
        "--locked",
        "--versioned-dirs",
        "--sync",
        MANIFESTS[1],
        "vendor",
    ]);
    run(vendor.current_dir(&folder))?;
    let mut configuration =
        fs::OpenOptions::new().append(true).open(folder.join(".cargo/config.toml"))?;
    configuration.write_all(SETTINGS.as_bytes())?;
    for manifest in MANIFESTS {
        check_completeness(release, &folder.join(manifest))?;
    }
    let archive = release.dist.join(format!("{name}.tar.gz"));
    archive::pack(&folder, release.time_s, Format::Gzip, &archive)
}

/// Resolves the dependencies of a manifest without a network and without the crates that the computer
/// has.
fn check_completeness(release: &Release, manifest: &Path) -> Result<(), Failure> {
    let mut resolve = Command::new("cargo");
    resolve.args(["metadata", "--offline", "--locked", "--format-version", "1", "--manifest-path"]);
    resolve.arg(manifest).env("CARGO_HOME", release.work_folder("no-crates")?);
    // Settings of the packed folder apply, not those of the checkout.
    read(resolve.current_dir(manifest.parent().ok_or("no folder")?)).map(drop)
}
