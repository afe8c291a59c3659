//! What is on its way to the broker: records of the log in their order, until they are acknowledged.
//!
//! Pure: it is told of records, connections, acknowledgements and the time (any clock that does not jump), and
//! says what to send and which place in the log is to be remembered. A place is remembered once everything before
//! it is acknowledged, so what a crash forgets is sent again and nothing is left out.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use bytes::Bytes;

use super::topics::Kind;

/// Messages under way that are not acknowledged, at most.
pub const MOST_UNDER_WAY: usize = 256;
/// What a message is counted for beside its payload, bytes.
const BESIDE_BYTES: usize = 128;
/// The place is remembered after so many acknowledgements,
const REMEMBERED_RECORDS: u64 = 1000;
/// or so long after the first of them.
const REMEMBERED_AFTER: Duration = Duration::from_secs(2);

/// Behind a line of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogPosition {
    /// The log's name in its folder.
    pub file: Arc<str>,
    /// So many bytes of it are behind.
    pub bytes: u64,
}

/// A record for the broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// What it is.
    pub kind: Kind,
    /// The record as it stands in the log.
    pub payload: Bytes,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Read {
    /// The record; `None` if there is none on it that could be sent.
    pub message: Option<Message>,
    /// The place behind it.
    pub after: LogPosition,
}

/// The records between the log and the broker, as the head of this file describes them.
#[derive(Debug)]
pub struct Window {
    most_bytes: usize,
    entries: VecDeque<Entry>,
    /// Number of the first of `entries`.
    first: u64,
    /// How many of them were given out on this connection.
    given: usize,
    bytes: usize,
    /// Everything before it is acknowledged.
    place: LogPosition,
    acknowledged: u64,
    passed_over: u64,
    left_out: u64,
    /// What of it is to be remembered still, and since when.
    moved: bool,
    unremembered: u64,
    since: Option<Duration>,
}

#[derive(Debug)]
struct Entry {
    message: Option<Message>,
    after: LogPosition,
    is_done: bool,
}

impl Entry {
    fn bytes(&self) -> usize {
        BESIDE_BYTES + self.message.as_ref().map_or(0, |message| message.payload.len())
    }
}

impl Window {
    /// Nothing under way; everything before `place` was acknowledged earlier.
    #[must_use]
    pub const fn new(most_bytes: usize, place: LogPosition) -> Self {
        Self {
            most_bytes,
            entries: VecDeque::new(),
            first: 0,
            given: 0,
            bytes: 0,
            place,
            acknowledged: 0,
            passed_over: 0,
            left_out: 0,
            moved: false,
            unremembered: 0,
            since: None,
        }
    }

    /// How many bytes of records may be put in: records are read as long as there is any room, so one more
    /// may be under way than fits.
    #[must_use]
    pub fn room(&self) -> usize {
        self.most_bytes.saturating_sub(self.bytes)
    }

    /// Takes in the next line of the log.
    pub fn put(&mut self, read: Read) {
        let is_done = read.message.is_none();
        let entry = Entry { message: read.message, after: read.after, is_done };
        self.passed_over += u64::from(is_done);
        self.bytes += entry.bytes();
        self.entries.push_back(entry);
        self.move_on();
    }

    /// The next record to send on this connection, with the number that it is acknowledged by.
    pub fn give(&mut self) -> Option<(u64, Message)> {
        while self.given < MOST_UNDER_WAY {
            let entry = self.entries.get(self.given)?;
            self.given += 1;
            if let Some(message) = entry.message.as_ref().filter(|_| !entry.is_done) {
                return Some((self.first + self.given as u64 - 1, message.clone()));
            }
        }
        None
    }

    /// The broker has this one. What it has twice or never got counts for nothing.
    pub fn acknowledge(&mut self, number: u64, now: Duration) {
        let at = number.checked_sub(self.first).and_then(|at| usize::try_from(at).ok());
        let Some(entry) = at.filter(|at| *at < self.given).and_then(|at| self.entries.get_mut(at))
        else {
            return;
        };
        if !std::mem::replace(&mut entry.is_done, true) {
            self.acknowledged += 1;
            self.unremembered += 1;
            self.since.get_or_insert(now);
        }
        self.move_on();
    }

    /// The broker does not take this one: it counts as done, and the place behind it is returned.
    pub fn leave_out(&mut self, number: u64, now: Duration) -> Option<LogPosition> {
        let at = usize::try_from(number.checked_sub(self.first)?).ok()?;
        let entry = self.entries.get_mut(at).filter(|entry| !entry.is_done)?;
        entry.is_done = true;
        let after = entry.after.clone();
        self.left_out += 1;
        self.unremembered += 1;
        self.since.get_or_insert(now);
        self.move_on();
        Some(after)
    }

    /// The connection is over: what is not acknowledged is given out again.
    pub const fn disconnect(&mut self) {
        self.given = 0;
    }

    /// The place that is to be remembered now, if it is time.
    #[must_use]
    pub fn due(&self, now: Duration) -> Option<&LogPosition> {
        let is_old = self.since.is_some_and(|since| now >= since + REMEMBERED_AFTER);
        let is_far = self.unremembered >= REMEMBERED_RECORDS;
        Some(&self.place).filter(|_| self.moved && (is_old || is_far))
    }

    /// The place that is to be remembered at the end, if it is not yet.
    #[must_use]
    pub fn last(&self) -> Option<&LogPosition> {
        Some(&self.place).filter(|_| self.moved)
    }

    /// This place is remembered.
    pub fn remembered(&mut self, place: &LogPosition, now: Duration) {
        self.moved = self.place != *place;
        self.unremembered = 0;
        self.since = self.moved.then_some(now);
    }

    /// The place that everything before is acknowledged of.
    #[must_use]
    pub const fn place(&self) -> &LogPosition {
        &self.place
    }

    /// Records that were acknowledged.
    #[must_use]
    pub const fn acknowledged(&self) -> u64 {
        self.acknowledged
    }

    /// Lines that were passed over because no record is on them.
    #[must_use]
    pub const fn passed_over(&self) -> u64 {
        self.passed_over
    }

    /// Records that the broker does not take.
    #[must_use]
    pub const fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Records under way that are not acknowledged.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.entries.iter().filter(|entry| !entry.is_done).count()
    }

    /// Moves over what is acknowledged.
    fn move_on(&mut self) {
        while self.entries.front().is_some_and(|entry| entry.is_done) {
            let Some(entry) = self.entries.pop_front() else { return };
            self.bytes -= entry.bytes();
            self.first += 1;
            self.given = self.given.saturating_sub(1);
            (self.place, self.moved) = (entry.after, true);
        }
    }
}

#[cfg(test)]
mod tests;
