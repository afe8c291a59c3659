//! Table of external crates in docs/dependencies.md, compared with those of the default build.

use std::{
    collections::BTreeSet,
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    fs::read_to_string(root().join("docs/dependencies.md")).expect("the page")
}

/// External crates of the default build.
#[derive(Debug, Default)]
struct Crates {
    /// Names of those that a crate of the workspace depends on.
    direct: BTreeSet<String>,
    /// Names and versions of all.
    all: BTreeSet<String>,
}

impl Crates {
    /// Reads the tree of the program for Linux, with its build scripts and without tests.
    fn read() -> Self {
        let output = Command::new(env::var_os("CARGO").expect("set by cargo"))
            .args(["tree", "--locked", "--offline", "--package", "sonard", "--no-dedupe"])
            .args(["--edges", "normal,build", "--target", "x86_64-unknown-linux-gnu"])
            .args(["--prefix", "depth", "--format", " {p}"])
            .current_dir(root())
            .output()
            .expect("cargo starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut crates = Self::default();
        // For each depth, whether the latest crate is one of the workspace.
        let mut is_own = Vec::new();
        for line in String::from_utf8(output.stdout).expect("UTF-8").lines() {
            let (depth, package) = line.split_once(' ').expect("depth and package");
            let depth: usize = depth.parse().expect("a depth");
            let own =
                package.contains(&format!("({}", root().canonicalize().expect("here").display()));
            is_own.truncate(depth);
            if !own {
                let name = package.split(' ').next().expect("a name");
                crates.all.insert(package.trim_end_matches(" (proc-macro)").to_owned());
                if is_own.last() == Some(&true) {
                    crates.direct.insert(name.to_owned());
                }
            }
            is_own.push(own);
        }
        crates
    }
}

#[test]
fn each_direct_dependency_has_a_reason() {
    let rows = page();
    let rows = rows.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
    let stated: BTreeSet<String> =
        rows.filter(|(_, reason)| reason.len() > 3).map(|(name, _)| name.to_owned()).collect();
    let found = Crates::read().direct;
    let unstated: Vec<_> = found.difference(&stated).collect();
    let unused: Vec<_> = stated.difference(&found).collect();
    assert!(
        unstated.is_empty() && unused.is_empty(),
        "without a row {unstated:?}, unused {unused:?}"
    );
}

#[test]
fn total_is_stated() {
    let total = Crates::read().all.len();
    assert!(page().contains(&format!("{total} external crates")), "there are {total}");
}

#[test]
fn no_crate_builds_c() {
    let builders = ["cc", "cmake", "pkg-config"];
    let found: Vec<_> = Crates::read().all.into_iter().collect();
    let found: Vec<_> = found
        .iter()
        .filter(|name| builders.iter().any(|cc| name.starts_with(&format!("{cc} v"))))
        .collect();
    assert!(found.is_empty(), "{found:?}");
}
