//! ROS 2 messages, field by field.

use sonard_interpret::interpret::grid::Grid;

use super::cdr::{CdrWriter, Encode};

/// Time stamp, nanoseconds since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Stamp(pub(crate) u64);

impl Encode for Stamp {
    fn encode(&self, cdr: &mut CdrWriter) {
        const SECOND: u64 = 1_000_000_000;
        // Seconds are signed and saturate in 2038.
        cdr.i32(i32::try_from(self.0 / SECOND).unwrap_or(i32::MAX));
        cdr.u32((self.0 % SECOND) as u32);
    }
}

/// `std_msgs/Header`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Header<'a> {
    pub(crate) stamp: Stamp,
    pub(crate) frame: &'a str,
}

impl Encode for Header<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        self.stamp.encode(cdr);
        cdr.text(self.frame);
    }
}

/// `sensor_msgs/Range` of an ultrasonic ranger.
#[derive(Debug)]
pub(crate) struct Range<'a> {
    pub(crate) header: Header<'a>,
    /// Full field of view, radians.
    pub(crate) field_of_view: f32,
    pub(crate) min_range: f32,
    pub(crate) max_range: f32,
    pub(crate) range: f32,
    /// True to write the variance, which exists since Iron.
    pub(crate) has_variance: bool,
}

impl Encode for Range<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        const ULTRASOUND: u8 = 0;
        /// Variance that means "unknown".
        const UNKNOWN: f32 = 0.0;
        self.header.encode(cdr);
        cdr.u8(ULTRASOUND);
        for value in [self.field_of_view, self.min_range, self.max_range, self.range] {
            cdr.f32(value);
        }
        if self.has_variance {
            cdr.f32(UNKNOWN);
        }
    }
}

/// `sensor_msgs/LaserScan`.
#[derive(Debug)]
pub(crate) struct LaserScan<'a> {
    pub(crate) header: Header<'a>,
    /// First angle, last angle and increment, radians.
    pub(crate) angles: [f32; 3],
    /// Time between firings and duration of the scan, seconds.
    pub(crate) times: [f32; 2],
    pub(crate) range_limits: [f32; 2],
    pub(crate) ranges: Vec<f32>,
    pub(crate) intensities: Vec<f32>,
}

impl Encode for LaserScan<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        self.header.encode(cdr);
        let figures = self.angles.iter().chain(&self.times).chain(&self.range_limits);
        figures.for_each(|value| cdr.f32(*value));
        cdr.f32s(&self.ranges);
        cdr.f32s(&self.intensities);
    }
}

/// `std_msgs/Float64`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Float(pub(crate) f64);

impl Encode for Float {
    fn encode(&self, cdr: &mut CdrWriter) {
        cdr.f64(self.0);
    }
}

/// Data type of a point field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PointNumber {
    I32 = 5,
    U32 = 6,
    F32 = 7,
}

/// `sensor_msgs/PointCloud2` of one row, with four-byte fields.
#[derive(Debug)]
pub(crate) struct PointCloud<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) fields: &'a [(&'static str, PointNumber)],
    /// Fields of consecutive points, little-endian.
    pub(crate) data: Vec<u8>,
}

impl Encode for PointCloud<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        let point_bytes = 4 * self.fields.len();
        let points = self.data.len() / point_bytes.max(1);
        self.header.encode(cdr);
        // Height and width.
        cdr.u32(1);
        cdr.u32(points as u32);
        cdr.u32(self.fields.len() as u32);
        for (place, (name, number)) in self.fields.iter().enumerate() {
            cdr.text(name);
            cdr.u32(4 * place as u32);
            cdr.u8(*number as u8);
            cdr.u32(1);
        }
        // Little-endian.
        cdr.flag(false);
        cdr.u32(point_bytes as u32);
        cdr.u32(self.data.len() as u32);
        cdr.bytes(&self.data);
        // Every point is valid.
        cdr.flag(true);
    }
}

/// `geometry_msgs/TransformStamped`: placement of a frame in its parent.
#[derive(Debug)]
pub(crate) struct Transform<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) child: &'a str,
    pub(crate) translation: [f64; 3],
    /// Quaternion x, y, z, w.
    pub(crate) rotation: [f64; 4],
}

