//! Which requests are carried out, which are answered from memory, which are refused.

use super::actions::Pending;
use super::settings::{check_plan, check_settings, check_step};
use super::{Accepted, Answer, Beam, Device, Phase, Run};
use crate::frame::{Header, count};
use crate::messages::{NakReason, Request, Settings, Sweep, SweepState};

/// What became of a request: an answer at once, or one that follows when it is done.
enum Outcome {
    Done(Answer),
    Running,
    /// A question: answered, and answered anew if it is repeated.
    Told(Answer),
}

impl Device {
    /// A frame with a right CRC came in; `request` is `None` if its body is no request.
    pub(super) fn handle_frame(&mut self, header: Header, crc: u32, request: Option<&Request>) {
        let Some(request) = request else {
            count(&mut self.counters.undecodable);
            self.outbox.answer(header.seq, Answer::Nak(NakReason::UnknownRequest));
            return;
        };
        let addressed = header.boot == self.board.boot;
        if addressed {
            self.host_is_alive();
        }
        match request {
            Request::Identify => self.outbox.answer(header.seq, Answer::Identity),
            Request::Stop if !addressed => self.stop_for_stranger(header.seq),
            _ if !addressed => {
                count(&mut self.counters.stale);
                self.outbox.answer(header.seq, Answer::Nak(NakReason::WrongBoot));
            }
            _ => self.handle_numbered(header.seq, crc, request),
        }
    }

    /// Serial arithmetic on the number tells new requests, repeated ones and old duplicates apart.
    fn handle_numbered(&mut self, seq: u16, crc: u32, request: &Request) {
        let Some(last) = self.last else {
            return self.accept(seq, crc, request);
        };
        match seq.wrapping_sub(last.seq) {
            0 if crc != last.crc => {
                self.outbox.answer(seq, Answer::Nak(NakReason::SequenceReused));
            }
            0 => self.repeat(last, request),
            1..0x8000 => self.accept(seq, crc, request),
            _ => count(&mut self.counters.stale),
        }
    }

    fn repeat(&mut self, last: Accepted, request: &Request) {
        match last.answer {
            Some(answer) => self.outbox.answer(last.seq, answer),
            None if may_be_done_twice(request) => self.accept(last.seq, last.crc, request),
            None if self.phase != Phase::Idle && self.phase_seq == last.seq => {
                self.outbox.answer(last.seq, Answer::Started);
            }
            None => self.outbox.answer(last.seq, Answer::Nak(NakReason::Stopped)),
        }
    }

    fn accept(&mut self, seq: u16, crc: u32, request: &Request) {
        self.last = Some(Accepted { seq, crc, answer: None });
        match self.perform(seq, request) {
            Ok(Outcome::Done(answer)) => self.conclude(seq, answer),
            Ok(Outcome::Told(answer)) => self.outbox.answer(seq, answer),
            Ok(Outcome::Running) => self.outbox.answer(seq, Answer::Started),
            Err(reason) => self.conclude(seq, Answer::Nak(reason)),
        }
    }

    /// Sends the final reply to request `seq`, and remembers it as long as `seq` is the last.
    pub(super) fn conclude(&mut self, seq: u16, answer: Answer) {
        if let Some(last) = &mut self.last
            && last.seq == seq
        {
            last.answer = Some(answer);
        }
        self.outbox.answer(seq, answer);
    }

    fn perform(&mut self, seq: u16, request: &Request) -> Result<Outcome, NakReason> {
        match request {
            Request::Identify => Ok(Outcome::Told(Answer::Identity)),
            Request::Stop => Ok(self.stop(seq)),
            Request::Reset => Ok(self.reset()),
            &Request::Resend { sweep, first, count } => Ok(self.resend(sweep, first, count)),
            &Request::KeepAlive { sweep, next } => Ok(self.keep_alive(sweep, next)),
            Request::Status => Ok(Outcome::Told(Answer::Status { ticks: self.now })),
            _ if self.phase != Phase::Idle => Err(NakReason::Busy),
            Request::Configure(settings) => self.configure(settings),
            Request::Home => self.home(seq),
            &Request::MoveTo { step } => self.move_to(seq, step),
            Request::Ping => self.ping(seq),
            Request::Sweep(plan) => self.sweep(seq, plan),
        }
    }

    /// A Stop from a host that does not know the boot nonce is obeyed all the same, but leaves
    /// the numbering alone.
    fn stop_for_stranger(&mut self, seq: u16) {
        match self.stop(seq) {
            Outcome::Done(answer) | Outcome::Told(answer) => self.outbox.answer(seq, answer),
            Outcome::Running => self.outbox.answer(seq, Answer::Started),
        }
    }

