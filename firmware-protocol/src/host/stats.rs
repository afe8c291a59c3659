//! Statistics of the link.

use crate::frame::LinkCounters;

/// Counters of the link since the creation of the host machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStats {
    /// Bytes handed out for sending.
    pub bytes_sent: u64,
    /// Bytes received, valid or not.
    pub bytes_received: u64,
    /// Frames handed out for sending, including repetitions.
    pub frames_sent: u64,
    /// Frames received with a valid CRC.
    pub frames_received: u64,
    /// Requests repeated because no reply arrived in time.
    pub retries: u64,
    /// Readings delivered as events.
    pub readings: u64,
    /// Readings that were lost at first and sent again.
    pub repaired: u64,
    /// Readings received more than once.
    pub duplicates: u64,
    /// Invalid readings, identities and replies.
    pub rejected: u64,
    /// Frames dropped on reception.
    pub dropped: LinkCounters,
}
