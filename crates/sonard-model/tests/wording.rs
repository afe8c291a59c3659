//! Wording of sources and documents, held against `docs/glossary.md`.
//!
//! Counts words that the glossary replaces, and doc comments that open with a question word or with
//! a pronoun whose noun is elsewhere. `docs/wording-allowed.txt` lists the count that each file may
//! still have. The list only shrinks: a file below its count fails, too, until
//! `SONARD_WORDING=write cargo test -p sonard-model --test wording` has lowered it.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

/// Words of the families tell, say, hear, ask, stand, doubt, and indefinite persons.
const WORDS: [&str; 27] = [
    "tell", "tells", "told", "telling", "say", "says", "said", "saying", "hear", "hears", "heard",
    "hearing", "ask", "asks", "asked", "stand", "stands", "standing", "stood", "doubt", "doubts",
    "doubtful", "whoever", "somebody", "nobody", "anew", "deaf",
];
/// First words of doc comments that are no noun phrase and no verb.
const OPENINGS: [&str; 25] = [
    "What", "Whether", "How", "Where", "When", "Who", "Whose", "Whatever", "Why", "Which", "That",
    "So", "Whoever", "It", "Its", "They", "Them", "Those", "One", "Of", "Says", "Tells", "Gives",
    "Such", "Nothing",
];
/// Folders without texts of the project.
const SKIPPED: [&str; 10] = [
    "target",
    "node_modules",
    "fixtures",
    "data",
    "corpus",
    "artifacts",
    "build",
    "dist",
    "venv",
    "__pycache__",
];
/// The glossary itself has the words that it replaces, and so have the table of former names and
/// this test.
const EXEMPT: [&str; 4] = [
    "docs/glossary.md",
    "docs/renamed.md",
    "docs/wording-allowed.txt",
    "crates/sonard-model/tests/wording.rs",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn words_of(text: &str) -> usize {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    words.filter(|word| WORDS.iter().any(|banned| banned.eq_ignore_ascii_case(word))).count()
}

/// Doc comments (runs of `///` or `//!` lines) that open with one of [`OPENINGS`] or "The same".
fn openings_of(source: &str) -> usize {
    let mut count = 0;
    let mut within = false;
    for line in source.lines().map(str::trim_start) {
        let text = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
        if let (Some(text), false) = (text, within) {
            let mut words = text
                .split_whitespace()
                .map(|word| word.trim_matches(['`', ',', '.', ';', ':', '(', ')']));
            let first = words.next().unwrap_or_default();
            let is_same = first == "The" && words.next() == Some("same");
            count += usize::from(is_same || OPENINGS.contains(&first));
        }
        within = text.is_some();
    }
    count
}

fn faults(path: &Path, text: &str) -> usize {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("rs") => words_of(text) + openings_of(text),
        _ => words_of(text),
    }
}

/// Every file with texts of the project below a folder.
fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry")) {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        if entry.file_type().expect("a type").is_dir() {
            if !SKIPPED.contains(&name.as_str()) && !name.starts_with('.') {
                collect(&path, found);
            }
        } else if ["rs", "md", "js", "html", "py", "pyi", "toml", "sh"]
            .iter()
            .any(|e| path.extension().is_some_and(|x| x == *e))
        {
            found.push(path);
        }
    }
}

fn count_all() -> BTreeMap<String, usize> {
    let mut files = Vec::new();
    collect(&root(), &mut files);
    let count = |path: PathBuf| {
        let name = path.strip_prefix(root()).expect("below the root").display().to_string();
        let text = fs::read_to_string(&path).unwrap_or_default();
        (name, faults(&path, &text))
    };
    let counts = files.into_iter().map(count);
    counts.filter(|(name, count)| *count > 0 && !EXEMPT.contains(&name.as_str())).collect()
}

fn read_allowed(text: &str) -> BTreeMap<String, usize> {
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    let entry = |line: &str| {
        let (count, name) = line.split_once(' ').expect("COUNT FILE");
        (name.to_owned(), count.parse().expect("a count"))
    };
    lines.map(entry).collect()
}

