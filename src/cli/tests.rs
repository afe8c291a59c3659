//! Rules for the whole command line.

use std::collections::{BTreeMap, BTreeSet};

use clap::{Arg, error::ErrorKind};

use super::*;

/// Lists options that take a value: their verb as words, with the option, and the value's name.
fn options(command: &Command, path: &[String]) -> Vec<(Vec<String>, String)> {
    let own = command.get_arguments().filter(|arg| arg.get_action().takes_values());
    let mut found: Vec<_> = own
        .filter_map(|arg| {
            let option = format!("--{}", arg.get_long()?);
            let name = arg.get_value_names()?.first()?.to_string();
            Some(([path, &[option]].concat(), name))
        })
        .collect();
    for verb in command.get_subcommands() {
        found.extend(options(verb, &[path, &[verb.get_name().to_owned()]].concat()));
    }
    found
}

#[test]
fn negative_numbers_are_values() {
    let command = command_line();
    let options = options(&command, &["sonard".to_owned()]);
    assert!(options.len() > 200, "{}", options.len());
    for (words, name) in options {
        let value = match name.as_str() {
            "POSE" => "-1,2,90",
            "REGION" => "-1,-2,3,4",
            _ => "-1.5",
        };
        let words = [&words[..], &[value.to_owned()]].concat();
        let error = command.clone().try_get_matches_from(&words).err();
        let kind = error.map(|error| error.kind());
        assert_ne!(kind, Some(ErrorKind::UnknownArgument), "{words:?}");
    }
}

/// Lists every verb with its path, including groups of verbs.
fn verbs(command: &Command, path: &str) -> Vec<(String, Command)> {
    let shown = command.get_subcommands().filter(|verb| !verb.is_hide_set());
    let below = shown.flat_map(|verb| {
        let path = format!("{path} {}", verb.get_name());
        [vec![(path.clone(), verb.clone())], verbs(verb, &path)].concat()
    });
    below.filter(|(_, verb)| verb.get_name() != "help").collect()
}

/// Lists visible options by their long name, with their verbs.
fn by_name() -> BTreeMap<String, Vec<(String, Arg)>> {
    let mut by_name: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for (path, verb) in verbs(&command_line(), "sonard") {
        for arg in verb.get_arguments().filter(|arg| !arg.is_hide_set()) {
            if let Some(long) = arg.get_long() {
                by_name.entry(long.to_owned()).or_default().push((path.clone(), arg.clone()));
            }
        }
    }
    by_name
}

/// Reports options of one name that differ in a property.
fn differing<T: Ord + std::fmt::Debug>(of: impl Fn(&Arg) -> Option<T>) -> Vec<String> {
    let mut faults = Vec::new();
    for (name, args) in by_name() {
        let values: BTreeSet<T> = args.iter().filter_map(|(_, arg)| of(arg)).collect();
        if values.len() > 1 {
            let paths: Vec<_> = args.iter().map(|(path, _)| path.as_str()).collect();
            faults.push(format!("--{name} has {values:?} in {}", paths.join(", ")));
        }
    }
    faults
}

#[test]
fn options_have_one_meaning() {
    // Text after a semicolon depends on the verb; brackets contain the default, parentheses a
    // remark.
    let meaning = |arg: &Arg| {
        let help = arg.get_help()?.to_string();
        Some(help.split([';', '[', '(']).next().unwrap_or_default().trim().to_owned())
    };
    assert_eq!(differing(meaning), Vec::<String>::new());
}

#[test]
fn options_have_one_form() {
    let placeholder = |arg: &Arg| {
        let takes = arg.get_action().takes_values();
        Some(takes.then(|| arg.get_value_names().map(|names| format!("{names:?}"))))
    };
    assert_eq!(differing(placeholder), Vec::<String>::new());
    assert_eq!(differing(|arg| Some(arg.get_short())), Vec::<String>::new());
    // Without a default, the option selects something that is otherwise absent.
    let default =
        |arg: &Arg| Some(format!("{:?}", arg.get_default_values())).filter(|values| values != "[]");
    assert_eq!(differing(default), Vec::<String>::new());
}

#[test]
fn placeholders() {
    for (name, args) in by_name() {
        for (path, arg) in args {
            let placeholder = match arg.get_action().takes_values() {
                true => {
                    arg.get_value_names().and_then(|names| names.first()).map(ToString::to_string)
                }
                false => None,
            };
            let placeholder = placeholder.unwrap_or_default();
            assert!(!placeholder.contains('_'), "{path} --{name} <{placeholder}>");
            assert!(arg.get_help().is_some(), "{path} --{name} has no help");
            match name.as_str() {
                "out" => {
                    assert_eq!((placeholder.as_str(), arg.get_short()), ("DIR", None), "{path}");
                }
                "output" => {
                    assert_eq!(
                        (placeholder.as_str(), arg.get_short()),
                        ("FILE", Some('o')),
                        "{path}"
                    );
                }
                _ => {}
            }
        }
    }
}

#[test]
fn meaning_of_scene() {
    for (path, arg) in by_name().remove("scene").expect("it is an option") {
        let help = arg.get_help().expect("help").to_string();
        let is_clear =
            help.contains("; used for predictions") != help.contains("; only its walls are drawn");
        assert!(is_clear, "{path}: {help}");
    }
}

#[test]
fn exit_codes_and_groups() {
    let command = command_line();
    for (path, verb) in verbs(&command, "sonard") {
        let help = verb.clone().render_long_help().to_string();
        assert_eq!(help.matches("Exit codes:").count(), 1, "{path}");
    }
    let mut grouped: Vec<_> = groups::GROUPS.iter().flat_map(|(_, verbs)| *verbs).collect();
    grouped.sort();
    let shown = command.get_subcommands().filter(|verb| !verb.is_hide_set());
    let mut shown: Vec<_> = shown.map(Command::get_name).filter(|name| *name != "help").collect();
    shown.sort_unstable();
    let there = |verb: &&&str| shown.contains(*verb) || **verb == "board";
    assert!(grouped.iter().all(there), "{grouped:?}");
    assert!(shown.iter().all(|verb| grouped.iter().filter(|name| **name == verb).count() == 1));
    let help = command.clone().render_help().to_string();
    for (group, _) in groups::GROUPS {
        assert!(help.contains(&format!("\n{group}:\n")), "{group}: {help}");
    }
}
