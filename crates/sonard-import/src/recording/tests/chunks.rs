//! Chunks of a recording, packed and damaged.

use sonard_records::{Ping, ScanStart};

use super::{Order, driving, examine, said, scans};
use crate::{Mapping, recording::MAGIC};

/// The same recording, its chunks packed by Zstandard; its index is wrong then, which is passed over.
fn packed_by_zstd(recording: &[u8]) -> Vec<u8> {
    let (magic, mut rest) = recording.split_at(MAGIC.len());
    let mut packed = magic.to_vec();
    while rest.len() > MAGIC.len() {
        let (opcode, length) = (rest[0], u64::from_le_bytes(rest[1..9].try_into().expect("eight")));
        let (body, behind) = rest[9..].split_at(length as usize);
        rest = behind;
        let body = if opcode == 0x06 { packed_chunk(body) } else { body.to_vec() };
        packed.push(opcode);
        packed.extend((body.len() as u64).to_le_bytes());
        packed.extend(body);
    }
    [&packed, rest].concat()
}

/// Times, length and checksum as they were; the name of the compression; length and bytes of what is packed.
fn packed_chunk(body: &[u8]) -> Vec<u8> {
    let (head, records) = (&body[..28], &body[40..]);
    assert_eq!(body[28..32], [0; 4], "it is not compressed");
    let level = ruzstd::encoding::CompressionLevel::Fastest;
    let records = ruzstd::encoding::compress_to_vec(records, level);
    let length = (records.len() as u64).to_le_bytes();
    [head, &4_u32.to_le_bytes(), b"zstd", &length, &records].concat()
}

#[test]
fn chunks_packed_by_zstandard_hold_the_same_readings() {
    let plain = driving(Order::Little).bytes();
    let packed = packed_by_zstd(&plain);
    assert!(packed.windows(4).any(|bytes| bytes == b"zstd"));
    let readings = |bytes: &[u8]| -> Vec<_> {
        let scans = scans(bytes, Mapping::default()).expect("a recording");
        let told = |(start, pings): (ScanStart, Vec<Ping>)| {
            (
                start.pose,
                pings
                    .into_iter()
                    .map(|ping| (ping.time, ping.status, ping.range_m))
                    .collect::<Vec<_>>(),
            )
        };
        scans.into_iter().map(told).collect()
    };
    assert_eq!(readings(&packed), readings(&plain));
    assert_eq!(readings(&plain).len(), 3);
}

#[test]
fn a_chunk_that_unpacks_to_another_length_than_it_says_is_refused() {
    let packed = packed_by_zstd(&driving(Order::Little).bytes());
    let name = packed.windows(4).position(|bytes| bytes == b"zstd").expect("there");
    let length = name - 16..name - 8;
    let true_length = u64::from_le_bytes(packed[length.clone()].try_into().expect("eight"));
    for lie in [0, true_length - 1, true_length + 1, 1 << 27] {
        let mut lying = packed.clone();
        lying[length.clone()].copy_from_slice(&lie.to_le_bytes());
        let told = said(examine(&lying, Mapping::default()));
        assert!(told.contains("another length"), "{lie}: {told}");
    }
    for at in 0..packed.len() {
        let mut damaged = packed.clone();
        damaged[at] ^= 0x55;
        let _ = scans(&damaged, Mapping::default());
    }
}

#[test]
fn a_record_of_a_chunk_that_says_it_is_longer_than_the_chunk_is_refused() {
    for length in [u64::MAX, u64::MAX - 8, 1 << 40, 22] {
        let message = [&[0x05], &length.to_le_bytes()[..], &[0; 21]].concat();
        let size = (message.len() as u64).to_le_bytes();
        let times = [0; 16];
        let crc_and_compression = [0; 8];
        let body = [&times, &size[..], &crc_and_compression, &size, &message].concat();
        let chunk = [&[0x06], &(body.len() as u64).to_le_bytes()[..], &body].concat();
        // Behind it, in a chunk that is longer than its records, there would be enough.
        let behind = [&chunk[..], &[0; 40]].concat();
        let longer = [&[0x06], &(body.len() as u64 + 40).to_le_bytes()[..], &behind[9..]].concat();
        for chunk in [chunk, longer] {
            let recording = [MAGIC, &chunk[..]].concat();
            let words = said(examine(&recording, Mapping::default()));
            assert!(words.contains("damaged"), "{length}: {words}");
        }
    }
}
