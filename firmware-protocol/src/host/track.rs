//! Which beams of a sweep have come in.

use super::config::{KEEP_ALIVES_A_LEASE, READINGS_AHEAD};
use super::firings::Firings;
use super::{HostError, ReplyFault};
use crate::messages::{Reading, Sweep};

/// Readings that may be known out of order, at most: more than the device can keep.
const WINDOW: u16 = READINGS_AHEAD as u16;
const _: () = assert!(READINGS_AHEAD as u32 == u64::BITS);

/// The sweep under way, as the host sees it.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) plan: Sweep,
    pub(super) beams: u16,
    pub(super) firings: Firings,
    /// Lowest index lacking.
    pub(super) next: u16,
    /// Bit `i` set: `next + i` is there.
    seen: u64,
    pub(super) delivered: u16,
    /// Everything below was sent by the device at least once.
    sent: u16,
    /// Beams fired, as far as known.
    pub(super) fired: u16,
    /// Readings since the device was last told what is there.
    pub(super) unacknowledged: u16,
    /// Tell it after so many.
    pub(super) acknowledge_after: u16,
    pub(super) lease_us: u64,
    pub(super) keep_alive_at_us: u64,
    pub(super) progress_at_us: u64,
    /// Answers in a row without anything new.
    pub(super) stalls: u8,
    /// Something new since the last answer.
    pub(super) moved_on: bool,
}

/// What a reading is to the sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reception {
    /// Not seen before.
    New {
        /// Whether it was lost at first.
        repaired: bool,
    },
    /// There already.
    Duplicate,
    /// Too far ahead to remember; the device will send it again.
    Beyond,
}

impl Track {
    pub(super) fn new(
        plan: Sweep,
        beams: u16,
        firings: Firings,
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
            moved_on: true,
        }
    }

    /// Checks a reading against the plan and tells its place. Changes nothing.
    pub(super) fn place(&self, reading: &Reading) -> Result<Reception, HostError> {
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

    /// Marks beam `index` as done with.
    pub(super) fn settle(&mut self, index: u16) {
        self.seen |= 1_u64.checked_shl(u32::from(index.wrapping_sub(self.next))).unwrap_or(0);
        let complete = self.seen.trailing_ones();
        self.seen = self.seen.checked_shr(complete).unwrap_or(0);
        self.next = self.next.saturating_add(u16::try_from(complete).unwrap_or(0));
        self.unacknowledged = self.unacknowledged.saturating_add(1);
        self.learn(index.saturating_add(1), index.saturating_add(1));
        self.progress();
    }

    /// Checks what the device tells of its progress.
    pub(super) fn check(&self, sent: u16, fired: u16, complete: bool) -> Result<(), HostError> {
        let beams = self.beams;
        if sent <= fired && fired <= beams && (!complete || fired == beams) {
            return Ok(());
        }
        Err(HostError::SenselessReply(ReplyFault::Progress { fired, sent, beams }))
    }

    /// The device has sent everything below `sent` and fired `fired` beams.
    pub(super) fn learn(&mut self, sent: u16, fired: u16) {
        self.sent = self.sent.max(sent.min(self.beams));
        if fired > self.fired {
            self.fired = fired.min(self.beams);
            self.progress();
        }
    }

    fn progress(&mut self) {
        self.stalls = 0;
        self.moved_on = true;
    }

    /// The first beams that were sent but are not there: index of the first, and how many.
    pub(super) fn missing(&self) -> Option<(u16, u8)> {
        let known = self.sent.checked_sub(self.next).filter(|&known| known > 0)?;
        let hole = self.seen.trailing_zeros();
        let count = u32::from(known.min(WINDOW)).min(hole);
        Some((self.next, u8::try_from(count).unwrap_or(u8::MAX)))
    }

    pub(super) const fn is_complete(&self) -> bool {
        self.next == self.beams
    }

    /// A frame goes out, which renews the lease.
    pub(super) fn frame_sent(&mut self, now_us: u64) {
        self.keep_alive_at_us = now_us + self.lease_us / u64::from(KEEP_ALIVES_A_LEASE);
        self.unacknowledged = 0;
    }
}
