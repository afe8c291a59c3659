//! Any bytes into the frame decoder and the message decoders; what decodes must encode again.
#![no_main]

use firmware_protocol::frame::{Frame, FrameDecoder, Header, PAYLOAD_MAX, Received};
use firmware_protocol::messages::{ProtocolId, Reply, Request, Wire};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    check_message(bytes);
    let mut decoder = FrameDecoder::new();
    for &byte in bytes {
        if let Received::Frame(raw) = decoder.push(byte) {
            assert!(raw.body.len() + 8 <= PAYLOAD_MAX);
            check_message(raw.body);
        }
    }
});

fn check_message(body: &[u8]) {
    let _ = ProtocolId::peek(body);
    if let Ok(request) = Request::decode(body) {
        assert_eq!(Request::decode(&body_again(&request)), Ok(request));
    }
    if let Ok(reply) = Reply::decode(body) {
        assert_eq!(Reply::decode(&body_again(&reply)), Ok(reply));
    }
}

/// The body of a frame around `message`, by way of the line.
fn body_again<M: Wire>(message: &M) -> Vec<u8> {
    let header = Header { boot: 1, seq: 2 };
    let frame = Frame::encode(header, message).expect("every message fits");
    let mut decoder = FrameDecoder::new();
    for &byte in frame.iter() {
        if let Received::Frame(raw) = decoder.push(byte) {
            assert_eq!(raw.header, header);
            return raw.body.to_vec();
        }
    }
    panic!("a frame must survive its own decoder");
}
