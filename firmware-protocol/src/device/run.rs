//! Sequence of moves, firings and listening windows in moves, pings and sweeps.

use super::actions::PendingActions;
use super::timers::ticks_until;
use super::{BeamPhase, CompactReply, Device, EchoReport, HomeError, Phase, SweepRun};
use crate::messages::limits::TICK_HZ;
use crate::messages::{FaultKind, NakReason, ReadingStatus, Sweep, SweepState};

const TICKS_PER_MS: u32 = TICK_HZ / 1_000;

impl SweepRun {
    pub(super) const fn none() -> Self {
        let plan =
            Sweep { sweep: 0, first_step: 0, stride: 0, stops: 0, pings_per_stop: 1, lease_ms: 0 };
        Self { plan, seq: 0, beams: 0, fired: 0, state: SweepState::None }
    }

    pub(super) const fn ping(seq: u16, step: i32) -> Self {
        let plan = Sweep {
            sweep: 0,
            first_step: step,
            stride: 0,
            stops: 1,
            pings_per_stop: 1,
            lease_ms: 0,
        };
        Self { plan, seq, beams: 1, fired: 0, state: SweepState::Running }
    }

    pub(super) const fn sweep(seq: u16, plan: Sweep, beams: u16) -> Self {
        Self { plan, seq, beams, fired: 0, state: SweepState::Running }
    }

    pub(super) const fn is_ping(&self) -> bool {
        self.plan.sweep == 0
    }
}

impl Device {
    pub(super) fn begin_run(&mut self, run: SweepRun) {
        self.run = run;
        self.ring.clear();
        self.outbox.begin_run();
        if !run.is_ping() {
            self.arm_lease();
        }
        self.enter(Phase::Beam(BeamPhase::Waiting), run.seq);
        self.next_beam();
    }

    /// Moves to the next beam, or ends the run after the last.
    fn next_beam(&mut self) {
        if self.run.fired >= self.run.beams {
            return self.finish_run();
        }
        let target = self.run.plan.step_of(self.run.fired).unwrap_or(self.step);
        if target == self.step {
            self.phase = Phase::Beam(BeamPhase::Waiting);
            self.try_fire();
        } else {
            self.phase = Phase::Beam(BeamPhase::Moving { target });
            self.pending.add(PendingActions::PHASE);
        }
    }

    fn finish_run(&mut self) {
        if self.run.is_ping() {
            self.conclude(self.phase_seq, CompactReply::Ping);
        }
        self.end_run(SweepState::Complete);
        self.rest();
    }

    /// Fires if a beam is waiting and settling time, interval and ring capacity allow it.
    pub(super) fn try_fire(&mut self) {
        let Some(settings) = self.settings else {
            return;
        };
        let free = self.phase == Phase::Beam(BeamPhase::Waiting)
            && self.timers.settle.is_none()
            && self.timers.min_interval.is_none();
        if !free {
            return;
        }
        if !self.ring.has_room(settings.max_echoes) {
            self.run.state = SweepState::Holding;
            return;
        }
        self.run.state = SweepState::Running;
        self.phase = Phase::Beam(BeamPhase::Listening);
        self.pending.add(PendingActions::PHASE);
        // Valid until the board reports the actual time of firing.
        self.timers.min_interval = armed(self.now, settings.min_interval_ticks);
    }

    pub(super) fn beam_measured(&mut self, report: &EchoReport) {
        let (Phase::Beam(BeamPhase::Listening), Some(settings)) = (self.phase, self.settings)
        else {
            return;
        };
        let next_fire = report.fired_ticks.wrapping_add(settings.min_interval_ticks);
        self.timers.min_interval = (ticks_until(self.now, next_fire) > 0).then_some(next_fire);
        let count = report.echoes.len().min(usize::from(settings.max_echoes));
        let echoes = report.echoes.get(..count).unwrap_or_default();
        let status = match report.status {
            ReadingStatus::Echo | ReadingStatus::NoEcho if !self.homed => {
                ReadingStatus::StepUncertain
            }
            ReadingStatus::Echo if echoes.is_empty() => ReadingStatus::NoEcho,
            status => status,
        };
        self.ring.push(report.fired_ticks, status, echoes);
        self.run.fired = self.run.fired.wrapping_add(1);
        self.next_beam();
    }

