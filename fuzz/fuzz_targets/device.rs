//! Requests, raw bytes, time and a board that does anything at any moment, into the device
//! machine. It must not panic, fire while the motor turns, or turn while it listens.
#![no_main]

use firmware_protocol::device::{Action, Board, Device, EchoReport, HomeError};
use firmware_protocol::frame::{Frame, FrameDecoder, Header, Received};
use firmware_protocol::messages::{
    Capabilities, Echoes, FirmwareVersion, ReadingStatus, Reply, Request, ResetCause,
};
use libfuzzer_sys::fuzz_target;

const BOOT: u16 = 7;

#[derive(Default)]
struct Watched {
    target: Option<i32>,
    turning: bool,
    listening: bool,
    seq: u16,
    now: u32,
}

fuzz_target!(|bytes: &[u8]| {
    let mut device = Device::new(Board {
        boot: BOOT,
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: *b"FUZZED0001",
        steps_per_revolution: 400,
        capabilities: Capabilities(u16::MAX),
        reset_cause: ResetCause::Unknown,
    });
    let mut watched = Watched { now: u32::MAX - 1_000, ..Watched::default() };
    let mut line = FrameDecoder::new();
    for chunk in bytes.chunks(12) {
        if let Some((&what, rest)) = chunk.split_first() {
            disturb(&mut device, &mut watched, what, rest);
        }
        while let Some(action) = device.poll_action() {
            watch(&mut watched, action);
        }
        read_line(&mut device, &mut line, usize::from(chunk[0] >> 4));
        let _ = device.poll_timeout();
    }
});

fn disturb(device: &mut Device, watched: &mut Watched, what: u8, rest: &[u8]) {
    let number = rest.iter().fold(0_u32, |sum, &byte| sum << 8 | u32::from(byte));
    let now = watched.now;
    match what & 0x0f {
        0..=4 => send(device, watched, rest),
        5 => device.handle_bytes(now, rest),
        6 => {
            watched.now = now.wrapping_add(number);
            device.handle_timeout(watched.now);
        }
        7 | 8 => {
            watched.turning = false;
            device.handle_moved(now, watched.target.take().unwrap_or(number as i32));
        }
        9 => {
            watched.turning = false;
            device.handle_homed(now, Ok(number as i32));
        }
        10 => {
            watched.turning = false;
            device.handle_homed(now, Err(HomeError::IndexNotFound));
        }
        11 | 12 => {
            watched.listening = false;
            let echoes = Echoes::from_ticks(&[number; 8][..usize::from(what >> 5)]);
            let status = ReadingStatus::Echo;
            device.handle_echoes(now, &EchoReport { fired_ticks: now, status, echoes });
        }
        13 => device.handle_emergency_stop(now),
        14 => device.handle_motion_fault(now),
        _ => device.handle_line_error(now),
    }
}

/// A right frame around any body, mostly with the next number.
fn send(device: &mut Device, watched: &mut Watched, body: &[u8]) {
    let Ok(request) = Request::decode(body) else {
        return;
    };
    watched.seq = watched.seq.wrapping_add(u16::from(body.len() % 3 != 0));
    let header = Header { boot: BOOT, seq: watched.seq };
    let frame = Frame::encode(header, &request).expect("every request fits");
    device.handle_bytes(watched.now, &frame);
}

fn watch(watched: &mut Watched, action: Action) {
    match action {
        Action::Home { .. } => {
            assert!(!watched.listening, "homes while listening");
            watched.turning = true;
        }
        Action::Move { target, .. } => {
            assert!(!watched.listening, "turns while listening");
            watched.turning = true;
            watched.target = Some(target);
        }
        Action::Fire { .. } => {
            assert!(!watched.listening, "fires while listening");
            assert!(!watched.turning, "fires while turning");
            watched.listening = true;
        }
        Action::AbortFire => watched.listening = false,
        Action::ReleaseCoils => watched.turning = false,
        Action::StopMotion => watched.target = None,
        Action::Reset => {}
    }
}

/// Everything the device sends must be a frame with a reply.
fn read_line(device: &mut Device, line: &mut FrameDecoder, room: usize) {
    let mut buffer = [0; 16];
    let count = device.poll_transmit(&mut buffer[..room]);
    for &byte in &buffer[..count] {
        match line.push(byte) {
            Received::Frame(raw) => {
                assert_eq!(raw.header.boot, BOOT);
                assert!(Reply::decode(raw.body).is_ok());
            }
            Received::Dropped(reason) => panic!("the device sent no frame: {reason:?}"),
            Received::Nothing | Received::Empty => {}
        }
    }
}