    fn stop(&mut self, seq: u16) -> Outcome {
        let turning = self.interrupt();
        self.end_run(SweepState::Stopped);
        if turning {
            self.enter(Phase::Stopping, seq);
            Outcome::Running
        } else {
            self.rest();
            Outcome::Done(Answer::Ack)
        }
    }

    fn reset(&mut self) -> Outcome {
        self.interrupt();
        self.release_coils();
        self.homed = false;
        self.end_run(SweepState::Stopped);
        self.rest();
        self.pending.add(Pending::RESET);
        Outcome::Done(Answer::Ack)
    }

    fn resend(&mut self, sweep: u16, first: u16, count: u8) -> Outcome {
        if sweep == self.run.plan.sweep {
            self.acknowledge(first);
            self.outbox.resend(first, count);
            self.try_fire();
        }
        Outcome::Told(Answer::Alive { ticks: self.now })
    }

    fn keep_alive(&mut self, sweep: u16, next: u16) -> Outcome {
        if sweep == self.run.plan.sweep {
            self.acknowledge(next);
            self.try_fire();
        }
        Outcome::Told(Answer::Alive { ticks: self.now })
    }

    /// Nobody can have what was never sent: it is kept, whatever is acknowledged.
    fn acknowledge(&mut self, next: u16) {
        self.ring.acknowledge(self.outbox.sent().min(next));
    }

    fn configure(&mut self, settings: &Settings) -> Result<Outcome, NakReason> {
        check_settings(settings, self.board.capabilities)?;
        self.settings = Some(*settings);
        self.rest();
        Ok(Outcome::Done(Answer::Ack))
    }

    fn home(&mut self, seq: u16) -> Result<Outcome, NakReason> {
        self.configured()?;
        self.homed = false;
        self.enter(Phase::Homing, seq);
        self.pending.add(Pending::PHASE);
        Ok(Outcome::Running)
    }

    fn move_to(&mut self, seq: u16, step: i32) -> Result<Outcome, NakReason> {
        self.configured()?;
        check_step(step)?;
        self.at_home()?;
        if step == self.step {
            return Ok(Outcome::Done(Answer::Ack));
        }
        self.enter(Phase::Moving { target: step }, seq);
        self.pending.add(Pending::PHASE);
        Ok(Outcome::Running)
    }

    fn ping(&mut self, seq: u16) -> Result<Outcome, NakReason> {
        self.configured()?;
        self.begin_run(Run::ping(seq, self.step));
        Ok(Outcome::Running)
    }

    fn sweep(&mut self, seq: u16, plan: &Sweep) -> Result<Outcome, NakReason> {
        self.configured()?;
        let beams = check_plan(plan)?;
        self.at_home()?;
        self.begin_run(Run::sweep(seq, *plan, beams));
        Ok(Outcome::Done(Answer::Ack))
    }

    fn configured(&self) -> Result<(), NakReason> {
        self.settings.map(|_| ()).ok_or(NakReason::NotConfigured)
    }

    fn at_home(&self) -> Result<(), NakReason> {
        if self.homed { Ok(()) } else { Err(NakReason::NotHomed) }
    }

    /// Begins a phase that serves request `seq`.
    pub(super) fn enter(&mut self, phase: Phase, seq: u16) {
        self.phase = phase;
        self.phase_seq = seq;
    }

    /// Takes back what is under way. Tells whether the motor turns and has been asked to stop.
    fn interrupt(&mut self) -> bool {
        let unpolled = self.pending.take(Pending::PHASE);
        match self.phase {
            Phase::Homing | Phase::Moving { .. } | Phase::Beam(Beam::Moving { .. }) => {
                if !unpolled {
                    self.pending.add(Pending::STOP_MOTION);
                }
                !unpolled
            }
            Phase::Beam(Beam::Listening) => {
                if !unpolled {
                    self.pending.add(Pending::ABORT_FIRE);
                }
                false
            }
            Phase::Stopping => true,
            Phase::Idle | Phase::Beam(Beam::Waiting) => false,
        }
    }
}

/// Questions change nothing, and who stops twice stands.
const fn may_be_done_twice(request: &Request) -> bool {
    matches!(
        request,
        Request::Stop | Request::Resend { .. } | Request::KeepAlive { .. } | Request::Status
    )
}
