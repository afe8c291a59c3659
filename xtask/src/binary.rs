//! Archives with the program, its manual pages and completions, laid out as below `/usr/local`.

use crate::{
    Failure,
    archive::{self, Contents, Format},
    folders::copy,
    release::Release,
};

/// Files of the checkout, and their places in the archive.
const DOCUMENTS: [(&str, &str); 5] = [
    ("README.md", "share/doc/sonard/README.md"),
    ("CHANGELOG.md", "share/doc/sonard/CHANGELOG.md"),
    ("LICENSE-APACHE", "share/doc/sonard/LICENSE-APACHE"),
    ("LICENSE-MIT", "share/doc/sonard/LICENSE-MIT"),
    ("config/sonard.toml", "share/doc/sonard/sonard.toml"),
];

/// Folders of manual pages and completions, and their places in the archive.
const PAGES: [(&str, &str); 5] = [
    ("man1", "share/man/man1"),
    ("man5", "share/man/man5"),
    ("completions/sonard.bash", "share/bash-completion/completions/sonard"),
    ("completions/_sonard", "share/zsh/site-functions/_sonard"),
    ("completions/sonard.fish", "share/fish/vendor_completions.d/sonard.fish"),
];

/// Builds the program for each target and packs it in both formats.
///
/// # Errors
/// A failed build, or a file that can't be written.
pub(crate) fn pack_all(release: &Release) -> Result<(), Failure> {
    let pages = release.write_package_files()?;
    for target in &release.targets {
        let program = release.build_program(target)?;
        let name = format!("sonard-{}-{target}", release.version);
        let folder = release.work_folder("binary")?.join(&name);
        let documents = DOCUMENTS.map(|(from, to)| (release.root.join(from), to));
        let pages = PAGES.map(|(from, to)| (pages.join(from), to));
        for (from, to) in documents.into_iter().chain(pages).chain([(program, "bin/sonard")]) {
            copy(&from, &folder.join(to))?;
        }
        // The xz of busybox, which systems with musl have, lacks the filter.
        let is_filtered = *target == "x86_64-unknown-linux-gnu";
        let contents = if is_filtered { Contents::X86 } else { Contents::Other };
        for (suffix, format) in [("gz", Format::Gzip), ("xz", Format::Xz(contents))] {
            let archive = release.dist.join(format!("{name}.tar.{suffix}"));
            archive::pack(&folder, release.time_s, format, &archive)?;
        }
    }
    Ok(())
}