impl Encode for Transform<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        self.header.encode(cdr);
        cdr.text(self.child);
        self.translation.iter().chain(&self.rotation).for_each(|value| cdr.f64(*value));
    }
}

/// `tf2_msgs/TFMessage`.
#[derive(Debug)]
pub(crate) struct Transforms<'a>(pub(crate) Vec<Transform<'a>>);

impl Encode for Transforms<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        cdr.list(&self.0);
    }
}

/// Marker type, which determines how the points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MarkerShape {
    /// `LINE_LIST`: pairs of points are lines.
    Lines = 5,
    /// `SPHERE_LIST`.
    Spheres = 7,
}

/// `visualization_msgs/Marker` of many points.
#[derive(Debug)]
pub(crate) struct Marker<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) namespace: &'a str,
    pub(crate) shape: MarkerShape,
    pub(crate) width_m: f64,
    /// Red, green, blue, opacity.
    pub(crate) colour: [f32; 4],
    pub(crate) points: Vec<[f64; 3]>,
}

impl Encode for Marker<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        // An empty marker deletes the one drawn before.
        const ADD: i32 = 0;
        const DELETE: i32 = 2;
        self.header.encode(cdr);
        cdr.text(self.namespace);
        cdr.i32(0);
        cdr.i32(self.shape as i32);
        cdr.i32(if self.points.is_empty() { DELETE } else { ADD });
        // Pose at the origin.
        for value in [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] {
            cdr.f64(value);
        }
        // Lines use only the first scale.
        let others_m = if self.shape == MarkerShape::Lines { 0.0 } else { self.width_m };
        for value in [self.width_m, others_m, others_m] {
            cdr.f64(value);
        }
        self.colour.iter().for_each(|value| cdr.f32(*value));
        // Unlimited lifetime.
        cdr.i32(0);
        cdr.u32(0);
        cdr.flag(false);
        cdr.u32(self.points.len() as u32);
        self.points.iter().flatten().for_each(|value| cdr.f64(*value));
        encode_unused_fields(cdr);
    }
}

/// Writes the fields from `colors` on, which other kinds of markers use.
fn encode_unused_fields(cdr: &mut CdrWriter) {
    // Point colours.
    cdr.u32(0);
    // Texture resource, its header, format and data, and texture coordinates.
    cdr.text("");
    Header { stamp: Stamp(0), frame: "" }.encode(cdr);
    cdr.text("");
    cdr.u32(0);
    cdr.u32(0);
    // Text, and resource and file of a mesh.
    cdr.text("");
    cdr.text("");
    cdr.text("");
    cdr.u32(0);
    cdr.flag(false);
}

/// `visualization_msgs/MarkerArray`.
#[derive(Debug)]
pub(crate) struct Markers<'a>(pub(crate) Vec<Marker<'a>>);

impl Encode for Markers<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        cdr.list(&self.0);
    }
}

/// `nav_msgs/OccupancyGrid`.
#[derive(Debug)]
pub(crate) struct OccupancyGrid<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) grid: &'a Grid,
}

impl Encode for OccupancyGrid<'_> {
    fn encode(&self, cdr: &mut CdrWriter) {
        let shape = self.grid.shape();
        self.header.encode(cdr);
        // Load time of the map.
        self.header.stamp.encode(cdr);
        cdr.f32(shape.resolution_m as f32);
        cdr.u32(shape.width as u32);
        cdr.u32(shape.height as u32);
        // Position of the lower left corner, without rotation.
        for value in [shape.origin.x, shape.origin.y, 0.0, 0.0, 0.0, 0.0, 1.0] {
            cdr.f64(value);
        }
        let cells: Vec<u8> = self.grid.probabilities().map(percent).collect();
        cdr.bytes(&cells);
    }
}

/// Returns the occupancy of a cell in percent as a signed byte; -1 for an unknown cell.
fn percent(p: f64) -> u8 {
    let known = p != 0.5;
    let percent = if known { (100.0 * p).round() as i8 } else { -1 };
    percent.cast_unsigned()
}
