//! Commands received from the broker: validated like requests of the HTTP API, executed in order.

use std::collections::VecDeque;

use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sonard_api::{Problem, ScanRequest, Strict, has_list};
use sonard_daemon::{Handle, Order, OrderError};
use tokio::task::JoinHandle;

/// Maximum number of queued commands.
const MAX_WAITING: usize = 8;
/// Maximum length of a body, bytes.
const MAX_BODY_BYTES: usize = 4096;
/// Maximum length of a command's name in a reply, characters.
const MAX_NAME_CHARS: usize = 32;

/// Message received on a command topic.
#[derive(Debug, Clone)]
pub(super) struct ReceivedCommand<'a> {
    /// Last level of the topic.
    pub(super) name: &'a str,
    pub(super) body: &'a [u8],
    /// Retain flag of the message.
    pub(super) is_retained: bool,
    /// Duplicate flag of the message.
    pub(super) is_repeated: bool,
}

#[derive(Debug, Clone, PartialEq)]
enum Command {
    Start(ScanRequest),
    Stop,
}

impl Command {
    fn parse(received: &ReceivedCommand<'_>) -> Result<Self, Problem> {
        if received.is_retained {
            let help =
                "publish it without the retain flag, and clear the topic (mosquitto_pub -r -n)";
            return Err(problem("a retained command would be executed repeatedly", help));
        }
        if received.is_repeated {
            return Err(problem(
                "it is a repetition and may have been executed already",
                "send it again",
            ));
        }
        if received.body.len() > MAX_BODY_BYTES {
            let error = format!("the body has {} bytes", received.body.len());
            return Err(problem(&error, &format!("send at most {MAX_BODY_BYTES}")));
        }
        match received.name {
            "start" => read_body(received.body).map(Self::Start),
            "stop" if matches!(received.body, b"" | b"{}") => Ok(Self::Stop),
            "stop" => Err(problem("stop has no parameters", "send an empty message, or {}")),
            _ => Err(problem("there is no such command", "start or stop")),
        }
    }

    const fn name(&self) -> &'static str {
        match self {
            Self::Start(_) => "start",
            Self::Stop => "stop",
        }
    }

    async fn execute(self, daemon: Handle) -> Result<Value, Problem> {
        let name = self.name();
        let done = match self {
            Self::Start(request) => {
                daemon.start(request).await.map(|started| Some(started.request))
            }
            Self::Stop => daemon.order(Order::Stop).await.map(|()| None),
        };
        match done {
            Ok(Some(request)) => Ok(json!({"command": name, "accepted": true, "request": request})),
            Ok(None) => Ok(json!({"command": name, "accepted": true})),
            Err(OrderError { message, help, field, .. }) => {
                Err(Problem { error: message, help, field })
            }
        }
    }
}

fn read_body<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let help = "send JSON as for POST /v1/start: {} or {\"scans\": 1}";
    let Strict(read) = serde_json::from_slice(body)
        .map_err(|error| problem(&format!("the body can't be read: {error}"), help))?;
    if serde_json::from_slice(body).is_ok_and(|value| has_list(&value)) {
        return Err(problem("there is a list instead of an object", help));
    }
    Ok(read)
}

fn problem(error: &str, help: &str) -> Problem {
    Problem { error: error.into(), help: help.into(), field: None }
}

/// Reply to a rejected command.
fn rejection(name: &str, problem: &Problem) -> Value {
    let name: String = name.chars().take(MAX_NAME_CHARS).collect();
    json!({"command": name, "accepted": false, "error": problem.error, "help": problem.help})
}

/// Queue of commands, executed in order.
#[derive(Debug)]
pub(super) struct CommandHandler {
    daemon: Handle,
    waiting: VecDeque<Command>,
    running: Option<(&'static str, JoinHandle<Result<Value, Problem>>)>,
}

impl CommandHandler {
    pub(super) const fn new(daemon: Handle) -> Self {
        Self { daemon, waiting: VecDeque::new(), running: None }
    }

