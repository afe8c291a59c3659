//! Archive of the source with all dependencies, which builds without a network.

use std::{fs, io::Write as _, process::Command};

use crate::{
    Failure,
    archive::{self, Format},
    command::{read, run},
    release::Release,
};

/// Packs the commit and the crates of its lock files.
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
        "python/Cargo.toml",
    ]);
    let settings = read(vendor.arg("vendor").current_dir(&folder))?;
    let mut configuration =
        fs::OpenOptions::new().append(true).open(folder.join(".cargo/config.toml"))?;
    write!(configuration, "\n{settings}\n")?;
    let archive = release.dist.join(format!("{name}.tar.gz"));
    archive::pack(&folder, release.time_s, Format::Gzip, &archive)
}
