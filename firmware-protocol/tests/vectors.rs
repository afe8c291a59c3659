//! Golden frames: `vectors/<name>.txt` holds one sample of every message, in hex.
//!
//! `UPDATE_VECTORS=1 cargo test -p firmware-protocol --test vectors` renews them. A frame that
//! changes although its sample does not also requires a new `PROTOCOL_VERSION`.

mod samples;

use std::fmt::Write as _;
use std::path::PathBuf;

use firmware_protocol::frame::{Frame, FrameDecoder, Header, Received};
use firmware_protocol::messages::{Reply, Request};
use samples::{BOOT, SEQ, replies, requests};

/// Instructions if the vectors differ from the code.
const RENEW: &str = "if this is intended, renew the vectors with \
    `UPDATE_VECTORS=1 cargo test -p firmware-protocol --test vectors`; if a host or device of the \
    present version would reject or misread the new frame, also raise PROTOCOL_VERSION in \
    firmware-protocol/src/messages.rs";

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("vectors")
}

fn hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in bytes {
        if !text.is_empty() {
            text.push(' ');
        }
        write!(text, "{byte:02x}").expect("writing to a string");
    }
    text
}

/// Text of a vector: description, body and frame.
fn vector(direction: &str, message: &str, frame: &Frame) -> String {
    let mut decoder = FrameDecoder::new();
    for &byte in frame.iter() {
        if let Received::Frame(raw) = decoder.push(byte) {
            let body = hex(raw.body);
            return format!(
                "direction: {direction}\nmessage: {message}\nboot: {BOOT:04x}\nseq: {SEQ:04x}\nbody: {body}\nframe: {}\n",
                hex(frame)
            );
        }
    }
    panic!("{message} does not survive its own decoder");
}

fn all() -> Vec<(String, String)> {
    let header = Header { boot: BOOT, seq: SEQ };
    let mut vectors = Vec::new();
    for (name, request) in requests() {
        let frame = Frame::encode(header, &request).expect("fits");
        let message = format!("{request:?}");
        vectors.push((format!("request-{name}"), vector("host to device", &message, &frame)));
    }
    for (name, reply) in replies() {
        let frame = Frame::encode(header, &reply).expect("fits");
        let message = format!("{reply:?}");
        vectors.push((format!("reply-{name}"), vector("device to host", &message, &frame)));
    }
    vectors
}

#[test]
fn frames_match_vectors() {
    let update = std::env::var_os("UPDATE_VECTORS").is_some();
    for (name, text) in all() {
        let path = folder().join(format!("{name}.txt"));
        if update {
            std::fs::create_dir_all(folder()).expect("can make the folder");
            std::fs::write(&path, &text).expect("can write the vector");
        }
        let golden = std::fs::read_to_string(&path);
        let golden = golden.unwrap_or_else(|error| panic!("{name}: {error}: {RENEW}"));
        assert_eq!(golden, text, "{name} changed on the wire: {RENEW}");
    }
}

#[test]
fn no_unused_vectors() {
    let mut files: Vec<_> = std::fs::read_dir(folder())
        .expect("the folder is there")
        .map(|entry| entry.expect("readable").file_name().into_string().expect("a name"))
        .collect();
    let mut names: Vec<_> = all().into_iter().map(|(name, _)| format!("{name}.txt")).collect();
    files.sort();
    names.sort();
    assert_eq!(files, names);
}

#[test]
fn every_message_has_a_vector() {
    let request_codes: Vec<u8> = requests().iter().map(|(_, request)| code(request)).collect();
    for variant in Request::VARIANTS {
        assert!(request_codes.contains(&variant.code), "no sample of {}", variant.name);
    }
    let reply_codes: Vec<u8> = replies().iter().map(|(_, reply)| code(reply)).collect();
    for variant in Reply::VARIANTS {
        assert!(reply_codes.contains(&variant.code), "no sample of {}", variant.name);
    }
}

fn code<M: serde::Serialize>(message: &M) -> u8 {
    let mut body = [0; 64];
    postcard::to_slice(message, &mut body).expect("fits")[0]
}
