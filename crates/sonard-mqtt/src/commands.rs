//! Commands that come through the broker: read and checked as the HTTP API does, carried out one after the other.

use std::collections::VecDeque;

use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sonard_api::{Problem, ScanRequest, Strict, has_list};
use sonard_daemon::{Handle, Order, Refusal};
use tokio::task::JoinHandle;

/// Commands that may wait while one is carried out.
const MOST_WAITING: usize = 8;
/// Longest body, bytes.
const MOST_BODY_BYTES: usize = 4096;
/// So much of a command's name is said again, characters.
const MOST_NAME: usize = 32;

/// What was published as a command.
#[derive(Debug, Clone)]
pub(super) struct Asked<'a> {
    /// Its name: what the topic ends in.
    pub(super) name: &'a str,
    /// Its body.
    pub(super) body: &'a [u8],
    /// Whether the broker kept it for who comes later.
    pub(super) is_retained: bool,
    /// Whether it may have come before.
    pub(super) is_repeated: bool,
}

#[derive(Debug, Clone, PartialEq)]
enum Command {
    Start(ScanRequest),
    Stop,
}

impl Command {
    fn read(asked: &Asked<'_>) -> Result<Self, Problem> {
        if asked.is_retained {
            let help =
                "publish it without the retain flag, and clear the topic (mosquitto_pub -r -n)";
            return Err(problem("a retained command would be carried out again and again", help));
        }
        if asked.is_repeated {
            return Err(problem(
                "it is a repetition, and may be carried out already",
                "send it anew",
            ));
        }
        if asked.body.len() > MOST_BODY_BYTES {
            let error = format!("the body has {} bytes", asked.body.len());
            return Err(problem(&error, &format!("send at most {MOST_BODY_BYTES}")));
        }
        match asked.name {
            "start" => read_body(asked.body).map(Self::Start),
            "stop" if matches!(asked.body, b"" | b"{}") => Ok(Self::Stop),
            "stop" => Err(problem("stop takes nothing", "send an empty message, or {}")),
            _ => Err(problem("there is no such command", "start or stop")),
        }
    }

    const fn name(&self) -> &'static str {
        match self {
            Self::Start(_) => "start",
            Self::Stop => "stop",
        }
    }

    async fn carry_out(self, daemon: Handle) -> Result<Value, Problem> {
        let name = self.name();
        let done = match self {
            Self::Start(asked) => daemon.start(asked).await.map(|started| Some(started.request)),
            Self::Stop => daemon.order(Order::Stop).await.map(|()| None),
        };
        match done {
            Ok(Some(request)) => Ok(json!({"command": name, "accepted": true, "request": request})),
            Ok(None) => Ok(json!({"command": name, "accepted": true})),
            Err(Refusal { message, help, .. }) => Err(problem(&message, &help)),
        }
    }
}

fn read_body<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let help = "send JSON as of POST /v1/start: {} or {\"scans\": 1}";
    let Strict(read) = serde_json::from_slice(body)
        .map_err(|error| problem(&format!("the body can't be read: {error}"), help))?;
    if serde_json::from_slice(body).is_ok_and(|value| has_list(&value)) {
        return Err(problem("there is a list where an object is wanted", help));
    }
    Ok(read)
}

fn problem(error: &str, help: &str) -> Problem {
    Problem { error: error.into(), help: help.into() }
}

/// What is said of a command that is refused.
fn refused(name: &str, problem: &Problem) -> Value {
    let name: String = name.chars().take(MOST_NAME).collect();
    json!({"command": name, "accepted": false, "error": problem.error, "help": problem.help})
}

/// Who carries commands out, in the order that they came in.
#[derive(Debug)]
pub(super) struct Clerk {
    daemon: Handle,
    waiting: VecDeque<Command>,
    at_work: Option<(&'static str, JoinHandle<Result<Value, Problem>>)>,
}

impl Clerk {
    pub(super) const fn new(daemon: Handle) -> Self {
        Self { daemon, waiting: VecDeque::new(), at_work: None }
    }

