//! Emulator of a scan's device: located, started, and ended with the scan.

use std::{
    env,
    io::{BufRead as _, BufReader, Read as _},
    os::unix::process::CommandExt as _,
    path::PathBuf,
    process::{Child, Command, Stdio},
};

use crate::cli::Failure;

const PROGRAM: &str = "sonard-emulator";
/// Environment variable with its path.
const VARIABLE: &str = "SONARD_EMULATOR";
const LISTENING: &str = "listening on ";

const BUILD: &str = "build it, in a clone of the repository, with `firmware/test.sh` (Debian; it \
     installs what is missing) or `cargo build --release --package \
     sonard-emulator --features simavr`; put it next to `sonard` or in PATH, or set \
     SONARD_EMULATOR. Without it, `--mock` runs the same device code";

/// Running `sonard-emulator`, killed on drop.
pub(in crate::cli) struct Emulator {
    child: Child,
    port: String,
}

impl Emulator {
    /// Starts the emulator with the given options, and waits for its port.
    pub(in crate::cli) fn start(options: &[String]) -> Result<Self, Failure> {
        let program = find()?;
        let mut child = Command::new(&program)
            .args(options)
            .arg("--attached")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // An interrupt must reach the scan first, which stops the motor.
            .process_group(0)
            .spawn()
            .map_err(|error| {
                Failure::device(format!("cannot start {}: {error}", program.display()), BUILD)
            })?;
        let output = child.stdout.take().map(BufReader::new);
        let port =
            output.into_iter().flat_map(BufReader::lines).map_while(Result::ok).find_map(|line| {
                line.strip_prefix(LISTENING)?.split(' ').next().map(str::to_owned)
            });
        match port {
            Some(port) => Ok(Self { child, port }),
            // The reason is on its standard error.
            None => Err(start_failure(child)),
        }
    }

    pub(in crate::cli) fn port(&self) -> String {
        self.port.clone()
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended by itself.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Failure of an emulator that exited with a message instead of starting.
fn start_failure(mut child: Child) -> Failure {
    let mut output = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        drop(stderr.read_to_string(&mut output));
    }
    drop(child.wait());
    Failure::input(
        format!("the emulator did not start: {}", output.trim()),
        "its firmware comes from `firmware/test.sh`, or SONARD_FIRMWARE names it",
    )
}

/// Searches the variable, this program's folder, PATH, and the build folders of a clone.
fn find() -> Result<PathBuf, Failure> {
    if let Some(named) = env::var_os(VARIABLE) {
        let path = PathBuf::from(named);
        return if path.is_file() {
            Ok(path)
        } else {
            Err(Failure::device(
                format!("{VARIABLE} is {}, which is not a file", path.display()),
                BUILD,
            ))
        };
    }
    let program = env::current_exe().unwrap_or_default();
    let next_to_program = program.parent().map(|folder| folder.join(PROGRAM));
    let search = env::var_os("PATH").unwrap_or_default();
    let in_path = env::split_paths(&search).map(|folder| folder.join(PROGRAM));
    let built = program.ancestors().flat_map(|folder| {
        ["release", "debug"].map(|kind| folder.join("target").join(kind).join(PROGRAM))
    });
    next_to_program
        .into_iter()
        .chain(in_path)
        .chain(built)
        .find(|path| path.is_file())
        .ok_or_else(|| Failure::device(format!("{PROGRAM} not found"), BUILD))
}
