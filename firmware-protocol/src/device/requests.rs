//! Request handling: execution, replies to repetitions, rejection.

use super::actions::PendingActions;
use super::settings::{check_plan, check_settings, check_step};
use super::{AcceptedRequest, BeamPhase, CompactReply, Device, Phase, SweepRun};
use crate::frame::{Header, count};
use crate::messages::{NakReason, Request, Settings, Sweep, SweepState};

/// Result of accepting a request.
enum Disposition {
    /// Completed; the reply is stored for repetitions.
    Done(CompactReply),
    /// In progress; the final reply follows.
    Running,
    /// Reply to a query, which is evaluated again when the request is repeated.
    Query(CompactReply),
}

impl Device {
    /// Handles a frame with a valid CRC; `request` is `None` if its body is not a request.
    pub(super) fn handle_frame(&mut self, header: Header, crc: u32, request: Option<&Request>) {
        let Some(request) = request else {
            count(&mut self.counters.undecodable);
            self.outbox.answer(header.seq, CompactReply::Nak(NakReason::UnknownRequest));
            return;
        };
        let addressed = header.boot == self.board.boot;
        if addressed {
            self.renew_timers();
        }
        match request {
            Request::Identify => self.outbox.answer(header.seq, CompactReply::Identity),
            Request::Stop if !addressed => self.stop_unnumbered(header.seq),
            _ if !addressed => {
                count(&mut self.counters.stale);
                self.outbox.answer(header.seq, CompactReply::Nak(NakReason::WrongBoot));
            }
            _ => self.handle_numbered(header.seq, crc, request),
        }
    }

    /// Distinguishes new requests, repetitions and old duplicates by serial arithmetic on the
    /// number.
    fn handle_numbered(&mut self, seq: u16, crc: u32, request: &Request) {
        let Some(last) = self.last else {
            return self.accept(seq, crc, request);
        };
        match seq.wrapping_sub(last.seq) {
            0 if crc != last.crc => {
                self.outbox.answer(seq, CompactReply::Nak(NakReason::SequenceReused));
            }
            0 => self.repeat(last, request),
            1..0x8000 => self.accept(seq, crc, request),
            _ => count(&mut self.counters.stale),
        }
    }

    fn repeat(&mut self, last: AcceptedRequest, request: &Request) {
        match last.answer {
            Some(answer) => self.outbox.answer(last.seq, answer),
            None if is_idempotent(request) => self.accept(last.seq, last.crc, request),
            None if self.phase != Phase::Idle && self.phase_seq == last.seq => {
                self.outbox.answer(last.seq, CompactReply::Started);
            }
            None => self.outbox.answer(last.seq, CompactReply::Nak(NakReason::Stopped)),
        }
    }

    fn accept(&mut self, seq: u16, crc: u32, request: &Request) {
        self.last = Some(AcceptedRequest { seq, crc, answer: None });
        match self.perform(seq, request) {
            Ok(Disposition::Done(answer)) => self.conclude(seq, answer),
            Ok(Disposition::Query(answer)) => self.outbox.answer(seq, answer),
            Ok(Disposition::Running) => self.outbox.answer(seq, CompactReply::Started),
            Err(reason) => self.conclude(seq, CompactReply::Nak(reason)),
        }
    }

    /// Sends the final reply to request `seq`, and stores it while `seq` is the latest number.
    pub(super) fn conclude(&mut self, seq: u16, answer: CompactReply) {
        if let Some(last) = &mut self.last
            && last.seq == seq
        {
            last.answer = Some(answer);
        }
        self.outbox.answer(seq, answer);
    }

    fn perform(&mut self, seq: u16, request: &Request) -> Result<Disposition, NakReason> {
        match request {
            Request::Identify => Ok(Disposition::Query(CompactReply::Identity)),
            Request::Stop => Ok(self.stop(seq)),
            Request::Reset => Ok(self.reset()),
            &Request::Resend { sweep, first, count } => Ok(self.resend(sweep, first, count)),
            &Request::KeepAlive { sweep, next } => Ok(self.keep_alive(sweep, next)),
            Request::Status => Ok(Disposition::Query(CompactReply::Status { ticks: self.now })),
            _ if self.phase != Phase::Idle => Err(NakReason::Busy),
            Request::Configure(settings) => self.configure(settings),
            Request::Home => self.home(seq),
            &Request::MoveTo { step } => self.move_to(seq, step),
            Request::Ping => self.ping(seq),
            Request::Sweep(plan) => self.sweep(seq, plan),
        }
    }

