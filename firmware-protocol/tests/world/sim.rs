//! Joint simulation of host, line, device and board; time jumps from event to event.

use firmware_protocol::frame::{FrameDecoder, Received};
use firmware_protocol::host::{Command, Host, HostConfig, HostEvent};
use firmware_protocol::messages::Reply;

use super::World;
use super::line::{Faults, Line, Random};

const NS_PER_TICK: u64 = 500;
const NS_PER_US: u64 = 1_000;
/// Maximum number of bytes that a UART accepts at a time.
const FIFO: usize = 8;

/// Replies at one end of the line, with the numbers of their requests.
#[derive(Debug, Default)]
pub struct ReplyLog {
    decoder: FrameDecoder,
    pub replies: Vec<(u16, Reply)>,
}

impl ReplyLog {
    fn record(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if let Received::Frame(raw) = self.decoder.push(byte)
                && let Ok(reply) = Reply::decode(raw.body)
            {
                self.replies.push((raw.header.seq, reply));
            }
        }
    }
}

/// Both machines and everything in between.
pub struct Sim {
    pub host: Host,
    pub world: World,
    pub up: Line,
    pub down: Line,
    pub now_ns: u64,
    pub events: Vec<(u64, HostEvent)>,
    /// Replies as sent by the device.
    pub sent: ReplyLog,
    /// Replies as received by the host.
    pub received: ReplyLog,
    /// Time at which the device restarts.
    pub reboot_at_ns: Option<u64>,
    /// Time at which the line is cut.
    pub hangup_at_ns: Option<u64>,
    /// Time at which the emergency stop is pressed.
    pub emergency_at_ns: Option<u64>,
    /// End of the time after a restart during which the device receives nothing, as in a boot
    /// loader.
    booting_until_ns: u64,
    pub iterations: u64,
}

/// Simulation error: the time or iteration limit was reached.
#[derive(Debug)]
pub struct Hang;

impl Sim {
    pub fn new(seed: u64, baud: u32, faults: Faults) -> Self {
        let mut random = Random::new(seed);
        let config = HostConfig::new(baud, random.next() as u32);
        let offset = random.next() as u32;
        let boot = random.next() as u16;
        Self {
            host: Host::new(config),
            world: World::new(boot, offset),
            up: Line::new(u64::from(baud), faults, Random::new(random.next())),
            down: Line::new(u64::from(baud), faults, Random::new(random.next())),
            now_ns: 0,
            events: Vec::new(),
            sent: ReplyLog::default(),
            received: ReplyLog::default(),
            reboot_at_ns: None,
            hangup_at_ns: None,
            emergency_at_ns: None,
            booting_until_ns: 0,
            iterations: 0,
        }
    }

    pub fn now_us(&self) -> u64 {
        self.now_ns / NS_PER_US
    }

    pub fn start(&mut self, command: Command) {
        let now = self.now_us();
        self.host.start(now, command).expect("free and prepared");
    }

    /// Runs `command` to its end and returns the events since its start.
    pub fn run(&mut self, command: Command) -> Result<Vec<HostEvent>, Hang> {
        let first = self.events.len();
        self.start(command);
        self.run_while(|sim| sim.host.is_busy())?;
        Ok(self.events[first..].iter().map(|(_, event)| *event).collect())
    }

    /// Advances the time.
    pub fn idle(&mut self, us: u64) -> Result<(), Hang> {
        let end = self.now_ns + us * NS_PER_US;
        self.run_while_until(|_| true, end)
    }

    pub fn run_while(&mut self, busy: impl Fn(&Self) -> bool) -> Result<(), Hang> {
        // Half an hour is far more than any test takes.
        let end = self.now_ns + 1_800_000_000_000;
        self.run_while_until(busy, end)?;
        if self.now_ns >= end { Err(Hang) } else { Ok(()) }
    }

    fn run_while_until(&mut self, busy: impl Fn(&Self) -> bool, end: u64) -> Result<(), Hang> {
        let mut at_once = 0;
        loop {
            self.step();
            if !busy(self) {
                return Ok(());
            }
            let next = self.next_ns().unwrap_or(end);
            if next >= end {
                self.now_ns = end;
                self.world.advance(end / NS_PER_TICK);
                return Ok(());
            }
            at_once = if next <= self.now_ns { at_once + 1 } else { 0 };
            if at_once > 1_000 {
                return Err(Hang);
            }
            self.iterations += 1;
            self.now_ns = next.max(self.now_ns);
            self.world.advance(self.now_ns / NS_PER_TICK);
        }
    }

    fn step(&mut self) {
        self.trigger_events();
        let to_device = self.up.arrived(self.now_ns);
        if self.now_ns >= self.booting_until_ns {
            self.world.device.handle_bytes(self.world.ticks(), &to_device);
        }
        self.world.settle();
        self.device_sends();
        let now_us = self.now_us();
        let to_host = self.down.arrived(self.now_ns);
        self.received.record(&to_host);
        if !to_host.is_empty() {
            self.host.handle_bytes(now_us, &to_host);
        }
        if self.host.poll_timeout().is_some_and(|(_, at)| at <= now_us) {
            self.host.handle_timeout(now_us);
        }
        while let Some(frame) = self.host.poll_transmit() {
            self.up.send(self.now_ns, &frame);
        }
        while let Some(event) = self.host.poll_event() {
            self.events.push((now_us, event));
        }
    }

    fn trigger_events(&mut self) {
        let now = self.now_ns;
        let due = |at: &mut Option<u64>| at.take_if(|at| *at <= now).is_some();
        if due(&mut self.reboot_at_ns) {
            self.world.reboot();
            self.booting_until_ns = now + 50_000_000;
        }
        if due(&mut self.emergency_at_ns) {
            let ticks = self.world.ticks();
            self.world.device.handle_emergency_stop(ticks);
        }
        if due(&mut self.hangup_at_ns) {
            self.up.cut();
            self.down.cut();
            let now_us = self.now_us();
            self.host.handle_hangup(now_us);
        }
    }

    fn device_sends(&mut self) {
        while self.down.free_at() <= self.now_ns {
            let mut fifo = [0; FIFO];
            let count = self.world.device.poll_transmit(&mut fifo);
            if count == 0 {
                return;
            }
            self.sent.record(&fifo[..count]);
            self.down.send(self.now_ns, &fifo[..count]);
            // A Reset may wait until the line has drained.
            self.world.settle();
        }
    }

    fn next_ns(&self) -> Option<u64> {
        let busy_line = Some(self.down.free_at()).filter(|&at| at > self.now_ns);
        [
            self.up.next_arrival(),
            self.down.next_arrival(),
            busy_line,
            self.world.next_event().map(|tick| tick * NS_PER_TICK),
            self.host.poll_timeout().map(|(_, us)| us * NS_PER_US),
            self.reboot_at_ns,
            self.hangup_at_ns,
            self.emergency_at_ns,
        ]
        .into_iter()
        .flatten()
        .min()
    }
}
