//! Frames and messages against arbitrary input from a line.

mod samples;

use firmware_protocol::frame::{
    DropReason, FRAME_MAX, Frame, FrameDecoder, Header, PAYLOAD_MAX, Received, crc32,
};
use firmware_protocol::messages::limits::{BEAMS_MAX, POSITION_MAX, WINDOW_TICKS_MAX};
use firmware_protocol::messages::{
    Alive, Echoes, PROTOCOL, ProtocolId, Reading, ReadingStatus, Reply, Request, Settings, Status,
    SweepDone,
};
use proptest::prelude::*;

type Found = (Header, Vec<u8>);

/// Decodes `bytes`; returns the frames and the reasons of drops.
fn feed(decoder: &mut FrameDecoder, bytes: &[u8]) -> (Vec<Found>, Vec<DropReason>) {
    let (mut frames, mut drops) = (Vec::new(), Vec::new());
    for &byte in bytes {
        match decoder.push(byte) {
            Received::Frame(raw) => frames.push((raw.header, raw.body.to_vec())),
            Received::Dropped(reason) => drops.push(reason),
            Received::Nothing | Received::Empty => {}
        }
    }
    (frames, drops)
}

fn decode(bytes: &[u8]) -> Vec<Found> {
    feed(&mut FrameDecoder::new(), bytes).0
}

/// Frame with an arbitrary payload, stuffed by the cobs crate: an independent encoder.
fn stuffed_frame(payload: &[u8]) -> Vec<u8> {
    let mut bytes = payload.to_vec();
    bytes.extend(crc32(payload).to_le_bytes());
    let mut stuffed = vec![0; cobs::max_encoding_length(bytes.len())];
    let len = cobs::encode(&bytes, &mut stuffed);
    stuffed.truncate(len);
    stuffed.push(0);
    stuffed
}

