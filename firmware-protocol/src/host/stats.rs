//! Numbers about the link.

use crate::frame::LinkCounters;

/// Counts of the link since the host machine was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStats {
    /// Bytes handed out for sending.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// Frames handed out for sending, with those sent again.
    pub frames_sent: u64,
    /// Frames received whose CRC was right.
    pub frames_received: u64,
    /// Requests sent again because no reply came in time.
    pub retries: u64,
    /// Readings delivered.
    pub readings: u64,
    /// Readings that were lost at first.
    pub repaired: u64,
    /// Readings that came more than once.
    pub duplicates: u64,
    /// Readings, and identities or answers, that made no sense and were refused.
    pub refused: u64,
    /// What was dropped on receiving.
    pub dropped: LinkCounters,
}
