//! What messages say of the readings of a scan.

use std::collections::BTreeMap;

use sonard_interpret::interpret::Extents;
use sonard_model::{acoustics::BeamPattern, viewpoint::Viewpoint};
use sonard_records::{PathKind, Ping, PingStatus, Point, ScanView, Session};

use super::{
    frames::Frames,
    settings::{Profile, Settings},
};
use crate::{
    LeftOut,
    ros::message::{Header, LaserScan, Marker, PointCloud, PointNumber, Shape, Stamp},
};

/// What holds for all readings of a session.
#[derive(Debug)]
pub(super) struct Figures {
    pub(super) frames: Frames,
    pub(super) min_range_m: f64,
    pub(super) max_range_m: f64,
    pub(super) field_of_view_rad: f64,
    /// Of the longest path that is listened for, nanoseconds.
    pub(super) window_ns: u64,
}

/// Two-way the beam is 6 dB down where the transducer's own pattern is 3 dB down.
const HALF_POWER: f64 = 0.707_945_784_384_138;

impl Figures {
    pub(super) fn of(session: &Session, settings: &Settings) -> Result<Self, LeftOut> {
        let extents =
            Extents::of_session(session).map_err(|error| LeftOut::Session(error.to_string()))?;
        let speed_m_s = session.air.sound_speed_m_s;
        let by_beam = || 2.0 * BeamPattern::new(&session.sensor, speed_m_s).angle_at(HALF_POWER);
        let asked = settings.field_of_view_deg.map(f64::to_radians);
        let window_ns = 2.0 * extents.max_range_m / speed_m_s * 1e9;
        Ok(Self {
            frames: Frames::of(session, &settings.frame),
            min_range_m: extents.min_range_m,
            max_range_m: extents.max_range_m,
            field_of_view_rad: asked.unwrap_or_else(by_beam),
            window_ns: window_ns as u64,
        })
    }

    /// What a `Range` says of a reading; `None` where there is nothing that it could say.
    pub(super) fn range(&self, profile: Profile, heard: Heard) -> Option<f32> {
        let [silent, near] = match profile {
            Profile::Rep117 => [f32::INFINITY, f32::NEG_INFINITY],
            Profile::Nav2 => [self.max_range_m as f32, self.min_range_m as f32],
        };
        match heard.status {
            PingStatus::Echo => heard.range_m.map(|range_m| range_m as f32),
            PingStatus::NoEcho => Some(silent),
            PingStatus::MinRange => Some(near),
            PingStatus::LinkLost | PingStatus::StepDoubtful | PingStatus::ModuleFault => None,
        }
    }
}

/// When the readings of a scan were fired.
#[derive(Debug)]
pub(crate) struct Firings {
    /// Of each reading; of one that never was, none.
    pub(crate) fired: Vec<Option<Stamp>>,
    /// How long each listened, nanoseconds.
    pub(crate) window_ns: u64,
}

/// What was heard, or is predicted to be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heard {
    status: PingStatus,
    range_m: Option<f64>,
    margin_db: Option<f64>,
    order: Option<u32>,
}

impl Heard {
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

/// The readings of a scan in the order of the plan. Of one that was measured again the last counts.
pub(crate) fn in_order(scan: &ScanView) -> Vec<&Ping> {
    let by_index: BTreeMap<u32, &Ping> = scan.pings.iter().map(|ping| (ping.index, ping)).collect();
    by_index.into_values().collect()
}

/// The fields of the points of a cloud.
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

/// The echoes of a scan as points straight ahead of the transducer.
pub(super) fn points<'a>(
    scan: &ScanView,
    (pings, firings): (&[&Ping], &Firings),
    header: Header<'a>,
    heard: impl Fn(&Ping) -> Option<Heard>,
) -> PointCloud<'a> {
    let mut data = Vec::new();
    for (ping, fired) in pings.iter().zip(&firings.fired) {
        let Some((heard, fired)) = heard(ping).zip(*fired) else { continue };
        let Some((range_m, from)) = heard.echo_m().zip(scan.viewpoint(ping)) else { continue };
        let [x, y, z] = ahead(&from, range_m);
        let time_s = fired.0.saturating_sub(header.stamp.0) as f64 * 1e-9;
        let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN) as f32;
        for value in
            [x as f32, y as f32, z as f32, or_nan(heard.margin_db), range_m as f32, time_s as f32]
        {
            data.extend(value.to_le_bytes());
        }
        data.extend(ping.index.to_le_bytes());
        data.extend(heard.order.map_or(-1, u32::cast_signed).to_le_bytes());
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

