//! Takes what a daemon has in its logs and the robot's folder lacks.

use std::time::Duration;

use jiff::{Timestamp, civil::DateTime, tz::TimeZone};
use thiserror::Error;
use tokio::{task::block_in_place, time::Instant};

use super::{
    body::Body,
    ledger::Taken,
    shelf::{Shelf, ShelfError},
    sieve::{Refusal, Sifted},
};
use crate::{
    api::LogEntry,
    client::{Client, ClientError},
    scan::Record,
};

/// Longest list of logs that is read, bytes.
const MOST_LIST_BYTES: usize = 4 << 20;
/// What of a log may be refused before it is given up, bytes.
const MOST_REFUSED_BYTES: u64 = 16 << 20;
/// After so many bytes it is remembered how far a log was taken.
const REMEMBER_BYTES: u64 = 1 << 18;
/// But no sooner than that, since it waits for the disk.
const REMEMBER_EVERY: Duration = Duration::from_millis(200);

/// Hears how it goes.
pub trait Watcher: Send + Sync {
    /// So many bytes more are to be taken.
    fn expect(&self, bytes: u64);
    /// So many of them came.
    fn came(&self, bytes: u64);
    /// A record of a robot's log is not taken.
    fn refused(&self, robot: &str, log: &str, refusal: &Refusal);
}

/// Counts of what was gathered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Logs that something was taken of.
    pub logs: u64,
    /// Scans that ended.
    pub scans: u64,
    /// Records, all in all.
    pub records: u64,
    /// Lines that were refused.
    pub refused: u64,
    /// Bytes that were looked at.
    pub bytes: u64,
}

/// The reason why not all could be gathered.
#[derive(Debug, Error)]
pub enum PullError {
    /// The daemon does not answer as it should.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// It sends nothing more.
    #[error("{0} came in part: the daemon is silent or broke off")]
    BrokenOff(String),
    /// It answers something else than it should.
    #[error("{0}")]
    Strange(String),
    /// Its logs are not those that were taken.
    #[error("{log} is not the log that was taken before: {why}")]
    OtherLog {
        /// The log.
        log: String,
        /// What differs.
        why: &'static str,
    },
    /// The folder can't be written.
    #[error(transparent)]
    Shelf(#[from] ShelfError),
}

impl PullError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Client(error) => error.help(),
            Self::BrokenOff(_) => "what came is kept; run it again".into(),
            Self::Strange(_) => "make sure that it is a sonard of this version".into(),
            Self::OtherLog { .. } => "another robot of the same name answers, or its logs were removed or changed: give each \
                 robot a name of its own (fleet.robot), or move what was gathered of this one away"
                .into(),
            Self::Shelf(error) => error.help.clone(),
        }
    }
}

/// What is to be taken.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Order {
    /// Logs that ended before are left out.
    pub(super) since: Option<Timestamp>,
    /// Then it is enough for this time.
    pub(super) until: Option<Instant>,
}

impl Order {
    fn is_enough(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }
}

/// Takes all that is new; adds it to `tally`.
///
/// # Errors
/// The first log that can't be taken whole; what came is kept, and the others are tried.
pub(super) async fn pull(
    client: &Client,
    shelf: &mut Shelf,
    order: Order,
    watcher: &dyn Watcher,
    tally: &mut Tally,
) -> Result<(), PullError> {
    let listed: Vec<LogEntry> = client.get_json_within("/v1/logs", MOST_LIST_BYTES).await?;
    let listed = checked(listed)?;
    let newest = shelf.ledger().logs.last_key_value();
    let newest = newest.map(|(name, taken)| (name.clone(), taken.clone()));
    same_robot(client, newest, &listed).await?;
    block_in_place(|| shelf.confirm())?;
    let lacking: Vec<_> = wanted(&listed, order.since)
        .iter()
        .filter(|log| log.bytes > shelf.taken(&log.name).bytes)
        .collect();
    let bytes = lacking.iter().map(|log| log.bytes - shelf.taken(&log.name).bytes);
    watcher.expect(bytes.fold(0, u64::saturating_add));
    let mut outcome = Ok(());
    for log in lacking {
        let one = Pull { client, shelf, log, order, watcher, tally }.run().await;
        let is_over = matches!(one, Err(PullError::Client(_) | PullError::Shelf(_)));
        if outcome.is_ok() {
            outcome = one;
        }
        if is_over || order.is_enough() {
            break;
        }
    }
    outcome
}

/// Names lead nowhere else, and each is there once.
fn checked(mut listed: Vec<LogEntry>) -> Result<Vec<LogEntry>, PullError> {
    listed.sort_by(|a, b| a.name.cmp(&b.name));
    let is_twice = listed.windows(2).any(|two| two[0].name == two[1].name);
    let bad = listed.iter().find(|log| time_of(&log.name).is_none());
    match bad {
        _ if is_twice => Err(PullError::Strange("it lists a log twice".into())),
        Some(bad) => Err(PullError::Strange(format!("it lists a log {:.80?}", bad.name))),
        None => Ok(listed),
    }
}

/// When a log was begun, by its name; `None` if no log has such a name.
fn time_of(name: &str) -> Option<Timestamp> {
    let stem = name.strip_prefix("sonard-")?.strip_suffix(".jsonl")?;
    let (time, number) = stem.split_once('_').unwrap_or((stem, "0"));
    let is_plain = number.len() <= 10 && number.bytes().all(|byte| byte.is_ascii_digit());
    let time = DateTime::strptime("%Y%m%dT%H%M%SZ", time).ok().filter(|_| is_plain)?;
    time.to_zoned(TimeZone::UTC).ok().map(|time| time.timestamp())
}

