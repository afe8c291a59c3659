//! Bill of materials: the crates in the program, in CycloneDX 1.6.

use std::{collections::BTreeMap, fs, process::Command};

use serde_json::{Value, json};

use crate::{Failure, command::read, release::Release};

/// Writes the bill of materials of the program with all features, for Linux.
///
/// # Errors
/// A lock file that differs from the manifests.
pub(crate) fn write(release: &Release) -> Result<(), Failure> {
    let mut tree = Command::new("cargo");
    tree.args([
        "tree",
        "--locked",
        "--package",
        "sonard",
        "--features",
        "full",
        "--prefix",
        "none",
    ]);
    tree.args(["--edges", "normal,no-proc-macro", "--target", "x86_64-unknown-linux-gnu"]);
    tree.args(["--format", "{p}|{l}"]).current_dir(&release.root);
    let lock = fs::read_to_string(release.root.join("Cargo.lock"))?;
    let document = describe(release, &read(&mut tree)?, &digests(&lock));
    let name = format!("sonard-{}.cdx.json", release.version);
    Ok(fs::write(release.dist.join(name), format!("{document:#}\n"))?)
}

/// Digest of each crate from a registry, by name and version, from a lock file.
fn digests(lock: &str) -> BTreeMap<(String, String), String> {
    let value = |package: &str, key: &str| {
        let line = package.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = "));
        line.map(|text| text.trim_matches('"').to_owned())
    };
    let packages = lock.split("[[package]]");
    let listed = packages.filter_map(|package| {
        let name = (value(package, "name")?, value(package, "version")?);
        Some((name, value(package, "checksum")?))
    });
    listed.collect()
}

/// Describes the lines of `cargo tree`: `NAME vVERSION (SOURCE)|LICENSE`.
fn describe(release: &Release, tree: &str, digests: &BTreeMap<(String, String), String>) -> Value {
    let mut components = BTreeMap::new();
    for line in tree.lines() {
        let (package, license) =
            line.trim_end_matches(" (*)").split_once('|').unwrap_or((line, ""));
        let mut words = package.split_whitespace();
        let (Some(name), Some(version)) = (words.next(), words.next()) else { continue };
        let version = version.trim_start_matches('v');
        let mut component = json!({
            "type": "library",
            "name": name,
            "version": version,
            "purl": format!("pkg:cargo/{name}@{version}"),
            // Older manifests separate alternatives by a slash.
            "licenses": [{ "expression": license.replace('/', " OR ") }],
        });
        if let Some(digest) = digests.get(&(name.to_owned(), version.to_owned())) {
            component["hashes"] = json!([{ "alg": "SHA-256", "content": digest }]);
        }
        components.insert((name.to_owned(), version.to_owned()), component);
    }
    components.remove(&("sonard".to_owned(), release.version.clone()));
    json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "name": "sonard",
                "version": release.version,
                "purl": format!("pkg:cargo/sonard@{}", release.version),
                "properties": [{ "name": "commit", "value": release.commit }],
            },
        },
        "components": components.into_values().collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_those_of_the_lock_file() {
        let lock = "version = 4\n\n[[package]]\nname = \"a\"\nversion = \"1.0.0\"\nsource = \"r\"\n\
                    checksum = \"00ff\"\ndependencies = [\n \"b\",\n]\n\n[[package]]\nname = \"b\"\n\
                    version = \"0.1.0\"\n";
        let digests = digests(lock);
        assert_eq!(digests.len(), 1, "workspace members have none");
        assert_eq!(digests[&("a".to_owned(), "1.0.0".to_owned())], "00ff");
    }
}
