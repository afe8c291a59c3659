//! Comparison with an independent CDR encoder.

use byteorder::LittleEndian;
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

use crate::ros::cdr::{CdrWriter, Encode};

/// Values of every type, for all alignments of each after each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum Field {
    U8(u8),
    Flag(bool),
    U32(u32),
    I32(i32),
    F32(f32),
    F64(f64),
    Text(String),
    Bytes(Vec<u8>),
    Floats(Vec<f32>),
}

/// Consecutive values, without the discriminants of an enum.
#[derive(Debug)]
struct Message(Vec<Field>);

impl Encode for Message {
    fn encode(&self, cdr: &mut CdrWriter) {
        for field in &self.0 {
            match field {
                Field::U8(value) => cdr.u8(*value),
                Field::Flag(value) => cdr.flag(*value),
                Field::U32(value) => cdr.u32(*value),
                Field::I32(value) => cdr.i32(*value),
                Field::F32(value) => cdr.f32(*value),
                Field::F64(value) => cdr.f64(*value),
                Field::Text(value) => cdr.text(value),
                Field::Bytes(value) => cdr.bytes(value),
                Field::Floats(value) => cdr.f32s(value),
            }
        }
    }
}

impl Serialize for Message {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeTuple as _;
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for field in &self.0 {
            match field {
                Field::U8(value) => tuple.serialize_element(value)?,
                Field::Flag(value) => tuple.serialize_element(value)?,
                Field::U32(value) => tuple.serialize_element(value)?,
                Field::I32(value) => tuple.serialize_element(value)?,
                Field::F32(value) => tuple.serialize_element(value)?,
                Field::F64(value) => tuple.serialize_element(value)?,
                Field::Text(value) => tuple.serialize_element(value)?,
                Field::Bytes(value) => tuple.serialize_element(value)?,
                Field::Floats(value) => tuple.serialize_element(value)?,
            }
        }
        tuple.end()
    }
}

fn field() -> impl Strategy<Value = Field> {
    prop_oneof![
        any::<u8>().prop_map(Field::U8),
        any::<bool>().prop_map(Field::Flag),
        any::<u32>().prop_map(Field::U32),
        any::<i32>().prop_map(Field::I32),
        any::<f32>().prop_map(Field::F32),
        any::<f64>().prop_map(Field::F64),
        "[a-z0-9é/]{0,9}".prop_map(Field::Text),
        prop::collection::vec(any::<u8>(), 0..9).prop_map(Field::Bytes),
        prop::collection::vec(any::<f32>(), 0..5).prop_map(Field::Floats),
    ]
}

proptest! {
    #[test]
    fn matches_independent_encoder(fields in prop::collection::vec(field(), 0..12)) {
        let message = Message(fields);
        let mut buffer = Vec::new();
        let bytes = CdrWriter::encode(&message, &mut buffer);
        let others = cdr_encoding::to_vec::<_, LittleEndian>(&message).expect("encodes");
        prop_assert_eq!(&bytes[..4], &[0, 1, 0, 0]);
        prop_assert_eq!(&bytes[4..], &others[..]);
    }
}
