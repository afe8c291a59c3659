//! The layers that ARCHITECTURE.md states for the modules of each crate, held against the code: a module
//! uses those below it, no other of its own layer, and none above.
//!
//! Between crates the compiler holds that; within one, `use` may go anywhere.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// The heading of the table in ARCHITECTURE.md.
const HEADING: &str = "### Layers within a crate";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// For each source folder of the table the layer of each module, counted from the lowest.
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

/// Rust files below a folder, without tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder") {
        let path = entry.expect("an entry").path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if stem == "tests" || stem == "fixtures" {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The code of a file: without comments, and without what is compiled for tests only.
fn code(text: &str) -> String {
    let lines = text.lines().take_while(|line| line.trim() != "mod tests {");
    lines.filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The first names of all paths that begin with `crate::`, also in groups.
fn used(code: &str) -> Vec<String> {
    let mut names = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        match rest.strip_prefix('{') {
            Some(group) => names.extend(first_names(group)),
            None => names.extend(name(rest)),
        }
    }
    names
}

fn name(text: &str) -> Option<String> {
    let name: String = text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    (!name.is_empty()).then_some(name)
}

/// The first name of each item of a `use` group, up to its closing brace.
fn first_names(group: &str) -> Vec<String> {
    let (mut depth, mut item, mut names) = (0, String::new(), Vec::new());
    for c in group.chars() {
        match c {
            '}' if depth == 0 => break,
            ',' if depth == 0 => names.extend(name(std::mem::take(&mut item).trim())),
            '{' => depth += 1,
            '}' => depth -= 1,
            c if depth == 0 => item.push(c),
            _ => {}
        }
    }
    names.extend(name(item.trim()));
    names
}

#[test]
fn modules_use_only_what_is_below_them() {
    let stated = stated();
    assert!(stated.len() >= 3, "the table of layers was not read: {stated:?}");
    let mut faults = Vec::new();
    for (folder, layer_of) in stated {
        let source = root().join(&folder);
        let mut files = Vec::new();
        sources(&source, &mut files);
        for file in files {
            let inner = file.strip_prefix(&source).expect("below it");
            let first = inner.components().next().expect("a name").as_os_str().to_string_lossy();
            let module = first.trim_end_matches(".rs");
            if ["lib", "main"].contains(&module) {
                continue;
            }
            let Some(layer) = layer_of.get(module) else {
                faults.push(format!("{folder}: module {module} has no layer in ARCHITECTURE.md"));
                continue;
            };
            let text = fs::read_to_string(&file).expect("a source file");
            for other in used(&code(&text)) {
                let Some(below) = layer_of.get(&other) else { continue };
                if other != module && below >= layer {
                    let file = inner.display();
                    faults.push(format!(
                        "{folder}/{file}: {module} uses {other}, which is not below it"
                    ));
                }
            }
        }
    }
    faults.sort();
    faults.dedup();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn groups_and_comments_are_read_as_the_compiler_does() {
    let text = "use crate::{\n    geometry::{DVec2, Pose},\n    scene::Scene,\n};\n\
                // crate::model\nfn f() { crate::plan::g(); }\nmod tests {\n use crate::array;\n";
    assert_eq!(used(&code(text)), ["geometry", "scene", "plan"]);
}
