//! Layers that ARCHITECTURE.md lists for the modules of each crate, compared with the code. A
//! module uses those below it, no other of its own layer, and none above. Files of a folder may
//! form import circles of a few files at most.
//!
//! Between crates the compiler enforces this; within a crate, `use` is unrestricted.

#[path = "layers/sources.rs"]
mod sources;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use sources::{Module, Sources};

/// Heading of the table in ARCHITECTURE.md.
const HEADING: &str = "### Layers within a crate";

/// Maximum number of files in a circle of imports: a type, its parts and its builder.
const MAX_CIRCLE: usize = 3;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Layer of each module for each source folder of the table, counted from the lowest.
fn stated() -> Vec<(String, BTreeMap<String, usize>)> {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let (_, section) = text.split_once(HEADING).expect("the section about layers");
    let rows = section
        .lines()
        .skip_while(|line| !line.starts_with("| `"))
        .take_while(|line| line.starts_with('|'));
    rows.map(|row| {
        let mut cells = row.trim_matches('|').split('|').map(str::trim);
        let folder = cells.next().expect("a folder").trim_matches('`').to_owned();
        let layers = cells.next().expect("layers").split('<');
        let layer_of = layers.enumerate().flat_map(|(layer, modules)| {
            modules.split(',').map(move |name| (name.trim().trim_matches('`').to_owned(), layer))
        });
        (folder, layer_of.collect())
    })
    .collect()
}

/// Splits a folder of the table into its crate and its module there.
fn module(folder: &str) -> (PathBuf, Module) {
    let (source, inner) = match folder.split_once("src/") {
        Some((before, inner)) => (format!("{before}src"), inner),
        None => (folder.to_owned(), ""),
    };
    (
        root().join(source),
        inner.split('/').filter(|name| !name.is_empty()).map(str::to_owned).collect(),
    )
}

#[test]
fn modules_use_lower_layers() {
    let stated = stated();
    assert!(stated.len() >= 4, "the table of layers was not read: {stated:?}");
    let mut faults = BTreeSet::new();
    for (folder, layer_of) in stated {
        let (source, within) = module(&folder);
        let sources = Sources::read(&source);
        let name = |module: &Module| module.strip_prefix(within.as_slice())?.first().cloned();
        for (file, used) in sources.uses() {
            let Some(module) = name(file).filter(|module| module != "main") else { continue };
            let Some(layer) = layer_of.get(&module) else {
                faults.insert(format!("{folder}: module {module} has no layer in ARCHITECTURE.md"));
                continue;
            };
            for other in used.iter().filter_map(name).filter(|other| *other != module) {
                if layer_of.get(&other).is_some_and(|below| below >= layer) {
                    let file = file.join("::");
                    faults.insert(format!("{file} uses {other}, which is not below {module}"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.into_iter().collect::<Vec<_>>().join("\n"));
}

#[test]
fn no_large_circle_of_files() {
    let stated = stated();
    let pure = stated.iter().filter(|(folder, _)| folder.starts_with("crates/"));
    let crates: BTreeSet<_> = pure.map(|(folder, _)| module(folder).0).collect();
    let large: Vec<_> = crates
        .iter()
        .flat_map(|source| Sources::read(source).circles())
        .filter(|circle| circle.len() > MAX_CIRCLE)
        .collect();
    assert!(large.is_empty(), "files that use each other in a circle: {large:#?}");
}

#[test]
fn uses_match_the_compiler() {
    let files = [
        ("", "mod a;\npub mod b;\n"),
        (
            "a",
            "mod deep;\npub use deep::Deep;\nuse crate::b::{self, Thing as Other};\n// use crate::c;\n",
        ),
        ("a::deep", "use super::super::b;\nuse crate::{c::{One, Two}, a};\npub struct Deep;\n"),
        ("b", "use crate::a::Deep;\nfn f() { crate::c::g(); }\nmod tests {\n use crate::a;\n}\n"),
        ("c", "use std::fs;\n"),
    ];
    let sources = Sources::from_files(files.map(|(module, code)| (path(module), code.to_owned())));
    let uses: Vec<_> = sources
        .uses()
        .map(|(file, used)| {
            let used: Vec<_> = used.iter().map(|module| module.join("::")).collect();
            format!("{}: {}", file.join("::"), used.join(", "))
        })
        .collect();
    assert_eq!(uses, [": ", "a: b", "a::deep: a, b, c", "b: a::deep, c", "c: "]);
    let circles = sources.circles();
    assert_eq!(circles, [vec!["a".to_owned(), "a::deep".to_owned(), "b".to_owned()]]);
}

fn path(module: &str) -> Module {
    module.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// One style of module files: `foo.rs` next to the folder `foo`.
#[test]
fn no_mod_rs_files() {
    fn look(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).expect("a source folder") {
            let path = entry.expect("an entry").path();
            match path.is_dir() {
                true => look(&path, found),
                false if path.ends_with("mod.rs") => found.push(path),
                false => {}
            }
        }
    }
    let mut found = Vec::new();
    let crates = fs::read_dir(root().join("crates")).expect("crates");
    let crates = crates.map(|entry| entry.expect("an entry").path().join("src"));
    let others = ["src", "firmware-protocol/src", "firmware/src", "emulator/src", "tests/cli"];
    let others = others.map(|folder| root().join(folder));
    crates.chain(others).for_each(|folder| look(&folder, &mut found));
    assert!(found.is_empty(), "foo.rs, not foo/mod.rs: {found:?}");
}
