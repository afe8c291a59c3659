//! The emulator as the scan's device: found, started, and ended with the scan.

use std::{
    env,
    io::{BufRead as _, BufReader, Read as _},
    os::unix::process::CommandExt as _,
    path::PathBuf,
    process::{Child, Command, Stdio},
};

use crate::cli::Failure;

const PROGRAM: &str = "sonard-emulator";
/// Names it, wherever it is.
const VARIABLE: &str = "SONARD_EMULATOR";
const LISTENING: &str = "listening on ";

const BUILD: &str = "build it, in a clone of the repository, with `firmware/test.sh` (Debian; it \
                     installs what is missing) or `cargo build --release --package \
                     sonard-emulator --features simavr`; put it beside `sonard` or in PATH, or name it in \
                     SONARD_EMULATOR. Without it, `--mock` runs the same device code";

/// A `sonard-emulator` that ends when this is dropped.
pub(in crate::cli) struct Emulator {
    child: Child,
    port: String,
}

impl Emulator {
    /// Starts one in the world that the options say, and waits until its port is there.
    pub(in crate::cli) fn start(options: &[String]) -> Result<Self, Failure> {
        let program = find()?;
        let mut child = Command::new(&program)
            .args(options)
            .arg("--attached")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // An interrupt is for the scan, which stops the motor first.
            .process_group(0)
            .spawn()
            .map_err(|error| {
                Failure::device(format!("cannot start {}: {error}", program.display()), BUILD)
            })?;
        let said = child.stdout.take().map(BufReader::new);
        let port =
            said.into_iter().flat_map(BufReader::lines).map_while(Result::ok).find_map(|line| {
                line.strip_prefix(LISTENING)?.split(' ').next().map(str::to_owned)
            });
        match port {
            Some(port) => Ok(Self { child, port }),
            // Why, it says on standard error.
            None => Err(refused(child)),
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

/// What it said instead of starting.
fn refused(mut child: Child) -> Failure {
    let mut said = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        drop(stderr.read_to_string(&mut said));
    }
    drop(child.wait());
    Failure::input(
        format!("the emulator did not start: {}", said.trim()),
        "its firmware comes from `firmware/test.sh`, or SONARD_FIRMWARE names it",
    )
}

/// By the variable, beside this program, in PATH, or where its build leaves it in a clone.
fn find() -> Result<PathBuf, Failure> {
    if let Some(named) = env::var_os(VARIABLE) {
        let path = PathBuf::from(named);
        return if path.is_file() {
            Ok(path)
        } else {
            Err(Failure::device(
                format!("{VARIABLE} names {}, which is no file", path.display()),
                BUILD,
            ))
        };
    }
    let program = env::current_exe().unwrap_or_default();
    let beside = program.parent().map(|folder| folder.join(PROGRAM));
    let search = env::var_os("PATH").unwrap_or_default();
    let in_path = env::split_paths(&search).map(|folder| folder.join(PROGRAM));
    let built = program.ancestors().flat_map(|folder| {
        ["release", "debug"].map(|kind| folder.join("target").join(kind).join(PROGRAM))
    });
    beside
        .into_iter()
        .chain(in_path)
        .chain(built)
        .find(|path| path.is_file())
        .ok_or_else(|| Failure::device(format!("there is no {PROGRAM} on this computer"), BUILD))
}
