//! Progress of a sweep: which beams have arrived.

use super::config::{KEEP_ALIVES_PER_LEASE, READINGS_AHEAD};
use super::firings::FiringTimes;
use super::{HostError, ReplyFault};
use crate::messages::{Reading, Sweep};

/// Maximum number of readings accepted out of order: more than the device can store.
const WINDOW: u16 = READINGS_AHEAD as u16;
const _: () = assert!(READINGS_AHEAD as u32 == u64::BITS);

/// Sweep in progress, as known to the host.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) plan: Sweep,
    pub(super) beams: u16,
    pub(super) firings: FiringTimes,
    /// Lowest missing index.
    pub(super) next: u16,
    /// Bit `i` set: beam `next + i` has arrived.
    seen: u64,
    pub(super) delivered: u16,
    /// All lower beams were sent by the device at least once.
    sent: u16,
    /// Number of beams fired, as far as known.
    pub(super) fired: u16,
    /// Readings since the last acknowledgement.
    pub(super) unacknowledged: u16,
    /// Number of readings after which an acknowledgement is due.
    pub(super) acknowledge_after: u16,
    pub(super) lease_us: u64,
    pub(super) keep_alive_at_us: u64,
    pub(super) progress_at_us: u64,
    /// Consecutive replies without progress.
    pub(super) stalls: u8,
    /// `true` if there was progress since the last reply.
    pub(super) progressed: bool,
}

/// Classification of a received reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reception {
    /// Not received before.
    New {
        /// `true` if the reading was lost at first.
        repaired: bool,
    },
    /// Already received.
    Duplicate,
    /// Beyond the window; the device will send the reading again.
    Beyond,
}

impl Track {
    pub(super) fn new(
        plan: Sweep,
        beams: u16,
        firings: FiringTimes,
        acknowledge_after: u16,
        now_us: u64,
    ) -> Self {
        let lease_us = u64::from(plan.lease_ms) * 1_000;
        Self {
            plan,
            beams,
            firings,
            next: 0,
            seen: 0,
            delivered: 0,
            sent: 0,
            fired: 0,
            unacknowledged: 0,
            acknowledge_after: acknowledge_after.max(1),
            lease_us,
            keep_alive_at_us: now_us,
            progress_at_us: now_us,
            stalls: 0,
            progressed: true,
        }
    }

    /// Checks a reading against the plan and classifies it, without changing the state.
    pub(super) fn classify(&self, reading: &Reading) -> Result<Reception, HostError> {
        let index = reading.index;
        let planned = self.plan.step_of(index).filter(|_| index < self.beams);
        if planned != Some(reading.step) {
            return Err(HostError::WrongReading { index, step: reading.step, planned });
        }
        Ok(match index.checked_sub(self.next) {
            None => Reception::Duplicate,
            Some(ahead) if ahead >= WINDOW => Reception::Beyond,
            Some(ahead) if self.seen >> ahead & 1 == 1 => Reception::Duplicate,
            Some(_) => Reception::New { repaired: index < self.sent },
        })
    }

    /// Marks the beam of a reading as delivered.
    pub(super) fn deliver(&mut self, reading: &Reading) {
        self.firings.keep(reading);
        self.delivered = self.delivered.saturating_add(1);
        self.settle(reading.index);
    }

    /// Marks beam `index` as settled: delivered or rejected.
    pub(super) fn settle(&mut self, index: u16) {
        self.seen |= 1_u64.checked_shl(u32::from(index.wrapping_sub(self.next))).unwrap_or(0);
        let complete = self.seen.trailing_ones();
        self.seen = self.seen.checked_shr(complete).unwrap_or(0);
        self.next = self.next.saturating_add(u16::try_from(complete).unwrap_or(0));
        self.unacknowledged = self.unacknowledged.saturating_add(1);
        self.update(index.saturating_add(1), index.saturating_add(1));
        self.mark_progress();
    }

    /// Checks the progress reported by the device.
    pub(super) fn check(&self, sent: u16, fired: u16, complete: bool) -> Result<(), HostError> {
        let beams = self.beams;
        if sent <= fired && fired <= beams && (!complete || fired == beams) {
            return Ok(());
        }
        Err(HostError::InvalidReply(ReplyFault::Progress { fired, sent, beams }))
    }

    /// Records that the device has sent all beams below `sent` and fired `fired` beams.
    pub(super) fn update(&mut self, sent: u16, fired: u16) {
        self.sent = self.sent.max(sent.min(self.beams));
        if fired > self.fired {
            self.fired = fired.min(self.beams);
            self.mark_progress();
        }
    }

    fn mark_progress(&mut self) {
        self.stalls = 0;
        self.progressed = true;
    }

    /// First gap in the beams sent so far: lowest index and number of beams.
    pub(super) fn missing(&self) -> Option<(u16, u8)> {
        let known = self.sent.checked_sub(self.next).filter(|&known| known > 0)?;
        let hole = self.seen.trailing_zeros();
        let count = u32::from(known.min(WINDOW)).min(hole);
        Some((self.next, u8::try_from(count).unwrap_or(u8::MAX)))
    }

    pub(super) const fn is_complete(&self) -> bool {
        self.next == self.beams
    }

    /// Records the transmission of a frame, which renews the lease.
    pub(super) fn frame_sent(&mut self, now_us: u64) {
        self.keep_alive_at_us = now_us + self.lease_us / u64::from(KEEP_ALIVES_PER_LEASE);
        self.unacknowledged = 0;
    }
}
