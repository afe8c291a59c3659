//! The messages, field by field as ROS 2's interfaces have them.

use sonard_interpret::interpret::grid::Grid;

use super::cdr::{Cdr, Encode};

/// A moment, nanoseconds since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Stamp(pub(crate) u64);

impl Encode for Stamp {
    fn encode(&self, cdr: &mut Cdr) {
        const SECOND: u64 = 1_000_000_000;
        // Seconds are signed and end in 2038.
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
    fn encode(&self, cdr: &mut Cdr) {
        self.stamp.encode(cdr);
        cdr.text(self.frame);
    }
}

/// `sensor_msgs/Range` of an ultrasonic ranger.
#[derive(Debug)]
pub(crate) struct Range<'a> {
    pub(crate) header: Header<'a>,
    /// Full angle, radians.
    pub(crate) field_of_view: f32,
    pub(crate) min_range: f32,
    pub(crate) max_range: f32,
    pub(crate) range: f32,
    /// Whether there is a variance, as there is since Iron.
    pub(crate) has_variance: bool,
}

impl Encode for Range<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        const ULTRASOUND: u8 = 0;
        /// The variance of a range of which none is known.
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
    /// First and last, and from one to the next, radians.
    pub(crate) angles: [f32; 3],
    /// From one firing to the next, and of the whole scan, seconds.
    pub(crate) times: [f32; 2],
    pub(crate) range_limits: [f32; 2],
    pub(crate) ranges: Vec<f32>,
    pub(crate) intensities: Vec<f32>,
}

impl Encode for LaserScan<'_> {
    fn encode(&self, cdr: &mut Cdr) {
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
    fn encode(&self, cdr: &mut Cdr) {
        cdr.f64(self.0);
    }
}

/// What the fields of a point are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PointNumber {
    I32 = 5,
    U32 = 6,
    F32 = 7,
}

/// `sensor_msgs/PointCloud2`, in a row, of points whose fields have four bytes each.
#[derive(Debug)]
pub(crate) struct PointCloud<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) fields: &'a [(&'static str, PointNumber)],
    /// The fields of one point after the other, little-endian.
    pub(crate) data: Vec<u8>,
}

impl Encode for PointCloud<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        let point_bytes = 4 * self.fields.len();
        let points = self.data.len() / point_bytes.max(1);
        self.header.encode(cdr);
        // Height, width.
        cdr.u32(1);
        cdr.u32(points as u32);
        cdr.u32(self.fields.len() as u32);
        for (place, (name, number)) in self.fields.iter().enumerate() {
            cdr.text(name);
            cdr.u32(4 * place as u32);
            cdr.u8(*number as u8);
            cdr.u32(1);
        }
        // Not big-endian.
        cdr.flag(false);
        cdr.u32(point_bytes as u32);
        cdr.u32(self.data.len() as u32);
        cdr.bytes(&self.data);
        // No point without a place.
        cdr.flag(true);
    }
}

/// `geometry_msgs/TransformStamped`: where a frame is in another one.
#[derive(Debug)]
pub(crate) struct Transform<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) child: &'a str,
    pub(crate) translation: [f64; 3],
    /// Quaternion x, y, z, w.
    pub(crate) rotation: [f64; 4],
}

impl Encode for Transform<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        self.header.encode(cdr);
        cdr.text(self.child);
        self.translation.iter().chain(&self.rotation).for_each(|value| cdr.f64(*value));
    }
}

/// `tf2_msgs/TFMessage`.
#[derive(Debug)]
pub(crate) struct Transforms<'a>(pub(crate) Vec<Transform<'a>>);

impl Encode for Transforms<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        cdr.list(&self.0);
    }
}

/// What the points of a marker are drawn as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// `LINE_LIST`: each two are the ends of a line.
    Lines = 5,
    /// `SPHERE_LIST`.
    Spheres = 7,
}

/// `visualization_msgs/Marker` of many points.
#[derive(Debug)]
pub(crate) struct Marker<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) namespace: &'a str,
    pub(crate) shape: Shape,
    pub(crate) width_m: f64,
    /// Red, green, blue, opacity.
    pub(crate) colour: [f32; 4],
    pub(crate) points: Vec<[f64; 3]>,
}

impl Encode for Marker<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        // What is not drawn any more has to be taken away.
        const ADD: i32 = 0;
        const DELETE: i32 = 2;
        self.header.encode(cdr);
        cdr.text(self.namespace);
        cdr.i32(0);
        cdr.i32(self.shape as i32);
        cdr.i32(if self.points.is_empty() { DELETE } else { ADD });
        // Pose: the origin.
        for value in [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] {
            cdr.f64(value);
        }
        // Of lines only the first counts.
        let others_m = if self.shape == Shape::Lines { 0.0 } else { self.width_m };
        for value in [self.width_m, others_m, others_m] {
            cdr.f64(value);
        }
        self.colour.iter().for_each(|value| cdr.f32(*value));
        // Lifetime: for ever.
        cdr.i32(0);
        cdr.u32(0);
        cdr.flag(false);
        cdr.u32(self.points.len() as u32);
        self.points.iter().flatten().for_each(|value| cdr.f64(*value));
        no_pictures(cdr);
    }
}

/// The fields of a marker from `colors` on, which are those of other kinds.
fn no_pictures(cdr: &mut Cdr) {
    // Colours.
    cdr.u32(0);
    // The resource of a texture, the texture's header, format and data, and where it lies.
    cdr.text("");
    Header { stamp: Stamp(0), frame: "" }.encode(cdr);
    cdr.text("");
    cdr.u32(0);
    cdr.u32(0);
    // Text, resource and file of a mesh.
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
    fn encode(&self, cdr: &mut Cdr) {
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
    fn encode(&self, cdr: &mut Cdr) {
        let shape = self.grid.shape();
        self.header.encode(cdr);
        // When the map was loaded.
        self.header.stamp.encode(cdr);
        cdr.f32(shape.resolution_m as f32);
        cdr.u32(shape.width as u32);
        cdr.u32(shape.height as u32);
        // Where the lower left corner is, and that it is not turned.
        for value in [shape.origin.x, shape.origin.y, 0.0, 0.0, 0.0, 0.0, 1.0] {
            cdr.f64(value);
        }
        let cells: Vec<u8> = self.grid.probabilities().map(percent).collect();
        cdr.bytes(&cells);
    }
}

/// How likely a cell is occupied, in hundredths, as a signed byte; -1 where nothing is known.
fn percent(p: f64) -> u8 {
    let known = p != 0.5;
    let percent = if known { (100.0 * p).round() as i8 } else { -1 };
    percent.cast_unsigned()
}
