//! Wheels with the Python package and the program, one for each processor and C library.

use std::{
    fs, io,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    Failure,
    command::{read, run},
    folders,
    release::Release,
    tools::{Tools, add_target},
};

/// Builds a wheel for each target. The program in it is linked statically, for both C libraries.
///
/// # Errors
/// A failed build.
pub(crate) fn build_all(release: &Release) -> Result<(), Failure> {
    let packing = Tools::for_packing(&release.target)?;
    let wheels = match &release.wheel {
        Some(wheel) => vec![wheel.clone()],
        None => build_packages(release)?,
    };
    for (target, wheel) in release.targets.iter().zip(wheels) {
        let program = release.build_program(&target.replace("-gnu", "-musl"))?;
        add_program(release, &packing, &wheel, &program)?;
    }
    Ok(())
}

/// Builds the wheel of the Python package for each target, and returns their paths.
fn build_packages(release: &Release) -> Result<Vec<PathBuf>, Failure> {
    let source = FixedCopy::new(release)?;
    release.targets.iter().map(|target| build(release, &source, target)).collect()
}

/// Copy of the checkout at a path that is the same on every computer, removed in the end.
///
/// The Python package is a workspace of its own. Paths of crates outside of a workspace are part of
/// their symbols' names, unlike those within.
struct FixedCopy(PathBuf);

impl FixedCopy {
    fn new(release: &Release) -> Result<Self, Failure> {
        let copy = Path::new("/tmp").join(format!("sonard-{}", release.commit));
        fs::create_dir(&copy).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => {
                format!(
                    "{0} exists: another build is at work, or was killed; remove {0}",
                    copy.display()
                )
            }
            _ => format!("{}: {error}", copy.display()),
        })?;
        let copy = Self(copy);
        let list = read(Command::new("git").args(["ls-files"]).current_dir(&release.root))?;
        for name in list.lines() {
            folders::copy(&release.root.join(name), &copy.0.join(name))?;
        }
        Ok(copy)
    }
}

impl Drop for FixedCopy {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_dir_all(&self.0) {
            eprintln!("xtask: {}: {error}", self.0.display());
        }
    }
}

/// Builds the wheel of the Python package for a target.
fn build(release: &Release, source: &FixedCopy, target: &str) -> Result<PathBuf, Failure> {
    let work = release.work_folder(&format!("wheel-{target}"))?;
    add_target(target)?;
    let tools = Tools::for_building(&release.target)?;
    let mut build = Command::new(tools.program("maturin"));
    build.args(["build", "--release", "--locked", "--quiet", "--zig", "--target", target]);
    build.args(["--compatibility", compatibility(target)]);
    build.args(["--manifest-path", "python/Cargo.toml", "--out"]).arg(&work);
    release.set_environment(&mut build, &source.0)?;
    build.env("PATH", tools.search_path());
    run(build.env("CARGO_TARGET_DIR", release.target.join("python")))?;
    Ok(fs::read_dir(work)?.next().ok_or("no wheel was built")??.path())
}

/// Adds the program to a wheel, as a script that `pip` puts on the path.
fn add_program(
    release: &Release,
    tools: &Tools,
    wheel: &Path,
    program: &Path,
) -> Result<(), Failure> {
    let folder = release.work_folder("unpacked")?;
    let mut unpack = Command::new(tools.program("wheel"));
    run(unpack.args(["unpack", "--dest"]).arg(&folder).arg(wheel))?;
    let package = fs::read_dir(&folder)?.next().ok_or("an empty wheel")??;
    let data = format!("{}.data/scripts", package.file_name().to_string_lossy());
    let scripts = package.path().join(data);
    folders::copy(program, &scripts.join("sonard"))?;
    let mut pack = Command::new(tools.program("wheel"));
    release.set_environment(&mut pack, &release.root)?;
    run(pack.args(["pack", "--dest-dir"]).arg(&release.dist).arg(package.path()))
}

/// Platform of the wheel: the oldest C library that the package is linked against.
fn compatibility(target: &str) -> &'static str {
    if target.ends_with("-gnu") { "manylinux2014" } else { "musllinux_1_2" }
}
