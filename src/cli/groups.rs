//! Groups of verbs in `sonard --help`.

use std::fmt::Write as _;

use clap::Command;

/// Verbs by purpose, in the order of a typical workflow.
pub(super) const GROUPS: [(&str, &[&str]); 9] = [
    ("First steps", &["tour"]),
    ("Measure", &["scan", "collect", "run", "status", "watch"]),
    ("Model", &["simulate", "paths", "trace", "predict", "generate"]),
    ("Logs and scans", &["plot", "compare", "interpret", "log", "import", "export"]),
    ("Estimate", &["calibrate", "locate"]),
    ("Map", &["survey", "map", "lines"]),
    ("Device", &["doctor", "mock", "board"]),
    ("Scenes and presets", &["scene", "sensor", "array"]),
    ("Shell and reports", &["completions", "report"]),
];

/// Width of the column of names.
const NAME_WIDTH: usize = 13;

/// Returns the command with a help template that lists its verbs in groups.
pub(super) fn in_groups(command: Command) -> Command {
    let styles = command.get_styles();
    let (header, literal) = (*styles.get_header(), *styles.get_literal());
    let mut text = String::from("{about-with-newline}\n{usage-heading} {usage}\n\n");
    for (group, verbs) in GROUPS {
        // Writing to a string never fails.
        let _ = writeln!(text, "{header}{group}:{header:#}");
        // Some builds lack a verb.
        for verb in verbs.iter().filter_map(|verb| command.find_subcommand(verb)) {
            let (name, about) = (verb.get_name(), verb.get_about().map(ToString::to_string));
            let about = about.unwrap_or_default();
            let _ = writeln!(text, "  {literal}{name:NAME_WIDTH$}{literal:#}{about}");
        }
        text.push('\n');
    }
    let _ = write!(text, "{header}Options:{header:#}\n{{options}}{{after-help}}");
    command.help_template(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_separated_from_descriptions() {
        let verbs = GROUPS.iter().flat_map(|(_, verbs)| *verbs);
        let longest = verbs.map(|verb| verb.len()).max();
        assert_eq!(longest, Some(NAME_WIDTH - 2));
    }
}
