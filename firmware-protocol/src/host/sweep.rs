//! Sweep supervision: keep-alive, acknowledgement and repair of lost readings.

use super::config::ACKNOWLEDGEMENTS_PER_RING;
use super::deadline::{beam_us, longest_frame_us, slew_us};
use super::firings::FiringTimes;
use super::track::{Reception, Track};
use super::validate::check_echoes;
use super::{Command, Host, HostError, HostEvent, ReadingFault, StartError};
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
        self.giving_up = None;
        self.received_before = (self.stats.bytes_received, self.stats.frames_received);
        let floor = self.device_time.floor(now_us).zip(self.step);
        let firings = FiringTimes::new(*settings, floor);
        let acknowledge_after = kept / u16::from(ACKNOWLEDGEMENTS_PER_RING);
        self.track = Some(Track::new(plan, beams, firings, acknowledge_after, now_us));
        self.send(now_us, Request::Sweep(plan));
        self.expect_progress(now_us);
        Ok(())
    }

    /// Handles a reading of a sweep.
    pub(super) fn handle_beam(&mut self, now_us: u64, reading: &Reading) {
        let Some(track) = self.track.as_ref().filter(|track| track.plan.sweep == reading.sweep)
        else {
            self.stats.duplicates += 1;
            return;
        };
        match track.classify(reading) {
            Err(error) => self.stop_and_fail(now_us, error),
            Ok(Reception::Duplicate) => self.stats.duplicates += 1,
            Ok(Reception::Beyond) => {}
            Ok(Reception::New { repaired }) if self.has_room_for_reading() => {
                match self.check_beam(now_us, track, reading) {
                    Ok(()) => self.deliver(reading, repaired),
                    Err(fault) => self.reject(reading, fault),
                }
                self.beam_settled(now_us);
            }
            Ok(Reception::New { .. }) => {}
        }
    }

    fn check_beam(
        &self,
        now_us: u64,
        track: &Track,
        reading: &Reading,
    ) -> Result<(), ReadingFault> {
        if let Some(settings) = &self.settings {
            check_echoes(reading, settings)?;
        }
        // A computer suspended for less than the lease takes the present for the past.
        self.check_past(now_us, reading, track.lease_us)?;
        track.firings.check(&track.plan, reading)
    }

    fn deliver(&mut self, reading: &Reading, repaired: bool) {
        if let Some(track) = &mut self.track {
            track.deliver(reading);
        }
        self.step = Some(reading.step);
        self.stats.readings += 1;
        self.stats.repaired += u64::from(repaired);
        self.report(HostEvent::Reading { reading: *reading, repaired });
    }

    /// Rejects a reading. Its beam is settled: a repetition would have the same content.
    fn reject(&mut self, reading: &Reading, fault: ReadingFault) {
        if let Some(track) = &mut self.track {
            track.settle(reading.index);
        }
        self.stats.rejected += 1;
        self.report(HostEvent::ReadingRejected { reading: *reading, fault });
    }

    fn beam_settled(&mut self, now_us: u64) {
        self.expect_progress(now_us);
        // A reading proves that the plan was accepted, even if the Ack was lost.
        if self.exchange.as_ref().is_some_and(|open| matches!(open.request, Request::Sweep(_))) {
            self.exchange = None;
        }
    }

    pub(super) fn handle_sweep_done(&mut self, now_us: u64, done: &SweepDone) {
        let Some(track) = self.track.as_mut().filter(|track| track.plan.sweep == done.sweep) else {
            return;
        };
        let progress = track.check(done.fired, done.fired, done.end == SweepState::Complete);
        track.update(done.fired, done.fired);
        if self.is_stopping() {
            return;
        }
        match (progress, end_error(done.end)) {
            (Err(error), _) | (Ok(()), Some(error)) => self.sweep_failed(now_us, error),
            (Ok(()), None) => self.continue_sweep(now_us),
        }
    }

    /// Handles the reply to KeepAlive or Resend, which reports the device's progress.
    pub(super) fn handle_alive(&mut self, now_us: u64, alive: &Alive, wire_len: u8) {
        self.time_reply(now_us, wire_len);
        self.report_clock(now_us, alive.ticks);
        self.exchange = None;
        let Some(track) = &mut self.track else { return };
        if alive.sweep != track.plan.sweep {
            return self.stop_and_fail(now_us, HostError::SweepLost);
        }
        let complete = alive.state == SweepState::Complete;
        if let Err(error) = track.check(alive.sent, alive.fired, complete) {
            return self.sweep_failed(now_us, error);
        }
        track.update(alive.sent, alive.fired);
        if let Some(error) = end_error(alive.state) {
            return self.sweep_failed(now_us, error);
        }
        self.count_stall(now_us);
    }

    /// Counts replies without progress while progress is due, and ends the sweep after too many.
    fn count_stall(&mut self, now_us: u64) {
        let Some(track) = &mut self.track else { return };
        let due = track.missing().is_some() || track.progress_at_us <= now_us;
        if core::mem::take(&mut track.progressed) || !due {
            return;
        }
        track.stalls = track.stalls.saturating_add(1);
        let (stalls, fired) = (track.stalls, track.fired);
        if stalls > self.config.max_attempts {
            self.stop_and_fail(now_us, HostError::Stalled { fired });
        } else {
            self.expect_progress(now_us);
        }
    }

    /// Fails the command. A device that ended the sweep by itself needs no Stop.
    fn sweep_failed(&mut self, now_us: u64, error: HostError) {
        self.stats.rejected += u64::from(matches!(error, HostError::InvalidReply(_)));
        if has_ended(&error) { self.fail(error) } else { self.stop_and_fail(now_us, error) }
    }

    /// Sends the next request of the sweep, unless one is open.
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

    /// Schedules a progress query for the next occasion.
    pub(super) fn query_soon(&mut self, now_us: u64) {
        if let Some(track) = &mut self.track {
            track.keep_alive_at_us = now_us;
        }
    }

    /// Handles the Ack of Stop; a sweep in progress ends with the readings received so far.
    pub(super) fn stopped(&mut self) {
        let track = self.track.take();
        self.step = None;
        if let Some(error) = self.giving_up {
            return self.fail(error);
        }
        if let Some(track) = track {
            let end = if track.is_complete() { SweepState::Complete } else { SweepState::Stopped };
            let (sweep, delivered) = (track.plan.sweep, track.delivered);
            self.report(HostEvent::SweepDone { sweep, delivered, end });
        }
        self.finish(super::Outcome::Stopped);
    }

    /// Computes the time by which the next reading must have arrived.
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

const fn has_ended(error: &HostError) -> bool {
    matches!(
        error,
        HostError::Stopped
            | HostError::LeaseExpired
            | HostError::EmergencyStop
            | HostError::MotionFault
    )
}

/// Returns the error for a sweep that ended without a Stop from this host; `None` if it did not
/// fail.
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