    /// Queues a command.
    ///
    /// # Errors
    /// The reply to a rejected command.
    pub(super) fn queue(&mut self, received: &ReceivedCommand<'_>) -> Result<(), Value> {
        let command =
            Command::parse(received).map_err(|problem| rejection(received.name, &problem))?;
        if self.waiting.len() >= MAX_WAITING {
            let many = problem("too many commands are queued", "wait for replies");
            return Err(rejection(received.name, &many));
        }
        tracing::info!("mqtt: received command {}", command.name());
        self.waiting.push_back(command);
        self.begin();
        Ok(())
    }

    /// Waits for the running command. Returns the reply, and `true` if the command was accepted;
    /// pending forever if there is none. Cancel-safe.
    pub(super) async fn next(&mut self) -> (Value, bool) {
        let Some((name, work)) = &mut self.running else { return std::future::pending().await };
        let done = work.await;
        let name = *name;
        self.running = None;
        self.begin();
        match done {
            Ok(Ok(answer)) => (answer, true),
            Ok(Err(problem)) => (rejection(name, &problem), false),
            Err(_) => {
                (rejection(name, &problem("the command failed", "see the daemon's log")), false)
            }
        }
    }

    fn begin(&mut self) {
        if self.running.is_none()
            && let Some(command) = self.waiting.pop_front()
        {
            let name = command.name();
            #[allow(
                clippy::disallowed_methods,
                reason = "its end is awaited as the command's outcome"
            )]
            let work = tokio::spawn(command.execute(self.daemon.clone()));
            self.running = Some((name, work));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(name: &str, body: &[u8]) -> Result<Command, Problem> {
        Command::parse(&ReceivedCommand { name, body, is_retained: false, is_repeated: false })
    }

    #[test]
    fn valid_commands_are_parsed() {
        let right = |name, body| parse(name, body).map_err(|problem| problem.error);
        assert_eq!(right("start", b"{}"), Ok(Command::Start(ScanRequest::default())));
        let two = ScanRequest { scans: Some(2), ..ScanRequest::default() };
        assert_eq!(right("start", b" {\"scans\": 2}\n"), Ok(Command::Start(two)));
        assert_eq!(right("stop", b""), Ok(Command::Stop));
        assert_eq!(right("stop", b"{}"), Ok(Command::Stop));
    }

    #[test]
    fn invalid_commands_are_rejected() {
        for (name, body, part) in [
            ("start", &b""[..], "can't be read"),
            ("start", b"now", "can't be read"),
            ("start", b"\xff\xfe", "can't be read"),
            ("start", b"{\"scan\": 1}", "unknown field"),
            ("start", b"{\"scans\": -1}", "can't be read"),
            ("start", b"{\"plan\": {\"from_deg\": 0}}", "missing field"),
            ("start", b"[1]", "list"),
            ("stop", b"{\"now\": true}", "no parameters"),
            ("reboot", b"{}", "no such command"),
            ("", b"{}", "no such command"),
        ] {
            let problem = parse(name, body).expect_err(name);
            assert!(problem.error.contains(part), "{name} {body:?}: {}", problem.error);
            assert!(!problem.help.is_empty());
        }
        let huge = [b'['; MAX_BODY_BYTES + 1];
        assert!(parse("start", &huge).is_err_and(|problem| problem.error.contains("4097 bytes")));
        let long = "x".repeat(5000);
        let reply = rejection(&long, &parse(&long, b"").expect_err("none")).to_string();
        assert!(reply.len() < 200, "{reply}");
    }

    #[test]
    fn retained_and_repeated_are_rejected() {
        let received = |is_retained, is_repeated| ReceivedCommand {
            name: "start",
            body: b"{}",
            is_retained,
            is_repeated,
        };
        assert!(Command::parse(&received(true, false)).is_err_and(|p| p.help.contains("retain")));
        assert!(
            Command::parse(&received(false, true)).is_err_and(|p| p.error.contains("repetition"))
        );
    }
}