fn any_reading() -> impl Strategy<Value = Reading> {
    let step = prop_oneof![Just(-POSITION_MAX), Just(POSITION_MAX), -POSITION_MAX..=POSITION_MAX];
    let echo = prop_oneof![Just(WINDOW_TICKS_MAX), 0..=WINDOW_TICKS_MAX];
    let echoes = prop::collection::vec(echo, 0..=8);
    let ticks = prop_oneof![Just(u32::MAX), any::<u32>()];
    (any::<u16>(), any::<u16>(), step, ticks, 0..4_u8, echoes).prop_map(
        |(sweep, index, step, fired_ticks, status, echoes)| Reading {
            sweep,
            index,
            step,
            fired_ticks,
            status: [
                ReadingStatus::Echo,
                ReadingStatus::NoEcho,
                ReadingStatus::ModuleFault,
                ReadingStatus::StepUncertain,
            ][usize::from(status)],
            echoes: Echoes::from_ticks(&echoes),
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn decoders_accept_any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        decode(&bytes);
        let _ = Request::decode(&bytes);
        let _ = Reply::decode(&bytes);
        let _ = ProtocolId::peek(&bytes);
    }

    #[test]
    fn decoding_round_trips(
        body in prop::collection::vec(any::<u8>(), 1..56),
    ) {
        let header = Header { boot: 1, seq: 2 };
        if let Ok(request) = Request::decode(&body) {
            let frame = Frame::encode(header, &request).expect("fits");
            prop_assert_eq!(Request::decode(&decode(&frame)[0].1), Ok(request));
        }
        if let Ok(reply) = Reply::decode(&body) {
            let frame = Frame::encode(header, &reply).expect("fits");
            prop_assert_eq!(Reply::decode(&decode(&frame)[0].1), Ok(reply));
        }
    }

    #[test]
    fn readings_round_trip(reading in any_reading(), boot: u16, seq: u16) {
        let header = Header { boot, seq };
        let frame = Frame::encode(header, &Reply::Reading(reading)).expect("fits");
        prop_assert!(frame.len() <= FRAME_MAX);
        if reading.echoes.len() <= 1 {
            prop_assert!(frame.len() <= 32, "{} bytes", frame.len());
        }
        let found = decode(&frame);
        prop_assert_eq!(found.len(), 1);
        prop_assert_eq!(found[0].0, header);
        prop_assert_eq!(Reply::decode(&found[0].1), Ok(Reply::Reading(reading)));
    }

    #[test]
    fn decodes_cobs_frames(
        payload in prop::collection::vec(prop_oneof![Just(0), any::<u8>()], 5..=60),
    ) {
        let found = decode(&stuffed_frame(&payload));
        prop_assert_eq!(found.len(), 1);
        prop_assert_eq!(&found[0].1[..], &payload[4..]);
    }

    #[test]
    fn cobs_decodes_our_frames(reading in any_reading(), seq: u16) {
        let frame = Frame::encode(Header { boot: 0, seq }, &Reply::Reading(reading)).expect("fits");
        let mut payload = vec![0; frame.len()];
        let report = cobs::decode(&frame[..frame.len() - 1], &mut payload);
        prop_assert!(report.is_ok());
        prop_assert_eq!(&payload[2..4], &seq.to_le_bytes());
    }

    /// No tail of an overlong byte sequence is read as a frame.
    #[test]
    fn overlong_tail_is_no_frame(
        junk in prop::collection::vec(1..=255_u8, 67..200),
        reading in any_reading(),
    ) {
        let header = Header { boot: 5, seq: 6 };
        let frame = Frame::encode(header, &Reply::Reading(reading)).expect("fits");
        let mut decoder = FrameDecoder::new();
        let (found, drops) = feed(&mut decoder, &[&junk[..], &frame[..]].concat());
        prop_assert_eq!(found, vec![]);
        prop_assert_eq!(drops.len(), 1);
        let (found, _) = feed(&mut decoder, &frame);
        prop_assert_eq!(found.len(), 1, "must be in step again");
    }

    /// CRC-32 detects every burst of up to 32 bits in frames this short.
    #[test]
    fn detects_bursts(
        payload in prop::collection::vec(any::<u8>(), 5..=60),
        start in 0_usize..512,
        pattern in 1..=u32::MAX,
    ) {
        let mut bytes = payload.clone();
        bytes.extend(crc32(&payload).to_le_bytes());
        let bits = bytes.len() * 8;
        let start = start % bits;
        let mut changed = bytes.clone();
        for bit in 0..32 {
            if pattern >> bit & 1 == 1 && start + bit < bits {
                changed[(start + bit) / 8] ^= 1 << ((start + bit) % 8);
            }
        }
        prop_assume!(changed != bytes);
        let covered = changed.len() - 4;
        let crc: [u8; 4] = changed[covered..].try_into().expect("four bytes");
        prop_assert_ne!(crc32(&changed[..covered]), u32::from_le_bytes(crc));
    }

    /// Bit flips anywhere on the wire, code bytes and delimiter included, never produce another
    /// message.
    #[test]
    fn drops_flipped_frames(
        reading in any_reading(),
        flips in prop::collection::btree_set(0_usize..8 * FRAME_MAX, 1..=3),
    ) {
        let header = Header { boot: 5, seq: 6 };
        let frame = Frame::encode(header, &Reply::Reading(reading)).expect("fits");
        let mut bytes = frame.to_vec();
        let bits = bytes.len() * 8;
        let flips: std::collections::BTreeSet<_> = flips.into_iter().map(|bit| bit % bits).collect();
        for bit in flips {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        bytes.push(0);
        for (found, body) in decode(&bytes) {
            prop_assert_eq!(found, header);
            prop_assert_eq!(Reply::decode(&body), Ok(Reply::Reading(reading)));
        }
    }
}

#[test]
fn crc_matches_zlib() {
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
}

#[test]
fn detects_all_double_flips() {
    let reading = samples::reading(ReadingStatus::Echo, &[9_652]);
    let frame = Frame::encode(Header { boot: 1, seq: 2 }, &Reply::Reading(reading)).expect("fits");
    let bits = frame.len() * 8;
    for first in 0..bits {
        for second in first..bits {
            let mut bytes = frame.to_vec();
            bytes[first / 8] ^= 1 << (first % 8);
            if second != first {
                bytes[second / 8] ^= 1 << (second % 8);
            }
            bytes.push(0);
            assert_eq!(decode(&bytes), vec![], "flipped bits {first} and {second}");
        }
    }
}

#[test]
fn extremes_fit() {
    let worst = Reading {
        sweep: u16::MAX,
        index: BEAMS_MAX,
        step: -POSITION_MAX,
        fired_ticks: u32::MAX,
        status: ReadingStatus::StepUncertain,
        echoes: Echoes::from_ticks(&[WINDOW_TICKS_MAX]),
    };
    let header = Header { boot: u16::MAX, seq: u16::MAX };
    let one = Frame::encode(header, &Reply::Reading(worst)).expect("fits");
    println!("worst reading with one echo: {} bytes", one.len());
    assert!(one.len() <= 32);
    let echoes = Echoes::from_ticks(&[WINDOW_TICKS_MAX; 8]);
    let eight = Frame::encode(header, &Reply::Reading(Reading { echoes, ..worst })).expect("fits");
    assert!(eight.len() <= FRAME_MAX, "{} bytes", eight.len());
}

/// Sums the longest encoding of each field: no value of any message can exceed a frame.
#[test]
fn all_messages_fit() {
    for fields in [
        firmware_protocol::messages::Identity::FIELDS,
        Settings::FIELDS,
        firmware_protocol::messages::Sweep::FIELDS,
        Reading::FIELDS,
        Alive::FIELDS,
        SweepDone::FIELDS,
        Status::FIELDS,
    ] {
        let longest: usize = fields.iter().map(|field| longest_encoding(field.kind)).sum();
        assert!(4 + 1 + longest + 4 <= PAYLOAD_MAX, "{fields:?} takes up to {longest} bytes");
    }
}

fn longest_encoding(kind: &str) -> usize {
    match kind.replace(' ', "").as_str() {
        "u8" | "bool" => 1,
        "u16" | "i16" | "Capabilities" => 3,
        "u32" | "i32" => 5,
        "Option<u16>" => 4,
        "Option<FaultKind>" => 2,
        "[u8;10]" => 10,
        "ProtocolId" => 6,
        "FirmwareVersion" => 3,
        "Blanking" => 4,
        "Echoes" => 1 + 8 * 3,
        "ReadingStatus" | "SweepState" | "DeviceState" | "ResetCause" => 1,
        other => panic!("how long is {other}?"),
    }
}

#[test]
fn rejects_excess_bytes() {
    for (name, request) in samples::requests() {
        let mut body = postcard_body(&request);
        body.push(0);
        assert!(Request::decode(&body).is_err(), "{name} with a further byte");
    }
    let mut body = postcard_body(&Reply::Identity(samples::identity()));
    body.extend([1, 2, 3]);
    assert!(Reply::decode(&body).is_err());
    let firmware = samples::identity().firmware;
    assert_eq!(ProtocolId::peek(&body), Some((PROTOCOL, firmware)));
    body.truncate(10);
    assert_eq!(ProtocolId::peek(&body), Some((PROTOCOL, firmware)), "a shorter Identity");
}

fn postcard_body<M: serde::Serialize>(message: &M) -> Vec<u8> {
    let mut body = [0; 64];
    postcard::to_slice(message, &mut body).expect("fits").to_vec()
}

#[test]
fn line_error_drops_frame() {
    let frame = Frame::encode(Header { boot: 1, seq: 2 }, &Reply::Ack).expect("fits");
    let mut decoder = FrameDecoder::new();
    feed(&mut decoder, &frame[..4]);
    decoder.discard_frame();
    let (found, drops) = feed(&mut decoder, &frame[4..]);
    assert_eq!((found, drops), (vec![], vec![DropReason::Line]));
    assert_eq!(feed(&mut decoder, &frame).0.len(), 1);
}
