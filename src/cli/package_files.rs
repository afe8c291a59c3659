//! `sonard package-files`: manual pages and completions, for packages.

use std::{fs, io, path::Path};

use clap::Command;
use clap_complete::Shell;
use clap_mangen::roff::{Roff, bold, italic, roman};

use super::{Failure, Outcome, command_line_within, completions, output::OutPath};
use crate::config::{Key, Section, sections};

/// Options of `sonard package-files`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Output folder, with man1, man5 and completions
    dir: OutPath,
}

/// Completion scripts, named as the shells find them.
const SCRIPTS: [(Shell, &str); 3] =
    [(Shell::Bash, "sonard.bash"), (Shell::Zsh, "_sonard"), (Shell::Fish, "sonard.fish")];

pub(super) fn run(args: &Args) -> Outcome {
    write_all(&args.dir)
        .map_err(|error| Failure::unwritable(&format!("into {}", args.dir.display()), &error))
}

fn write_all(dir: &Path) -> io::Result<()> {
    let [pages, files, scripts] = ["man1", "man5", "completions"].map(|part| dir.join(part));
    for folder in [&pages, &files, &scripts] {
        fs::create_dir_all(folder)?;
    }
    // Lines are wrapped by the pager.
    let command = command_line_within(0);
    clap_mangen::generate_to(command.clone(), &pages)?;
    for (shell, name) in SCRIPTS {
        fs::write(scripts.join(name), completions::script(shell)?)?;
    }
    fs::write(files.join("sonard.toml.5"), configuration_page(&command))
}

/// Page `sonard.toml(5)`, generated from the table of configuration keys.
fn configuration_page(command: &Command) -> String {
    let version = command.get_version().unwrap_or_default();
    let mut page = Roff::new();
    page.control("TH", ["sonard.toml", "5", "", &format!("sonard {version}"), ""]);
    section(&mut page, "NAME");
    page.text([roman("sonard.toml - configuration of the ultrasonic ranger's daemon")]);
    section(&mut page, "SYNOPSIS");
    page.text([italic("/etc/sonard/sonard.toml")]);
    section(&mut page, "DESCRIPTION");
    page.text([
        roman("Read by "),
        bold("sonard run"),
        roman(
            ". The file is TOML. Every key has a default or is optional; an unknown key \
             is an error, with the nearest known key. Environment variables \
             (SONARD_PLAN_STEP_DEG=1.8) override the file, options of the command line (",
        ),
        bold("--set plan.step_deg=1.8"),
        roman(") override both. "),
        bold("sonard run --check"),
        roman(
            " validates the configuration and prints the effective values. A reload (SIGHUP) applies changes; \
             keys marked (restart) take effect after a restart.",
        ),
    ]);
    for entry in sections() {
        write_keys(&mut page, entry);
    }
    section(&mut page, "SEE ALSO");
    page.text([bold("sonard-run"), roman("(1), "), bold("sonard"), roman("(1)")]);
    page.render()
}

fn write_keys(page: &mut Roff, entry: &Section) {
    section(page, &format!("[{}]", entry.name));
    page.text([roman(entry.about.as_str())]);
    for key in &entry.keys {
        page.control("TP", []);
        page.text([bold(key.name.as_str())]);
        page.text([roman(format!("{} {}", key.about, key.kind.description()))]);
        page.control("br", []);
        page.text([roman(describe_default(key))]);
    }
}

/// Describes the value of a key that is not given.
fn describe_default(key: &Key) -> String {
    match (&key.default, &key.example) {
        (Some(default), _) => format!("Default: {}.", key.kind.toml(default)),
        (None, Some(example)) => format!("No default; for example {}.", key.kind.toml(example)),
        (None, None) => "No default.".to_owned(),
    }
}

fn section(page: &mut Roff, title: &str) {
    page.control("SH", [title]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_cover_verbs_and_keys() {
        let folder = tempfile::tempdir().expect("a folder");
        write_all(folder.path()).expect("there is room");
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("it is there");
        for verb in command_line_within(0).get_subcommands().filter(|verb| !verb.is_hide_set()) {
            let page = read(&format!("man1/sonard-{}.1", verb.get_name()));
            assert!(page.contains(".SH OPTIONS"), "{}", verb.get_name());
        }
        // A hidden verb is for packagers only.
        assert!(!folder.path().join("man1/sonard-package-files.1").exists());
        let page = read("man5/sonard.toml.5");
        for section in sections() {
            for key in &section.keys {
                assert!(page.contains(&format!("\\fB{}\\fR", key.name)), "{}", key.name);
            }
        }
        for (shell, name) in SCRIPTS {
            let script = completions::script(shell).expect("a script");
            assert_eq!(read(&format!("completions/{name}")).as_bytes(), script);
        }
    }
}
