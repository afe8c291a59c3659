//! Transmit queue. Frames are encoded individually, when the line is free.

use super::{BeamPhase, CompactReply, Device, Phase};
use crate::frame::{Frame, Header};
use crate::messages::table::{code_of, put_record};
use crate::messages::{
    Alive, DeviceState, FaultKind, Identity, PROTOCOL, Reading, Reply, Status, SweepDone,
    SweepState, Wire as _, Writer, limits,
};

/// Frames to be encoded, and the frame in transmission.
#[derive(Debug, Clone)]
pub(super) struct Outbox {
    answer: Option<(u16, CompactReply)>,
    announce: bool,
    fault: Option<FaultKind>,
    sweep_done: bool,
    /// Lowest index never sent.
    sent: u16,
    resend_next: u16,
    resend_left: u8,
    /// Frame in transmission, or empty.
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

    /// Queues the reply to request `seq`. The host has a single open request, so a newer reply
    /// replaces an older one.
    pub(super) fn answer(&mut self, seq: u16, answer: CompactReply) {
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

    /// Returns `true` if neither a reply nor the announcement is left to send.
    pub(super) fn is_empty(&self) -> bool {
        self.frame.is_empty() && self.answer.is_none() && !self.announce
    }
}

impl Device {
    /// Returns the next byte for the host.
    pub(super) fn next_byte(&mut self) -> Option<u8> {
        if self.outbox.frame.is_empty() && !self.next_frame() {
            return None;
        }
        self.outbox.frame.pop()
    }

    /// Encodes the next frame, if there is one: replies first for a short round trip, then readings
    /// in order, and the end of the sweep after the last reading.
    fn next_frame(&mut self) -> bool {
        if let Some((seq, answer)) = self.outbox.answer
            && !self.must_wait_for_resend(answer)
        {
            self.outbox.answer = None;
            return self.encode_frame(seq, answer);
        }
        if core::mem::take(&mut self.outbox.announce) {
            return self.encode_frame(0, CompactReply::Identity);
        }
        if let Some(kind) = self.outbox.fault.take() {
            return self.encode_frame(0, CompactReply::Fault(kind));
        }
        self.next_event()
    }

    fn must_wait_for_resend(&self, answer: CompactReply) -> bool {
        matches!(answer, CompactReply::Alive { .. }) && self.outbox.resend_left > 0
    }

    fn next_event(&mut self) -> bool {
        while self.outbox.resend_left > 0 {
            let index = self.outbox.resend_next;
            self.outbox.resend_left = self.outbox.resend_left.wrapping_sub(1);
            self.outbox.resend_next = index.wrapping_add(1);
            // Beams never sent follow in their regular order.
            if index < self.outbox.sent
                && self.encode_frame(self.run.seq, CompactReply::Beam(index))
            {
                return true;
            }
        }
        if let Some((seq, answer)) = self.outbox.answer.take() {
            return self.encode_frame(seq, answer);
        }
        let index = self.outbox.sent.max(self.ring.first());
        if !self.run.is_ping() && index < self.run.fired {
            self.outbox.sent = index.wrapping_add(1);
            return self.encode_frame(self.run.seq, CompactReply::Beam(index));
        }
        if core::mem::take(&mut self.outbox.sweep_done) {
            return self.encode_frame(self.run.seq, CompactReply::SweepDone);
        }
        false
    }

    /// Encodes a frame; returns `false` if its subject is no longer stored.
    // Not inlined, nor are its parts: all frames are built in a single buffer, and each part has a
    // small stack frame of its own on the microcontroller.
    #[inline(never)]
    fn encode_frame(&mut self, seq: u16, answer: CompactReply) -> bool {
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
    fn put(&self, answer: CompactReply, mut body: Writer<'_>) -> Option<u8> {
        let out = &mut body;
        match answer {
            CompactReply::Identity => self.put_identity(out),
            CompactReply::Ack => Reply::Ack.put(out),
            CompactReply::Nak(reason) => Reply::Nak { reason }.put(out),
            CompactReply::Started => Reply::Started.put(out),
            CompactReply::Homed { drift_steps } => Reply::Homed { drift_steps }.put(out),
            CompactReply::Ping => self.put_reading(0, out)?,
            CompactReply::Beam(index) => self.put_reading(index, out)?,
            CompactReply::Fault(kind) => Reply::Fault { kind }.put(out),
            CompactReply::SweepDone => self.put_sweep_done(out),
            CompactReply::Alive { ticks } => self.put_alive(ticks, out),
            CompactReply::Status { ticks } => self.put_status(ticks, out),
        }
        body.finish()
    }

    #[inline(never)]
    fn put_reading(&self, index: u16, out: &mut Writer<'_>) -> Option<()> {
        let stored = self.ring.get(index)?;
        let plan = &self.run.plan;
        let step = plan.step_of(index)?;
        out.byte(const { code_of(Reply::VARIANTS, "Reading") });
        put_record!(
            out,
            Reading {
                sweep: plan.sweep,
                index: index,
                step: step,
                fired_ticks: stored.fired_ticks(),
                status: stored.status(),
                echoes: stored.echoes(),
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
            Phase::Beam(BeamPhase::Moving { .. } | BeamPhase::Waiting | BeamPhase::Listening) => {
                if self.run.is_ping() {
                    DeviceState::Pinging
                } else {
                    DeviceState::Sweeping
                }
            }
        }
    }
}
