//! What the device still has to say. Frames are built one at a time, when the line is free.

use super::{Answer, Beam, Device, Phase};
use crate::frame::{Frame, Header};
use crate::messages::{
    Alive, DeviceState, FaultKind, Identity, PROTOCOL, Reading, Reply, Status, SweepDone,
    SweepState, limits,
};

/// Frames not yet begun, and the one on its way.
#[derive(Debug, Clone)]
pub(super) struct Outbox {
    answer: Option<(u16, Answer)>,
    announce: bool,
    fault: Option<FaultKind>,
    sweep_done: bool,
    /// Lowest index never sent.
    sent: u16,
    resend_next: u16,
    resend_left: u8,
    /// On its way, or empty.
    frame: Frame,
    frame_at: u8,
}

impl Outbox {
    pub(super) const fn new() -> Self {
        Self {
            answer: None,
            announce: true,
            fault: None,
            sweep_done: false,
            sent: 0,
            resend_next: 0,
            resend_left: 0,
            frame: Frame::EMPTY,
            frame_at: 0,
        }
    }

    /// Answers request `seq`. The host has one request open, so the newest answer counts.
    pub(super) fn answer(&mut self, seq: u16, answer: Answer) {
        self.answer = Some((seq, answer));
    }

    pub(super) fn fault(&mut self, kind: FaultKind) {
        self.fault = Some(kind);
    }

    pub(super) fn sweep_done(&mut self) {
        self.sweep_done = true;
    }

    pub(super) fn begin_run(&mut self) {
        self.sweep_done = false;
        self.sent = 0;
        self.resend_left = 0;
    }

    pub(super) fn resend(&mut self, first: u16, count: u8) {
        self.resend_next = first;
        self.resend_left = count;
    }

    /// Whether nothing of importance is left to send.
    pub(super) fn is_empty(&self) -> bool {
        self.frame.is_empty() && self.answer.is_none() && !self.announce
    }
}

impl Device {
    pub(super) fn transmit(&mut self, buffer: &mut [u8]) -> usize {
        let mut written = 0;
        while let Some(room) = buffer.get_mut(written..).filter(|room| !room.is_empty()) {
            if self.outbox.frame.is_empty() {
                self.outbox.frame_at = 0;
                if !self.next_frame() {
                    break;
                }
            }
            let at = usize::from(self.outbox.frame_at);
            let rest = self.outbox.frame.get(at..).unwrap_or_default();
            let count = rest.len().min(room.len());
            for (slot, byte) in room.iter_mut().zip(rest) {
                *slot = *byte;
            }
            written = written.wrapping_add(count);
            if count == rest.len() {
                self.outbox.frame.clear();
            } else {
                self.outbox.frame_at = self.outbox.frame_at.wrapping_add(low_byte(count));
            }
        }
        written
    }

    /// Builds the next frame, if there is one. Answers first, so that requests are quick; then
    /// readings in order; the end after the last.
    fn next_frame(&mut self) -> bool {
        if let Some((seq, answer)) = self.outbox.answer
            && !self.must_wait_for_resend(answer)
        {
            self.outbox.answer = None;
            return self.say(seq, answer);
        }
        if core::mem::take(&mut self.outbox.announce) {
            return self.say(0, Answer::Identity);
        }
        if let Some(kind) = self.outbox.fault.take() {
            return self.say(0, Answer::Fault(kind));
        }
        self.next_event()
    }

    fn must_wait_for_resend(&self, answer: Answer) -> bool {
        matches!(answer, Answer::Alive { .. }) && self.outbox.resend_left > 0
    }

    fn next_event(&mut self) -> bool {
        while self.outbox.resend_left > 0 {
            let index = self.outbox.resend_next;
            self.outbox.resend_left = self.outbox.resend_left.wrapping_sub(1);
            self.outbox.resend_next = index.wrapping_add(1);
            // What was never sent comes in its turn.
            if index < self.outbox.sent && self.say(self.run.seq, Answer::Beam(index)) {
                return true;
            }
        }
        if let Some((seq, answer)) = self.outbox.answer.take() {
            return self.say(seq, answer);
        }
        let index = self.outbox.sent.max(self.ring.first());
        if !self.run.is_ping() && index < self.run.fired {
            self.outbox.sent = index.wrapping_add(1);
            return self.say(self.run.seq, Answer::Beam(index));
        }
        if core::mem::take(&mut self.outbox.sweep_done) {
            return self.say(self.run.seq, Answer::SweepDone);
        }
        false
    }

