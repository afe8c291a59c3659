//! Verbs and options by the names that they had before: they go on working for a version, with a hint.

use std::ffi::OsString;

/// Verbs by their former names.
const VERBS: [(&str, [&str; 2]); 4] = [
    ("map-benchmark", ["benchmark", "map"]),
    ("map-score", ["benchmark", "score"]),
    ("explore-benchmark", ["benchmark", "explore"]),
    ("interpret-benchmark", ["benchmark", "interpret"]),
];

/// Options of verbs by their former names.
pub(super) const OPTIONS: [(&[&str], &str, &str); 14] = [
    // --out is a folder, --output a file.
    (&["plot"], "--out", "--output"),
    (&["trace"], "--out", "--output"),
    (&["interpret"], "--out", "--output"),
    (&["lines"], "--out", "--output"),
    (&["simulate"], "--out", "--output"),
    (&["log", "annotate"], "--out", "--output"),
    (&["benchmark", "interpret"], "--out", "--output"),
    // --max-range is how far a ranger listens.
    (&["map"], "--max-range", "--silent-beyond"),
    (&["log", "annotate"], "--max-range", "--silent-beyond"),
    (&["benchmark", "map"], "--max-range", "--silent-beyond"),
    (&["explore"], "--max-range", "--sonar-range"),
    (&["benchmark", "explore"], "--max-range", "--sonar-range"),
    // --rooms are explored, --pings are fired.
    (&["benchmark", "interpret"], "--rooms", "--trials"),
    (&["log", "show"], "--pings", "--readings"),
];

/// A command line, the program's name first, with names as they are now; and what to tell about it.
pub(super) fn translated(
    arguments: impl IntoIterator<Item = OsString>,
) -> (Vec<OsString>, Vec<String>) {
    let mut arguments: Vec<OsString> = arguments.into_iter().collect();
    let mut hints = Vec::new();
    let verb = arguments.get(1).and_then(|verb| verb.to_str()).unwrap_or_default();
    if let Some((old, new)) = VERBS.iter().find(|(old, _)| *old == verb) {
        hints.push(hint(old, &new.join(" ")));
        arguments.splice(1..2, new.iter().map(OsString::from));
    }
    let is_of = |verb: &[&str]| {
        arguments.get(1..=verb.len()).is_some_and(|given| given.iter().eq(verb.iter()))
    };
    let options: Vec<_> = OPTIONS.iter().filter(|(verb, ..)| is_of(verb)).collect();
    let before_end = arguments.iter_mut().skip(2).take_while(|argument| *argument != "--");
    for argument in before_end {
        let Some(text) = argument.to_str() else { continue };
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (text, None),
        };
        let Some((_, old, new)) = options.iter().find(|(_, old, _)| *old == name) else { continue };
        hints.push(hint(old, new));
        *argument = value.map_or_else(|| (*new).into(), |value| format!("{new}={value}").into());
    }
    (arguments, hints)
}

fn hint(old: &str, new: &str) -> String {
    format!("hint: {old} is {new} now; the old name goes with the next version")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(line: &str) -> (String, usize) {
        let (arguments, hints) = translated(line.split(' ').map(OsString::from));
        let words: Vec<_> = arguments.iter().map(|word| word.to_str().expect("text")).collect();
        (words.join(" "), hints.len())
    }

    #[test]
    fn former_names_become_those_of_now_with_a_hint_each() {
        for (line, now, hints) in [
            ("sonard map-score a b --json", "sonard benchmark score a b --json", 1),
            ("sonard map-benchmark --max-range=4", "sonard benchmark map --silent-beyond=4", 2),
            (
                "sonard simulate --scene s --out a.jsonl",
                "sonard simulate --scene s --output a.jsonl",
                1,
            ),
            ("sonard log show --pings a", "sonard log show --readings a", 1),
            (
                "sonard plot a --out a.svg --out b.png",
                "sonard plot a --output a.svg --output b.png",
                2,
            ),
        ] {
            assert_eq!(of(line), (now.to_owned(), hints), "{line}");
        }
    }

    #[test]
    fn what_was_never_renamed_stays() {
        for line in [
            "sonard",
            "sonard scan --mock --out a --max-range 4",
            "sonard doctor --pings 3",
            "sonard plot -- --out",
            "sonard log verify a --out",
        ] {
            assert_eq!(of(line), (line.to_owned(), 0));
        }
    }
}
