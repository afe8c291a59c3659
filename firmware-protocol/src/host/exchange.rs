//! Exchange of a request and its reply: numbering, deadlines, repetition.

use super::config::{SEQ_GAP_MAX, STOP_ATTEMPTS};
use super::deadline::{beam_us, longest_frame_us, slew_us, wire_us};
use super::{Command, Host, HostError};
use crate::frame::{Frame, Header};
use crate::messages::{Request, Settings};

/// Request that waits for its reply.
#[derive(Debug, Clone)]
pub(super) struct OpenRequest {
    pub(super) request: Request,
    pub(super) seq: u16,
    /// Time of the first transmission, us.
    pub(super) sent_us: u64,
    /// Transmissions in total.
    pub(super) attempts: u8,
    /// Transmissions since the device last replied Started.
    unanswered: u8,
    /// `true` after the device has replied Started.
    pub(super) started: bool,
    /// Number of times that the expected duration of the work has passed.
    overruns: u8,
    pub(super) deadline_us: u64,
    frame: Frame,
}

/// Generator of sequence and sweep numbers.
#[derive(Debug, Clone)]
pub(super) struct Numbers {
    seq: u16,
    sweep: u16,
    random: u32,
}

impl Numbers {
    pub(super) fn new(seed: u32) -> Self {
        let mut numbers = Self { seq: 0, sweep: 0, random: seed | 1 };
        numbers.seq = numbers.random();
        numbers.sweep = numbers.random();
        numbers
    }

    /// Returns a number from Marsaglia's xorshift, which only has to differ between runs.
    fn random(&mut self) -> u16 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        (self.random >> 16) as u16
    }

    fn next_seq(&mut self) -> u16 {
        self.seq = self.seq.wrapping_add(1);
        self.seq
    }

    /// Returns the next sweep number, never 0.
    pub(super) fn next_sweep(&mut self) -> u16 {
        self.sweep = self.sweep.wrapping_add(1).max(1);
        self.sweep
    }

    /// Continues after the last number that the device accepted, from any host. The random gap
    /// avoids numbers of requests from an earlier host that may still be in transit.
    pub(super) fn continue_from(&mut self, last_seq: u16) {
        if !(1..0x8000).contains(&self.seq.wrapping_sub(last_seq)) {
            self.seq = last_seq.wrapping_add(self.random() % SEQ_GAP_MAX);
        }
    }
}

impl Host {
    /// Sends a new request.
    pub(super) fn send(&mut self, now_us: u64, request: Request) {
        if matches!(request, Request::Home | Request::MoveTo { .. }) {
            self.device_time.forget();
        }
        let seq = self.numbers.next_seq();
        let boot = self.identity.as_ref().map_or(Header::BOOT_UNKNOWN, |identity| identity.boot);
        // Every request fits into a frame: checked by a test.
        let Ok(frame) = Frame::encode(Header { boot, seq }, &request) else {
            return;
        };
        let first = self.stats.frames_sent == 0 || matches!(request, Request::Identify);
        let frame = if first { frame.with_leading_delimiter() } else { frame };
        let exchange = OpenRequest {
            request,
            seq,
            sent_us: now_us,
            attempts: 1,
            unanswered: 1,
            started: false,
            overruns: 0,
            deadline_us: now_us,
            frame,
        };
        self.transmit(now_us, exchange);
    }

    fn transmit(&mut self, now_us: u64, mut exchange: OpenRequest) {
        exchange.deadline_us = now_us + self.reply_time_us(&exchange);
        self.outgoing = Some(exchange.frame);
        self.exchange = Some(exchange);
        if let Some(track) = &mut self.track {
            track.frame_sent(now_us);
        }
    }

    /// Repeats the same bytes after a timeout, or gives up.
    pub(super) fn retry(&mut self, now_us: u64) {
        let Some(mut exchange) = self.exchange.take() else {
            return;
        };
        if exchange.started {
            // The device is present, so only its final reply may have been lost.
            exchange.overruns += 1;
            exchange.unanswered = 0;
        }
        if self.is_exhausted(&exchange) {
            return self.give_up(now_us, &exchange);
        }
        exchange.attempts = exchange.attempts.saturating_add(1);
        exchange.unanswered += 1;
        exchange.started = false;
        exchange.frame = exchange.frame.with_leading_delimiter();
        self.stats.retries += 1;
        self.transmit(now_us, exchange);
    }

    /// Repeats the request with the next number, because the number was already in use.
    pub(super) fn renumber(&mut self, now_us: u64) {
        let Some(exchange) = self.exchange.take() else {
            return;
        };
        if self.is_exhausted(&exchange) {
            return self.give_up(now_us, &exchange);
        }
        self.stats.retries += 1;
        self.send(now_us, exchange.request);
        if let Some(renewed) = &mut self.exchange {
            renewed.attempts = exchange.attempts.saturating_add(1);
            renewed.unanswered = exchange.unanswered + 1;
            renewed.overruns = exchange.overruns;
        }
    }

