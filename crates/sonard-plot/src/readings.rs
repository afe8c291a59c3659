//! Readings as they are drawn: what each one is, whatever kind of log it came from. Where a
//! prediction stands beside a reading, [`sonard_interpret::compare`] says what explains it, so that pictures
//! and tables agree.

use super::{canvas::Shape, fans::Fan, theme};
use sonard_interpret::compare::{Judged, Verdict, compare};
use sonard_model::{
    acoustics::BeamPattern,
    geometry::{DVec2, Pose, wrap_360},
    viewpoint::Viewpoint,
};
use sonard_records::{PathKind, PathRecord, Ping, PingStatus, ScanView, Session};

/// What a beam gave, as far as the model explains it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Kind {
    /// An echo with no model beside it.
    Echo,
    /// One mirror reflection.
    Direct,
    /// Two or more.
    Multiple,
    /// Bent at an edge.
    Edge,
    /// Sound was there when the receiver opened.
    MinRange,
    /// Heard, but not by the model at this range.
    Unexplained,
    /// No echo.
    Silent,
    /// No echo although the model gives one.
    SilentUnexplained,
    /// No reading, or none to be relied on.
    Lost,
}

impl Kind {
    /// Kinds that have a place on the floor plan.
    pub(super) const HEARD: [Self; 6] =
        [Self::Echo, Self::Direct, Self::Multiple, Self::Edge, Self::MinRange, Self::Unexplained];
    /// Kinds that have a direction only.
    pub(super) const UNHEARD: [Self; 3] = [Self::Silent, Self::SilentUnexplained, Self::Lost];

    pub(super) const fn colour(self) -> &'static str {
        match self {
            Self::Echo | Self::Direct => theme::BLUE,
            Self::Multiple => theme::VERMILLION,
            Self::Edge => theme::GREEN,
            Self::MinRange => theme::PURPLE,
            Self::Unexplained | Self::SilentUnexplained => theme::INK,
            Self::Silent => theme::SILENT,
            Self::Lost => theme::ORANGE,
        }
    }

    pub(super) const fn shape(self) -> Shape {
        match self {
            Self::Multiple => Shape::Square,
            Self::Edge => Shape::Triangle,
            Self::MinRange => Shape::Diamond,
            Self::Unexplained => Shape::Cross,
            _ => Shape::Dot,
        }
    }

    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Echo => "echo",
            Self::Direct => "direct echo",
            Self::Multiple => "multiple reflection",
            Self::Edge => "edge",
            Self::MinRange => "minimum range",
            Self::Unexplained => "unexplained",
            Self::Silent => "silent",
            Self::SilentUnexplained => "silent, model hears",
            Self::Lost => "no valid reading",
        }
    }
}

/// One beam.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reading {
    /// Azimuth from the scan's heading, degrees.
    pub(super) azimuth_deg: f64,
    /// Where it was taken from, if not all of the scan are from its pose.
    pub(super) viewpoint: Option<Viewpoint>,
    /// Its name.
    pub(super) ranger: Option<String>,
    pub(super) kind: Kind,
    /// Finite, not negative, and there exactly for the kinds that were heard.
    pub(super) range_m: Option<f64>,
    /// The prediction beside a measured reading, if it is a range.
    pub(super) model_range_m: Option<f64>,
    pub(super) residual_m: Option<f64>,
    /// Amplitude above the threshold, decibels, of a reading that the model made.
    pub(super) margin_db: Option<f64>,
    /// The reading in words.
    pub(super) hint: String,
}

/// The beams of a scan with what is common to them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Readings {
    pub(super) beams: Vec<Reading>,
    /// Range of the end of blanking, metres.
    pub(super) min_range_m: Option<f64>,
    /// Whether predictions stand beside the readings.
    pub(super) has_model: bool,
    /// How to draw readings of an array.
    pub(super) fan: Option<Fan>,
}

impl Reading {
    /// The place at a range along the beam, for a scan at `pose`.
    pub(super) fn point(&self, pose: &Pose, range_m: f64) -> DVec2 {
        match &self.viewpoint {
            Some(viewpoint) => viewpoint.point_at(range_m),
            None => pose.point_at(self.azimuth_deg, range_m),
        }
    }

    /// Where the beam begins, and the world direction that it has, radians.
    pub(super) fn ray(&self, pose: &Pose) -> (DVec2, f64) {
        match &self.viewpoint {
            Some(viewpoint) => (viewpoint.position(), viewpoint.direction_rad()),
            None => (pose.position(), pose.direction_rad(self.azimuth_deg)),
        }
    }
}

impl Readings {
    /// Every beam with a direction, by azimuth; of a beam logged twice the reading that counts.
    pub(super) fn of(view: &ScanView) -> Self {
        let min_range_m = view.session.as_deref().and_then(min_range_m);
        let (_, judged) = compare(std::slice::from_ref(view));
        let has_one_place = view.has_one_place();
        let seen = |judged: &Judged<'_>| {
            let reading = reading(judged, min_range_m);
            if has_one_place { reading } else { mounted(view, judged.ping, reading) }
        };
        let finite = judged.iter().filter(|judged| judged.ping.azimuth_deg.is_finite());
        let mut beams: Vec<_> = finite.map(seen).collect();
        beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
        let has_model = view.pings.iter().any(|ping| ping.sim.is_some());
        let fan = view.session.as_deref().and_then(fan);
        Self { beams, min_range_m, has_model, fan }
    }

    /// The beams of several scans as one.
    pub(super) fn merged<'a>(scans: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = Self { beams: Vec::new(), min_range_m: None, has_model: false, fan: None };
        for scan in scans {
            all.beams.extend_from_slice(&scan.beams);
            all.min_range_m = all.min_range_m.or(scan.min_range_m);
            all.has_model |= scan.has_model;
            all.fan = all.fan.or(scan.fan);
        }
        all.beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
        all
    }

    pub(super) fn count(&self, kind: Kind) -> usize {
        self.beams.iter().filter(|beam| beam.kind == kind).count()
    }

    /// Residuals that exist, with their azimuths.
    pub(super) fn residuals(&self) -> impl Iterator<Item = (f64, f64)> {
        self.beams.iter().filter_map(|beam| beam.residual_m.map(|r| (beam.azimuth_deg, r)))
    }
}