    /// Takes a command in.
    ///
    /// # Errors
    /// What is answered at once, because it is refused.
    pub(super) fn take(&mut self, asked: &Asked<'_>) -> Result<(), Value> {
        let command = Command::read(asked).map_err(|problem| refused(asked.name, &problem))?;
        if self.waiting.len() >= MOST_WAITING {
            let many = problem("too many commands wait already", "wait for answers");
            return Err(refused(asked.name, &many));
        }
        tracing::info!("mqtt: {} is asked for", command.name());
        self.waiting.push_back(command);
        self.begin();
        Ok(())
    }

    /// The answer to the next command that is done, and whether it was taken; never, if there is none. Cancel-safe.
    pub(super) async fn next(&mut self) -> (Value, bool) {
        let Some((name, work)) = &mut self.at_work else { return std::future::pending().await };
        let done = work.await;
        let name = *name;
        self.at_work = None;
        self.begin();
        match done {
            Ok(Ok(answer)) => (answer, true),
            Ok(Err(problem)) => (refused(name, &problem), false),
            Err(_) => (refused(name, &problem("it failed", "see what the daemon says")), false),
        }
    }

    fn begin(&mut self) {
        if self.at_work.is_none()
            && let Some(command) = self.waiting.pop_front()
        {
            let name = command.name();
            #[allow(
                clippy::disallowed_methods,
                reason = "its end is awaited as the command's outcome"
            )]
            let work = tokio::spawn(command.carry_out(self.daemon.clone()));
            self.at_work = Some((name, work));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, body: &[u8]) -> Result<Command, Problem> {
        Command::read(&Asked { name, body, is_retained: false, is_repeated: false })
    }

    #[test]
    fn commands_are_read_as_the_api_reads_them() {
        let right = |name, body| read(name, body).map_err(|problem| problem.error);
        assert_eq!(right("start", b"{}"), Ok(Command::Start(ScanRequest::default())));
        let two = ScanRequest { scans: Some(2), ..ScanRequest::default() };
        assert_eq!(right("start", b" {\"scans\": 2}\n"), Ok(Command::Start(two)));
        assert_eq!(right("stop", b""), Ok(Command::Stop));
        assert_eq!(right("stop", b"{}"), Ok(Command::Stop));
    }

    #[test]
    fn what_is_no_command_is_refused_with_what_would_be_right() {
        for (name, body, told) in [
            ("start", &b""[..], "can't be read"),
            ("start", b"now", "can't be read"),
            ("start", b"\xff\xfe", "can't be read"),
            ("start", b"{\"scan\": 1}", "unknown field"),
            ("start", b"{\"scans\": -1}", "can't be read"),
            ("start", b"{\"plan\": {\"from_deg\": 0}}", "missing field"),
            ("start", b"[1]", "list"),
            ("stop", b"{\"now\": true}", "takes nothing"),
            ("reboot", b"{}", "no such command"),
            ("", b"{}", "no such command"),
        ] {
            let refused = read(name, body).expect_err(name);
            assert!(refused.error.contains(told), "{name} {body:?}: {}", refused.error);
            assert!(!refused.help.is_empty());
        }
        let huge = [b'['; MOST_BODY_BYTES + 1];
        assert!(read("start", &huge).is_err_and(|refused| refused.error.contains("4097 bytes")));
        let long = "x".repeat(5000);
        let said = refused(&long, &read(&long, b"").expect_err("none")).to_string();
        assert!(said.len() < 200, "{said}");
    }

    #[test]
    fn kept_and_repeated_commands_are_not_carried_out() {
        let asked = |is_retained, is_repeated| Asked {
            name: "start",
            body: b"{}",
            is_retained,
            is_repeated,
        };
        assert!(Command::read(&asked(true, false)).is_err_and(|p| p.help.contains("retain")));
        assert!(Command::read(&asked(false, true)).is_err_and(|p| p.error.contains("repetition")));
    }
}
