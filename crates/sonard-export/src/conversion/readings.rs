//! Conversion of readings to points, laser scans and path markers.

use std::collections::BTreeMap;

use sonard_interpret::interpret::Extents;
use sonard_model::{acoustics::BeamPattern, viewpoint::Viewpoint};
use sonard_records::{PathKind, Ping, PingStatus, Point, ScanView, Session};

use super::{
    frames::RangerFrames,
    settings::{ExportSettings, Profile},
};
use crate::{
    SkippedScan,
    ros::message::{Header, LaserScan, Marker, MarkerShape, PointCloud, PointNumber, Stamp},
};

/// Parameters shared by all readings of a session.
#[derive(Debug)]
pub(super) struct SessionParameters {
    pub(super) frames: RangerFrames,
    pub(super) min_range_m: f64,
    pub(super) max_range_m: f64,
    pub(super) field_of_view_rad: f64,
    /// Duration of the receive window, nanoseconds.
    pub(super) window_ns: u64,
}

/// One-way amplitude at which the two-way beam is 6 dB down and the transducer's own pattern 3 dB.
const HALF_POWER: f64 = 0.707_945_784_384_138;

impl SessionParameters {
    pub(super) fn new(session: &Session, settings: &ExportSettings) -> Result<Self, SkippedScan> {
        let extents = Extents::from_session(session)
            .map_err(|error| SkippedScan::Session(error.to_string()))?;
        let speed_m_s = session.air.sound_speed_m_s;
        let by_beam = || 2.0 * BeamPattern::new(&session.sensor, speed_m_s).angle_at(HALF_POWER);
        let requested = settings.field_of_view_deg.map(f64::to_radians);
        let window_ns = 2.0 * extents.max_range_m / speed_m_s * 1e9;
        Ok(Self {
            frames: RangerFrames::new(session, &settings.frame),
            min_range_m: extents.min_range_m,
            max_range_m: extents.max_range_m,
            field_of_view_rad: requested.unwrap_or_else(by_beam),
            window_ns: window_ns as u64,
        })
    }

    /// Returns the value of a `Range` message; `None` for a reading without a valid measurement.
    pub(super) fn range(&self, profile: Profile, reading: RangeReading) -> Option<f32> {
        let [no_echo, too_near] = match profile {
            Profile::Rep117 => [f32::INFINITY, f32::NEG_INFINITY],
            Profile::Nav2 => [self.max_range_m as f32, self.min_range_m as f32],
        };
        match reading.status {
            PingStatus::Echo => reading.range_m.map(|range_m| range_m as f32),
            PingStatus::NoEcho => Some(no_echo),
            PingStatus::MinRange => Some(too_near),
            PingStatus::LinkLost | PingStatus::StepUncertain | PingStatus::ModuleFault => None,
        }
    }
}

/// Firing times of the readings of a scan.
#[derive(Debug)]
pub(crate) struct FiringTimes {
    /// Time of each reading; `None` if it was never fired.
    pub(crate) fired: Vec<Option<Stamp>>,
    /// Duration of the receive window, nanoseconds.
    pub(crate) window_ns: u64,
}

/// Measured or predicted range.
#[derive(Debug, Clone, Copy)]
pub(super) struct RangeReading {
    status: PingStatus,
    range_m: Option<f64>,
    margin_db: Option<f64>,
    order: Option<u32>,
}

impl RangeReading {
    pub(super) fn measured(ping: &Ping) -> Self {
        let Ping { status, range_m, margin_db, .. } = *ping;
        let order = ping.sound_path().map(|path| path.order);
        Self { status, range_m, margin_db, order }
    }

    pub(super) fn predicted(ping: &Ping) -> Option<Self> {
        let sim = ping.sim.as_ref()?;
        let order = sim.path.as_ref().map(|path| path.order);
        Some(Self { status: sim.status, range_m: sim.range_m, margin_db: sim.margin_db, order })
    }

