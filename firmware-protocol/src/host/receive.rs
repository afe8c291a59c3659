//! Handling of replies and events.

use super::firings::check_after;
use super::validate::{check_drift, check_echoes, check_identity};
use super::{
    BoardChange, Host, HostError, HostEvent, IdentityFault, Outcome, ReadingFault, ReplyFault,
};
use crate::frame::Header;
use crate::messages::limits::POSITION_MAX;
use crate::messages::{
    Capabilities, FirmwareVersion, Identity, NakReason, PROTOCOL, ProtocolId, Reading, Reply,
    Request, Status,
};

/// Maximum time that a computer may have been suspended unnoticed during a Ping, us.
const PING_SLACK_US: u64 = 2_000_000;

impl Host {
    /// Handles an Identity: the reply to Identify, or the announcement of a device that has booted.
    pub(super) fn handle_identity(
        &mut self,
        now_us: u64,
        header: Header,
        identity: &Identity,
        wire_len: u8,
    ) {
        if self.request_with(header.seq) == Some(Request::Identify) {
            if identity.protocol != PROTOCOL {
                return self.wrong_version(identity.protocol, identity.firmware);
            }
            if let Err(fault) = check_identity(header, identity) {
                return self.wrong_identity(fault);
            }
            self.time_reply(now_us, wire_len);
            return self.identified(identity);
        }
        let identifying = self.exchange.as_ref().filter(|open| open.request == Request::Identify);
        if identifying.is_some() {
            // The device has just booted and may have missed the request.
            if let Some(open) = &mut self.exchange {
                open.deadline_us = now_us;
            }
        } else if self.is_new_boot(header.boot) || self.is_other_board(header, identity) {
            self.rebooted(header.boot);
        }
    }

    /// Returns `true` if a board announces itself with the known nonce but another identity.
    fn is_other_board(&self, header: Header, announced: &Identity) -> bool {
        let known = self.identity.as_ref().filter(|known| known.boot == header.boot);
        known.is_some_and(|known| BoardChange::between(known, announced).is_some())
    }

    fn wrong_identity(&mut self, fault: IdentityFault) {
        self.stats.rejected += 1;
        self.fail(HostError::InvalidIdentity(fault));
    }

    fn identified(&mut self, identity: &Identity) {
        let new = identity.boot;
        let other = self
            .last_identity
            .is_some_and(|last_identity| BoardChange::between(&last_identity, identity).is_some());
        if let Some(old) = self.boot
            && (old != new || other)
        {
            self.forget_boot(old);
            self.report(HostEvent::Rebooted { old, new });
        }
        if self.previous_boot == Some(new) {
            self.previous_boot = None;
        }
        self.boot = Some(new);
        self.identity = Some(*identity);
        self.last_identity = Some(*identity);
        if let Some(last_seq) = identity.last_seq {
            self.numbers.continue_from(last_seq);
        }
        self.end_job();
        self.report(HostEvent::Identified(*identity));
    }

    /// Handles a valid frame that contains no message of this version.
    pub(super) fn handle_undecodable(
        &mut self,
        device_version: Option<(ProtocolId, FirmwareVersion)>,
    ) {
        self.stats.dropped.undecodable = self.stats.dropped.undecodable.saturating_add(1);
        let identifying =
            self.exchange.as_ref().is_some_and(|open| open.request == Request::Identify);
        match device_version {
            Some((PROTOCOL, _)) if identifying => self.wrong_identity(IdentityFault::Form),
            Some((theirs, firmware)) if identifying => self.wrong_version(theirs, firmware),
            _ => {}
        }
    }

    fn wrong_version(&mut self, theirs: ProtocolId, firmware: FirmwareVersion) {
        self.fail(HostError::WrongVersion { ours: PROTOCOL, theirs, firmware });
    }

