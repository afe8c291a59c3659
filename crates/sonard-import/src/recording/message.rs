//! Decoding of the ROS 2 messages, field by field.

use jiff::Timestamp;

use super::cdr::{CdrReader, Decoded};

/// `std_msgs/Header`: time stamp and frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MessageHeader {
    /// Time stamp, nanoseconds since 1970.
    pub(crate) stamp_ns: i64,
    pub(crate) frame: String,
}

impl MessageHeader {
    pub(crate) fn decode(cdr: &mut CdrReader<'_>) -> Decoded<Self> {
        let (seconds, nanoseconds) = (cdr.i32()?, cdr.u32()?);
        let stamp_ns = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
        Ok(Self { stamp_ns, frame: frame(cdr.text()?) })
    }
}

/// Removes the leading slash that ROS 1 programs put before frame names.
fn frame(name: &str) -> String {
    name.trim_start_matches('/').to_owned()
}

/// Converts a time stamp; every 64-bit value is representable.
pub(crate) fn timestamp(stamp_ns: i64) -> Timestamp {
    Timestamp::from_nanosecond(stamp_ns.into()).unwrap_or(Timestamp::UNIX_EPOCH)
}

/// `sensor_msgs/Range`; fields after the range, added by later versions, are ignored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RangeMessage {
    pub(crate) header: MessageHeader,
    pub(crate) limits_m: [f32; 2],
    pub(crate) range_m: f32,
}

impl RangeMessage {
    pub(crate) fn decode(cdr: &mut CdrReader<'_>) -> Decoded<Self> {
        let header = MessageHeader::decode(cdr)?;
        let (_radiation_type, _field_of_view) = (cdr.u8()?, cdr.f32()?);
        let limits_m = [cdr.f32()?, cdr.f32()?];
        Ok(Self { header, limits_m, range_m: cdr.f32()? })
    }
}

/// `sensor_msgs/LaserScan`, without its intensities.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LaserScanMessage {
    pub(crate) header: MessageHeader,
    pub(crate) first_rad: f32,
    pub(crate) max_rad: f32,
    pub(crate) step_rad: f32,
    pub(crate) time_increment_s: f32,
    pub(crate) limits_m: [f32; 2],
    pub(crate) ranges_m: Vec<f32>,
}

impl LaserScanMessage {
    pub(crate) fn decode(cdr: &mut CdrReader<'_>) -> Decoded<Self> {
        let header = MessageHeader::decode(cdr)?;
        let [first_rad, max_rad, step_rad] = [cdr.f32()?, cdr.f32()?, cdr.f32()?];
        let [time_increment_s, _whole] = [cdr.f32()?, cdr.f32()?];
        let limits_m = [cdr.f32()?, cdr.f32()?];
        let ranges_m = cdr.list(CdrReader::f32)?;
        Ok(Self { header, first_rad, max_rad, step_rad, time_increment_s, limits_m, ranges_m })
    }
}

/// `geometry_msgs/TransformStamped`: placement of a frame in its parent.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TransformMessage {
    /// Time stamp and parent frame.
    pub(crate) header: MessageHeader,
    pub(crate) child: String,
    pub(crate) translation_m: [f64; 3],
    /// Quaternion x, y, z, w.
    pub(crate) rotation: [f64; 4],
}

impl TransformMessage {
    fn decode(cdr: &mut CdrReader<'_>) -> Decoded<Self> {
        let header = MessageHeader::decode(cdr)?;
        let child = frame(cdr.text()?);
        let translation_m = [cdr.f64()?, cdr.f64()?, cdr.f64()?];
        let rotation = [cdr.f64()?, cdr.f64()?, cdr.f64()?, cdr.f64()?];
        Ok(Self { header, child, translation_m, rotation })
    }

    /// Decodes the transforms of a `tf2_msgs/TFMessage`.
    pub(crate) fn all(cdr: &mut CdrReader<'_>) -> Decoded<Vec<Self>> {
        cdr.list(Self::decode)
    }
}