    fn is_exhausted(&self, exchange: &OpenRequest) -> bool {
        let attempts = if self.giving_up.is_some() {
            STOP_ATTEMPTS.min(self.config.max_attempts)
        } else {
            self.config.max_attempts
        };
        exchange.unanswered >= attempts || exchange.overruns >= self.config.max_overruns
    }

    /// Ends a failed exchange. A device that replied since the first transmission may still be
    /// active and is stopped.
    fn give_up(&mut self, now_us: u64, exchange: &OpenRequest) {
        let error = self.exhausted_error(now_us, exchange);
        if self.last_frame_us.is_some_and(|last_frame_us| last_frame_us >= exchange.sent_us) {
            self.stop_and_fail(now_us, error);
        } else {
            self.fail(error);
        }
    }

    /// Fails the command, after stopping the device if that may be active.
    pub(super) fn stop_and_fail(&mut self, now_us: u64, error: HostError) {
        let at_work = matches!(
            self.job,
            Some(Command::Sweep(_) | Command::Home | Command::MoveTo { .. } | Command::Ping)
        );
        if !at_work || self.giving_up.is_some() || self.identity.is_none() {
            return self.fail(error);
        }
        self.giving_up = Some(error);
        self.track = None;
        self.send(now_us, Request::Stop);
    }

    fn exhausted_error(&self, now_us: u64, exchange: &OpenRequest) -> HostError {
        let (bytes, frames) = self.received_before;
        let bytes = self.stats.bytes_received - bytes;
        if exchange.started {
            let waited_us = now_us.saturating_sub(exchange.sent_us);
            HostError::Overrun { waited_ms: u32::try_from(waited_us / 1_000).unwrap_or(u32::MAX) }
        } else if bytes > 0 && self.stats.frames_received == frames {
            HostError::NotADevice { bytes }
        } else {
            HostError::NoAnswer { attempts: exchange.unanswered }
        }
    }

    /// Restarts the deadline after Started: from now on the work counts, not the line.
    pub(super) fn started(&mut self, now_us: u64) {
        let Some(exchange) = &self.exchange else {
            return;
        };
        let time = self.work_us(&exchange.request)
            + 2 * longest_frame_us(self.config.baud)
            + self.margin.us(exchange.attempts);
        if let Some(exchange) = &mut self.exchange {
            exchange.started = true;
            exchange.deadline_us = now_us + time;
        }
    }

    /// Time until the reply must have arrived, us: both frames, a frame that the device may be
    /// sending, the readings that precede the reply, and the margin.
    fn reply_time_us(&self, exchange: &OpenRequest) -> u64 {
        let longest = longest_frame_us(self.config.baud);
        let before = match exchange.request {
            Request::Resend { count, .. } => u64::from(count) * longest,
            _ => 0,
        };
        let bytes = wire_us(exchange.frame.len(), self.config.baud) + 2 * longest + before;
        let mut margin = self.margin.us(exchange.attempts);
        if let Some(track) = &self.track {
            // The back-off must not let the lease expire.
            margin = margin.min((track.lease_us / 4).max(self.margin.us(1)));
        }
        bytes + margin
    }

    /// Expected duration of the work on a request, us.
    fn work_us(&self, request: &Request) -> u64 {
        let Some(settings) = &self.settings else {
            return 0;
        };
        let revolution = self.identity.as_ref().map_or(0, |id| u32::from(id.steps_per_revolution));
        match *request {
            Request::Home => slew_us(2 * revolution, settings),
            Request::MoveTo { step } => {
                let distance = match self.step {
                    Some(from) => step.abs_diff(from),
                    None => step.unsigned_abs() + revolution,
                };
                slew_us(distance, settings)
            }
            Request::Ping => beam_us(settings),
            Request::Stop => braking_us(settings),
            _ => 0,
        }
    }

    /// Adds the reply time to the margin estimate, if the reply belongs to a single transmission.
    pub(super) fn time_reply(&mut self, now_us: u64, wire_len: u8) {
        let Some(exchange) = &self.exchange else {
            return;
        };
        let unambiguous =
            exchange.attempts == 1 && !matches!(exchange.request, Request::Resend { .. });
        if unambiguous && !exchange.started {
            let baud = self.config.baud;
            let on_wire = wire_us(exchange.frame.len() + usize::from(wire_len), baud);
            let taken = now_us.saturating_sub(exchange.sent_us);
            self.margin.sample(taken.saturating_sub(on_wire));
        }
    }

    /// Returns the open request if `seq` is its number.
    pub(super) fn request_with(&self, seq: u16) -> Option<Request> {
        self.exchange.as_ref().filter(|exchange| exchange.seq == seq).map(|open| open.request)
    }

    pub(super) fn is_started(&self) -> bool {
        self.exchange.as_ref().is_some_and(|open| open.started)
    }

    pub(super) fn is_stopping(&self) -> bool {
        matches!(self.job, Some(Command::Stop))
    }
}

/// Braking time from full speed to rest, us.
fn braking_us(settings: &Settings) -> u64 {
    u64::from(settings.speed) * 1_000_000 / u64::from(settings.acceleration.max(1))
}