/// Range at which the receiver opens; the model's setting goes before the sensor's.
fn min_range_m(session: &Session) -> Option<f64> {
    let settings = session.model.as_ref().map(|model| &model.settings);
    let blanking_us = settings
        .and_then(|settings| settings.get("blanking_us")?.as_f64())
        .unwrap_or(session.sensor.blanking_us);
    length(Some(session.air.sound_speed_m_s * blanking_us * 1e-6 / 2.0))
}

/// The beam's width and reach, for the session of an array.
fn fan(session: &Session) -> Option<Fan> {
    session.array.as_ref()?;
    let (sensor, air) = (&session.sensor, &session.air);
    sensor.check().ok()?;
    let speed_m_s = Some(air.sound_speed_m_s).filter(|speed| speed.is_finite() && *speed > 0.0)?;
    let settings = session.model.as_ref().map(|model| &model.settings);
    let modelled_m = settings.and_then(|settings| settings.get("max_range_m")?.as_f64());
    let max_range_m = length(modelled_m).unwrap_or(sensor.max_range_m);
    Some(Fan { half_rad: BeamPattern::new(sensor, speed_m_s).angle_at(0.5), max_range_m })
}

/// A reading of a scan with several places, with its viewpoint, and its azimuth as seen from the scan's pose.
fn mounted(view: &ScanView, ping: &Ping, reading: Reading) -> Reading {
    let viewpoint = view.viewpoint(ping).filter(|viewpoint| {
        viewpoint.position().is_finite() && viewpoint.direction_deg.is_finite()
    });
    let azimuth_deg = match (&viewpoint, view.pose()) {
        (Some(viewpoint), Some(pose)) if pose.heading_deg.is_finite() => {
            wrap_360(viewpoint.direction_deg - pose.heading_deg)
        }
        _ => reading.azimuth_deg,
    };
    Reading { azimuth_deg, viewpoint, ranger: ping.ranger.clone(), ..reading }
}

fn reading(judged: &Judged<'_>, min_range_m: Option<f64>) -> Reading {
    let ping = judged.ping;
    let or_min_range = |status: PingStatus, range_m: Option<f64>| match status {
        PingStatus::Echo => length(range_m),
        PingStatus::MinRange => length(range_m).or(min_range_m),
        _ => None,
    };
    let range_m = or_min_range(ping.status, ping.range_m);
    let model_range_m = ping.sim.as_ref().and_then(|sim| or_min_range(sim.status, sim.range_m));
    let kind = match range_m {
        Some(_) => heard_kind(judged),
        None => unheard_kind(judged),
    };
    Reading {
        azimuth_deg: ping.azimuth_deg,
        viewpoint: None,
        ranger: None,
        kind,
        range_m,
        model_range_m,
        residual_m: judged.residual_m.filter(|_| range_m.is_some() && model_range_m.is_some()),
        margin_db: ping.margin_db.filter(|margin| margin.is_finite()),
        hint: hint(ping, kind, range_m, model_range_m),
    }
}

fn heard_kind(judged: &Judged<'_>) -> Kind {
    match (judged.verdict, judged.ping.status) {
        (Ok(Verdict::Direct), _) => Kind::Direct,
        (Ok(Verdict::Multiple), _) => Kind::Multiple,
        (Ok(Verdict::Edge), _) => Kind::Edge,
        (Ok(Verdict::MinRange), _) | (Err(_), PingStatus::MinRange) => Kind::MinRange,
        (Ok(Verdict::Unexplained | Verdict::Silent), _) => Kind::Unexplained,
        // Nothing to compare with: what the model itself made has its path.
        (Err(_), _) => judged.ping.path.as_ref().map_or(Kind::Echo, path_kind),
    }
}

fn unheard_kind(judged: &Judged<'_>) -> Kind {
    match (judged.ping.status, judged.verdict) {
        (PingStatus::NoEcho, Ok(Verdict::Unexplained)) => Kind::SilentUnexplained,
        (PingStatus::NoEcho, _) => Kind::Silent,
        // A range that is missing, or no reading at all.
        _ => Kind::Lost,
    }
}

fn path_kind(path: &PathRecord) -> Kind {
    match (path.kind, path.order) {
        (PathKind::Diffracted, _) => Kind::Edge,
        (PathKind::Specular | PathKind::Scattered, 0 | 1) => Kind::Direct,
        (PathKind::Specular | PathKind::Scattered, _) => Kind::Multiple,
    }
}

fn length(range_m: Option<f64>) -> Option<f64> {
    range_m.filter(|range| range.is_finite() && *range >= 0.0)
}

fn hint(ping: &Ping, kind: Kind, range_m: Option<f64>, model_m: Option<f64>) -> String {
    let ranger = ping.ranger.as_ref().map(|id| format!("{id}, ")).unwrap_or_default();
    let mut words = format!("{ranger}{:.1}\u{b0} {}", ping.azimuth_deg, kind.words());
    if let Some(range) = range_m {
        words += &format!(" {range:.3} m");
    }
    if let Some(model) = model_m {
        words += &format!(", model {model:.3} m");
    }
    if let Some(path) = ping.sound_path().filter(|path| !path.interactions.is_empty()) {
        words += &format!(" by {}", path.in_words());
    }
    words
}
