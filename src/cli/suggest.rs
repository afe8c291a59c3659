//! Suggestions for unknown verbs and options: the words of other programs, next to those that are
//! spelled similarly.

use std::ffi::OsStr;

use clap::{
    Command, Error,
    builder::StyledStr,
    error::{ContextKind, ContextValue, ErrorKind},
};

/// Verbs of other programs, and verbs with the same purpose here, of which one or another exists.
const VERBS: [(&str, &[&str]); 33] = [
    ("analyse", &["compare", "interpret"]),
    ("analyze", &["compare", "interpret"]),
    ("ascan", &["trace"]),
    ("cat", &["show"]),
    ("check", &["verify", "check", "doctor"]),
    ("completion", &["completions"]),
    ("convert", &["import", "export"]),
    ("daemon", &["run"]),
    ("demo", &["tour"]),
    ("diagnose", &["doctor"]),
    ("diff", &["compare"]),
    ("draw", &["plot", "show"]),
    ("dump", &["show", "export"]),
    ("emulate", &["mock"]),
    ("fit", &["calibrate"]),
    ("fix", &["repair"]),
    ("grid", &["map"]),
    ("list", &["list", "show"]),
    ("localise", &["locate"]),
    ("localize", &["locate"]),
    ("ls", &["list", "show"]),
    ("measure", &["scan"]),
    ("model", &["simulate"]),
    ("print", &["show"]),
    ("record", &["scan", "run"]),
    ("render", &["plot"]),
    ("replay", &["mock"]),
    ("serve", &["run"]),
    ("start", &["run"]),
    ("sweep", &["scan"]),
    ("tail", &["watch", "show"]),
    ("validate", &["verify", "check"]),
    ("view", &["plot", "show"]),
];

/// Options of other programs, and options with the same purpose here, of which one or another
/// exists.
const OPTIONS: [(&str, &[&str]); 31] = [
    ("angle", &["azimuth-deg"]),
    ("at", &["pose"]),
    ("azimuth", &["azimuth-deg"]),
    ("bearing", &["azimuth-deg"]),
    ("blanking", &["blanking-us", "short-blanking"]),
    ("count", &["repeat"]),
    ("device", &["port"]),
    ("end", &["to-deg"]),
    ("file", &["output", "out"]),
    ("from", &["from-deg"]),
    ("host", &["address"]),
    ("humidity", &["humidity-percent"]),
    ("location", &["pose"]),
    ("max-range-m", &["until", "max-range"]),
    ("noise", &["noise-mm", "noise-floor"]),
    ("out", &["output"]),
    ("output", &["out"]),
    ("position", &["pose"]),
    ("pressure", &["pressure-kpa"]),
    ("range", &["until", "max-range"]),
    ("room", &["scene"]),
    ("scans", &["repeat"]),
    ("serial", &["port"]),
    ("start", &["from-deg"]),
    ("step", &["step-deg"]),
    ("temperature", &["temperature-c"]),
    ("to", &["to-deg"]),
    ("tty", &["port"]),
    ("url", &["address"]),
    ("window", &["window-ms"]),
    ("world", &["scene"]),
];

/// Options without which there is nothing to predict, and where to find their values.
const PLACES: [(&str, &str); 2] = [
    ("--scene", "'sonard scene list' lists the shipped scenes and their poses"),
    (
        "--pose",
        "a pose is X,Y,DEG (metres, degrees), or a name from the scene: 'sonard scene list' lists them",
    ),
];

