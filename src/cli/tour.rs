//! `sonard tour`.

use std::{
    env, fs,
    io::{self, IsTerminal as _, Write as _},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use super::{Failure, Outcome, output::OutPath, prompt};
use crate::platform::picture_viewer;

/// Options of `sonard tour`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Output folder; a new or empty one [default: sonard-tour]
    #[arg(long, value_name = "DIR")]
    out: Option<OutPath>,
    /// Name the pictures, and open none
    #[arg(long)]
    no_open: bool,
    /// Continue without a prompt; all steps
    #[arg(long)]
    yes: bool,
}

pub(super) const ABOUT: &str = "\
Run the first commands of the documentation, step by step.

Each step explains a command, runs it, and opens its picture, or names it where no desktop is \
available. Files go to a folder of their own, which can be removed afterwards. At a terminal, \
Enter starts the next step. No device is needed: the scans are of a mock.";

const HELP: &str = "\
Examples:
  sonard tour
  sonard tour --out /tmp/tour --no-open --yes

Exit codes: 0 done, 1 ended before the last step, 2 wrong usage or input, 3 a step failed.";

/// Default of `--out`.
const FOLDER: &str = "sonard-tour";

/// Step of the tour.
struct Step {
    title: &'static str,
    /// Command as README has it, without the program's name.
    command: &'static str,
    about: &'static str,
    picture: Option<&'static str>,
}

/// Commands of README, in its order.
const STEPS: [Step; 6] = [
    Step {
        title: "A scan",
        command: "scan --mock --scene simple-room --pose fig9 --out out/fig9",
        about: "The mock takes 400 readings over the serial protocol; each is logged next to the model's \
                prediction. The ranger is 85 mm from the lower wall, inside its blanking distance, and reads \
                827 mm there: the echo has been reflected by the near, the far and the near wall again.",
        picture: Some("out/fig9/scan.png"),
    },
    Step {
        title: "Repeated scans",
        command: "scan --mock --scene simple-room --pose fig7 --repeat 3 --out out/fig7",
        about: "Three scans from another pose go to one log. The picture shows the last one.",
        picture: Some("out/fig7/scan.png"),
    },
    Step {
        title: "Measured and predicted",
        command: "compare out/fig7/scan.jsonl",
        about: "Each reading is compared with its prediction: agreement, residuals, and a verdict by the kind of \
                propagation path.",
        picture: None,
    },
    Step {
        title: "Propagation paths",
        command: "paths --scene simple-room --pose fig9 --max-range 2",
        about: "Every path of sound at that pose, shortest first, with its amplitude and the walls on it.",
        picture: None,
    },
    Step {
        title: "The model alone",
        command: "simulate --scene corridor --pose beside-wall -o corridor.jsonl",
        about: "A scan without a device. The records have the same format as measured ones.",
        picture: None,
    },
    Step {
        title: "One beam",
        command: "plot corridor.jsonl --azimuth-deg 45 -o path.png",
        about: "The path of the echo at 45 degrees, reflection by reflection.",
        picture: Some("path.png"),
    },
];

/// Width of explanations, columns.
const COLUMNS: usize = 78;

pub(super) fn run(args: &Args) -> Outcome {
    let folder = args.out.as_deref().map_or_else(|| PathBuf::from(FOLDER), Path::to_path_buf);
    create(&folder)?;
    let program = env::current_exe().map_err(|error| {
        Failure::device(format!("cannot find this program: {error}"), "start it by its full path")
    })?;
    let prompts = !args.yes && prompt::is_interactive();
    let viewer = if args.no_open { None } else { viewer() };
    for (number, step) in (1..).zip(&STEPS) {
        introduce(number, step)?;
        if prompts && !continues()? {
            let done = number - 1;
            return Err(Failure::Found(Some(format!(
                "ended after {done} of {} steps; the files are in {}",
                STEPS.len(),
                folder.display()
            ))));
        }
        perform(&program, &folder, step)?;
        if let Some(picture) = step.picture.map(|picture| folder.join(picture)) {
            show(&picture, viewer)?;
        }
    }
    let end = format!(
        "\nThat was the tour. Its files are in {}; remove the folder when you are done.\n\
         Next: `sonard scene show simple-room > my-room.json` for a room of your own, `sonard run --mock --scene \
         simple-room --pose fig9 --set server.listen=127.0.0.1:8765` for the live page, `sonard --help`.",
        folder.display()
    );
    print_text(&end)
}

/// Creates the folder; files that are already there are not mixed with the tour.
fn create(folder: &Path) -> Outcome {
    let is_empty = match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => true,
        Err(error) => return Err(Failure::unwritable(&folder.display(), &error)),
    };
    if !is_empty {
        return Err(Failure::input(
            format!("{} is not empty", folder.display()),
            "remove it if it is of an earlier tour, or give another folder with --out",
        ));
    }
    super::output::make_folder(folder)
}

fn introduce(number: usize, step: &Step) -> Outcome {
    let about = textwrap::fill(step.about, COLUMNS);
    let (count, title, command) = (STEPS.len(), step.title, step.command);
    print_text(&format!("\n[{number}/{count}] {title}\n{about}\n\n  $ sonard {command}"))
}

fn print_text(text: &str) -> Outcome {
    let mut out = io::stdout();
    writeln!(out, "{text}")
        .and_then(|()| out.flush())
        .or_else(|error| Failure::from_write("standard output", &error))
}

/// Waits for Enter; `q` and the end of the input end the tour.
fn continues() -> Result<bool, Failure> {
    let answer = prompt::prompt("  (Enter runs it, q ends the tour)")?;
    Ok(answer.is_some_and(|answer| !answer.eq_ignore_ascii_case("q")))
}

/// Runs the command of a step in the folder.
fn perform(program: &Path, folder: &Path, step: &Step) -> Outcome {
    let status = Command::new(program)
        .args(step.command.split(' '))
        .current_dir(folder)
        .stdin(Stdio::null())
        .status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(Failure::device(
            format!("`sonard {}` failed: {status}", step.command),
            "see the messages before this one; `sonard report` collects what a bug report needs",
        )),
        Err(error) => Err(Failure::device(
            format!("cannot run {}: {error}", program.display()),
            "start sonard by its full path",
        )),
    }
}

/// Opens a picture, or names it.
fn show(picture: &Path, viewer: Option<&str>) -> Outcome {
    let path = fs::canonicalize(picture).unwrap_or_else(|_| picture.to_path_buf());
    let opened = viewer.is_some_and(|viewer| {
        let quiet = || Stdio::null();
        let command =
            Command::new(viewer).arg(&path).stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
        command.is_ok_and(|status| status.success())
    });
    let verb = if opened { "opened" } else { "picture:" };
    print_text(&format!("  {verb} {}", path.display()))
}

/// Program that opens pictures on this desktop, for a reader at a terminal.
fn viewer() -> Option<&'static str> {
    picture_viewer().filter(|_| io::stdout().is_terminal())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_those_of_readme() {
        let readme = include_str!("../../README.md");
        let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let readme = words(&readme.replace("cargo run --release -- ", "sonard "));
        let mut at = 0;
        for step in STEPS {
            let command = format!("sonard {}", step.command);
            let found = readme[at..].find(&command);
            at += found.unwrap_or_else(|| panic!("not in README, or out of order: {command}"));
        }
    }
}
