//! The book of docs/: its table of contents names each page once, and links, anchors and named
//! paths of all documents resolve. mdBook itself is not needed (docs/build.sh).

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Component, Path, PathBuf},
};

/// Documents outside of docs/ that the book links to or contains.
const OUTSIDE: [&str; 7] = [
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "README.md",
    "examples/scale/README.md",
    "firmware-protocol/PROTOCOL.md",
    "firmware/README.md",
    "python/README.md",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}

/// Path without `.` and `..`, so that files outside of the repository cannot be linked.
fn normalized(path: &Path) -> PathBuf {
    let mut parts = Vec::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                assert!(parts.pop().is_some(), "{path:?} leaves the repository");
            }
            part => parts.push(part),
        }
    }
    parts.iter().collect()
}

/// Pages below docs/, as paths within the repository.
fn pages() -> BTreeSet<PathBuf> {
    fn collect(folder: &Path, pages: &mut BTreeSet<PathBuf>) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                collect(&path, pages);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                pages.insert(path.strip_prefix(root()).expect("in the repository").to_owned());
            }
        }
    }
    let mut pages = BTreeSet::new();
    collect(&root().join("docs"), &mut pages);
    pages.remove(Path::new("docs/SUMMARY.md"));
    pages
}

fn text(document: &Path) -> String {
    fs::read_to_string(root().join(document))
        .unwrap_or_else(|error| panic!("{document:?}: {error}"))
}

/// Lines outside of fenced blocks.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut fenced = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fenced && !fence
    })
}

/// Targets of links and images of a document, without those with a scheme.
fn links(text: &str) -> Vec<String> {
    let prose: Vec<_> = prose(text).collect();
    // Code in backticks has no links.
    let joined = prose.join("\n");
    let text: String = joined.split('`').step_by(2).collect::<Vec<_>>().join("`");
    let markdown = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let html = text.split(" src=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let local = markdown.chain(html).filter(|link| !link.contains(':'));
    local.map(str::to_owned).collect()
}

/// Anchors of the headings of a document, as GitHub and mdBook make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen = BTreeMap::<String, usize>::new();
    let headings = prose(text).filter(|line| line.starts_with('#'));
    let anchor = |heading: &str| -> String {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings
        .map(|heading| {
            let anchor = anchor(heading);
            let count = seen.entry(anchor.clone()).or_default();
            *count += 1;
            if *count == 1 { anchor } else { format!("{anchor}-{}", *count - 1) }
        })
        .collect()
}

#[test]
fn summary_lists_each_page_once() {
    let mut listed = BTreeSet::new();
    for link in links(&text(Path::new("docs/SUMMARY.md"))) {
        let page = normalized(&Path::new("docs").join(&link));
        assert!(root().join(&page).is_file(), "SUMMARY.md: {link} does not exist");
        assert!(listed.insert(page), "SUMMARY.md lists {link} twice");
    }
    let orphans: Vec<_> = pages().into_iter().filter(|page| !listed.contains(page)).collect();
    assert!(orphans.is_empty(), "not in SUMMARY.md: {orphans:?}");
}

#[test]
fn links_and_anchors_resolve() {
    let (mut broken, mut count) = (Vec::new(), 0);
    let outside = OUTSIDE.iter().map(PathBuf::from);
    for document in pages().into_iter().chain(outside) {
        let folder = document.parent().expect("a folder");
        for link in links(&text(&document)) {
            count += 1;
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match path {
                "" => document.clone(),
                path => normalized(&folder.join(path)),
            };
            let exists = root().join(&target).exists();
            let is_page = target.extension().is_some_and(|extension| extension == "md");
            if !exists || !anchor.is_empty() && is_page && !anchors(&text(&target)).contains(anchor)
            {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(count > 200, "{count} links were found");
}

/// Names of paths that are no files of the repository.
const NO_FILES: [&str; 1] = ["scenes/SHA256.json"];

/// Paths of the repository that a document names in backticks.
fn named_paths(text: &str) -> Vec<String> {
    let folders: Vec<String> = fs::read_dir(root())
        .expect("the repository")
        .map(|entry| entry.expect("an entry"))
        .filter(|entry| entry.path().is_dir())
        .map(|entry| format!("{}/", entry.file_name().display()))
        .filter(|folder| !folder.starts_with('.') && folder != "target/")
        .collect();
    let prose: Vec<_> = prose(text).collect();
    let joined = prose.join("\n");
    let spans = joined.split('`').skip(1).step_by(2);
    let paths = spans.filter(|span| {
        let is_path = folders.iter().any(|folder| span.starts_with(folder));
        let is_pattern = span.contains(['{', '<', ' ', '*']) || span.contains("NAME");
        is_path && !is_pattern && !NO_FILES.contains(span)
    });
    paths.map(str::to_owned).collect()
}

#[test]
fn named_paths_exist() {
    let (mut missing, mut count) = (Vec::new(), 0);
    let outside = ["ARCHITECTURE.md", "CONTRIBUTING.md", "README.md"].map(PathBuf::from);
    for document in pages().into_iter().chain(outside) {
        for path in named_paths(&text(&document)) {
            count += 1;
            if !root().join(&path).exists() {
                missing.push(format!("{}: {path}", document.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(count > 60, "{count} paths were found");
    let stations = named_paths(&text(Path::new("docs/life-of-an-echo.md")));
    assert!(stations.len() > 20, "the stations name their files");
}

/// The introduction stays short.
#[test]
fn readme_has_at_most_1000_words() {
    let words = text(Path::new("README.md")).split_whitespace().count();
    assert!(words <= 1000, "{words} words");
}

#[test]
fn anchors_of_headings() {
    let text = "# The log, in `docs`\n```sh\n# a comment\n```\n## Limits\n## Limits\n";
    let expected = ["limits", "limits-1", "the-log-in-docs"].map(str::to_owned);
    assert_eq!(anchors(text), BTreeSet::from(expected));
}
