//! A device made of nothing but well-formed replies, true or not, against the host machine.
#![allow(unreachable_pub, reason = "a test file's part")]

mod made_up;

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
/// Device time when the sweep begins.
pub const BEGAN: u32 = u32::MAX - 100_000;
/// From beam to beam, ticks.
pub const BEAM: u32 = 60_000;

pub const IDENTITY: Identity = Identity {
    protocol: PROTOCOL,
    firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
    serial: *b"STRANGER-1",
    boot: BOOT,
    last_seq: None,
    tick_hz: 2_000_000,
    steps_per_revolution: 400,
    capabilities: Capabilities(1 | 4),
    ring_bytes: 256,
    reset_cause: ResetCause::PowerOn,
};

/// The host, and what it said last.
pub struct Stranger {
    pub host: Host,
    pub now_us: u64,
    pub boot: u16,
    /// Header and request of every frame the host sent.
    pub asked: Vec<(Header, Request)>,
    pub events: Vec<HostEvent>,
}

impl Stranger {
    pub fn new() -> Self {
        let host = Host::new(HostConfig::new(115_200, 7));
        Self { host, now_us: 0, boot: BOOT, asked: Vec::new(), events: Vec::new() }
    }

    /// Identified, configured, homed, and asked for its clock.
    pub fn homed() -> Self {
        let mut stranger = Self::new();
        stranger.run(Command::Identify, Reply::Identity(IDENTITY));
        stranger.run(Command::Configure(SETTINGS), Reply::Ack);
        stranger.run(Command::Home, Reply::Homed { drift_steps: 0 });
        let status = Status { ticks: BEGAN, homed: true, configured: true, ..Status::BLANK };
        stranger.run(Command::Status, Reply::StatusReport(status));
        assert!(!stranger.host.is_busy(), "{:?}", stranger.events);
        stranger.events.clear();
        stranger
    }

    /// In a sweep that was acknowledged.
    pub fn sweeping() -> Self {
        let mut stranger = Self::homed();
        stranger.run(Command::Sweep(PLAN), Reply::Ack);
        stranger
    }

    /// Begins a command and answers its request.
    pub fn run(&mut self, command: Command, reply: Reply) {
        self.begin(command);
        self.answer(reply);
    }

    pub fn begin(&mut self, command: Command) {
        self.host.start(self.now_us, command).expect("begins");
        self.exchange();
    }

    /// What the host asked last.
    pub fn last(&self) -> (Header, Request) {
        *self.asked.last().expect("the host has said something")
    }

    /// Answers what the host asked last.
    pub fn answer(&mut self, reply: Reply) {
        let seq = self.last().0.seq;
        self.say(seq, reply);
    }

    pub fn say(&mut self, seq: u16, reply: Reply) {
        self.say_all(&[(Header { boot: self.boot, seq }, reply)]);
    }

    /// All in one piece.
    pub fn say_all(&mut self, replies: &[(Header, Reply)]) {
        let mut bytes = Vec::new();
        for (header, reply) in replies {
            bytes.extend_from_slice(&Frame::encode(*header, reply).expect("fits"));
        }
        self.now_us += 1_000;
        self.host.handle_bytes(self.now_us, &bytes);
        self.exchange();
    }

    /// Lets time pass until the host asks for something or comes to an end; false if it waits for
    /// nothing.
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
                    self.asked.push((raw.header, Request::decode(raw.body).expect("a request")));
                }
            }
        }
        while let Some(event) = self.host.poll_event() {
            self.events.push(event);
        }
    }

    /// Sweep number and sequence number of the sweep that was asked for.
    pub fn sweep(&self) -> (u16, u16) {
        let found = self.asked.iter().rev().find_map(|(header, request)| match request {
            Request::Sweep(plan) => Some((plan.sweep, header.seq)),
            _ => None,
        });
        found.expect("a sweep was asked for")
    }

    /// A true reading of beam `index`.
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

    /// Tells of a beam, some time after it was fired.
    pub fn tell(&mut self, reading: Reading) {
        self.now_us += u64::from(BEAM) / 2;
        let seq = self.sweep().1;
        self.say(seq, Reply::Reading(reading));
    }

    /// Answers KeepAlive and Resend as a device that has sent `sent` beams.
    pub fn alive(&mut self, sent: u16, state: SweepState) {
        let sweep = self.sweep().0;
        let ticks = BEGAN.wrapping_add(u32::from(sent) * BEAM);
        self.answer(Reply::Alive(Alive { ticks, sweep, fired: sent, sent, state }));
    }

    pub fn asks_to_stop(&self) -> bool {
        self.asked.iter().any(|(_, request)| *request == Request::Stop)
    }
}
