//! Device that sends arbitrary well-formed replies, valid or not, to the host machine.
#![allow(unreachable_pub, reason = "a test file's part")]

mod arbitrary;

use firmware_protocol::frame::{Frame, FrameDecoder, Header, Received};
use firmware_protocol::host::{Command, Host, HostConfig, HostEvent};
use firmware_protocol::messages::{
    Alive, Blanking, Capabilities, Echoes, FirmwareVersion, Identity, PROTOCOL, Reading,
    ReadingStatus, Reply, Request, ResetCause, Settings, Status, Sweep, SweepState, Wire as _,
};

pub const BOOT: u16 = 0x1234;
pub const SETTINGS: Settings = Settings {
    window_ticks: 40_000,
    min_interval_ticks: 50_000,
    settle_ticks: 10_000,
    max_echoes: 2,
    blanking: Blanking::Internal,
    speed: 1_000,
    acceleration: 40_000,
    hold_s: 0,
};
pub const PLAN: Sweep =
    Sweep { sweep: 0, first_step: 0, stride: 1, stops: 12, pings_per_stop: 1, lease_ms: 1_000 };
/// Device clock at the start of the sweep, ticks.
pub const BEGAN: u32 = u32::MAX - 100_000;
/// Ticks from beam to beam.
pub const BEAM: u32 = 60_000;

pub const IDENTITY: Identity = Identity {
    protocol: PROTOCOL,
    firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
    serial: *b"ROGUE-0001",
    boot: BOOT,
    last_seq: None,
    tick_hz: 2_000_000,
    steps_per_revolution: 400,
    capabilities: Capabilities(1 | 4),
    ring_bytes: 256,
    reset_cause: ResetCause::PowerOn,
};

/// Host under test, and the requests and events that it has produced.
pub struct RogueDevice {
    pub host: Host,
    pub now_us: u64,
    pub boot: u16,
    /// Header and request of every frame sent by the host.
    pub requests: Vec<(Header, Request)>,
    pub events: Vec<HostEvent>,
}

impl RogueDevice {
    pub fn new() -> Self {
        let host = Host::new(HostConfig::new(115_200, 7));
        Self { host, now_us: 0, boot: BOOT, requests: Vec::new(), events: Vec::new() }
    }

    /// Identified, configured and homed, with a reported device clock.
    pub fn homed() -> Self {
        let mut rogue = Self::new();
        rogue.run(Command::Identify, Reply::Identity(IDENTITY));
        rogue.run(Command::Configure(SETTINGS), Reply::Ack);
        rogue.run(Command::Home, Reply::Homed { drift_steps: 0 });
        let status = Status { ticks: BEGAN, homed: true, configured: true, ..Status::BLANK };
        rogue.run(Command::Status, Reply::StatusReport(status));
        assert!(!rogue.host.is_busy(), "{:?}", rogue.events);
        rogue.events.clear();
        rogue
    }

    /// Sweep in progress, acknowledged.
    pub fn sweeping() -> Self {
        let mut rogue = Self::homed();
        rogue.run(Command::Sweep(PLAN), Reply::Ack);
        rogue
    }

    /// Starts a command and replies to its request.
    pub fn run(&mut self, command: Command, reply: Reply) {
        self.begin(command);
        self.reply(reply);
    }

    pub fn begin(&mut self, command: Command) {
        self.host.start(self.now_us, command).expect("begins");
        self.exchange();
    }

    /// Last request of the host.
    pub fn last_request(&self) -> (Header, Request) {
        *self.requests.last().expect("a request was sent")
    }

    /// Replies to the last request.
    pub fn reply(&mut self, reply: Reply) {
        let seq = self.last_request().0.seq;
        self.send(seq, reply);
    }

    pub fn send(&mut self, seq: u16, reply: Reply) {
        self.send_all(&[(Header { boot: self.boot, seq }, reply)]);
    }

    /// Sends all replies in a single block of bytes.
    pub fn send_all(&mut self, replies: &[(Header, Reply)]) {
        let mut bytes = Vec::new();
        for (header, reply) in replies {
            bytes.extend_from_slice(&Frame::encode(*header, reply).expect("fits"));
        }
        self.now_us += 1_000;
        self.host.handle_bytes(self.now_us, &bytes);
        self.exchange();
    }

    /// Advances the time to the next timeout of the host; returns `false` if there is none.
    pub fn wait(&mut self) -> bool {
        let Some((_, at_us)) = self.host.poll_timeout() else { return false };
        self.now_us = self.now_us.max(at_us);
        self.host.handle_timeout(self.now_us);
        self.exchange();
        true
    }

    pub fn exchange(&mut self) {
        while let Some(frame) = self.host.poll_transmit() {
            let mut decoder = FrameDecoder::new();
            for &byte in &*frame {
                if let Received::Frame(raw) = decoder.push(byte) {
                    self.requests.push((raw.header, Request::decode(raw.body).expect("a request")));
                }
            }
        }
        while let Some(event) = self.host.poll_event() {
            self.events.push(event);
        }
    }

    /// Sweep number and sequence number of the requested sweep.
    pub fn sweep(&self) -> (u16, u16) {
        let found = self.requests.iter().rev().find_map(|(header, request)| match request {
            Request::Sweep(plan) => Some((plan.sweep, header.seq)),
            _ => None,
        });
        found.expect("a sweep was requested")
    }

    /// Valid reading of beam `index`.
    pub fn reading(&self, index: u16) -> Reading {
        Reading {
            sweep: self.sweep().0,
            index,
            step: i32::from(index),
            fired_ticks: BEGAN.wrapping_add(1_000 + u32::from(index) * BEAM),
            status: ReadingStatus::Echo,
            echoes: Echoes::from_ticks(&[9_000, 20_000]),
        }
    }

    /// Sends a reading some time after it was fired.
    pub fn send_reading(&mut self, reading: Reading) {
        self.now_us += u64::from(BEAM) / 2;
        let seq = self.sweep().1;
        self.send(seq, Reply::Reading(reading));
    }

    /// Replies to KeepAlive or Resend like a device that has sent `sent` beams.
    pub fn alive(&mut self, sent: u16, state: SweepState) {
        let sweep = self.sweep().0;
        let ticks = BEGAN.wrapping_add(u32::from(sent) * BEAM);
        self.reply(Reply::Alive(Alive { ticks, sweep, fired: sent, sent, state }));
    }

    pub fn received_stop(&self) -> bool {
        self.requests.iter().any(|(_, request)| *request == Request::Stop)
    }
}
