//! Messages in flight: log records in order, from reading to acknowledgement.
//!
//! Pure: the caller passes records, connections, acknowledgements and the time of any monotonic
//! clock, and gets the messages to send and the log positions to checkpoint. A position is
//! checkpointed once everything before it is acknowledged, so after a crash records may be sent
//! twice but none is lost.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use bytes::Bytes;

use super::topics::MessageKind;

/// Maximum number of unacknowledged messages in flight.
pub const MAX_IN_FLIGHT: usize = 256;
/// Overhead per message in the memory limit, bytes.
const OVERHEAD_BYTES: usize = 128;
/// Number of acknowledgements after which a checkpoint is due.
const CHECKPOINT_RECORDS: u64 = 1000;
/// Time from the first acknowledgement after which a checkpoint is due.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(2);

/// Position after a line of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogPosition {
    /// File name of the log in its folder.
    pub file: Arc<str>,
    /// Offset in bytes.
    pub bytes: u64,
}

/// Message with a record for the broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordMessage {
    /// Kind of the record, which selects the topic.
    pub kind: MessageKind,
    /// Line of the log, without newline.
    pub payload: Bytes,
}

/// Line read from the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogLine {
    /// Message to send; `None` if the line is not a valid record.
    pub message: Option<RecordMessage>,
    /// Position after the line.
    pub after: LogPosition,
}

/// Queue of records read from the log and not yet acknowledged by the broker.
#[derive(Debug)]
pub struct InFlightQueue {
    max_bytes: usize,
    entries: VecDeque<Entry>,
    /// Sequence number of the first entry.
    first: u64,
    /// Number of entries sent on the current connection.
    sent: usize,
    bytes: usize,
    /// Position up to which everything is acknowledged.
    place: LogPosition,
    acknowledged: u64,
    passed_over: u64,
    left_out: u64,
    /// `true` if `place` has moved since the last checkpoint.
    moved: bool,
    uncheckpointed: u64,
    /// Time of the first acknowledgement since the last checkpoint.
    since: Option<Duration>,
}

#[derive(Debug)]
struct Entry {
    message: Option<RecordMessage>,
    after: LogPosition,
    is_done: bool,
}

impl Entry {
    fn bytes(&self) -> usize {
        OVERHEAD_BYTES + self.message.as_ref().map_or(0, |message| message.payload.len())
    }
}

impl InFlightQueue {
    /// Creates an empty queue; everything before `place` was acknowledged earlier.
    #[must_use]
    pub const fn new(max_bytes: usize, place: LogPosition) -> Self {
        Self {
            max_bytes,
            entries: VecDeque::new(),
            first: 0,
            sent: 0,
            bytes: 0,
            place,
            acknowledged: 0,
            passed_over: 0,
            left_out: 0,
            moved: false,
            uncheckpointed: 0,
            since: None,
        }
    }

    /// Number of bytes of records that may be added. Reading continues while any room is left, so
    /// the limit may be exceeded by one record.
    #[must_use]
    pub fn room(&self) -> usize {
        self.max_bytes.saturating_sub(self.bytes)
    }

    /// Appends the next line of the log.
    pub fn push(&mut self, read: LogLine) {
        let is_done = read.message.is_none();
        let entry = Entry { message: read.message, after: read.after, is_done };
        self.passed_over += u64::from(is_done);
        self.bytes += entry.bytes();
        self.entries.push_back(entry);
        self.remove_done();
    }

    /// Takes the next record to send on this connection, with its sequence number.
    pub fn pop_next(&mut self) -> Option<(u64, RecordMessage)> {
        while self.sent < MAX_IN_FLIGHT {
            let entry = self.entries.get(self.sent)?;
            self.sent += 1;
            if let Some(message) = entry.message.as_ref().filter(|_| !entry.is_done) {
                return Some((self.first + self.sent as u64 - 1, message.clone()));
            }
        }
        None
    }

    /// Marks a record as acknowledged. Duplicate and unknown sequence numbers are ignored.
    pub fn acknowledge(&mut self, number: u64, now: Duration) {
        let at = number.checked_sub(self.first).and_then(|at| usize::try_from(at).ok());
        let Some(entry) = at.filter(|at| *at < self.sent).and_then(|at| self.entries.get_mut(at))
        else {
            return;
        };
        if !std::mem::replace(&mut entry.is_done, true) {
            self.acknowledged += 1;
            self.uncheckpointed += 1;
            self.since.get_or_insert(now);
        }
        self.remove_done();
    }

    /// Drops a record that the broker rejects. Returns the position after the record.
    pub fn reject(&mut self, number: u64, now: Duration) -> Option<LogPosition> {
        let at = usize::try_from(number.checked_sub(self.first)?).ok()?;
        let entry = self.entries.get_mut(at).filter(|entry| !entry.is_done)?;
        entry.is_done = true;
        let after = entry.after.clone();
        self.left_out += 1;
        self.uncheckpointed += 1;
        self.since.get_or_insert(now);
        self.remove_done();
        Some(after)
    }

    /// Ends the connection: unacknowledged records will be sent again.
    pub const fn disconnect(&mut self) {
        self.sent = 0;
    }

    /// Position to checkpoint, if a checkpoint is due.
    #[must_use]
    pub fn due_checkpoint(&self, now: Duration) -> Option<&LogPosition> {
        let is_old = self.since.is_some_and(|since| now >= since + CHECKPOINT_INTERVAL);
        let is_far = self.uncheckpointed >= CHECKPOINT_RECORDS;
        Some(&self.place).filter(|_| self.moved && (is_old || is_far))
    }

    /// Position to checkpoint at shutdown, unless it is the last checkpoint.
    #[must_use]
    pub fn final_checkpoint(&self) -> Option<&LogPosition> {
        Some(&self.place).filter(|_| self.moved)
    }

    /// Notes a written checkpoint.
    pub fn checkpointed(&mut self, place: &LogPosition, now: Duration) {
        self.moved = self.place != *place;
        self.uncheckpointed = 0;
        self.since = self.moved.then_some(now);
    }

    /// Position up to which everything is acknowledged.
    #[must_use]
    pub const fn position(&self) -> &LogPosition {
        &self.place
    }

    /// Number of acknowledged records.
    #[must_use]
    pub const fn acknowledged(&self) -> u64 {
        self.acknowledged
    }

    /// Number of skipped lines without a valid record.
    #[must_use]
    pub const fn passed_over(&self) -> u64 {
        self.passed_over
    }

    /// Number of records dropped because the broker rejects them.
    #[must_use]
    pub const fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Number of unacknowledged records.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.entries.iter().filter(|entry| !entry.is_done).count()
    }

    /// Removes the acknowledged entries at the front and advances the position.
    fn remove_done(&mut self) {
        while self.entries.front().is_some_and(|entry| entry.is_done) {
            let Some(entry) = self.entries.pop_front() else { return };
            self.bytes -= entry.bytes();
            self.first += 1;
            self.sent = self.sent.saturating_sub(1);
            (self.place, self.moved) = (entry.after, true);
        }
    }
}

#[cfg(test)]
mod tests;
