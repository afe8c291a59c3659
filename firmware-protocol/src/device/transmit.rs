//! What the device still has to say. Frames are built one at a time, when the line is free.

use super::{Answer, Beam, Device, Phase};
use crate::frame::{Frame, Header};
use crate::messages::table::{code_of, put_record};
use crate::messages::{
    Alive, DeviceState, FaultKind, Identity, PROTOCOL, Reading, Reply, Status, SweepDone,
    SweepState, Wire as _, Writer, limits,
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

    /// Lowest index never sent.
    pub(super) const fn sent(&self) -> u16 {
        self.sent
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
    /// The next byte for the host.
    pub(super) fn next_byte(&mut self) -> Option<u8> {
        if self.outbox.frame.is_empty() && !self.next_frame() {
            return None;
        }
        self.outbox.frame.pop()
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
    // Not inlined, as its parts: all frames are built in one place, beside the machine that they
    // tell of, and each part has a small frame of its own on a microcontroller's stack.
    #[inline(never)]
    fn say(&mut self, seq: u16, answer: Answer) -> bool {
        let mut frame = Frame::EMPTY;
        let Some(body_len) = self.put(answer, frame.body()) else {
            return false;
        };
        let header = Header { boot: self.board.boot, seq };
        let closed = frame.close(header, body_len).is_ok();
        self.outbox.frame = frame;
        closed
    }

    #[inline(never)]
    fn put(&self, answer: Answer, mut body: Writer<'_>) -> Option<u8> {
        let out = &mut body;
        match answer {
            Answer::Identity => self.put_identity(out),
            Answer::Ack => Reply::Ack.put(out),
            Answer::Nak(reason) => Reply::Nak { reason }.put(out),
            Answer::Started => Reply::Started.put(out),
            Answer::Homed { drift_steps } => Reply::Homed { drift_steps }.put(out),
            Answer::Ping => self.put_reading(0, out)?,
            Answer::Beam(index) => self.put_reading(index, out)?,
            Answer::Fault(kind) => Reply::Fault { kind }.put(out),
            Answer::SweepDone => self.put_sweep_done(out),
            Answer::Alive { ticks } => self.put_alive(ticks, out),
            Answer::Status { ticks } => self.put_status(ticks, out),
        }
        body.finish()
    }

    #[inline(never)]
    fn put_reading(&self, index: u16, out: &mut Writer<'_>) -> Option<()> {
        let kept = self.ring.get(index)?;
        let plan = &self.run.plan;
        let step = plan.step_of(index)?;
        out.byte(const { code_of(Reply::VARIANTS, "Reading") });
        put_record!(
            out,
            Reading {
                sweep: plan.sweep,
                index: index,
                step: step,
                fired_ticks: kept.fired_ticks(),
                status: kept.status(),
                echoes: kept.echoes(),
            }
        );
        Some(())
    }

    #[inline(never)]
    fn put_identity(&self, out: &mut Writer<'_>) {
        let board = &self.board;
        out.byte(const { code_of(Reply::VARIANTS, "Identity") });
        put_record!(
            out,
            Identity {
                protocol: PROTOCOL,
                firmware: board.firmware,
                serial: board.serial,
                boot: board.boot,
                last_seq: self.last.map(|last| last.seq),
                tick_hz: limits::TICK_HZ,
                steps_per_revolution: board.steps_per_revolution,
                capabilities: board.capabilities,
                ring_bytes: limits::RING_BYTES,
                reset_cause: board.reset_cause,
            }
        );
    }

    fn put_sweep_done(&self, out: &mut Writer<'_>) {
        let run = &self.run;
        out.byte(const { code_of(Reply::VARIANTS, "SweepDone") });
        put_record!(out, SweepDone { sweep: run.plan.sweep, fired: run.fired, end: run.state });
    }

    #[inline(never)]
    fn put_alive(&self, ticks: u32, out: &mut Writer<'_>) {
        let run = &self.run;
        out.byte(const { code_of(Reply::VARIANTS, "Alive") });
        put_record!(
            out,
            Alive {
                ticks: ticks,
                sweep: run.plan.sweep,
                fired: run.fired,
                sent: self.outbox.sent,
                state: if run.is_ping() { SweepState::None } else { run.state },
            }
        );
    }

    #[inline(never)]
    fn put_status(&self, ticks: u32, out: &mut Writer<'_>) {
        let counters = &self.counters;
        out.byte(const { code_of(Reply::VARIANTS, "StatusReport") });
        put_record!(
            out,
            Status {
                ticks: ticks,
                state: self.state(),
                configured: self.settings.is_some(),
                homed: self.homed,
                step: self.step,
                sweep: self.run.plan.sweep,
                fired: self.run.fired,
                fault: self.fault,
                dropped_checksum: counters.checksum,
                dropped_stuffing: counters.stuffing,
                dropped_too_long: counters.too_long,
                dropped_line: counters.line,
                undecodable: counters.undecodable,
                stale: counters.stale,
            }
        );
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
