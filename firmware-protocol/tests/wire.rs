//! The codec of the messages against postcard, whose format it writes.

mod samples;

use firmware_protocol::messages::{Reply, Request, Wire, Writer};
use proptest::prelude::*;
use serde::{Serialize, de::DeserializeOwned};

fn ours<M: Wire>(message: &M) -> Vec<u8> {
    let mut room = [0; 64];
    let mut writer = Writer::new(&mut room);
    message.put(&mut writer);
    let len = writer.finish().expect("fits");
    room[..usize::from(len)].to_vec()
}

fn postcards<M: Serialize>(message: &M) -> Vec<u8> {
    postcard::to_slice(message, &mut [0; 64]).expect("fits").to_vec()
}

/// What postcard makes of a body that must hold one message exactly.
fn postcard_reads<M: DeserializeOwned>(body: &[u8]) -> Option<M> {
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Some(message),
        _ => None,
    }
}

fn read_alike(body: &[u8]) -> Result<(), TestCaseError> {
    prop_assert_eq!(Request::decode(body).ok(), postcard_reads::<Request>(body), "{:02x?}", body);
    prop_assert_eq!(Reply::decode(body).ok(), postcard_reads::<Reply>(body), "{:02x?}", body);
    Ok(())
}

#[test]
fn every_sample_is_written_as_postcard_writes_it() {
    for (name, request) in samples::requests() {
        assert_eq!(ours(&request), postcards(&request), "{name}");
    }
    for (name, reply) in samples::replies() {
        assert_eq!(ours(&reply), postcards(&reply), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// Bytes that begin with a code and go on with small and with any values.
    #[test]
    fn arbitrary_bodies_are_read_alike(
        code in 0..12_u8,
        rest in prop::collection::vec(prop_oneof![0..3_u8, any::<u8>(), 0x80..=0x83_u8], 0..40),
    ) {
        let mut body = vec![code];
        body.extend(rest);
        read_alike(&body)?;
    }

    /// Right messages, one byte of them changed, cut or lengthened.
    #[test]
    fn damaged_messages_are_read_alike(which in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(), byte: u8, cut: bool) {
        let mut bodies: Vec<Vec<u8>> = samples::requests().iter().map(|(_, m)| postcards(m)).collect();
        bodies.extend(samples::replies().iter().map(|(_, m)| postcards(m)));
        let body = which.get(&bodies);
        read_alike(body)?;
        let mut changed = body.clone();
        changed[at.index(body.len())] = byte;
        read_alike(&changed)?;
        // What is still a message is written the same way by both.
        if let Ok(request) = Request::decode(&changed) {
            prop_assert_eq!(ours(&request), postcards(&request));
        }
        if let Ok(reply) = Reply::decode(&changed) {
            prop_assert_eq!(ours(&reply), postcards(&reply));
        }
        let mut other = body.clone();
        if cut { other.truncate(at.index(body.len())) } else { other.push(byte) }
        read_alike(&other)?;
    }
}