    pub(super) fn handle_reply(
        &mut self,
        now_us: u64,
        header: Header,
        reply: &Reply,
        wire_len: u8,
    ) {
        let request = self.request_with(header.seq);
        if !self.is_current_boot(header, reply, request) {
            return;
        }
        match *reply {
            Reply::Reading(reading) if reading.sweep != 0 => self.handle_beam(now_us, &reading),
            Reply::SweepDone(done) => self.handle_sweep_done(now_us, &done),
            Reply::Fault { kind } => {
                self.step = None;
                // The queue keeps places free for events that end a command.
                if self.has_room_for_reading() {
                    self.report(HostEvent::Fault(kind));
                }
                self.query_soon(now_us);
            }
            _ => match request {
                Some(request) => self.handle_answer(now_us, &request, reply, wire_len),
                None => self.count_stale(),
            },
        }
    }

    /// Distinguishes frames of the current boot from late copies, and detects a restart.
    fn is_current_boot(&mut self, header: Header, reply: &Reply, request: Option<Request>) -> bool {
        let current = match &self.identity {
            Some(identity) => identity.boot == header.boot,
            // A Stop before Identify.
            None => request == Some(Request::Stop),
        };
        if current {
            return true;
        }
        let answers = request.is_some() && !matches!(reply, Reply::Reading(_));
        if answers && self.is_new_boot(header.boot) {
            self.rebooted(header.boot);
        } else {
            self.count_stale();
        }
        false
    }

    fn is_new_boot(&self, boot: u16) -> bool {
        // No device has boot 0, so a frame with it proves nothing.
        boot != Header::BOOT_UNKNOWN
            && self.identity.as_ref().is_some_and(|identity| identity.boot != boot)
            && self.previous_boot != Some(boot)
    }

    fn rebooted(&mut self, new: u16) {
        let Some(old) = self.boot else { return };
        self.forget_boot(old);
        self.boot = Some(new);
        self.giving_up = None;
        let stopped = self.is_stopping();
        let reset = matches!(self.job, Some(super::Command::Reset));
        if reset {
            return self.finish(Outcome::Reset);
        }
        self.report(HostEvent::Rebooted { old, new });
        if stopped {
            // After a restart the motor is at rest.
            self.finish(Outcome::Stopped);
        } else if self.job.is_some() {
            self.fail(HostError::Rebooted);
        }
    }

    fn forget_boot(&mut self, old: u16) {
        self.previous_boot = Some(old);
        self.boot = None;
        self.identity = None;
        self.settings = None;
        self.step = None;
        self.device_time.forget();
    }

    fn count_stale(&mut self) {
        self.stats.dropped.stale = self.stats.dropped.stale.saturating_add(1);
    }

    /// Handles a reply with the number of the open request.
    fn handle_answer(&mut self, now_us: u64, request: &Request, reply: &Reply, wire_len: u8) {
        match (*reply, *request) {
            (Reply::Nak { reason: NakReason::SequenceReused }, _) => self.renumber(now_us),
            (Reply::Nak { reason }, Request::KeepAlive { .. } | Request::Resend { .. }) => {
                self.stop_and_fail(now_us, HostError::Rejected(reason));
            }
            (Reply::Nak { reason }, _) => self.fail(HostError::Rejected(reason)),
            (Reply::Started, _) if self.is_started() => self.count_stale(),
            (Reply::Started, _) => {
                self.time_reply(now_us, wire_len);
                self.started(now_us);
            }
            (Reply::Ack, _) => self.handle_ack(now_us, request, wire_len),
            (Reply::Homed { drift_steps }, Request::Home) => self.handle_homed(drift_steps),
            (Reply::Reading(reading), Request::Ping) => self.handle_ping(now_us, &reading),
            (Reply::StatusReport(status), Request::Status) => {
                self.handle_status(now_us, &status, wire_len);
            }
            (Reply::Alive(alive), Request::KeepAlive { .. } | Request::Resend { .. }) => {
                self.handle_alive(now_us, &alive, wire_len);
            }
            _ => self.count_stale(),
        }
    }

