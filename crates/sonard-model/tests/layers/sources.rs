//! Dependencies between the files of a crate, read from their `use` lines and paths.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// A module by its path from the crate's root, which is empty.
pub(crate) type Module = Vec<String>;

/// Files of a crate.
#[derive(Default)]
pub(crate) struct Sources {
    /// References of each file, by module.
    uses: BTreeMap<Module, BTreeSet<Module>>,
}

/// A path as written in a file.
struct Reference {
    path: Module,
    /// `true` for a re-export of another module's item.
    re_exports: bool,
}

impl Sources {
    /// Reads the files below a source folder, without tests.
    pub(crate) fn read(source: &Path) -> Self {
        let mut files = Vec::new();
        collect(source, source, &mut files);
        Self::from_files(files)
    }

    /// Collects the references of files by module.
    pub(crate) fn from_files(files: impl IntoIterator<Item = (Module, String)>) -> Self {
        let references: BTreeMap<_, _> =
            files.into_iter().map(|(module, text)| (module, references(&code(&text)))).collect();
        let known: BTreeSet<Module> = references.keys().cloned().collect();
        let mut given_on = BTreeMap::new();
        for (module, references) in &references {
            for Reference { path, .. } in references.iter().filter(|found| found.re_exports) {
                let name = path.last().cloned().unwrap_or_default();
                given_on.insert((module.clone(), name), absolute(&known, module, path));
            }
        }
        let uses = references.iter().map(|(module, references)| {
            let own = references.iter().filter(|found| !found.re_exports);
            let used = own.filter_map(|Reference { path, .. }| {
                defined_in(&known, &given_on, &absolute(&known, module, path)?)
            });
            (module.clone(), used.filter(|used| used != module).collect())
        });
        Self { uses: uses.collect() }
    }

    /// Each file with the files it uses. A re-exported item counts as used from its definition.
    pub(crate) fn uses(&self) -> impl Iterator<Item = (&Module, &BTreeSet<Module>)> {
        self.uses.iter()
    }

    /// Groups of files each of which uses, directly or indirectly, all others.
    pub(crate) fn circles(&self) -> Vec<Vec<String>> {
        let reached: BTreeMap<_, _> =
            self.uses.keys().map(|module| (module, self.reached_from(module))).collect();
        let circle = |module: &Module| -> Vec<String> {
            let back = reached[module].iter().filter(|other| reached[*other].contains(module));
            back.map(|other| other.join("::")).collect()
        };
        let circles: BTreeSet<_> = self.uses.keys().map(circle).filter(|of| of.len() > 1).collect();
        circles.into_iter().collect()
    }

    fn reached_from(&self, module: &Module) -> BTreeSet<Module> {
        let mut reached = BTreeSet::new();
        let mut next: Vec<&Module> = self.uses[module].iter().collect();
        while let Some(used) = next.pop() {
            if reached.insert(used.clone()) {
                next.extend(&self.uses[used]);
            }
        }
        reached
    }
}