    /// Obeys a Stop from a host that does not know the boot nonce, without affecting the numbering.
    fn stop_unnumbered(&mut self, seq: u16) {
        match self.stop(seq) {
            Disposition::Done(answer) | Disposition::Query(answer) => {
                self.outbox.answer(seq, answer);
            }
            Disposition::Running => self.outbox.answer(seq, CompactReply::Started),
        }
    }

    fn stop(&mut self, seq: u16) -> Disposition {
        let turning = self.interrupt();
        self.end_run(SweepState::Stopped);
        if turning {
            self.enter(Phase::Stopping, seq);
            Disposition::Running
        } else {
            self.rest();
            Disposition::Done(CompactReply::Ack)
        }
    }

    fn reset(&mut self) -> Disposition {
        self.interrupt();
        self.release_coils();
        self.homed = false;
        self.end_run(SweepState::Stopped);
        self.rest();
        self.pending.add(PendingActions::RESET);
        Disposition::Done(CompactReply::Ack)
    }

    fn resend(&mut self, sweep: u16, first: u16, count: u8) -> Disposition {
        if sweep == self.run.plan.sweep {
            self.acknowledge(first);
            self.outbox.resend(first, count);
            self.try_fire();
        }
        Disposition::Query(CompactReply::Alive { ticks: self.now })
    }

    fn keep_alive(&mut self, sweep: u16, next: u16) -> Disposition {
        if sweep == self.run.plan.sweep {
            self.acknowledge(next);
            self.try_fire();
        }
        Disposition::Query(CompactReply::Alive { ticks: self.now })
    }

    /// Acknowledges beams below `next`, except those never sent, which no host can have received.
    fn acknowledge(&mut self, next: u16) {
        self.ring.acknowledge(self.outbox.sent().min(next));
    }

    fn configure(&mut self, settings: &Settings) -> Result<Disposition, NakReason> {
        check_settings(settings, self.board.capabilities)?;
        self.settings = Some(*settings);
        self.rest();
        Ok(Disposition::Done(CompactReply::Ack))
    }

    fn home(&mut self, seq: u16) -> Result<Disposition, NakReason> {
        self.require_settings()?;
        self.homed = false;
        self.enter(Phase::Homing, seq);
        self.pending.add(PendingActions::PHASE);
        Ok(Disposition::Running)
    }

    fn move_to(&mut self, seq: u16, step: i32) -> Result<Disposition, NakReason> {
        self.require_settings()?;
        check_step(step)?;
        self.require_homed()?;
        if step == self.step {
            return Ok(Disposition::Done(CompactReply::Ack));
        }
        self.enter(Phase::Moving { target: step }, seq);
        self.pending.add(PendingActions::PHASE);
        Ok(Disposition::Running)
    }

    fn ping(&mut self, seq: u16) -> Result<Disposition, NakReason> {
        self.require_settings()?;
        self.begin_run(SweepRun::ping(seq, self.step));
        Ok(Disposition::Running)
    }

    fn sweep(&mut self, seq: u16, plan: &Sweep) -> Result<Disposition, NakReason> {
        self.require_settings()?;
        let beams = check_plan(plan)?;
        self.require_homed()?;
        self.begin_run(SweepRun::sweep(seq, *plan, beams));
        Ok(Disposition::Done(CompactReply::Ack))
    }

    fn require_settings(&self) -> Result<(), NakReason> {
        self.settings.map(|_| ()).ok_or(NakReason::NotConfigured)
    }

    fn require_homed(&self) -> Result<(), NakReason> {
        if self.homed { Ok(()) } else { Err(NakReason::NotHomed) }
    }

    /// Enters a phase that serves request `seq`.
    pub(super) fn enter(&mut self, phase: Phase, seq: u16) {
        self.phase = phase;
        self.phase_seq = seq;
    }

    /// Cancels the operation in progress. Returns `true` if the motor turns and was commanded to
    /// stop.
    fn interrupt(&mut self) -> bool {
        let unpolled = self.pending.take(PendingActions::PHASE);
        match self.phase {
            Phase::Homing | Phase::Moving { .. } | Phase::Beam(BeamPhase::Moving { .. }) => {
                if !unpolled {
                    self.pending.add(PendingActions::STOP_MOTION);
                }
                !unpolled
            }
            Phase::Beam(BeamPhase::Listening) => {
                if !unpolled {
                    self.pending.add(PendingActions::ABORT_FIRE);
                }
                false
            }
            Phase::Stopping => true,
            Phase::Idle | Phase::Beam(BeamPhase::Waiting) => false,
        }
    }
}

/// Returns `true` for requests whose repetition may be executed again without effect.
const fn is_idempotent(request: &Request) -> bool {
    matches!(
        request,
        Request::Stop | Request::Resend { .. } | Request::KeepAlive { .. } | Request::Status
    )
}
