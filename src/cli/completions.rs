//! `sonard completions`, and the values that shells complete.

use std::{
    env,
    ffi::{OsStr, OsString},
    io::{self, Write as _},
};

use clap::{Arg, Command};
use clap_complete::{
    ArgValueCompleter, CompletionCandidate, PathCompleter, Shell,
    engine::ValueCompleter as _,
    env::{CompleteEnv, Shells},
};

use super::{Failure, Outcome, command_line, output, scene_file};
use crate::{
    acoustics::Sensor,
    array::RangerArray,
    scene::{Scene, shipped},
};

/// Environment variable with which a shell's script requests completions of this program.
const VARIABLE: &str = "SONARD_COMPLETE";

/// Options of `sonard completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Shell that loads the script
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

pub(super) const ABOUT: &str = "\
Print a script that completes verbs, options and values in a shell.

Names of scenes, sensors and arrays are completed, and after --scene the poses of that scene.";

const HELP: &str = "\
Examples:
  source <(sonard completions bash)   # in ~/.bashrc
  source <(sonard completions zsh)   # in ~/.zshrc, after compinit
  sonard completions fish > ~/.config/fish/completions/sonard.fish
  eval (sonard completions elvish | slurp)   # in ~/.config/elvish/rc.elv
  sonard completions powershell | Out-String | Invoke-Expression   # in $PROFILE";

pub(super) fn run(args: &Args) -> Outcome {
    let script = script(args.shell)
        .map_err(|error| Failure::device(error, "this is a bug: please report it"))?;
    let written = io::stdout().lock().write_all(&script);
    written.or_else(|error| Failure::from_write("to standard output", &error))
}

/// Returns the script that requests completions of the `sonard` on the path.
pub(super) fn script(shell: Shell) -> io::Result<Vec<u8>> {
    let mut script = Vec::new();
    let shells = Shells::builtins();
    let writer = shells.completer(&shell.to_string()).ok_or(io::ErrorKind::Unsupported)?;
    writer.write_registration(VARIABLE, "sonard", "sonard", "sonard", &mut script)?;
    Ok(script)
}

/// Prints the completions that a shell's script requests, and ends the process.
pub(super) fn serve_requests() {
    CompleteEnv::with_factory(command_line).var(VARIABLE).complete();
}

/// Adds completions of values to the arguments of all verbs.
pub(super) fn with_values(command: Command) -> Command {
    let command = ["scene", "sensor", "array"].into_iter().fold(command, |command, group| {
        command.mut_subcommand(group, |verbs| {
            verbs.mut_subcommand("show", |show| {
                show.mut_arg("name", |name| match group {
                    "scene" => name.add(ArgValueCompleter::new(complete_shipped_scene)),
                    "sensor" => name.add(ArgValueCompleter::new(complete_sensor_name)),
                    _ => name.add(ArgValueCompleter::new(complete_array_name)),
                })
            })
        })
    });
    command.mut_subcommands(with_paths_and_names)
}

fn with_paths_and_names(command: Command) -> Command {
    let complete = |arg: Arg| {
        let is_scene = arg.get_id() == "scene"
            || arg.get_value_names().is_some_and(|names| names.iter().any(|name| name == "SCENE"));
        match arg.get_long() {
            Some("sensor") => arg.add(ArgValueCompleter::new(complete_sensor)),
            Some("array") => arg.add(ArgValueCompleter::new(complete_array)),
            Some("pose") => arg.add(ArgValueCompleter::new(complete_pose)),
            _ if is_scene => arg.add(ArgValueCompleter::new(complete_scene)),
            _ if output::is_output(&arg) => arg.value_hint(clap::ValueHint::AnyPath),
            _ => arg,
        }
    };
    command.mut_args(complete).mut_subcommands(with_paths_and_names)
}

fn candidates<'a>(
    names: impl Iterator<Item = &'a str>,
    describe: impl Fn(&str) -> Option<String>,
    current: &OsStr,
) -> Vec<CompletionCandidate> {
    let current = current.to_string_lossy();
    let matching = names.filter(|name| name.starts_with(&*current));
    let candidate = |name: &str| {
        let help = describe(name).filter(|text| !text.is_empty());
        CompletionCandidate::new(name).help(help.map(Into::into))
    };
    matching.map(candidate).collect()
}

