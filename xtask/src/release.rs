//! Release of the checked-out commit: version, time, folders, and the environment of builds.

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use sha2::{Digest as _, Sha256};

use crate::{
    Failure,
    command::{read, run},
    folders,
    options::Options,
    tools::{Tools, add_target},
};

/// Name of the list of digests.
const DIGESTS: &str = "SHA256SUMS";
/// Oldest C library that the programs for glibc run with: Debian 11.
const GLIBC: &str = "2.31";

/// Release under construction.
#[derive(Debug)]
pub(crate) struct Release {
    pub(crate) root: PathBuf,
    /// Folder of cargo's output.
    pub(crate) target: PathBuf,
    /// Folder of the artefacts.
    pub(crate) dist: PathBuf,
    pub(crate) version: String,
    /// Abbreviated commit, with `-modified` if the checkout differs from it.
    pub(crate) commit: String,
    /// Time of the commit, seconds since 1970.
    pub(crate) time_s: u64,
    pub(crate) targets: Vec<&'static str>,
    program: Option<PathBuf>,
    /// Wheel that gets the program, instead of built ones.
    pub(crate) wheel: Option<PathBuf>,
}

impl Release {
    /// Describes the checkout that contains this program.
    ///
    /// # Errors
    /// No git checkout.
    pub(crate) fn of_checkout(options: &Options) -> Result<Self, Failure> {
        let root = folders::root()?;
        let git = |arguments: &[&str]| read(Command::new("git").args(arguments).current_dir(root));
        let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
        let changes = git(&["status", "--porcelain", "--untracked-files=no"])?;
        let target = folders::target()?;
        Ok(Self {
            dist: options.out.clone().unwrap_or_else(|| target.join("dist")),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: if changes.is_empty() { commit } else { format!("{commit}-modified") },
            time_s: git(&["show", "--no-patch", "--format=%ct", "HEAD"])?.parse()?,
            targets: options.targets.clone(),
            program: options.program.clone(),
            wheel: options.wheel.clone(),
            root: root.to_owned(),
            target,
        })
    }

    /// Empty folder for intermediate files.
    ///
    /// # Errors
    /// A folder that can't be written.
    pub(crate) fn work_folder(&self, name: &str) -> Result<PathBuf, Failure> {
        let folder = self.target.join("dist-work").join(name);
        if folder.exists() {
            fs::remove_dir_all(&folder)?;
        }
        fs::create_dir_all(&folder)?;
        Ok(folder)
    }

    /// Sets what makes a build in a folder independent of computer, user and time: the commit's time,
    /// and replaced paths of that folder, the target folder, registry and toolchain.
    ///
    /// # Errors
    /// A toolchain that does not report its folder.
    pub(crate) fn set_environment(
        &self,
        command: &mut Command,
        source: &Path,
    ) -> Result<(), Failure> {
        let home = || env::var_os("HOME").map(|home| PathBuf::from(home).join(".cargo"));
        let cargo = env::var_os("CARGO_HOME").map(PathBuf::from).or_else(home);
        let sysroot = read(Command::new("rustc").args(["--print", "sysroot"]))?;
        let mut folders = vec![(PathBuf::from(sysroot), "/rust".to_owned())];
        if let Some(cargo) = cargo {
            folders.push((cargo.clone(), "/cargo".to_owned()));
            // The name of a registry's folder contains a hash of its address.
            let registries = fs::read_dir(cargo.join("registry/src")).into_iter().flatten();
            folders.extend(registries.flatten().map(|entry| (entry.path(), "/crates".to_owned())));
        }
        folders.push((source.to_owned(), "/sonard".to_owned()));
        folders.push((self.target.clone(), "/target".to_owned()));
        let flags = |option: &str| {
            let flags =
                folders.iter().map(|(from, to)| format!("{option}={}={to}", from.display()));
            flags.collect::<Vec<_>>().join(" ")
        };
        command
            .env("RUSTFLAGS", flags("--remap-path-prefix"))
            .env("CFLAGS", flags("-ffile-prefix-map"))
            .env("SONARD_COMMIT", &self.commit)
            .env("SOURCE_DATE_EPOCH", self.time_s.to_string())
            .env("CARGO_INCREMENTAL", "0")
            .env("TZ", "UTC")
            .env("LC_ALL", "C")
            .current_dir(source);
        Ok(())
    }

    /// Builds the program for a target, and returns its path.
    ///
    /// # Errors
    /// A failed build.
    pub(crate) fn build_program(&self, target: &str) -> Result<PathBuf, Failure> {
        let built = self.target.join(target).join("shipped/sonard");
        if let Some(program) = &self.program {
            folders::copy(program, &built)?;
            return Ok(built);
        }
        add_target(target)?;
        let tools = Tools::for_building(&self.target)?;
        let zig_target = match target.ends_with("-gnu") {
            true => format!("{target}.{GLIBC}"),
            false => target.to_owned(),
        };
        let mut build = Command::new(tools.program("cargo-zigbuild"));
        build.args([
            "zigbuild",
            "--quiet",
            "--locked",
            "--profile",
            "shipped",
            "--package",
            "sonard",
        ]);
        build.args(["--bin", "sonard", "--features", "full", "--target", &zig_target]);
        self.set_environment(&mut build, &self.root)?;
        build.env("PATH", tools.search_path()).env("CARGO_TARGET_DIR", &self.target);
        run(&mut build)?;
        Ok(built)
    }

    /// Writes manual pages and completions, which are the same for all targets, into a new folder.
    ///
    /// # Errors
    /// A failed build of a program that runs on this computer.
    pub(crate) fn write_package_files(&self) -> Result<PathBuf, Failure> {
        // Where the assets in Cargo.toml name them.
        let folder = self.root.join("target/package");
        if folder.exists() {
            fs::remove_dir_all(&folder)?;
        }
        let own = self.targets.iter().find(|target| target.starts_with(env::consts::ARCH));
        let own = own.copied().unwrap_or(match env::consts::ARCH {
            "aarch64" => "aarch64-unknown-linux-musl",
            _ => "x86_64-unknown-linux-musl",
        });
        run(Command::new(self.build_program(own)?).arg("package-files").arg(&folder))?;
        Ok(folder)
    }

    /// Writes the installer, which selects one of the binary archives.
    ///
    /// # Errors
    /// A file that can't be written.
    pub(crate) fn write_installer(&self) -> Result<(), Failure> {
        let text = fs::read_to_string(self.root.join("packaging/install.sh"))?;
        Ok(fs::write(self.dist.join("install.sh"), text.replace("@VERSION@", &self.version))?)
    }

    /// Lists the SHA-256 digests of all files in the folder, as `sha256sum --check` reads them.
    ///
    /// # Errors
    /// An unreadable file.
    pub(crate) fn write_digests(&self) -> Result<(), Failure> {
        let mut digests = BTreeMap::new();
        for entry in fs::read_dir(&self.dist)? {
            let (path, name) = entry.map(|entry| (entry.path(), entry.file_name()))?;
            if path.is_file() && name != DIGESTS {
                let digest = Sha256::digest(fs::read(path)?);
                let hex: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
                digests.insert(name.to_string_lossy().into_owned(), hex);
            }
        }
        let lines = digests.iter().map(|(name, digest)| format!("{digest}  {name}\n"));
        let text: String = lines.collect();
        fs::write(self.dist.join(DIGESTS), &text)?;
        print!("{text}");
        Ok(())
    }
}