    pub(super) fn motor_stopped(&mut self, step: i32) {
        match self.phase {
            Phase::Moving { target } | Phase::Beam(BeamPhase::Moving { target })
                if step != target =>
            {
                self.halt(FaultKind::MotionFault);
            }
            Phase::Moving { .. } => {
                self.moved_to(step);
                self.conclude(self.phase_seq, CompactReply::Ack);
                self.rest();
            }
            Phase::Beam(BeamPhase::Moving { .. }) => {
                self.moved_to(step);
                self.phase = Phase::Beam(BeamPhase::Waiting);
                self.try_fire();
            }
            Phase::Stopping => {
                self.pending.take(PendingActions::STOP_MOTION);
                self.moved_to(step);
                self.conclude(self.phase_seq, CompactReply::Ack);
                self.rest();
            }
            Phase::Idle
            | Phase::Homing
            | Phase::Beam(BeamPhase::Waiting | BeamPhase::Listening) => {}
        }
    }

    pub(super) fn homing_ended(&mut self, outcome: Result<i32, HomeError>) {
        match (self.phase, outcome) {
            (Phase::Homing, Ok(drift_steps)) => {
                self.homed = true;
                self.fault = None;
                self.moved_to(0);
                self.conclude(self.phase_seq, CompactReply::Homed { drift_steps });
                self.rest();
            }
            (Phase::Homing, Err(HomeError::IndexNotFound)) => {
                self.conclude(self.phase_seq, CompactReply::Nak(NakReason::IndexNotFound));
                self.rest();
            }
            _ => {}
        }
    }

    fn moved_to(&mut self, step: i32) {
        self.step = step;
        self.timers.settle =
            self.settings.and_then(|settings| armed(self.now, settings.settle_ticks));
    }

    /// Stops all activity, releases the coils and discards the position.
    pub(super) fn halt(&mut self, kind: FaultKind) {
        self.pending.take(PendingActions::PHASE);
        self.pending.take(PendingActions::STOP_MOTION);
        if self.phase == Phase::Beam(BeamPhase::Listening) {
            self.pending.add(PendingActions::ABORT_FIRE);
        }
        self.release_coils();
        let running = core::mem::replace(&mut self.phase, Phase::Idle);
        match running {
            Phase::Homing | Phase::Moving { .. } => self.reject_running(kind),
            Phase::Beam(_) if self.run.is_ping() => self.reject_running(kind),
            Phase::Stopping => self.conclude(self.phase_seq, CompactReply::Ack),
            Phase::Beam(_) | Phase::Idle => {}
        }
        self.end_run(match kind {
            FaultKind::LeaseExpired | FaultKind::HoldExpired => SweepState::LeaseExpired,
            FaultKind::EmergencyStop => SweepState::EmergencyStop,
            FaultKind::MotionFault => SweepState::MotionFault,
        });
        self.homed = false;
        self.fault = Some(kind);
        self.outbox.fault(kind);
        self.rest();
    }

    pub(super) fn release_coils(&mut self) {
        self.holds_coils = false;
        self.pending.add(PendingActions::RELEASE_COILS);
    }

    fn reject_running(&mut self, kind: FaultKind) {
        let reason = match kind {
            FaultKind::EmergencyStop => NakReason::EmergencyStop,
            FaultKind::MotionFault => NakReason::MotionFault,
            FaultKind::LeaseExpired | FaultKind::HoldExpired => NakReason::Stopped,
        };
        self.conclude(self.phase_seq, CompactReply::Nak(reason));
    }

    /// Ends the sweep or ping in progress, if any.
    pub(super) fn end_run(&mut self, state: SweepState) {
        if self.run.state.is_running() {
            self.run.state = state;
            self.timers.lease = None;
            if !self.run.is_ping() {
                self.outbox.sweep_done();
            }
        }
    }

    /// Returns to idle, and starts the hold timer if the coils carry current.
    pub(super) fn rest(&mut self) {
        self.phase = Phase::Idle;
        self.arm_hold();
    }

    /// Renews lease and hold timer after a request addressed to this boot.
    pub(super) fn renew_timers(&mut self) {
        if self.timers.lease.is_some() {
            self.arm_lease();
        }
        if self.timers.hold.is_some() {
            self.arm_hold();
        }
    }

    fn arm_lease(&mut self) {
        let lease = u32::from(self.run.plan.lease_ms).wrapping_mul(TICKS_PER_MS);
        self.timers.lease = Some(self.now.wrapping_add(lease));
    }

    fn arm_hold(&mut self) {
        let hold_s = self.settings.map_or(0, |settings| settings.hold_s);
        let hold = armed(self.now, u32::from(hold_s).wrapping_mul(TICK_HZ));
        self.timers.hold = hold.filter(|_| self.holds_coils);
    }
}

/// Deadline `ticks` from now; `None` for 0 ticks.
const fn armed(now: u32, ticks: u32) -> Option<u32> {
    if ticks == 0 { None } else { Some(now.wrapping_add(ticks)) }
}
