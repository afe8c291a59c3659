//! Tools that are not part of Rust, at fixed versions: zig as C compiler and linker, maturin.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{Failure, command::run};

/// Packages of PyPI that build programs and libraries.
const BUILD: [&str; 3] = ["cargo-zigbuild==0.24.1", "maturin==1.16.0", "ziglang==0.17.1"];
/// Packages of PyPI that pack wheels.
const PACK: [&str; 1] = ["wheel==0.48.0"];

/// Folder of installed tools.
#[derive(Debug)]
pub(crate) struct Tools(PathBuf);

impl Tools {
    /// Installs what builds, unless it is there.
    ///
    /// # Errors
    /// No Python, or a package that can't be installed.
    pub(crate) fn for_building(target: &Path) -> Result<Self, Failure> {
        Self::install(&target.join("tools/dist-build"), &BUILD)
    }

    /// Installs what packs wheels, unless it is there.
    ///
    /// # Errors
    /// No Python, or a package that can't be installed.
    pub(crate) fn for_packing(target: &Path) -> Result<Self, Failure> {
        Self::install(&target.join("tools/dist-pack"), &PACK)
    }

    /// Makes a virtual environment with packages.
    fn install(environment: &Path, packages: &[&str]) -> Result<Self, Failure> {
        // Written last, so that an incomplete environment is made again.
        let (list, wanted) = (environment.join("packages"), packages.join("\n"));
        if fs::read_to_string(&list).unwrap_or_default() != wanted {
            run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(environment))?;
            run(Command::new(environment.join("bin/pip"))
                .args(["install", "--quiet", "--disable-pip-version-check"])
                .args(packages))?;
            fs::write(list, wanted)?;
        }
        Ok(Self(environment.join("bin")))
    }

    /// Path of one of the tools.
    #[must_use]
    pub(crate) fn program(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Search path of programs with the tools first.
    #[must_use]
    pub(crate) fn search_path(&self) -> std::ffi::OsString {
        let path = env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(self.0.clone()).chain(env::split_paths(&path));
        // The folder is a path of this computer, so it has no separator.
        env::join_paths(folders).unwrap_or(path)
    }
}

/// Installs the standard library of a target, unless it is there.
///
/// # Errors
/// A toolchain without the target, and no rustup to install it.
pub(crate) fn add_target(target: &str) -> Result<(), Failure> {
    let sysroot = crate::command::read(Command::new("rustc").args(["--print", "sysroot"]))?;
    if Path::new(&sysroot).join("lib/rustlib").join(target).join("lib").exists() {
        return Ok(());
    }
    run(Command::new("rustup").args(["--quiet", "target", "add", target]))
}