/// Adds suggestions to an error of the command line.
pub(super) fn suggest<'a>(
    mut error: Error,
    command: &Command,
    arguments: impl IntoIterator<Item = &'a OsStr>,
) -> Error {
    let context = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let Some(given) = context(ContextKind::InvalidSubcommand) else { return error };
            let command = command_of(command, arguments);
            let exists = |verb: &&&str| command.find_subcommand(verb).is_some();
            let found: Vec<String> =
                synonyms(&VERBS, &given).iter().filter(exists).map(ToString::to_string).collect();
            if given == "version" {
                let tip = StyledStr::from("'sonard --version' prints version, commit and features");
                error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
                error.remove(ContextKind::SuggestedSubcommand);
            } else if !found.is_empty() {
                error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(found));
            }
        }
        ErrorKind::UnknownArgument => {
            let Some(given) = context(ContextKind::InvalidArg) else { return error };
            let command = command_of(command, arguments);
            let exists = |option: &&&str| {
                command.get_arguments().any(|argument| argument.get_long() == Some(**option))
            };
            let name = given.trim_start_matches('-');
            if let Some(option) = synonyms(&OPTIONS, name).iter().find(exists) {
                let option = ContextValue::String(format!("--{option}"));
                error.insert(ContextKind::SuggestedArg, option);
                // The tip to pass the argument as a value would distract.
                error.remove(ContextKind::Suggested);
            }
        }
        ErrorKind::MissingRequiredArgument => {
            let missing = match error.get(ContextKind::InvalidArg) {
                Some(ContextValue::Strings(names)) => names.join(" "),
                _ => return error,
            };
            if let Some((_, tip)) = PLACES.iter().find(|(option, _)| missing.contains(option)) {
                error.insert(
                    ContextKind::Suggested,
                    ContextValue::StyledStrs(vec![StyledStr::from(*tip)]),
                );
            }
        }
        _ => {}
    }
    error
}

fn synonyms<'a>(table: &[(&str, &'a [&'a str])], given: &str) -> &'a [&'a str] {
    let given = given.to_lowercase();
    table.iter().find(|(word, _)| *word == given).map_or(&[], |(_, here)| here)
}

/// Returns the deepest command that the arguments name.
fn command_of<'a, 'b>(
    mut command: &'a Command,
    arguments: impl IntoIterator<Item = &'b OsStr>,
) -> &'a Command {
    for argument in arguments {
        match argument.to_str().and_then(|name| command.find_subcommand(name)) {
            Some(below) => command = below,
            None => break,
        }
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::command_line;

    /// Error message for a wrong command line.
    fn message(words: &[&str]) -> String {
        let mut command = command_line();
        let error = command
            .try_get_matches_from_mut(["sonard"].iter().chain(words))
            .expect_err("it is wrong");
        let arguments = words.iter().map(OsStr::new);
        suggest(error, &command, arguments).render().to_string()
    }

    #[test]
    fn words_of_other_programs() {
        for (words, expected) in [
            (&["log", "check", "a.jsonl"][..], "'verify'"),
            (&["log", "fix"], "'repair'"),
            (&["log", "cat"], "'show'"),
            (&["check"], "'doctor'"),
            (&["version"], "sonard --version"),
            (&["draw"], "'plot'"),
            (&["scan", "--range", "4"], "'--max-range'"),
            (&["trace", "--range", "4"], "'--until'"),
            (&["simulate", "--out", "a"], "'--output'"),
            (&["calibrate", "--output", "a"], "'--out'"),
            (&["scan", "--temperature", "4"], "'--temperature-c'"),
            // Similar spelling.
            (&["simulat"], "'simulate'"),
            // Missing options.
            (&["simulate", "--scene", "a.json"], "X,Y,DEG"),
            (&["scan", "--mock", "--out", "a"], "'sonard scene list'"),
        ] {
            let text = message(words);
            assert!(text.contains("tip: ") && text.contains(expected), "{text}");
        }
    }

    #[test]
    fn each_suggestion_exists() {
        fn collect(command: &Command, verbs: &mut Vec<String>, options: &mut Vec<String>) {
            let longs = command.get_arguments().filter_map(clap::Arg::get_long);
            options.extend(longs.map(str::to_owned));
            for below in command.get_subcommands() {
                verbs.push(below.get_name().to_owned());
                collect(below, verbs, options);
            }
        }
        let (mut verbs, mut options) = (Vec::new(), Vec::new());
        collect(&command_line(), &mut verbs, &mut options);
        for (known, table) in [(verbs, &VERBS[..]), (options, &OPTIONS[..])] {
            for (word, here) in table {
                for name in *here {
                    assert!(known.iter().any(|known| known == name), "{word}: {name}");
                }
            }
        }
    }
}