/// A scan as that of a laser at the middle of the stepper's axis; `None` of scans that have no such form: of arrays, of a
/// face beside its axis or tilted, with several firings a stop, or in directions that are not evenly apart.
pub(super) fn laser_scan<'a>(
    scan: &ScanView,
    (pings, firings): (&[&Ping], &Firings),
    figures: &'a Figures,
    stamp: Stamp,
) -> Option<LaserScan<'a>> {
    let session = scan.session.as_ref()?;
    let plan = scan.start.as_ref()?.plan;
    let has_form =
        !scan.is_of_array() && scan.has_one_place() && session.sensor.mounting.tilt_deg == 0.0;
    if !has_form || plan.check().is_err() || plan.pings_per_stop != 1 {
        return None;
    }
    let mut ranges = vec![f32::NAN; plan.beams() as usize];
    let simulated = pings.iter().any(|ping| ping.margin_db.is_some());
    let mut intensities = vec![0.0; if simulated { ranges.len() } else { 0 }];
    for ping in pings {
        let even =
            sonard_model::geometry::wrap_180(plan.azimuth_deg(ping.index) - ping.azimuth_deg).abs()
                < SAME_DEG;
        let range = ranges.get_mut(ping.index as usize).filter(|_| even)?;
        *range = figures.range(Profile::Rep117, Heard::measured(ping)).unwrap_or(f32::NAN);
        if let Some(intensity) = intensities.get_mut(ping.index as usize) {
            *intensity = ping.margin_db.unwrap_or(0.0) as f32;
        }
    }
    let step_rad = plan.step_deg.to_radians();
    let last_rad =
        plan.from_deg.to_radians() + step_rad * f64::from(plan.beams().saturating_sub(1));
    Some(LaserScan {
        header: Header { stamp, frame: &figures.frames.mount },
        angles: [plan.from_deg.to_radians() as f32, last_rad as f32, step_rad as f32],
        times: times(pings, firings),
        range_limits: [figures.min_range_m as f32, figures.max_range_m as f32],
        ranges,
        intensities,
    })
}

/// Directions closer than this are one, degrees.
const SAME_DEG: f64 = 1e-3;

/// From one firing to the next on the average, and from the first to the end of the last's window, seconds.
fn times(pings: &[&Ping], firings: &Firings) -> [f32; 2] {
    let fired = pings
        .iter()
        .zip(&firings.fired)
        .filter_map(|(ping, fired)| Some((ping.index, fired.as_ref()?.0)));
    let (first, last) = (fired.clone().min(), fired.max());
    let Some(((from, began), (to, ended))) = first.zip(last) else { return [0.0; 2] };
    let gone_s = ended.saturating_sub(began) as f64 * 1e-9;
    let apart_s = if to > from { gone_s / f64::from(to - from) } else { 0.0 };
    [apart_s as f32, (gone_s + firings.window_ns as f64 * 1e-9) as f32]
}

/// How a path of each kind is drawn: its name, and red, green and blue.
const PATH_KINDS: [(PathKind, &str, [f32; 3]); 3] = [
    (PathKind::Specular, "specular", [0.0, 0.45, 0.7]),
    (PathKind::Diffracted, "diffracted", [0.84, 0.37, 0.0]),
    (PathKind::Scattered, "scattered", [0.0, 0.62, 0.45]),
];

const PATH_WIDTH_M: f64 = 0.004;
const PATH_OPACITY: f32 = 0.5;

/// The paths of the sound of all echoes, lines of one kind together.
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
            shape: Shape::Lines,
            width_m: PATH_WIDTH_M,
            colour: [red, green, blue, PATH_OPACITY],
            points,
        }
    });
    lines.into()
}

/// The corners of the path of a reading's echo, if it is of this kind and known.
fn path_of(scan: &ScanView, ping: &Ping, kind: PathKind) -> Option<Vec<[f64; 3]>> {
    let heard = |status: PingStatus| status.has_range();
    let own = ping.path.as_ref().filter(|_| heard(ping.status));
    let predicted = || {
        let sim = ping.sim.as_ref().filter(|sim| heard(sim.status))?;
        sim.path.as_ref()
    };
    let path = own.or_else(predicted).filter(|path| path.kind == kind)?;
    let from = scan.viewpoint(ping)?;
    let z_m = from.z_m.unwrap_or(0.0);
    let corner = |point: Point| match point {
        Point::Plan([x, y]) => [x, y, z_m],
        Point::Space(at) => at,
    };
    let [transmitter, receiver] = scan.ends(ping, path)?.map(|end| [end.x, end.y, z_m]);
    let met = path.interactions.iter().map(|met| corner(met.point));
    Some([transmitter].into_iter().chain(met).chain([receiver]).collect())
}
