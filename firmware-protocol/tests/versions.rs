//! Host and device with different protocol versions or different numbering.

mod samples;
mod world;

use firmware_protocol::device::Device;
use firmware_protocol::frame::{Frame, FrameDecoder, Header, Received, crc32};
use firmware_protocol::host::{Command, Host, HostConfig, HostError, HostEvent};
use firmware_protocol::messages::{
    FirmwareVersion, Identity, NakReason, PROTOCOL, ProtocolId, Reply, Request,
};

/// Frame with an arbitrary body.
fn raw_frame(header: Header, body: &[u8]) -> Vec<u8> {
    let mut payload = [header.boot.to_le_bytes(), header.seq.to_le_bytes()].concat();
    payload.extend(body);
    payload.extend(crc32(&payload).to_le_bytes());
    let mut frame = vec![0; cobs::max_encoding_length(payload.len())];
    let len = cobs::encode(&payload, &mut frame);
    frame.truncate(len);
    frame.push(0);
    frame
}

fn decode(bytes: &[u8]) -> Vec<(Header, Vec<u8>)> {
    let mut decoder = FrameDecoder::new();
    let mut found = Vec::new();
    for &byte in bytes {
        if let Received::Frame(raw) = decoder.push(byte) {
            found.push((raw.header, raw.body.to_vec()));
        }
    }
    found
}

/// Starts Identify; returns the host and the header of its request.
fn identifying() -> (Host, Header) {
    let mut host = Host::new(HostConfig::new(115_200, 1));
    host.start(0, Command::Identify).expect("free");
    let frame = host.poll_transmit().expect("a request");
    let (header, body) = decode(&frame)[0].clone();
    assert_eq!(body, [0], "Identify is frozen");
    assert_eq!(header.boot, Header::BOOT_UNKNOWN);
    (host, header)
}

fn check_wrong_version(body: &[u8], theirs: ProtocolId) {
    let (mut host, header) = identifying();
    host.handle_bytes(1_000, &raw_frame(Header { boot: 9, ..header }, body));
    let firmware = FirmwareVersion { major: 2, minor: 3, patch: 4 };
    let error = HostError::WrongVersion { ours: PROTOCOL, theirs, firmware };
    assert_eq!(host.poll_event(), Some(HostEvent::Failed(error)));
    let text = error.to_string();
    assert!(text.contains(&format!("has protocol {}", theirs.version)), "{text}");
    assert!(text.contains(&format!("this sonard has {}", PROTOCOL.version)), "{text}");
}

#[test]
fn reports_other_version() {
    let theirs = ProtocolId { version: 9, schema: 5 };
    // Shorter than this version's Identity, and longer with fields of a later version.
    check_wrong_version(&[0, 9, 5, 2, 3, 4], theirs);
    check_wrong_version(&[0, 9, 5, 2, 3, 4, 250, 251, 252, 253, 254, 255, 255], theirs);
}

#[test]
fn reports_other_schema() {
    let theirs = ProtocolId { version: PROTOCOL.version, schema: 5 };
    let firmware = FirmwareVersion { major: 2, minor: 3, patch: 4 };
    let identity = Identity { protocol: theirs, firmware, ..samples::identity() };
    let mut body = [0; 64];
    let body = postcard::to_slice(&Reply::Identity(identity), &mut body).expect("fits");
    check_wrong_version(body, theirs);
}

/// Passes `frame` to the device and returns all of its replies.
fn exchange(device: &mut Device, frame: &[u8]) -> Vec<(Header, Reply)> {
    device.handle_bytes(0, frame);
    let mut out = [0; 512];
    let count = device.poll_transmit(&mut out);
    decode(&out[..count])
        .into_iter()
        .map(|(header, body)| (header, Reply::decode(&body).expect("a reply")))
        .collect()
}

fn device() -> Device {
    let mut device = Device::new(world::board(7));
    let announced = exchange(&mut device, &[]);
    assert!(matches!(announced[..], [(Header { boot: 7, seq: 0 }, Reply::Identity(_))]));
    device
}

/// Frozen requests as literal bytes, which no later version may change.
#[test]
fn frozen_requests_work_from_bytes() {
    let mut device = device();
    let unknown = Header { boot: 0, seq: 77 };
    let replies = exchange(&mut device, &raw_frame(unknown, &[0]));
    assert!(matches!(replies[..], [(Header { boot: 7, seq: 77 }, Reply::Identity(_))]));
    let replies = exchange(&mut device, &raw_frame(unknown, &[1]));
    assert_eq!(replies, [(Header { boot: 7, seq: 77 }, Reply::Ack)]);
    let replies = exchange(&mut device, &raw_frame(unknown, &[2]));
    let rejected = Reply::Nak { reason: NakReason::WrongBoot };
    assert_eq!(replies, [(Header { boot: 7, seq: 77 }, rejected)], "Reset needs the nonce");
    let known = Header { boot: 7, seq: 77 };
    assert_eq!(exchange(&mut device, &raw_frame(known, &[2])), [(known, Reply::Ack)]);
}

#[test]
fn rejects_unknown_request() {
    let mut device = device();
    let header = Header { boot: 7, seq: 1 };
    let rejected = Reply::Nak { reason: NakReason::UnknownRequest };
    assert_eq!(exchange(&mut device, &raw_frame(header, &[99])), [(header, rejected)]);
    assert_eq!(device.counters().undecodable, 1);
}

#[test]
fn classifies_sequence_numbers() {
    let mut device = device();
    let header = |seq| Header { boot: 7, seq };
    let send = |device: &mut Device, seq, request| {
        exchange(device, &Frame::encode(header(seq), &request).expect("fits"))
    };
    let rejected = Reply::Nak { reason: NakReason::NotConfigured };
    assert_eq!(send(&mut device, 65_535, Request::Home), [(header(65_535), rejected)]);
    assert_eq!(send(&mut device, 65_535, Request::Home), [(header(65_535), rejected)]);
    let reused = Reply::Nak { reason: NakReason::SequenceReused };
    assert_eq!(send(&mut device, 65_535, Request::Ping), [(header(65_535), reused)]);
    assert_eq!(send(&mut device, 3, Request::Ping), [(header(3), rejected)], "numbers wrap");
    assert_eq!(send(&mut device, 65_535, Request::Home), [], "an old duplicate");
    assert_eq!(device.counters().stale, 1);
}

#[test]
fn host_renumbers_on_reuse() {
    let mut sim = world::sim::Sim::new(11, 115_200, world::line::Faults::default());
    sim.run(Command::Identify).expect("ends");
    sim.host.start(sim.now_us(), Command::Configure(world::settings())).expect("free");
    let frame = sim.host.poll_transmit().expect("a request");
    let (header, _) = decode(&frame)[0].clone();
    let other = Frame::encode(header, &Request::Status).expect("fits");
    let ticks = sim.world.ticks();
    sim.world.device.handle_bytes(ticks, &other);
    sim.world.device.handle_bytes(ticks, &frame);
    sim.run_while(|sim| sim.host.is_busy()).expect("ends");
    let (_, last) = sim.events.last().expect("an event");
    assert!(matches!(last, HostEvent::Done(_)), "{last:?}");
}
