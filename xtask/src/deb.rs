//! Debian packages, around the programs for glibc.

use std::process::Command;

use crate::{Failure, command::run, release::Release};

/// Builds a package for each requested target with glibc.
///
/// # Errors
/// A failed build.
pub(crate) fn build_all(release: &Release) -> Result<(), Failure> {
    let targets: Vec<_> = release.targets.iter().filter(|name| name.ends_with("-gnu")).collect();
    if targets.is_empty() {
        return Ok(());
    }
    release.write_package_files()?;
    run(Command::new("packaging/build.sh").arg("tools").current_dir(&release.root))?;
    for target in targets {
        release.build_program(target)?;
        let mut package = Command::new(release.target.join("tools/bin/cargo-deb"));
        package.args(["--no-build", "--no-strip", "--quiet", "--profile", "shipped"]);
        package.args(["--variant", "dist", "--target", target, "--output"]).arg(&release.dist);
        release.set_environment(&mut package, &release.root)?;
        run(package.env("CARGO_TARGET_DIR", &release.target))?;
    }
    Ok(())
}
