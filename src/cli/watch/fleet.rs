//! `sonard watch` of several daemons: records of all, each with its robot.

use std::io::{self, Write as _};

use tokio::{sync::mpsc, task::JoinSet, time::sleep};

use super::{RECONNECT, format_record};
use crate::{
    api::FleetState,
    cli::{Failure, Outcome},
    client::ClientError,
    fleet::{PolledDaemon, observe, poll, sanitize},
};

/// Maximum length of a daemon's line, bytes; a complete scan is one line.
const MAX_LINE_BYTES: usize = 16 << 20;
/// Capacity of the channel of output lines.
const LINE_CAPACITY: usize = 64;

enum Line {
    /// Record of a robot's stream.
    Record(String, Vec<u8>),
    /// Change of a stream's state, as text.
    News(String),
}

/// Follows all daemons until the output is closed.
pub(super) async fn watch(daemons: Vec<PolledDaemon>, path: &str, json: bool) -> Outcome {
    let (send, mut lines) = mpsc::channel(LINE_CAPACITY);
    let mut following = JoinSet::new();
    for one in daemons {
        following.spawn(follow(one, path.to_owned(), send.clone()));
    }
    drop(send);
    while let Some(line) = lines.recv().await {
        let text = match line {
            Line::News(news) => {
                notice!("{news}");
                continue;
            }
            Line::Record(robot, line) if json => encode_record(&robot, &line),
            Line::Record(robot, line) => format_line(&robot, &line).into_bytes(),
        };
        let mut out = io::stdout().lock();
        if let Err(error) = out.write_all(&text).and_then(|()| out.flush()) {
            return Failure::from_write("to standard output", &error);
        }
    }
    Ok(())
}

/// Encodes a record with its robot's name, which needs no escaping.
fn encode_record(robot: &str, record: &[u8]) -> Vec<u8> {
    let record = record.trim_ascii_end();
    [b"{\"robot\":\"", robot.as_bytes(), b"\",\"record\":", record, b"}\n"].concat()
}

/// Formats a record as text, without control characters from the robot.
fn format_line(robot: &str, record: &[u8]) -> String {
    let text = format_record(record);
    let shown = |letter: char| if letter.is_control() { '\u{fffd}' } else { letter };
    let text: String = text.trim_end().chars().map(shown).collect();
    format!("{robot:<12} {text}\n")
}

/// Follows one daemon indefinitely; repeated errors are reported once.
async fn follow(one: PolledDaemon, path: String, send: mpsc::Sender<Line>) {
    let mut expected = one.member.robot.clone();
    let mut last = String::new();
    let mut backoff = RECONNECT;
    loop {
        let address = one.member.address();
        let seen = observe(expected.as_deref(), poll(&one.client).await);
        let why = match seen.report {
            Some(report) if matches!(seen.state, FleetState::Healthy | FleetState::Unhealthy) => {
                let robot = expected.get_or_insert(report.status.robot).clone();
                let connected = format!("{robot} connected at {address}");
                if !notify(&send, &mut last, connected).await {
                    return;
                }
                backoff.reset();
                match forward(&one, &path, &robot, &send).await {
                    Some(why) => format!("{robot}: {why}"),
                    None => return,
                }
            }
            _ => {
                format!("{}: {}", expected.as_deref().unwrap_or(&address), seen.problems.join("; "))
            }
        };
        if !notify(&send, &mut last, format!("{why}: reconnecting")).await {
            return;
        }
        sleep(backoff.next_wait()).await;
    }
}

/// Sends a message unless it repeats the last one; returns `false` if the receiver is closed.
async fn notify(send: &mpsc::Sender<Line>, last: &mut String, news: String) -> bool {
    if *last == news {
        return !send.is_closed();
    }
    last.clone_from(&news);
    send.send(Line::News(news)).await.is_ok()
}

/// Forwards lines until the stream ends; returns the reason, or `None` if the receiver is closed.
async fn forward(
    one: &PolledDaemon,
    path: &str,
    robot: &str,
    send: &mpsc::Sender<Line>,
) -> Option<String> {
    let lines = match one.client.live(path).await {
        Ok(lines) => lines,
        Err(error) => return Some(sanitize(&error.to_string())),
    };
    let mut lines = lines.with_max_line_bytes(MAX_LINE_BYTES);
    loop {
        let line = match lines.next().await {
            Ok(Some(line)) => line,
            Ok(None) => return Some("stream ended".into()),
            Err(ClientError::Closed(error)) => {
                return Some(sanitize(&format!("connection lost: {error}")));
            }
            Err(error) => return Some(sanitize(&error.to_string())),
        };
        // A program other than the daemon could send anything, including terminal control
        // sequences.
        if serde_json::from_slice::<serde::de::IgnoredAny>(&line).is_err() {
            continue;
        }
        send.send(Line::Record(robot.to_owned(), line)).await.ok()?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn record_with_its_robot() {
        let line = encode_record("kiwi", b"{\"type\":\"ping\"}\n");
        assert_eq!(format_line("kiwi", b"\"a\x1b[2J\""), "kiwi         \"a\u{fffd}[2J\"\n");
        assert_eq!(line, b"{\"robot\":\"kiwi\",\"record\":{\"type\":\"ping\"}}\n");
    }
}