    fn echo_m(self) -> Option<f64> {
        self.range_m.filter(|_| self.status == PingStatus::Echo)
    }
}

/// Returns the readings of a scan in plan order; the last measurement of a repeated reading wins.
pub(crate) fn plan_order(scan: &ScanView) -> Vec<&Ping> {
    let by_index: BTreeMap<u32, &Ping> = scan.pings.iter().map(|ping| (ping.index, ping)).collect();
    by_index.into_values().collect()
}

/// Point fields of a `PointCloud2`.
pub(super) const POINT_FIELDS: &[(&str, PointNumber)] = &[
    ("x", PointNumber::F32),
    ("y", PointNumber::F32),
    ("z", PointNumber::F32),
    ("intensity", PointNumber::F32),
    ("range", PointNumber::F32),
    ("time", PointNumber::F32),
    ("index", PointNumber::U32),
    ("order", PointNumber::I32),
    ("residual", PointNumber::F32),
    ("confidence", PointNumber::F32),
];

/// Builds a cloud of the echoes, at their range along the beam axis.
pub(super) fn points<'a>(
    scan: &ScanView,
    (pings, firings): (&[&Ping], &FiringTimes),
    header: Header<'a>,
    reading: impl Fn(&Ping) -> Option<RangeReading>,
) -> PointCloud<'a> {
    let mut data = Vec::new();
    for (ping, fired) in pings.iter().zip(&firings.fired) {
        let Some((reading, fired)) = reading(ping).zip(*fired) else { continue };
        let Some((range_m, from)) = reading.echo_m().zip(scan.viewpoint(ping)) else { continue };
        let [x, y, z] = ahead(&from, range_m);
        let time_s = fired.0.saturating_sub(header.stamp.0) as f64 * 1e-9;
        let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN) as f32;
        for value in
            [x as f32, y as f32, z as f32, or_nan(reading.margin_db), range_m as f32, time_s as f32]
        {
            data.extend(value.to_le_bytes());
        }
        data.extend(ping.index.to_le_bytes());
        data.extend(reading.order.map_or(-1, u32::cast_signed).to_le_bytes());
        data.extend(or_nan(ping.residual_m).to_le_bytes());
        data.extend(or_nan(ping.confidence).to_le_bytes());
    }
    PointCloud { header, fields: POINT_FIELDS, data }
}

fn ahead(from: &Viewpoint, range_m: f64) -> [f64; 3] {
    let (sin, cos) = from.tilt_deg.to_radians().sin_cos();
    let [x, y] = from.point_at(range_m * cos).to_array();
    [x, y, from.z_m.unwrap_or(0.0) + range_m * sin]
}

/// Builds a `LaserScan` about the axis of the stepper.
///
/// Returns `None` for scans without this form: of arrays, of faces off the axis or tilted, with
/// several firings per stop, or with uneven directions.
pub(super) fn laser_scan<'a>(
    scan: &ScanView,
    (pings, firings): (&[&Ping], &FiringTimes),
    parameters: &'a SessionParameters,
    stamp: Stamp,
) -> Option<LaserScan<'a>> {
    let session = scan.session.as_ref()?;
    let plan = scan.start.as_ref()?.plan;
    let is_planar = !scan.is_array_scan()
        && scan.is_from_one_position()
        && session.sensor.mounting.tilt_deg == 0.0;
    if !is_planar || plan.check().is_err() || plan.pings_per_stop != 1 {
        return None;
    }
    let mut ranges = vec![f32::NAN; plan.beams() as usize];
    let simulated = pings.iter().any(|ping| ping.margin_db.is_some());
    let mut intensities = vec![0.0; if simulated { ranges.len() } else { 0 }];
    for ping in pings {
        let is_even =
            sonard_model::geometry::wrap_180(plan.azimuth_deg(ping.index) - ping.azimuth_deg).abs()
                < SAME_DEG;
        let range = ranges.get_mut(ping.index as usize).filter(|_| is_even)?;
        *range =
            parameters.range(Profile::Rep117, RangeReading::measured(ping)).unwrap_or(f32::NAN);
        if let Some(intensity) = intensities.get_mut(ping.index as usize) {
            *intensity = ping.margin_db.unwrap_or(0.0) as f32;
        }
    }
    let step_rad = plan.step_deg.to_radians();
    let last_rad =
        plan.from_deg.to_radians() + step_rad * f64::from(plan.beams().saturating_sub(1));
    Some(LaserScan {
        header: Header { stamp, frame: &parameters.frames.mount },
        angles: [plan.from_deg.to_radians() as f32, last_rad as f32, step_rad as f32],
        times: times(pings, firings),
        range_limits: [parameters.min_range_m as f32, parameters.max_range_m as f32],
        ranges,
        intensities,
    })
}