    /// Builds a frame; false if there is nothing to say it about any more.
    // Not inlined: all frames are built in one place, with one message on the stack.
    #[inline(never)]
    fn say(&mut self, seq: u16, answer: Answer) -> bool {
        let header = Header { boot: self.board.boot, seq };
        let Some(reply) = self.reply(answer) else {
            return false;
        };
        self.outbox.frame.fill(header, &reply).is_ok()
    }

    fn reply(&self, answer: Answer) -> Option<Reply> {
        Some(match answer {
            Answer::Identity => Reply::Identity(self.identity()),
            Answer::Ack => Reply::Ack,
            Answer::Nak(reason) => Reply::Nak { reason },
            Answer::Started => Reply::Started,
            Answer::Homed { drift_steps } => Reply::Homed { drift_steps },
            Answer::Ping => Reply::Reading(self.reading(0)?),
            Answer::Beam(index) => Reply::Reading(self.reading(index)?),
            Answer::Fault(kind) => Reply::Fault { kind },
            Answer::SweepDone => Reply::SweepDone(SweepDone {
                sweep: self.run.plan.sweep,
                fired: self.run.fired,
                end: self.run.state,
            }),
            Answer::Alive { ticks } => Reply::Alive(self.alive(ticks)),
            Answer::Status { ticks } => Reply::StatusReport(self.status(ticks)),
        })
    }

    fn reading(&self, index: u16) -> Option<Reading> {
        let kept = self.ring.get(index)?;
        let plan = &self.run.plan;
        Some(Reading {
            sweep: plan.sweep,
            index,
            step: plan.step_of(index)?,
            fired_ticks: kept.fired_ticks,
            status: kept.status,
            echoes: kept.echoes,
        })
    }

    const fn identity(&self) -> Identity {
        Identity {
            protocol: PROTOCOL,
            firmware: self.board.firmware,
            serial: self.board.serial,
            boot: self.board.boot,
            last_seq: match self.last {
                Some(last) => Some(last.seq),
                None => None,
            },
            tick_hz: limits::TICK_HZ,
            steps_per_revolution: self.board.steps_per_revolution,
            capabilities: self.board.capabilities,
            ring_bytes: limits::RING_BYTES,
            reset_cause: self.board.reset_cause,
        }
    }

    const fn alive(&self, ticks: u32) -> Alive {
        let run = &self.run;
        let state = if run.is_ping() { SweepState::None } else { run.state };
        Alive { ticks, sweep: run.plan.sweep, fired: run.fired, sent: self.outbox.sent, state }
    }

    fn status(&self, ticks: u32) -> Status {
        Status {
            ticks,
            state: self.state(),
            configured: self.settings.is_some(),
            homed: self.homed,
            step: self.step,
            sweep: self.run.plan.sweep,
            fired: self.run.fired,
            fault: self.fault,
            dropped_checksum: self.counters.checksum,
            dropped_stuffing: self.counters.stuffing,
            dropped_too_long: self.counters.too_long,
            dropped_line: self.counters.line,
            undecodable: self.counters.undecodable,
            stale: self.counters.stale,
        }
    }

    const fn state(&self) -> DeviceState {
        match self.phase {
            Phase::Idle => DeviceState::Idle,
            Phase::Homing => DeviceState::Homing,
            Phase::Moving { .. } => DeviceState::Moving,
            Phase::Stopping => DeviceState::Stopping,
            Phase::Beam(Beam::Moving { .. } | Beam::Waiting | Beam::Listening) => {
                if self.run.is_ping() { DeviceState::Pinging } else { DeviceState::Sweeping }
            }
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a frame has at most 66 bytes")]
/// A frame has at most 66 bytes.
const fn low_byte(len: usize) -> u8 {
    len as u8
}
