//! `sonard watch` of several daemons: lines of all, each with its robot.

use std::io::{self, Write as _};

use tokio::{sync::mpsc, task::JoinSet, time::sleep};

use super::{RECONNECT, words};
use crate::{
    api::FleetState,
    cli::{Failure, Outcome},
    client::ClientError,
    fleet::{Asked, ask, judge, plain},
};

/// Longest line that is taken of a daemon, bytes: a whole scan is one.
const MOST_LINE_BYTES: usize = 16 << 20;
/// Lines that may wait to be written.
const WAITING: usize = 64;

/// What there is to write.
enum Line {
    /// A record of a robot's stream.
    Record(String, Vec<u8>),
    /// What became of a stream, for people.
    News(String),
}

/// Follows all of them until nobody reads what is written.
pub(super) async fn watch(daemons: Vec<Asked>, path: &str, json: bool) -> Outcome {
    let (send, mut lines) = mpsc::channel(WAITING);
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
            Line::Record(robot, line) if json => of_robot(&robot, &line),
            Line::Record(robot, line) => for_people(&robot, &line).into_bytes(),
        };
        let mut out = io::stdout().lock();
        if let Err(error) = out.write_all(&text).and_then(|()| out.flush()) {
            return Failure::from_write("to standard output", &error);
        }
    }
    Ok(())
}

/// A record beside its robot's name, which has nothing to escape.
fn of_robot(robot: &str, record: &[u8]) -> Vec<u8> {
    let record = record.trim_ascii_end();
    [b"{\"robot\":\"", robot.as_bytes(), b"\",\"record\":", record, b"}\n"].concat()
}

/// A record as a line for a person; what a robot says steers no terminal.
fn for_people(robot: &str, record: &[u8]) -> String {
    let said = words(record);
    let shown = |letter: char| if letter.is_control() { '\u{fffd}' } else { letter };
    let said: String = said.trim_end().chars().map(shown).collect();
    format!("{robot:<12} {said}\n")
}

/// Follows one daemon for ever; whatever breaks is told once, and tried again.
async fn follow(one: Asked, path: String, send: mpsc::Sender<Line>) {
    let mut expected = one.member.robot.clone();
    let mut told = String::new();
    let mut backoff = RECONNECT;
    loop {
        let address = one.member.address();
        let seen = judge(expected.as_deref(), ask(&one.client).await);
        let why = match seen.told {
            Some(answer) if matches!(seen.state, FleetState::Well | FleetState::NotWell) => {
                let robot = expected.get_or_insert(answer.status.robot).clone();
                let came = format!("{robot} answers at {address}");
                if !tell(&send, &mut told, came).await {
                    return;
                }
                backoff.reset();
                match stream(&one, &path, &robot, &send).await {
                    Some(why) => format!("{robot}: {why}"),
                    None => return,
                }
            }
            _ => format!("{}: {}", expected.as_deref().unwrap_or(&address), seen.wrong.join("; ")),
        };
        if !tell(&send, &mut told, format!("{why}: waiting for it")).await {
            return;
        }
        sleep(backoff.next_wait()).await;
    }
}

/// Says it, unless it was said last; whether anybody listens.
async fn tell(send: &mpsc::Sender<Line>, told: &mut String, news: String) -> bool {
    if *told == news {
        return !send.is_closed();
    }
    told.clone_from(&news);
    send.send(Line::News(news)).await.is_ok()
}

/// Takes lines until the stream is over; why, or `None` if nobody wants more.
async fn stream(one: &Asked, path: &str, robot: &str, send: &mpsc::Sender<Line>) -> Option<String> {
    let lines = match one.client.live(path).await {
        Ok(lines) => lines,
        Err(error) => return Some(plain(&error.to_string())),
    };
    let mut lines = lines.with_max_line_bytes(MOST_LINE_BYTES);
    loop {
        let line = match lines.next().await {
            Ok(Some(line)) => line,
            Ok(None) => return Some("it ended the stream".into()),
            Err(ClientError::Http(error)) => return Some(plain(&format!("it broke off: {error}"))),
            Err(error) => return Some(plain(&error.to_string())),
        };
        // A program that is no daemon could say anything, also to a terminal.
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
    fn a_record_stands_whole_beside_its_robot() {
        let line = of_robot("kiwi", b"{\"type\":\"ping\"}\n");
        assert_eq!(for_people("kiwi", b"\"a\x1b[2J\""), "kiwi         \"a\u{fffd}[2J\"\n");
        assert_eq!(line, b"{\"robot\":\"kiwi\",\"record\":{\"type\":\"ping\"}}\n");
    }
}
