//! Where poses come from that are not known beforehand.

use std::{
    io::{BufRead as _, BufReader},
    os::unix::process::CommandExt as _,
    process::{Child, Command, Stdio},
};

use rustix::process::{Pid, Signal, kill_process_group};
use sonard_model::scene::Scene;
use sonard_runtime::interrupts::Interrupts;
use tokio::sync::mpsc::{Receiver, channel};

use super::{Halt, NamedPose, Poses, Watcher};

/// Tells programs which pose is wanted.
const VARIABLE: &str = "SONARD_POSE";

/// Gives poses one by one.
pub(super) enum Source {
    /// There are none but those listed.
    Listed,
    Prompt,
    Program(String),
    Stream {
        command: String,
        running: Option<Stream>,
    },
}

/// A command that is running, with what it has printed.
pub(super) struct Stream {
    child: Child,
    lines: Receiver<String>,
}

impl Drop for Stream {
    fn drop(&mut self) {
        // It may have ended by itself; what it started itself goes with it.
        if let Some(group) = Pid::from_raw(self.child.id().cast_signed()) {
            let _ = kill_process_group(group, Signal::TERM);
        }
        drop(self.child.wait());
    }
}

impl Source {
    pub(super) fn of(poses: &Poses) -> Self {
        match poses {
            Poses::Listed(_) => Self::Listed,
            Poses::Prompt => Self::Prompt,
            Poses::Program(command) => Self::Program(command.clone()),
            Poses::Stream(command) => Self::Stream { command: command.clone(), running: None },
        }
    }

    /// The pose with this number; `None` when there are no more.
    ///
    /// # Errors
    /// When a program fails or prints no pose, or when interrupted.
    pub(super) async fn next(
        &mut self,
        number: u32,
        scene: &Scene,
        watcher: &mut impl Watcher,
        interrupts: &Interrupts,
    ) -> Result<Option<NamedPose>, Halt> {
        match self {
            Self::Listed => Ok(None),
            Self::Prompt => prompt(number, scene, watcher, interrupts).await,
            Self::Program(command) => {
                let ran = command.clone();
                let output = tokio::task::spawn_blocking(move || run_once(&ran, number));
                let text = tokio::select! {
                    output = output => output.unwrap_or_else(|error| Err(error.to_string())),
                    () = interrupts.clone().wait() => return Err(Halt::on_request()),
                };
                let text = text.map_err(|why| failed(command, &why))?;
                parse(command, text.trim(), scene)
            }
            Self::Stream { command, running } => {
                if running.is_none() {
                    *running = Some(start(command, number)?);
                }
                let Some(stream) = running else { return Ok(None) };
                let line = tokio::select! {
                    line = stream.lines.recv() => line,
                    () = interrupts.clone().wait() => return Err(Halt::on_request()),
                };
                match line {
                    Some(line) => parse(command, line.trim(), scene),
                    None => {
                        let ended = stream.child.wait();
                        let fault = ended.map_or_else(
                            |error| Some(error.to_string()),
                            |status| (!status.success()).then(|| status.to_string()),
                        );
                        fault.map_or(Ok(None), |why| Err(failed(command, &why)))
                    }
                }
            }
        }
    }
}

/// Asks until there is a pose at which a ranger can stand, or none any more.
async fn prompt(
    number: u32,
    scene: &Scene,
    watcher: &mut impl Watcher,
    interrupts: &Interrupts,
) -> Result<Option<NamedPose>, Halt> {
    let question =
        format!("pose {number} (X,Y,DEG or a name; an empty line when there are no more):");
    loop {
        let answer = answered(watcher, &question, interrupts).await?;
        let Some(text) = answer.filter(|text| !text.is_empty()) else { return Ok(None) };
        match NamedPose::parse(&text, scene) {
            Ok(pose) => return Ok(Some(pose)),
            Err(fault) => watcher.say(&format!("{fault}; {}", fault.help)),
        }
    }
}

/// An answer, unless it is interrupted.
pub(super) async fn answered(
    watcher: &mut impl Watcher,
    question: &str,
    interrupts: &Interrupts,
) -> Result<Option<String>, Halt> {
    tokio::select! {
        answer = watcher.ask(question) => Ok(answer),
        () = interrupts.clone().wait() => Err(Halt::on_request()),
    }
}

fn parse(command: &str, text: &str, scene: &Scene) -> Result<Option<NamedPose>, Halt> {
    if text.is_empty() {
        return Ok(None);
    }
    let pose = NamedPose::parse(text, scene);
    pose.map(Some)
        .map_err(|fault| Halt::wrong(format!("`{command}` printed no pose: {fault}"), &fault.help))
}

fn shell(command: &str, number: u32) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", command]).env(VARIABLE, number.to_string()).stdin(Stdio::null());
    shell
}

fn run_once(command: &str, number: u32) -> Result<String, String> {
    let output = shell(command, number)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| error.to_string())?;
    if !output.status.success() {
        return Err(output.status.to_string());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn start(command: &str, number: u32) -> Result<Stream, Halt> {
    let mut child = shell(command, number)
        .stdout(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(|error| failed(command, &error.to_string()))?;
    // As many lines as are wanted and one more: who prints faster has to wait.
    let (sender, lines) = channel(1);
    let printed = child.stdout.take();
    #[allow(clippy::disallowed_methods, reason = "its end is received as the end of a channel")]
    std::thread::spawn(move || {
        for line in printed.into_iter().flat_map(|out| BufReader::new(out).lines()) {
            let Ok(line) = line else { break };
            if !line.trim().is_empty() && sender.blocking_send(line).is_err() {
                break;
            }
        }
    });
    Ok(Stream { child, lines })
}

fn failed(command: &str, why: &str) -> Halt {
    Halt::wrong(
        format!("`{command}`, which is to give poses, failed: {why}"),
        "run it by itself; what was collected is kept, and the collection goes on when started again",
    )
}
