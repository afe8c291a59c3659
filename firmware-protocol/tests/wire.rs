//! Comparison of the message codec with postcard, whose format it implements.

mod samples;

use firmware_protocol::messages::{Reply, Request, Wire, Writer};
use proptest::prelude::*;
use serde::{Serialize, de::DeserializeOwned};

fn ours<M: Wire>(message: &M) -> Vec<u8> {
    let mut buffer = [0; 64];
    let mut writer = Writer::new(&mut buffer);
    message.put(&mut writer);
    let len = writer.finish().expect("fits");
    buffer[..usize::from(len)].to_vec()
}

fn postcards<M: Serialize>(message: &M) -> Vec<u8> {
    postcard::to_slice(message, &mut [0; 64]).expect("fits").to_vec()
}

/// Decodes a body that must contain exactly one message, with postcard.
fn postcard_reads<M: DeserializeOwned>(body: &[u8]) -> Option<M> {
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Some(message),
        _ => None,
    }
}

fn check_decoding(body: &[u8]) -> Result<(), TestCaseError> {
    prop_assert_eq!(Request::decode(body).ok(), postcard_reads::<Request>(body), "{:02x?}", body);
    prop_assert_eq!(Reply::decode(body).ok(), postcard_reads::<Reply>(body), "{:02x?}", body);
    Ok(())
}

#[test]
fn encodes_like_postcard() {
    for (name, request) in samples::requests() {
        assert_eq!(ours(&request), postcards(&request), "{name}");
    }
    for (name, reply) in samples::replies() {
        assert_eq!(ours(&reply), postcards(&reply), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// Bytes that begin with a code and continue with small and with arbitrary values.
    #[test]
    fn decodes_arbitrary_bodies_alike(
        code in 0..12_u8,
        rest in prop::collection::vec(prop_oneof![0..3_u8, any::<u8>(), 0x80..=0x83_u8], 0..40),
    ) {
        let mut body = vec![code];
        body.extend(rest);
        check_decoding(&body)?;
    }

    /// Valid messages with one byte altered, removed or added.
    #[test]
    fn decodes_damaged_bodies_alike(which in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(), byte: u8, cut: bool) {
        let mut bodies: Vec<Vec<u8>> = samples::requests().iter().map(|(_, m)| postcards(m)).collect();
        bodies.extend(samples::replies().iter().map(|(_, m)| postcards(m)));
        let body = which.get(&bodies);
        check_decoding(body)?;
        let mut changed = body.clone();
        changed[at.index(body.len())] = byte;
        check_decoding(&changed)?;
        // Bodies that are still valid are encoded identically by both.
        if let Ok(request) = Request::decode(&changed) {
            prop_assert_eq!(ours(&request), postcards(&request));
        }
        if let Ok(reply) = Reply::decode(&changed) {
            prop_assert_eq!(ours(&reply), postcards(&reply));
        }
        let mut other = body.clone();
        if cut { other.truncate(at.index(body.len())) } else { other.push(byte) }
        check_decoding(&other)?;
    }
}
