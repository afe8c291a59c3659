//! The verbs in groups, as `sonard --help` shows them.

use std::fmt::Write as _;

use clap::Command;

/// What the verbs are for, in the order in which a person comes to them.
pub(super) const GROUPS: [(&str, &[&str]); 7] = [
    ("Measure", &["scan", "collect", "run", "status", "watch", "import"]),
    ("Model", &["simulate", "paths", "trace", "predict", "generate"]),
    ("Look at scans", &["plot", "compare", "interpret", "log", "export"]),
    ("Explain", &["calibrate", "locate"]),
    ("Map", &["map", "lines"]),
    ("Device", &["doctor", "mock", "board"]),
    ("Scenes and presets", &["scene", "sensor", "array"]),
];

/// Widest name of a verb, and what stands between it and its meaning.
const NAME_WIDTH: usize = 11;

/// The command with its verbs listed in groups.
pub(super) fn in_groups(command: Command) -> Command {
    let styles = command.get_styles();
    let (header, literal) = (*styles.get_header(), *styles.get_literal());
    let mut text = String::from("{about-with-newline}\n{usage-heading} {usage}\n\n");
    for (group, verbs) in GROUPS {
        // Writing to a text can't fail.
        let _ = writeln!(text, "{header}{group}:{header:#}");
        // Some builds have no pins.
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
