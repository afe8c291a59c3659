//! Keeping a sweep alive and its readings whole.

use super::deadline::{beam_us, longest_frame_us, slew_us};
use super::track::{Place, Track};
use super::{Command, Host, HostError, HostEvent, StartError};
use crate::messages::limits::readings_in;
use crate::messages::{Alive, Reading, Request, Sweep, SweepDone, SweepState};

impl Host {
    pub(super) fn start_sweep(&mut self, now_us: u64, plan: Sweep) -> Result<(), StartError> {
        let beams = plan.beams().ok_or(StartError::EmptySweep)?;
        let settings = self.settings.as_ref().ok_or(StartError::NotConfigured)?;
        let identity = self.identity.as_ref().ok_or(StartError::NotIdentified)?;
        let kept = readings_in(identity.ring_bytes, settings.max_echoes);
        let plan = Sweep { sweep: self.numbers.next_sweep(), ..plan };
        self.job = Some(Command::Sweep(plan));
        self.received_before = (self.stats.bytes_received, self.stats.frames_received);
        self.track = Some(Track::new(plan, beams, kept / 4, now_us));
        self.send(now_us, Request::Sweep(plan));
        self.expect_progress(now_us);
        Ok(())
    }

    /// A reading of a sweep came in.
    pub(super) fn handle_beam(&mut self, now_us: u64, reading: &Reading) {
        let Some(track) = self.track.as_ref().filter(|track| track.plan.sweep == reading.sweep)
        else {
            self.stats.duplicates += 1;
            return;
        };
        match track.place(reading) {
            Err(error) => self.fail(error),
            Ok(Place::Duplicate) => self.stats.duplicates += 1,
            Ok(Place::Beyond) => {}
            Ok(Place::New { repaired }) if self.has_room_for_reading() => {
                self.deliver(now_us, reading, repaired);
            }
            Ok(Place::New { .. }) => {}
        }
    }

    fn deliver(&mut self, now_us: u64, reading: &Reading, repaired: bool) {
        if let Some(track) = &mut self.track {
            track.deliver(reading.index);
        }
        self.step = Some(reading.step);
        self.stats.readings += 1;
        self.stats.repaired += u64::from(repaired);
        self.report(HostEvent::Reading { reading: *reading, repaired });
        self.expect_progress(now_us);
        // A reading proves that the plan was accepted, whatever became of the Ack.
        if self.exchange.as_ref().is_some_and(|open| matches!(open.request, Request::Sweep(_))) {
            self.exchange = None;
        }
    }

    pub(super) fn handle_sweep_done(&mut self, now_us: u64, done: &SweepDone) {
        let Some(track) = self.track.as_mut().filter(|track| track.plan.sweep == done.sweep) else {
            return;
        };
        track.learn(done.fired, done.fired);
        if self.is_stopping() {
            return;
        }
        match end_error(done.end) {
            Some(error) => self.fail(error),
            None => self.continue_sweep(now_us),
        }
    }

    /// The answer to KeepAlive or Resend: how far the device is.
    pub(super) fn handle_alive(&mut self, now_us: u64, alive: &Alive, wire_len: u8) {
        self.time_reply(now_us, wire_len);
        self.report_clock(now_us, alive.ticks);
        self.exchange = None;
        let Some(track) = &mut self.track else { return };
        if alive.sweep != track.plan.sweep {
            return self.fail(HostError::SweepLost);
        }
        track.learn(alive.sent, alive.fired);
        if let Some(error) = end_error(alive.state) {
            return self.fail(error);
        }
        self.count_stall(now_us);
    }

    /// Answers without anything new, when something new was due, end the sweep at last.
    fn count_stall(&mut self, now_us: u64) {
        let Some(track) = &mut self.track else { return };
        let due = track.missing().is_some() || track.progress_at_us <= now_us;
        if core::mem::take(&mut track.moved_on) || !due {
            return;
        }
        track.stalls = track.stalls.saturating_add(1);
        let (stalls, fired) = (track.stalls, track.fired);
        if stalls > self.config.max_attempts {
            self.fail(HostError::Stalled { fired });
        } else {
            self.expect_progress(now_us);
        }
    }

    /// Sends what the sweep needs, once nothing else is open.
    pub(super) fn continue_sweep(&mut self, now_us: u64) {
        let Some(track) = &self.track else { return };
        if self.is_stopping() {
            return;
        }
        let sweep = track.plan.sweep;
        if track.is_complete() {
            let delivered = track.delivered;
            self.end_job();
            return self.report(HostEvent::SweepDone {
                sweep,
                delivered,
                end: SweepState::Complete,
            });
        }
        if self.exchange.is_some() {
            return;
        }
        let due = track.unacknowledged >= track.acknowledge_after
            || track.keep_alive_at_us <= now_us
            || track.progress_at_us <= now_us;
        let next = track.next;
        if let Some((first, count)) = track.missing() {
            self.send(now_us, Request::Resend { sweep, first, count });
        } else if due {
            self.send(now_us, Request::KeepAlive { sweep, next });
        }
    }

    /// Asks at the next occasion how far the device is.
    pub(super) fn ask_soon(&mut self, now_us: u64) {
        if let Some(track) = &mut self.track {
            track.keep_alive_at_us = now_us;
        }
    }

    /// Stop was obeyed; a sweep that was under way ends with what came in.
    pub(super) fn stopped(&mut self) {
        let track = self.track.take();
        self.step = None;
        if let Some(track) = track {
            let end = if track.is_complete() { SweepState::Complete } else { SweepState::Stopped };
            let (sweep, delivered) = (track.plan.sweep, track.delivered);
            self.report(HostEvent::SweepDone { sweep, delivered, end });
        }
        self.finish(super::Outcome::Stopped);
    }

    /// Computes when the next reading must have come in.
    fn expect_progress(&mut self, now_us: u64) {
        let (Some(track), Some(settings)) = (&self.track, &self.settings) else {
            return;
        };
        let target = track.plan.step_of(track.fired).unwrap_or(track.plan.first_step);
        let distance = match self.step {
            Some(from) => target.abs_diff(from),
            None => target.unsigned_abs(),
        };
        let margin = self.margin.us(track.stalls.saturating_add(1));
        let time = slew_us(distance, settings)
            + beam_us(settings)
            + 2 * longest_frame_us(self.config.baud)
            + margin;
        if let Some(track) = &mut self.track {
            track.progress_at_us = now_us + time;
        }
    }
}

/// What a sweep's end means to a host that did not ask for it; `None` if it is no failure.
const fn end_error(state: SweepState) -> Option<HostError> {
    match state {
        SweepState::Running | SweepState::Holding | SweepState::Complete => None,
        SweepState::None => Some(HostError::SweepLost),
        SweepState::Stopped => Some(HostError::Stopped),
        SweepState::LeaseExpired => Some(HostError::LeaseExpired),
        SweepState::EmergencyStop => Some(HostError::EmergencyStop),
        SweepState::MotionFault => Some(HostError::MotionFault),
    }
}