#[test]
fn words_are_those_of_the_glossary() {
    let list = root().join("docs/wording-allowed.txt");
    let counted = count_all();
    if std::env::var_os("SONARD_WORDING").is_some_and(|value| value == "write") {
        let mut text = String::from(
            "# Words left to replace (docs/glossary.md): COUNT FILE. The list only shrinks.\n",
        );
        for (name, count) in &counted {
            writeln!(text, "{count} {name}").expect("a string");
        }
        fs::write(&list, text).expect("writable");
        return;
    }
    let allowed = read_allowed(&fs::read_to_string(&list).expect("the list"));
    let mut faults = Vec::new();
    for (name, count) in &counted {
        let limit = allowed.get(name).copied().unwrap_or(0);
        if *count > limit {
            faults.push(format!(
                "{name}: {count} words or openings that docs/glossary.md replaces, {limit} allowed"
            ));
        }
    }
    for (name, limit) in &allowed {
        let count = counted.get(name).copied().unwrap_or(0);
        if count < *limit {
            faults.push(format!(
                "{name}: {count} are left, so lower its entry of {limit} (SONARD_WORDING=write)"
            ));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn faults_are_counted() {
    let source = "/// What is told.\n/// Whether it counts.\nfn a() {}\n/// The same.\nfn b() {}\n// asked\nlet is_told = 1;\n";
    assert_eq!(openings_of(source), 2);
    assert_eq!(words_of(source), 2);
    assert_eq!(faults(Path::new("a.md"), "Somebody asks; a standard receiver."), 2);
}

/// Names of the types that a source declares and that cannot be English words: two capitals.
fn declared_types(source: &str) -> Vec<&str> {
    let is_compound = |name: &&str| {
        name.chars().next().is_some_and(char::is_uppercase)
            && name.chars().filter(|c| c.is_uppercase()).count() > 1
            && name.chars().any(char::is_lowercase)
    };
    let kinds = ["struct ", "enum ", "trait ", "type "];
    let declaration = |line: &'_ str| kinds.iter().find_map(|kind| line.split_once(kind)).is_some();
    source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//") && declaration(line))
        .flat_map(|line| line.split(|c: char| !c.is_alphanumeric()))
        .filter(is_compound)
        .collect()
}

/// Words of a line's comment outside code, links and their targets.
fn prose_of(line: &str) -> String {
    let Some(text) = line.trim_start().strip_prefix("//") else { return String::new() };
    // Every second part is between backticks, double ones in Python.
    let words: String = text.replace("``", "`").split('`').step_by(2).collect::<Vec<_>>().join(" ");
    // Targets of links are paths.
    words.split_whitespace().filter(|word| !word.contains("::")).collect::<Vec<_>>().join(" ")
}

/// Doc comments in which the name of a type replaces a word, as a renaming by text leaves them:
/// "`PlottedScan` outside the view" without its backticks.
#[test]
fn type_names_are_marked_as_code() {
    let mut files = Vec::new();
    collect(&root(), &mut files);
    let mut faults = Vec::new();
    for path in files.iter().filter(|path| path.extension().is_some_and(|e| e == "rs")) {
        let source = fs::read_to_string(path).unwrap_or_default();
        let types = declared_types(&source);
        let mut in_code = false;
        for (number, line) in (1..).zip(source.lines()) {
            in_code ^= line.trim_start().starts_with("//") && line.contains("```");
            let prose = prose_of(line);
            let named = prose
                .split(|c: char| !c.is_alphanumeric())
                .find(|word| !in_code && types.contains(word));
            if let Some(name) = named {
                faults.push(format!("{}:{number}: {name}", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn type_name_in_prose_is_found() {
    let source = "/// PlottedScan outside the view.\nstruct PlottedScan;\n";
    assert_eq!(declared_types(source), ["PlottedScan"]);
    assert_eq!(prose_of("    /// A [`PlottedScan`](super::PlottedScan) of `x`."), "/ A [ of .");
    assert!(prose_of(source.lines().next().expect("a line")).contains("PlottedScan"));
}