/// Tolerance for equal directions, degrees.
const SAME_DEG: f64 = 1e-3;

/// Returns the mean time between firings, and the time from the first firing to the end of the last
/// window, seconds.
fn times(pings: &[&Ping], firings: &FiringTimes) -> [f32; 2] {
    let fired = pings
        .iter()
        .zip(&firings.fired)
        .filter_map(|(ping, fired)| Some((ping.index, fired.as_ref()?.0)));
    let (first, last) = (fired.clone().min(), fired.max());
    let Some(((from, start), (to, end))) = first.zip(last) else { return [0.0; 2] };
    let elapsed_s = end.saturating_sub(start) as f64 * 1e-9;
    let interval_s = if to > from { elapsed_s / f64::from(to - from) } else { 0.0 };
    [interval_s as f32, (elapsed_s + firings.window_ns as f64 * 1e-9) as f32]
}

/// Namespace and colour (red, green, blue) of each kind of path.
const PATH_KINDS: [(PathKind, &str, [f32; 3]); 3] = [
    (PathKind::Specular, "specular", [0.0, 0.45, 0.7]),
    (PathKind::Diffracted, "diffracted", [0.84, 0.37, 0.0]),
    (PathKind::Scattered, "scattered", [0.0, 0.62, 0.45]),
];

const PATH_WIDTH_M: f64 = 0.004;
const PATH_OPACITY: f32 = 0.5;

/// Builds line markers of the propagation paths of all echoes, one per kind of path.
pub(super) fn paths<'a>(scan: &ScanView, pings: &[&Ping], header: Header<'a>) -> Vec<Marker<'a>> {
    let lines = PATH_KINDS.map(|(kind, namespace, [red, green, blue])| {
        let mut points = Vec::new();
        for ping in pings {
            let corners = path_of(scan, ping, kind).unwrap_or_default();
            points.extend(corners.windows(2).flatten());
        }
        Marker {
            header,
            namespace,
            shape: MarkerShape::Lines,
            width_m: PATH_WIDTH_M,
            colour: [red, green, blue, PATH_OPACITY],
            points,
        }
    });
    lines.into()
}

/// Returns the corners of a reading's propagation path, if it is known and of this kind.
fn path_of(scan: &ScanView, ping: &Ping, kind: PathKind) -> Option<Vec<[f64; 3]>> {
    let has_range = |status: PingStatus| status.has_range();
    let own = ping.path.as_ref().filter(|_| has_range(ping.status));
    let predicted = || {
        let sim = ping.sim.as_ref().filter(|sim| has_range(sim.status))?;
        sim.path.as_ref()
    };
    let path = own.or_else(predicted).filter(|path| path.kind == kind)?;
    let from = scan.viewpoint(ping)?;
    let z_m = from.z_m.unwrap_or(0.0);
    let corner = |point: Point| match point {
        Point::Plan([x, y]) => [x, y, z_m],
        Point::Space(at) => at,
    };
    let [transmitter, receiver] =
        scan.transducer_positions(ping, path)?.map(|end| [end.x, end.y, z_m]);
    let reflections = path.interactions.iter().map(|interaction| corner(interaction.point));
    Some([transmitter].into_iter().chain(reflections).chain([receiver]).collect())
}