/// The logs that were not followed by another before that time.
fn wanted(listed: &[LogEntry], since: Option<Timestamp>) -> &[LogEntry] {
    let Some(since) = since else { return listed };
    let begun = listed.iter().map(|log| time_of(&log.name));
    let before = begun.take_while(|time| time.is_some_and(|time| time <= since)).count();
    &listed[before.saturating_sub(1)..]
}

/// The newest log that was taken has to be there still, and as it was.
async fn same_robot(
    client: &Client,
    newest: Option<(String, Taken)>,
    listed: &[LogEntry],
) -> Result<(), PullError> {
    let Some((name, taken)) = newest else { return Ok(()) };
    let other = |why| PullError::OtherLog { log: name.clone(), why };
    let log = listed.iter().find(|log| log.name == name).ok_or_else(|| other("it is gone"))?;
    if log.bytes < taken.bytes {
        return Err(other("it is shorter"));
    }
    if taken.bytes > 0 {
        let mut body = Body::of(client, &name, taken.bytes, taken.bytes).await?;
        body.before(&name, taken.bytes, &taken.sha256).await?;
    }
    Ok(())
}

/// A log that is taken.
struct Pull<'a> {
    client: &'a Client,
    shelf: &'a mut Shelf,
    log: &'a LogEntry,
    order: Order,
    watcher: &'a dyn Watcher,
    tally: &'a mut Tally,
}

impl Pull<'_> {
    async fn run(mut self) -> Result<(), PullError> {
        let name = &self.log.name;
        block_in_place(|| self.shelf.take_on(name))?;
        let taken = self.shelf.taken(name);
        let mut body = Body::of(self.client, name, taken.bytes, self.log.bytes).await?;
        let last = body.before(name, taken.bytes, &taken.sha256).await?;
        if let Some(log) = self.shelf.log() {
            log.sieve.go_on(taken.bytes, &last);
        }
        self.tally.logs += 1;
        let taking = self.take(body).await;
        let kept = block_in_place(|| self.shelf.keep());
        taking.and(Ok(kept?))
    }

    async fn take(&mut self, mut body: Body) -> Result<(), PullError> {
        let (mut waiting, mut kept) = (0, Instant::now());
        while let Some(bytes) = body.next(&self.log.name).await? {
            let count = bytes.len() as u64;
            self.tally.bytes += count;
            self.watcher.came(count);
            waiting += count;
            block_in_place(|| self.sift(&bytes))?;
            if self.order.is_enough() {
                return Ok(());
            }
            if waiting >= REMEMBER_BYTES && kept.elapsed() >= REMEMBER_EVERY {
                block_in_place(|| self.shelf.keep())?;
                (waiting, kept) = (0, Instant::now());
            }
        }
        Ok(())
    }

    fn sift(&mut self, bytes: &[u8]) -> Result<(), PullError> {
        let name = &self.log.name;
        if let Some(log) = self.shelf.log() {
            log.sieve.push(bytes);
        }
        while let Some(line) = self.shelf.log().and_then(|log| log.sieve.next_line()) {
            match line {
                Sifted::Record(record, line) => {
                    self.shelf.put(&record, &line)?;
                    self.tally.records += 1;
                    self.tally.scans += u64::from(matches!(*record, Record::ScanEnd(_)));
                }
                Sifted::Refused(refusal) => {
                    self.tally.refused += 1;
                    self.watcher.refused(self.shelf.robot(), name, &refusal);
                }
            }
        }
        let refused = self.shelf.log().map_or(0, |log| log.sieve.refused_bytes());
        if refused > MOST_REFUSED_BYTES {
            let why = format!("{name}: more than {MOST_REFUSED_BYTES} bytes of it are no records");
            return Err(PullError::Strange(why));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(name: &str) -> LogEntry {
        LogEntry { name: name.into(), bytes: 1, current: false }
    }

    #[test]
    fn names_that_lead_elsewhere_or_stand_twice_are_refused() {
        let good = ["sonard-20260102T000000Z.jsonl", "sonard-20260102T000000Z_000001.jsonl"];
        assert!(checked(good.map(log).into()).is_ok());
        for bad in [
            "../x.jsonl",
            "sonard-../../x.jsonl",
            "sonard-.jsonl",
            "sonard-20260102T000000Z_/.jsonl",
            "",
        ] {
            assert!(checked(vec![log(bad)]).is_err(), "{bad:?}");
        }
        assert!(checked(vec![log(good[0]), log(good[0])]).is_err());
    }

    #[test]
    fn logs_that_ended_before_are_left_out() {
        let logs = [
            "sonard-20260101T000000Z.jsonl",
            "sonard-20260102T000000Z.jsonl",
            "sonard-20260103T000000Z.jsonl",
        ]
        .map(log);
        let names = |since: &str| wanted(&logs, since.parse().ok()).len();
        assert_eq!(names("2025-01-01T00:00:00Z"), 3);
        assert_eq!(
            names("2026-01-01T12:00:00Z"),
            3,
            "the first was written up to the second's beginning"
        );
        assert_eq!(names("2026-01-02T00:00:00Z"), 2);
        assert_eq!(names("2027-01-01T00:00:00Z"), 1, "the newest is still written");
    }
}
