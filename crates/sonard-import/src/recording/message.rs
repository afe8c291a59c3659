//! The messages, field by field as ROS 2's interfaces have them.

use jiff::Timestamp;

use super::cdr::{Cdr, Part};

/// `std_msgs/Header`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    /// Nanoseconds since 1970.
    pub(crate) stamp_ns: i64,
    pub(crate) frame: String,
}

impl Header {
    pub(crate) fn decode(cdr: &mut Cdr<'_>) -> Part<Self> {
        let (seconds, nanoseconds) = (cdr.i32()?, cdr.u32()?);
        let stamp_ns = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
        Ok(Self { stamp_ns, frame: frame(cdr.text()?) })
    }
}

/// Without the slash that older programs put before it.
fn frame(name: &str) -> String {
    name.trim_start_matches('/').to_owned()
}

/// A moment of a message; within what can be told for any 64 bits.
pub(crate) fn moment(stamp_ns: i64) -> Timestamp {
    Timestamp::from_nanosecond(stamp_ns.into()).unwrap_or(Timestamp::UNIX_EPOCH)
}

/// `sensor_msgs/Range`; what later versions have behind the range is not looked at.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Range {
    pub(crate) header: Header,
    pub(crate) limits_m: [f32; 2],
    pub(crate) range_m: f32,
}

impl Range {
    pub(crate) fn decode(cdr: &mut Cdr<'_>) -> Part<Self> {
        let header = Header::decode(cdr)?;
        let (_radiation_type, _field_of_view) = (cdr.u8()?, cdr.f32()?);
        let limits_m = [cdr.f32()?, cdr.f32()?];
        Ok(Self { header, limits_m, range_m: cdr.f32()? })
    }
}

/// `sensor_msgs/LaserScan`, without its intensities.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LaserScan {
    pub(crate) header: Header,
    pub(crate) first_rad: f32,
    pub(crate) step_rad: f32,
    pub(crate) apart_s: f32,
    pub(crate) limits_m: [f32; 2],
    pub(crate) ranges_m: Vec<f32>,
}

impl LaserScan {
    pub(crate) fn decode(cdr: &mut Cdr<'_>) -> Part<Self> {
        let header = Header::decode(cdr)?;
        let [first_rad, _last, step_rad] = [cdr.f32()?, cdr.f32()?, cdr.f32()?];
        let [apart_s, _whole] = [cdr.f32()?, cdr.f32()?];
        let limits_m = [cdr.f32()?, cdr.f32()?];
        let ranges_m = cdr.list(Cdr::f32)?;
        Ok(Self { header, first_rad, step_rad, apart_s, limits_m, ranges_m })
    }
}

/// `geometry_msgs/TransformStamped`: where a frame is in its parent.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Transform {
    /// The parent, and when.
    pub(crate) header: Header,
    pub(crate) child: String,
    pub(crate) translation_m: [f64; 3],
    /// Quaternion x, y, z, w.
    pub(crate) rotation: [f64; 4],
}

impl Transform {
    fn decode(cdr: &mut Cdr<'_>) -> Part<Self> {
        let header = Header::decode(cdr)?;
        let child = frame(cdr.text()?);
        let translation_m = [cdr.f64()?, cdr.f64()?, cdr.f64()?];
        let rotation = [cdr.f64()?, cdr.f64()?, cdr.f64()?, cdr.f64()?];
        Ok(Self { header, child, translation_m, rotation })
    }

    /// Those of a `tf2_msgs/TFMessage`.
    pub(crate) fn all(cdr: &mut Cdr<'_>) -> Part<Vec<Self>> {
        cdr.list(Self::decode)
    }
}
