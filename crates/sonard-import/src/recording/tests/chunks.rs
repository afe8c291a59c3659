//! Compressed and damaged chunks of a recording.

use std::io::Write as _;

use sonard_records::{Ping, ScanStart};

use super::{Order, driving, error_text, examine, scans};
use crate::{Mapping, recording::MAGIC};

/// Compresses the chunks of a recording; its index becomes wrong, which readers ignore.
fn packed(recording: &[u8], name: &str, compress: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let (magic, mut rest) = recording.split_at(MAGIC.len());
    let mut packed = magic.to_vec();
    while rest.len() > MAGIC.len() {
        let (opcode, length) = (rest[0], u64::from_le_bytes(rest[1..9].try_into().expect("eight")));
        let (body, behind) = rest[9..].split_at(length as usize);
        rest = behind;
        let body = match opcode {
            0x06 => packed_chunk(body, name, &compress),
            _ => body.to_vec(),
        };
        packed.push(opcode);
        packed.extend((body.len() as u64).to_le_bytes());
        packed.extend(body);
    }
    [&packed, rest].concat()
}

/// Builds a chunk with the old times, length and checksum, and with compressed records.
fn packed_chunk(body: &[u8], name: &str, compress: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let (head, records) = (&body[..28], &body[40..]);
    assert_eq!(body[28..32], [0; 4], "the chunk is uncompressed");
    let records = compress(records);
    let name_length = name.len() as u32;
    let length = (records.len() as u64).to_le_bytes();
    [head, &name_length.to_le_bytes(), name.as_bytes(), &length, &records].concat()
}

fn packed_by_zstd(recording: &[u8]) -> Vec<u8> {
    packed(recording, "zstd", |records| {
        let level = ruzstd::encoding::CompressionLevel::Fastest;
        ruzstd::encoding::compress_to_vec(records, level)
    })
}

fn packed_by_lz4(recording: &[u8]) -> Vec<u8> {
    packed(recording, "lz4", |records| {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        encoder.write_all(records).expect("memory takes it");
        encoder.finish().expect("memory takes it")
    })
}

fn find(bytes: &[u8], text: &str) -> Option<usize> {
    bytes.windows(text.len()).position(|part| part == text.as_bytes())
}

#[test]
fn reads_compressed_chunks() {
    let plain = driving(Order::Little).bytes();
    let readings = |bytes: &[u8]| -> Vec<_> {
        let scans = scans(bytes, Mapping::default()).expect("a recording");
        let readings_of = |(start, pings): (ScanStart, Vec<Ping>)| {
            (
                start.pose,
                pings
                    .into_iter()
                    .map(|ping| (ping.time, ping.status, ping.range_m))
                    .collect::<Vec<_>>(),
            )
        };
        scans.into_iter().map(readings_of).collect()
    };
    assert_eq!(readings(&plain).len(), 3);
    for (packed, name) in [(packed_by_zstd(&plain), "zstd"), (packed_by_lz4(&plain), "lz4")] {
        assert!(find(&packed, name).is_some(), "{name}");
        assert_eq!(readings(&packed), readings(&plain), "{name}");
    }
}

#[test]
fn rejects_wrong_decompressed_length() {
    let plain = driving(Order::Little).bytes();
    for (packed, name) in [(packed_by_zstd(&plain), "zstd"), (packed_by_lz4(&plain), "lz4")] {
        let at = find(&packed, name).expect("there");
        let length = at - 16..at - 8;
        let true_length = u64::from_le_bytes(packed[length.clone()].try_into().expect("eight"));
        for wrong in [0, true_length - 1, true_length + 1, 1 << 27] {
            let mut changed = packed.clone();
            changed[length.clone()].copy_from_slice(&wrong.to_le_bytes());
            let message = error_text(examine(&changed, Mapping::default()));
            assert!(message.contains("another length"), "{name} {wrong}: {message}");
        }
        for at in 0..packed.len() {
            let mut damaged = packed.clone();
            damaged[at] ^= 0x55;
            let _ = scans(&damaged, Mapping::default());
        }
    }
}

#[test]
fn rejects_records_longer_than_chunk() {
    for length in [u64::MAX, u64::MAX - 8, 1 << 40, 22] {
        let message = [&[0x05], &length.to_le_bytes()[..], &[0; 21]].concat();
        let size = (message.len() as u64).to_le_bytes();
        let times = [0; 16];
        let crc_and_compression = [0; 8];
        let body = [&times, &size[..], &crc_and_compression, &size, &message].concat();
        let chunk = [&[0x06], &(body.len() as u64).to_le_bytes()[..], &body].concat();
        // In a chunk longer than its records, the bytes after them would suffice.
        let behind = [&chunk[..], &[0; 40]].concat();
        let longer = [&[0x06], &(body.len() as u64 + 40).to_le_bytes()[..], &behind[9..]].concat();
        for chunk in [chunk, longer] {
            let recording = [MAGIC, &chunk[..]].concat();
            let words = error_text(examine(&recording, Mapping::default()));
            assert!(words.contains("damaged"), "{length}: {words}");
        }
    }
}
