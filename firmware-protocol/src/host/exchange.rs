//! One request at a time: numbering, deadlines, repeating.

use super::config::{SEQ_GAP_MAX, STOP_ATTEMPTS};
use super::deadline::{beam_us, longest_frame_us, slew_us, wire_us};
use super::{Command, Host, HostError};
use crate::frame::{Frame, Header};
use crate::messages::{Request, Settings};

/// The request that waits for its reply.
#[derive(Debug, Clone)]
pub(super) struct Exchange {
    pub(super) request: Request,
    pub(super) seq: u16,
    /// When it was sent for the first time.
    pub(super) sent_us: u64,
    pub(super) attempts: u8,
    /// The device has said that it is at it.
    pub(super) started: bool,
    /// How often the time of its work has passed since then.
    overruns: u8,
    pub(super) deadline_us: u64,
    frame: Frame,
}

/// Where sequence and sweep numbers come from.
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

    /// Marsaglia's xorshift; only has to differ from run to run.
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

    /// A sweep number, never 0.
    pub(super) fn next_sweep(&mut self) -> u16 {
        self.sweep = self.sweep.wrapping_add(1).max(1);
        self.sweep
    }

    /// Goes on behind the last number that the device accepted, from whatever host. The gap
    /// keeps clear of requests of an earlier host that may still be on their way.
    pub(super) fn follow(&mut self, last_seq: u16) {
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
        // Every request fits a frame; there is a test.
        let Ok(frame) = Frame::encode(Header { boot, seq }, &request) else {
            return;
        };
        let first = self.stats.frames_sent == 0 || matches!(request, Request::Identify);
        let frame = if first { frame.with_leading_delimiter() } else { frame };
        let exchange = Exchange {
            request,
            seq,
            sent_us: now_us,
            attempts: 1,
            started: false,
            overruns: 0,
            deadline_us: now_us,
            frame,
        };
        self.transmit(now_us, exchange);
    }

    fn transmit(&mut self, now_us: u64, mut exchange: Exchange) {
        exchange.deadline_us = now_us + self.reply_time_us(&exchange);
        self.outgoing = Some(exchange.frame);
        self.exchange = Some(exchange);
        if let Some(track) = &mut self.track {
            track.frame_sent(now_us);
        }
    }

    /// No reply in time: sends the same bytes again, or gives up.
    pub(super) fn retry(&mut self, now_us: u64) {
        let Some(mut exchange) = self.exchange.take() else {
            return;
        };
        exchange.overruns += u8::from(exchange.started);
        if self.is_exhausted(&exchange) {
            return self.give_up_on(now_us, &exchange);
        }
        exchange.attempts += 1;
        exchange.started = false;
        exchange.frame = exchange.frame.with_leading_delimiter();
        self.stats.retries += 1;
        self.transmit(now_us, exchange);
    }

    /// The number was taken: the same request under the next one.
    pub(super) fn renumber(&mut self, now_us: u64) {
        let Some(exchange) = self.exchange.take() else {
            return;
        };
        if self.is_exhausted(&exchange) {
            return self.give_up_on(now_us, &exchange);
        }
        self.stats.retries += 1;
        self.send(now_us, exchange.request);
        if let Some(renewed) = &mut self.exchange {
            renewed.attempts = exchange.attempts + 1;
        }
    }

    fn is_exhausted(&self, exchange: &Exchange) -> bool {
        let attempts = if self.giving_up.is_some() {
            STOP_ATTEMPTS.min(self.config.max_attempts)
        } else {
            self.config.max_attempts
        };
        exchange.attempts >= attempts || exchange.overruns >= self.config.max_overruns
    }

    /// The exchange came to nothing. A device that has said something since it began may still be
    /// at work.
    fn give_up_on(&mut self, now_us: u64, exchange: &Exchange) {
        let error = self.gave_up(now_us, exchange);
        if self.heard_us.is_some_and(|heard_us| heard_us >= exchange.sent_us) {
            self.give_up(now_us, error);
        } else {
            self.fail(error);
        }
    }

    /// Ends the command by an error, and before that whatever the device is at.
    pub(super) fn give_up(&mut self, now_us: u64, error: HostError) {
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

    fn gave_up(&self, now_us: u64, exchange: &Exchange) -> HostError {
        let (bytes, frames) = self.received_before;
        let bytes = self.stats.bytes_received - bytes;
        if exchange.started {
            let waited_us = now_us.saturating_sub(exchange.sent_us);
            HostError::Overrun { waited_ms: u32::try_from(waited_us / 1_000).unwrap_or(u32::MAX) }
        } else if bytes > 0 && self.stats.frames_received == frames {
            HostError::NotADevice { bytes }
        } else {
            HostError::NoAnswer { attempts: exchange.attempts }
        }
    }

    /// The device is at it: now its work counts, not the line.
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

    /// Until a reply must have come: both frames, one that the device was just sending, what it
    /// was asked to send first, and the margin.
    fn reply_time_us(&self, exchange: &Exchange) -> u64 {
        let longest = longest_frame_us(self.config.baud);
        let before = match exchange.request {
            Request::Resend { count, .. } => u64::from(count) * longest,
            _ => 0,
        };
        let bytes = wire_us(exchange.frame.len(), self.config.baud) + 2 * longest + before;
        let mut margin = self.margin.us(exchange.attempts);
        if let Some(track) = &self.track {
            // Backing off must not let the lease run out.
            margin = margin.min((track.lease_us / 4).max(self.margin.us(1)));
        }
        bytes + margin
    }

    /// How long the device works on a request that it has begun.
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

    /// A reply to the open request came in: times it, if it can be told which sending it answers.
    pub(super) fn time_reply(&mut self, now_us: u64, wire_len: u8) {
        let Some(exchange) = &self.exchange else {
            return;
        };
        let clear = exchange.attempts == 1 && !matches!(exchange.request, Request::Resend { .. });
        if clear && !exchange.started {
            let baud = self.config.baud;
            let on_wire = wire_us(exchange.frame.len() + usize::from(wire_len), baud);
            let taken = now_us.saturating_sub(exchange.sent_us);
            self.margin.sample(taken.saturating_sub(on_wire));
        }
    }

    /// The open request, if `seq` is its number.
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

/// From full speed to rest.
fn braking_us(settings: &Settings) -> u64 {
    u64::from(settings.speed) * 1_000_000 / u64::from(settings.acceleration.max(1))
}
