//! Replies, raw bytes, time and commands in any order into the host machine. It must not panic,
//! deliver a beam twice, or wait for ever with a command under way.
#![no_main]

use std::collections::BTreeSet;

use firmware_protocol::frame::{Frame, FrameDecoder, Header, Received};
use firmware_protocol::host::{Command, Host, HostConfig, HostEvent};
use firmware_protocol::messages::{Blanking, Reply, Settings, Sweep};
use libfuzzer_sys::fuzz_target;

const SETTINGS: Settings = Settings {
    window_ticks: 48_000,
    min_interval_ticks: 0,
    settle_ticks: 0,
    max_echoes: 8,
    blanking: Blanking::Internal,
    speed: 2_000,
    acceleration: 40_000,
    hold_s: 0,
};

struct Line {
    host: Host,
    now_us: u64,
    /// Header of the latest request.
    latest: Header,
    beams: BTreeSet<(u16, u16)>,
}

fuzz_target!(|bytes: &[u8]| {
    let mut line = Line {
        host: Host::new(HostConfig::new(115_200, 1)),
        now_us: 0,
        latest: Header { boot: 0, seq: 0 },
        beams: BTreeSet::new(),
    };
    for chunk in bytes.chunks(40) {
        if let Some((&what, rest)) = chunk.split_first() {
            disturb(&mut line, what, rest);
        }
        poll(&mut line);
    }
    wait_for_the_end(&mut line);
});

fn disturb(line: &mut Line, what: u8, rest: &[u8]) {
    match what & 0x07 {
        0..=3 => reply(line, what, rest),
        4 => line.host.handle_bytes(line.now_us, rest),
        5 => {
            // Up to an hour.
            let ahead = rest.iter().fold(0_u64, |sum, &byte| sum << 3 ^ u64::from(byte));
            line.now_us += ahead % 3_600_000_000;
            line.host.handle_timeout(line.now_us);
        }
        6 => {
            let command = command(what, rest);
            let _ = line.host.start(line.now_us, command);
        }
        _ if what == u8::MAX => line.host.handle_hangup(line.now_us),
        _ => line.host.handle_timeout(line.now_us),
    }
}

/// A right frame around any reply, mostly to the latest request.
fn reply(line: &mut Line, what: u8, rest: &[u8]) {
    let Some(reply) = decode_front(rest) else {
        return;
    };
    let mut header = line.latest;
    if let Reply::Identity(identity) = reply {
        header.boot = identity.boot;
    }
    header.boot ^= u16::from(what >> 7);
    header.seq ^= u16::from(what >> 6 & 1);
    let frame = Frame::encode(header, &reply).expect("every reply fits");
    line.host.handle_bytes(line.now_us, &frame);
}

/// The longest front of `bytes` that is a reply.
fn decode_front(bytes: &[u8]) -> Option<Reply> {
    (1..=bytes.len()).rev().find_map(|len| Reply::decode(&bytes[..len]).ok())
}

fn command(what: u8, rest: &[u8]) -> Command {
    let number = rest.first().copied().unwrap_or(1);
    match what >> 4 {
        0..=2 => Command::Identify,
        3..=5 => Command::Configure(SETTINGS),
        6 => Command::Home,
        7 => Command::MoveTo { step: i32::from(number) },
        8 => Command::Ping,
        9 => Command::Status,
        10 => Command::Stop,
        11 => Command::Reset,
        _ => Command::Sweep(Sweep {
            sweep: 0,
            first_step: 0,
            stride: 1,
            stops: u16::from(number),
            pings_per_stop: 2,
            lease_ms: 1_000,
        }),
    }
}

fn poll(line: &mut Line) {
    while let Some(frame) = line.host.poll_transmit() {
        let mut decoder = FrameDecoder::new();
        for &byte in frame.iter() {
            if let Received::Frame(raw) = decoder.push(byte) {
                line.latest = raw.header;
            }
        }
    }
    while let Some(event) = line.host.poll_event() {
        if let HostEvent::Reading { reading, .. } = event
            && reading.sweep != 0
        {
            assert!(line.beams.insert((reading.sweep, reading.index)), "delivered twice");
        }
    }
}

/// With a silent device every command must end after a bounded number of timeouts.
fn wait_for_the_end(line: &mut Line) {
    for _ in 0..100 {
        if !line.host.is_busy() {
            return;
        }
        let (_, at) = line.host.poll_timeout().expect("waits for ever");
        line.now_us = line.now_us.max(at);
        line.host.handle_timeout(line.now_us);
        poll(line);
    }
    panic!("never ends");
}