fn complete_shipped_scene(current: &OsStr) -> Vec<CompletionCandidate> {
    candidates(shipped::names(), |_| None, current)
}

fn complete_scene(current: &OsStr) -> Vec<CompletionCandidate> {
    let mut all = complete_shipped_scene(current);
    all.extend(PathCompleter::file().complete(current));
    all
}

fn complete_sensor_name(current: &OsStr) -> Vec<CompletionCandidate> {
    let describe = |name: &str| Sensor::preset(name).ok().map(|sensor| sensor.description);
    candidates(Sensor::preset_names(), describe, current)
}

fn complete_sensor(current: &OsStr) -> Vec<CompletionCandidate> {
    let mut all = complete_sensor_name(current);
    all.extend(PathCompleter::file().complete(current));
    all
}

fn complete_array_name(current: &OsStr) -> Vec<CompletionCandidate> {
    let describe = |name: &str| RangerArray::preset(name).ok().map(|array| array.description);
    candidates(RangerArray::preset_names(), describe, current)
}

fn complete_array(current: &OsStr) -> Vec<CompletionCandidate> {
    let mut all = complete_array_name(current);
    all.extend(PathCompleter::file().complete(current));
    all
}

/// Completes the names of the poses of the scene on the command line.
fn complete_pose(current: &OsStr) -> Vec<CompletionCandidate> {
    let Some(scene) = scene_of(env::args_os()) else { return Vec::new() };
    let describe = |name: &str| {
        let pose = scene.poses.get(name)?;
        Some(format!("{},{},{}", pose.x_m, pose.y_m, pose.heading_deg))
    };
    candidates(scene.poses.keys().map(String::as_str), describe, current)
}

/// Reads the scene that a command line names: by `--scene`, or as in `sonard scene draw SCENE`.
fn scene_of(words: impl Iterator<Item = OsString>) -> Option<Scene> {
    let words: Vec<OsString> = words.collect();
    let option = words.iter().enumerate().find_map(|(place, word)| {
        match word.to_str()?.strip_prefix("--scene")? {
            "" => words.get(place + 1).cloned(),
            value => value.strip_prefix('=').map(OsString::from),
        }
    });
    let operand = || {
        let verb = words.windows(3).find(|words| words[0] == "scene")?;
        Some(verb[2].clone()).filter(|operand| !operand.to_string_lossy().starts_with('-'))
    };
    scene_file::load(option.or_else(operand)?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(candidates: &[CompletionCandidate]) -> Vec<String> {
        candidates
            .iter()
            .map(|candidate| candidate.get_value().to_string_lossy().into_owned())
            .collect()
    }

    #[test]
    fn names_by_their_beginning() {
        let all = values(&complete_sensor_name(OsStr::new("senscomp")));
        assert!(all.contains(&"senscomp-6500".to_owned()), "{all:?}");
        assert!(all.iter().all(|name| name.starts_with("senscomp")), "{all:?}");
        assert_eq!(values(&complete_array_name(OsStr::new("pioneer-8"))), ["pioneer-8"]);
        assert_eq!(
            values(&complete_shipped_scene(OsStr::new("simple-room-r"))),
            ["simple-room-robot"]
        );
    }

    #[test]
    fn scene_on_the_command_line() {
        for words in [
            &["--scene", "simple-room", "--pose"][..],
            &["--scene=simple-room"],
            &["sonard", "scene", "draw", "simple-room", "--pose"],
        ] {
            let scene = scene_of(words.iter().map(OsString::from)).expect("it is shipped");
            assert!(scene.poses.contains_key("fig9"));
        }
        assert!(scene_of(["--scene"].iter().map(OsString::from)).is_none());
    }

    #[test]
    fn scripts_of_all_shells() {
        for shell in clap::ValueEnum::value_variants() {
            let script = String::from_utf8(script(*shell).expect("a script")).expect("UTF-8");
            assert!(script.contains(VARIABLE), "{shell}: {script}");
        }
    }
}
