//! Steps shared by the scenarios.

extern crate std;

use std::vec::Vec;

use super::{Bench, DeviceUnderTest, scenarios::BOOT_S};
use crate::frame::{Frame, FrameDecoder, Header, Received};
use crate::host::{Command, HostEvent, Outcome};
use crate::messages::{Identity, Reading, Reply, Request, Settings, Status, SweepState};

pub(super) fn ready(bench: &mut Bench<impl DeviceUnderTest>, settings: Settings) -> Identity {
    let identity = identify(bench);
    for command in [Command::Configure(settings), Command::Home] {
        bench.perform(command, 20.0).expect("gets ready");
    }
    identity
}

pub(super) fn identify(bench: &mut Bench<impl DeviceUnderTest>) -> Identity {
    bench.run(BOOT_S).expect("boots");
    bench.perform(Command::Identify, 5.0).expect("identifies itself");
    *bench.host.identity().expect("identified")
}

pub(super) fn status(bench: &mut Bench<impl DeviceUnderTest>) -> Status {
    let events = bench.perform(Command::Status, 2.0).expect("answers");
    let found = events.iter().find_map(|event| match event {
        HostEvent::Done(Outcome::Status(status)) => Some(*status),
        _ => None,
    });
    found.expect("a status")
}

pub(super) fn ping(bench: &mut Bench<impl DeviceUnderTest>) -> Reading {
    let events = bench.perform(Command::Ping, 2.0).expect("pings");
    let readings = readings(&events);
    assert_eq!(readings.len(), 1);
    readings[0]
}

pub(super) fn readings(events: &[HostEvent]) -> Vec<Reading> {
    let reading = |event: &HostEvent| match event {
        HostEvent::Reading { reading, .. } => Some(*reading),
        _ => None,
    };
    assert!(!events.iter().any(|event| matches!(
        event,
        HostEvent::SweepDone { end, .. } if *end != SweepState::Complete
    )));
    events.iter().filter_map(reading).collect()
}

pub(super) fn assert_echoes(
    bench: &Bench<impl DeviceUnderTest>,
    reading: &Reading,
    expected_us: &[f64],
) {
    assert_eq!(reading.echoes.len(), expected_us.len(), "{reading:?} for {expected_us:?}");
    for (ticks, us) in reading.echoes.iter().zip(expected_us) {
        let off = (f64::from(*ticks) - 2.0 * us).abs();
        let allowed = f64::from(bench.device.tolerance_ticks());
        assert!(off <= allowed, "{reading:?} for {expected_us:?}: {off} ticks off");
    }
}

pub(super) fn frame(boot: u16, seq: u16, request: &Request) -> Vec<u8> {
    Frame::encode(Header { boot, seq }, request).expect("fits").to_vec()
}

/// Decodes the bytes of a board into replies and their sequence numbers. Panics on an invalid
/// frame.
pub(super) fn replies(bytes: &[u8]) -> Vec<(u16, Reply)> {
    let mut decoder = FrameDecoder::new();
    let mut replies = Vec::new();
    for byte in bytes {
        match decoder.push(*byte) {
            Received::Frame(frame) => {
                let reply = Reply::decode(frame.body).expect("a reply");
                replies.push((frame.header.seq, reply));
            }
            Received::Dropped(reason) => panic!("the device sent an invalid frame: {reason:?}"),
            Received::Nothing | Received::Empty => {}
        }
    }
    replies
}

/// Sends a request directly, without the host machine, and returns the reply.
pub(super) fn answer(
    bench: &mut Bench<impl DeviceUnderTest>,
    boot: u16,
    seq: u16,
    request: &Request,
) -> Reply {
    // Offset from the numbers of the host machine, which start at a random one.
    let seq = bench.host.identity().and_then(|known| known.last_seq).unwrap_or(0).wrapping_add(seq);
    bench.device.receive();
    bench.device.send(&frame(boot, seq, request));
    bench.device.run(30_000).expect("runs");
    let replies = replies(&bench.device.receive());
    let found = replies.iter().find(|(answered, _)| *answered == seq);
    found.unwrap_or_else(|| panic!("no reply to {request:?}, number {seq}: {replies:?}")).1
}