fn collect(source: &Path, folder: &Path, found: &mut Vec<(Module, String)>) {
    for entry in fs::read_dir(folder).expect("a source folder") {
        let path = entry.expect("an entry").path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if stem == "tests" || stem == "fixtures" {
            continue;
        }
        if path.is_dir() {
            collect(source, &path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let inner = path.strip_prefix(source).expect("below it").with_extension("");
            let names = inner.iter().map(|name| name.to_string_lossy().into_owned());
            let mut module: Module = names.collect();
            module.pop_if(|name| name == "mod" || name == "lib");
            found.push((module, fs::read_to_string(&path).expect("a source file")));
        }
    }
}

/// Code of a file, without comments and test-only parts.
fn code(text: &str) -> String {
    let lines = text.lines().take_while(|line| line.trim() != "mod tests {");
    lines.filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// Paths in `use` lines, and those elsewhere that begin with `crate`, `super` or `self`.
fn references(code: &str) -> Vec<Reference> {
    let mut found = Vec::new();
    let mut rest = String::new();
    for statement in code.split_inclusive(';') {
        match statement.split_once("use ").filter(|(before, _)| ends_as_a_use(before)) {
            Some((before, tree)) => {
                let re_exports = before.trim_end().ends_with(['b', ')']);
                let paths = expanded(tree.trim_end_matches(';').trim());
                found.extend(paths.into_iter().map(|path| Reference { path, re_exports }));
                rest.push_str(before);
            }
            None => rest.push_str(statement),
        }
    }
    let starts = ["crate::", "super::", "self::"];
    for (at, _) in starts.iter().flat_map(|start| rest.match_indices(start)) {
        let is_start = !rest[..at].ends_with(|c: char| c.is_alphanumeric() || "_:$".contains(c));
        if is_start {
            let end = |c: char| !(c.is_alphanumeric() || c == '_' || c == ':');
            let path = rest[at..].split(end).next().unwrap_or_default();
            let path =
                path.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect();
            found.push(Reference { path, re_exports: false });
        }
    }
    found
}

/// Returns `true` if a statement that continues with `use` begins this way: alone on its line
/// except for its visibility.
fn ends_as_a_use(before: &str) -> bool {
    let line = before.rsplit('\n').next().unwrap_or_default().trim();
    line.is_empty() || line == "pub" || line.starts_with("pub(") && line.ends_with(')')
}

/// Paths of a `use` tree.
fn expanded(tree: &str) -> Vec<Module> {
    let names = |path: &str| -> Module {
        path.split("::")
            .map(|name| name.trim().to_owned())
            .filter(|name| !name.is_empty())
            .collect()
    };
    let Some((before, (group, _))) = tree
        .split_once('{')
        .and_then(|(before, rest)| Some((names(before), rest.rsplit_once('}')?)))
    else {
        return vec![names(tree.split(" as ").next().unwrap_or_default())];
    };
    let inner = items(group).into_iter().flat_map(expanded);
    inner.map(|inner| before.iter().cloned().chain(inner).collect()).collect()
}

/// Items of a group, separated by commas.
fn items(group: &str) -> Vec<&str> {
    let (mut depth, mut from, mut items) = (0, 0, Vec::new());
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                items.push(group[from..at].trim());
                from = at + 1;
            }
            _ => {}
        }
    }
    items.push(group[from..].trim());
    items.retain(|item| !item.is_empty());
    items
}

/// Path in a module from the crate's root; `None` for one into another crate.
fn absolute(known: &BTreeSet<Module>, module: &Module, path: &Module) -> Option<Module> {
    let mut from = module.clone();
    let mut names = path.iter().peekable();
    match names.peek()?.as_str() {
        "crate" => {
            names.next();
            from.clear();
        }
        "super" | "self" => {
            while let Some(name) = names.next_if(|name| ["super", "self"].contains(&name.as_str()))
            {
                if name == "super" {
                    from.pop();
                }
            }
        }
        child => {
            from.push(child.to_owned());
            if !known.contains(&from) {
                return None;
            }
            from.pop();
        }
    }
    from.extend(names.filter(|name| *name != "self").cloned());
    Some(from)
}

/// Finds the file that defines the target of a path, through re-exports.
fn defined_in(
    known: &BTreeSet<Module>,
    given_on: &BTreeMap<(Module, String), Option<Module>>,
    path: &Module,
) -> Option<Module> {
    let file = (0..=path.len()).rev().map(|count| &path[..count]).find(|at| known.contains(*at))?;
    let name = path.get(file.len()).cloned().unwrap_or_default();
    match given_on.get(&(file.to_vec(), name)).cloned().flatten() {
        Some(other) if other != *path => {
            let inner = path[file.len() + 1..].iter().cloned();
            defined_in(known, given_on, &other.into_iter().chain(inner).collect())
        }
        _ => Some(file.to_vec()),
    }
}
