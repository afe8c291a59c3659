//! Sources of poses that are not listed in the plan: prompt, program or stream.

use std::{
    io::{BufRead as _, BufReader},
    os::unix::process::CommandExt as _,
    process::{Child, Command, Stdio},
};

use rustix::process::{Pid, Signal, kill_process_group};
use sonard_model::scene::Scene;
use sonard_runtime::interrupts::Interrupts;
use tokio::sync::mpsc::{Receiver, channel};

use super::{CollectError, NamedPose, Observer, Poses};

/// Environment variable with the requested pose's number.
const POSE_VARIABLE: &str = "SONARD_POSE";

/// Supplier of poses, one at a time.
pub(super) enum PoseSource {
    /// No poses beyond the listed ones.
    Listed,
    Prompt,
    Program(String),
    Stream {
        command: String,
        running: Option<PoseStream>,
    },
}

/// Running command with the lines that it printed.
pub(super) struct PoseStream {
    child: Child,
    lines: Receiver<String>,
}

impl Drop for PoseStream {
    fn drop(&mut self) {
        // The group includes the command's own children; it may have ended already.
        if let Some(group) = Pid::from_raw(self.child.id().cast_signed()) {
            let _ = kill_process_group(group, Signal::TERM);
        }
        drop(self.child.wait());
    }
}

impl From<&Poses> for PoseSource {
    fn from(poses: &Poses) -> Self {
        match poses {
            Poses::Listed(_) => Self::Listed,
            Poses::Prompt => Self::Prompt,
            Poses::Program(command) => Self::Program(command.clone()),
            Poses::Stream(command) => Self::Stream { command: command.clone(), running: None },
        }
    }
}

impl PoseSource {
    /// Returns the pose with this number; `None` if there are no more.
    ///
    /// # Errors
    /// Returns an error if a program fails or prints no valid pose, or on an interrupt.
    pub(super) async fn next(
        &mut self,
        number: u32,
        scene: &Scene,
        watcher: &mut impl Observer,
        interrupts: &Interrupts,
    ) -> Result<Option<NamedPose>, CollectError> {
        match self {
            Self::Listed => Ok(None),
            Self::Prompt => prompt(number, scene, watcher, interrupts).await,
            Self::Program(command) => {
                let ran = command.clone();
                let output = tokio::task::spawn_blocking(move || run_once(&ran, number));
                let text = tokio::select! {
                    output = output => output.unwrap_or_else(|error| Err(error.to_string())),
                    () = interrupts.clone().wait() => return Err(CollectError::interrupted()),
                };
                let text = text.map_err(|reason| failed(command, &reason))?;
                parse(command, text.trim(), scene)
            }
            Self::Stream { command, running } => {
                if running.is_none() {
                    *running = Some(start(command, number)?);
                }
                let Some(stream) = running else { return Ok(None) };
                let line = tokio::select! {
                    line = stream.lines.recv() => line,
                    () = interrupts.clone().wait() => return Err(CollectError::interrupted()),
                };
                match line {
                    Some(line) => parse(command, line.trim(), scene),
                    None => {
                        let ended = stream.child.wait();
                        let fault = ended.map_or_else(
                            |error| Some(error.to_string()),
                            |status| (!status.success()).then(|| status.to_string()),
                        );
                        fault.map_or(Ok(None), |reason| Err(failed(command, &reason)))
                    }
                }
            }
        }
    }
}

/// Prompts until the operator enters a valid pose, or an empty line to end the collection.
async fn prompt(
    number: u32,
    scene: &Scene,
    watcher: &mut impl Observer,
    interrupts: &Interrupts,
) -> Result<Option<NamedPose>, CollectError> {
    let question = format!("pose {number} (X,Y,DEG or a name; empty line to finish):");
    loop {
        let answer = answered(watcher, &question, interrupts).await?;
        let Some(text) = answer.filter(|text| !text.is_empty()) else { return Ok(None) };
        match NamedPose::parse(&text, scene) {
            Ok(pose) => return Ok(Some(pose)),
            Err(fault) => watcher.message(&format!("{fault}; {}", fault.help)),
        }
    }
}

/// Prompts the operator and returns the answer, unless interrupted.
pub(super) async fn answered(
    watcher: &mut impl Observer,
    question: &str,
    interrupts: &Interrupts,
) -> Result<Option<String>, CollectError> {
    tokio::select! {
        answer = watcher.prompt(question) => Ok(answer),
        () = interrupts.clone().wait() => Err(CollectError::interrupted()),
    }
}

fn parse(command: &str, text: &str, scene: &Scene) -> Result<Option<NamedPose>, CollectError> {
    if text.is_empty() {
        return Ok(None);
    }
    let pose = NamedPose::parse(text, scene);
    pose.map(Some).map_err(|fault| {
        CollectError::invalid(format!("`{command}` printed no valid pose: {fault}"), &fault.help)
    })
}

fn shell(command: &str, number: u32) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", command]).env(POSE_VARIABLE, number.to_string()).stdin(Stdio::null());
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

fn start(command: &str, number: u32) -> Result<PoseStream, CollectError> {
    let mut child = shell(command, number)
        .stdout(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(|error| failed(command, &error.to_string()))?;
    // Buffers one line beyond the requested ones; a faster command blocks.
    let (sender, lines) = channel(1);
    let printed = child.stdout.take();
    #[allow(clippy::disallowed_methods, reason = "ends by closing the channel")]
    std::thread::spawn(move || {
        for line in printed.into_iter().flat_map(|out| BufReader::new(out).lines()) {
            let Ok(line) = line else { break };
            if !line.trim().is_empty() && sender.blocking_send(line).is_err() {
                break;
            }
        }
    });
    Ok(PoseStream { child, lines })
}

fn failed(command: &str, reason: &str) -> CollectError {
    CollectError::invalid(
        format!("`{command}`, the source of poses, failed: {reason}"),
        "test the command alone; recorded scans are kept, and the same `sonard collect` resumes",
    )
}