    fn handle_ack(&mut self, now_us: u64, request: &Request, wire_len: u8) {
        match *request {
            Request::Configure(settings) => {
                self.time_reply(now_us, wire_len);
                self.settings = Some(settings);
                self.finish(Outcome::Configured);
            }
            Request::MoveTo { step } => {
                self.step = Some(step);
                self.finish(Outcome::Moved { step });
            }
            Request::Sweep(_) => {
                self.time_reply(now_us, wire_len);
                self.exchange = None;
            }
            Request::Stop => self.stopped(),
            Request::Reset => {
                if let Some(old) = self.boot {
                    self.forget_boot(old);
                }
                self.finish(Outcome::Reset);
            }
            _ => self.count_stale(),
        }
    }

    fn handle_homed(&mut self, drift_steps: i32) {
        let checked = self.identity.as_ref().map(|identity| check_drift(drift_steps, identity));
        match checked {
            Some(Err(fault)) => self.reject_reply(fault),
            _ => {
                self.step = Some(0);
                self.finish(Outcome::Homed { drift_steps });
            }
        }
    }

    fn handle_ping(&mut self, now_us: u64, reading: &Reading) {
        // Without a free place the request is repeated, and the device sends its stored reply.
        if !self.has_room_for_reading() {
            return;
        }
        match self.check_ping(now_us, reading) {
            Ok(()) => {
                self.stats.readings += 1;
                self.report(HostEvent::Reading { reading: *reading, repaired: false });
                self.finish(Outcome::Pinged);
            }
            Err(error) => {
                self.stats.rejected += 1;
                self.fail(error);
            }
        }
    }

    fn check_ping(&self, now_us: u64, reading: &Reading) -> Result<(), HostError> {
        let Reading { index, step, .. } = *reading;
        let planned = self.step.or(Some(step)).filter(|_| index == 0);
        if planned != Some(step) {
            return Err(HostError::WrongReading { index, step, planned });
        }
        let check = || {
            if let Some(settings) = &self.settings {
                check_echoes(reading, settings)?;
            }
            let sent_us = self.exchange.as_ref().map_or(now_us, |open| open.sent_us);
            check_after(self.device_time.floor(sent_us), reading.fired_ticks)?;
            self.check_past(now_us, reading, PING_SLACK_US)
        };
        check().map_err(HostError::InvalidReading)
    }

    /// Rejects a reading from the future, unless the device's clock jumps.
    pub(super) fn check_past(
        &self,
        now_us: u64,
        reading: &Reading,
        slack_us: u64,
    ) -> Result<(), ReadingFault> {
        let jumps = self
            .identity
            .as_ref()
            .is_some_and(|identity| identity.capabilities.has(Capabilities::VIRTUAL_CLOCK));
        if jumps {
            return Ok(());
        }
        self.device_time.check_past(now_us, reading.fired_ticks, slack_us)
    }

    fn handle_status(&mut self, now_us: u64, status: &Status, wire_len: u8) {
        let step = status.step;
        if status.homed && !(-POSITION_MAX..=POSITION_MAX).contains(&step) {
            return self.reject_reply(ReplyFault::Position { step });
        }
        self.time_reply(now_us, wire_len);
        self.step = status.homed.then_some(step);
        self.report_clock(now_us, status.ticks);
        self.finish(Outcome::Status(*status));
    }

    fn reject_reply(&mut self, fault: ReplyFault) {
        self.stats.rejected += 1;
        self.fail(HostError::InvalidReply(fault));
    }

    pub(super) fn report_clock(&mut self, now_us: u64, device_ticks: u32) {
        let Some(open) = &self.exchange else { return };
        let (sent_us, retried) = (open.sent_us, open.attempts > 1);
        self.device_time.record(sent_us, device_ticks);
        if self.has_room_for_reading() {
            let received_us = now_us;
            self.report(HostEvent::ClockSample { sent_us, received_us, device_ticks, retried });
        }
    }
}
