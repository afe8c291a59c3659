//! Readings prepared for drawing, from any kind of log. Readings with a prediction are
//! classified by [`sonard_interpret::compare`], so that pictures and tables agree.

use super::{canvas::MarkShape, fans::FanStyle, theme};
use sonard_interpret::compare::{ClassifiedPing, Verdict, compare};
use sonard_model::{
    acoustics::BeamPattern,
    geometry::{DVec2, Pose, wrap_360},
    viewpoint::Viewpoint,
};
use sonard_records::{PathKind, PathRecord, Ping, PingStatus, ScanView, Session};

/// Kind of a reading by its outcome and classification.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum ReadingKind {
    /// Echo without a prediction.
    Echo,
    /// Echo with at most one reflection.
    Direct,
    /// Echo with two or more reflections.
    Multiple,
    /// Echo diffracted at an edge.
    Edge,
    /// Target below the minimum range.
    MinRange,
    /// Echo that disagrees with the model.
    Unexplained,
    /// No echo.
    NoEcho,
    /// No echo although the model predicts one.
    MissedEcho,
    /// Missing or invalid reading.
    Invalid,
}

impl ReadingKind {
    /// Kinds with a position on the floor plan.
    pub(super) const WITH_RANGE: [Self; 6] =
        [Self::Echo, Self::Direct, Self::Multiple, Self::Edge, Self::MinRange, Self::Unexplained];
    /// Kinds with a direction only.
    pub(super) const WITHOUT_RANGE: [Self; 3] = [Self::NoEcho, Self::MissedEcho, Self::Invalid];

    pub(super) const fn colour(self) -> &'static str {
        match self {
            Self::Echo | Self::Direct => theme::BLUE,
            Self::Multiple => theme::VERMILLION,
            Self::Edge => theme::GREEN,
            Self::MinRange => theme::PURPLE,
            Self::Unexplained | Self::MissedEcho => theme::INK,
            Self::NoEcho => theme::NO_ECHO,
            Self::Invalid => theme::ORANGE,
        }
    }

    pub(super) const fn shape(self) -> MarkShape {
        match self {
            Self::Multiple => MarkShape::Square,
            Self::Edge => MarkShape::Triangle,
            Self::MinRange => MarkShape::Diamond,
            Self::Unexplained => MarkShape::Cross,
            _ => MarkShape::Dot,
        }
    }

    pub(super) const fn label(self) -> &'static str {
        match self {
            Self::Echo => "echo",
            Self::Direct => "direct echo",
            Self::Multiple => "multiple reflection",
            Self::Edge => "edge",
            Self::MinRange => "minimum range",
            Self::Unexplained => "disagrees with model",
            Self::NoEcho => "no echo",
            Self::MissedEcho => "missed echo",
            Self::Invalid => "invalid reading",
        }
    }
}

/// Beam prepared for drawing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlottedBeam {
    /// Azimuth from the scan's heading, degrees.
    pub(super) azimuth_deg: f64,
    /// Position and direction of the transducer, unless all beams start at the scan's pose.
    pub(super) viewpoint: Option<Viewpoint>,
    /// Name of the ranger.
    pub(super) ranger: Option<String>,
    pub(super) kind: ReadingKind,
    /// Range, metres: finite, not negative, and present exactly for kinds with a range.
    pub(super) range_m: Option<f64>,
    /// Predicted range of a measured reading, metres.
    pub(super) model_range_m: Option<f64>,
    pub(super) residual_m: Option<f64>,
    /// Level above the threshold, decibels, of a simulated reading.
    pub(super) margin_db: Option<f64>,
    /// Tooltip.
    pub(super) hint: String,
}

/// Beams of a scan with their common properties.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlottedScan {
    pub(super) beams: Vec<PlottedBeam>,
    /// Range at the end of blanking, metres.
    pub(super) min_range_m: Option<f64>,
    /// Whether the readings have predictions.
    pub(super) has_model: bool,
    /// Drawing style for an array.
    pub(super) fan: Option<FanStyle>,
}

impl PlottedBeam {
    /// World position at a range along the beam, for a scan at `pose`.
    pub(super) fn point(&self, pose: &Pose, range_m: f64) -> DVec2 {
        match &self.viewpoint {
            Some(viewpoint) => viewpoint.point_at(range_m),
            None => pose.point_at(self.azimuth_deg, range_m),
        }
    }

    /// Origin of the beam, metres, and its world direction, radians.
    pub(super) fn ray(&self, pose: &Pose) -> (DVec2, f64) {
        match &self.viewpoint {
            Some(viewpoint) => (viewpoint.position(), viewpoint.direction_rad()),
            None => (pose.position(), pose.direction_rad(self.azimuth_deg)),
        }
    }
}

impl PlottedScan {
    /// Beams with a valid direction, by azimuth; of a beam logged twice the decisive reading.
    pub(super) fn from_scan(view: &ScanView) -> Self {
        let min_range_m = view.session.as_deref().and_then(min_range_m);
        let (_, classified) = compare(std::slice::from_ref(view));
        let has_one_place = view.is_from_one_position();
        let plotted = |classified: &ClassifiedPing<'_>| {
            let reading = reading(classified, min_range_m);
            if has_one_place { reading } else { mounted(view, classified.ping, reading) }
        };
        let finite = classified.iter().filter(|beam| beam.ping.azimuth_deg.is_finite());
        let mut beams: Vec<_> = finite.map(plotted).collect();
        beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
        let has_model = view.pings.iter().any(|ping| ping.sim.is_some());
        let fan = view.session.as_deref().and_then(fan);
        Self { beams, min_range_m, has_model, fan }
    }

    /// Merges the beams of several scans.
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

    pub(super) fn count(&self, kind: ReadingKind) -> usize {
        self.beams.iter().filter(|beam| beam.kind == kind).count()
    }

    /// Azimuths and residuals of the beams that have both ranges.
    pub(super) fn residuals(&self) -> impl Iterator<Item = (f64, f64)> {
        self.beams.iter().filter_map(|beam| beam.residual_m.map(|r| (beam.azimuth_deg, r)))
    }
}

/// Range at the end of blanking; the model's setting overrides the sensor's.
fn min_range_m(session: &Session) -> Option<f64> {
    let settings = session.model.as_ref().map(|model| &model.settings);
    let blanking_us = settings
        .and_then(|settings| settings.get("blanking_us")?.as_f64())
        .unwrap_or(session.sensor.blanking_us);
    length(Some(session.air.sound_speed_m_s * blanking_us * 1e-6 / 2.0))
}

/// Drawing style for the session of an array: beam width and maximum range.
fn fan(session: &Session) -> Option<FanStyle> {
    session.array.as_ref()?;
    let (sensor, air) = (&session.sensor, &session.air);
    sensor.check().ok()?;
    let speed_m_s = Some(air.sound_speed_m_s).filter(|speed| speed.is_finite() && *speed > 0.0)?;
    let settings = session.model.as_ref().map(|model| &model.settings);
    let modelled_m = settings.and_then(|settings| settings.get("max_range_m")?.as_f64());
    let max_range_m = length(modelled_m).unwrap_or(sensor.max_range_m);
    Some(FanStyle { half_rad: BeamPattern::new(sensor, speed_m_s).angle_at(0.5), max_range_m })
}

/// Adds the viewpoint of a reading, and its azimuth relative to the scan's pose.
fn mounted(view: &ScanView, ping: &Ping, reading: PlottedBeam) -> PlottedBeam {
    let viewpoint = view.viewpoint(ping).filter(|viewpoint| {
        viewpoint.position().is_finite() && viewpoint.direction_deg.is_finite()
    });
    let azimuth_deg = match (&viewpoint, view.pose()) {
        (Some(viewpoint), Some(pose)) if pose.heading_deg.is_finite() => {
            wrap_360(viewpoint.direction_deg - pose.heading_deg)
        }
        _ => reading.azimuth_deg,
    };
    PlottedBeam { azimuth_deg, viewpoint, ranger: ping.ranger.clone(), ..reading }
}

fn reading(classified: &ClassifiedPing<'_>, min_range_m: Option<f64>) -> PlottedBeam {
    let ping = classified.ping;
    let or_min_range = |status: PingStatus, range_m: Option<f64>| match status {
        PingStatus::Echo => length(range_m),
        PingStatus::MinRange => length(range_m).or(min_range_m),
        _ => None,
    };
    let range_m = or_min_range(ping.status, ping.range_m);
    let model_range_m = ping.sim.as_ref().and_then(|sim| or_min_range(sim.status, sim.range_m));
    let kind = match range_m {
        Some(_) => kind_with_range(classified),
        None => kind_without_range(classified),
    };
    PlottedBeam {
        azimuth_deg: ping.azimuth_deg,
        viewpoint: None,
        ranger: None,
        kind,
        range_m,
        model_range_m,
        residual_m: classified.residual_m.filter(|_| range_m.is_some() && model_range_m.is_some()),
        margin_db: ping.margin_db.filter(|margin| margin.is_finite()),
        hint: hint(ping, kind, range_m, model_range_m),
    }
}

fn kind_with_range(classified: &ClassifiedPing<'_>) -> ReadingKind {
    match (classified.verdict, classified.ping.status) {
        (Ok(Verdict::Direct), _) => ReadingKind::Direct,
        (Ok(Verdict::Multiple), _) => ReadingKind::Multiple,
        (Ok(Verdict::Edge), _) => ReadingKind::Edge,
        (Ok(Verdict::MinRange), _) | (Err(_), PingStatus::MinRange) => ReadingKind::MinRange,
        (Ok(Verdict::Unexplained | Verdict::NoEcho), _) => ReadingKind::Unexplained,
        // Without a comparison, a simulated reading still has its path.
        (Err(_), _) => classified.ping.path.as_ref().map_or(ReadingKind::Echo, path_kind),
    }
}

fn kind_without_range(classified: &ClassifiedPing<'_>) -> ReadingKind {
    match (classified.ping.status, classified.verdict) {
        (PingStatus::NoEcho, Ok(Verdict::Unexplained)) => ReadingKind::MissedEcho,
        (PingStatus::NoEcho, _) => ReadingKind::NoEcho,
        // Missing range, or no reading at all.
        _ => ReadingKind::Invalid,
    }
}

fn path_kind(path: &PathRecord) -> ReadingKind {
    match (path.kind, path.order) {
        (PathKind::Diffracted, _) => ReadingKind::Edge,
        (PathKind::Specular | PathKind::Scattered, 0 | 1) => ReadingKind::Direct,
        (PathKind::Specular | PathKind::Scattered, _) => ReadingKind::Multiple,
    }
}

fn length(range_m: Option<f64>) -> Option<f64> {
    range_m.filter(|range| range.is_finite() && *range >= 0.0)
}

fn hint(ping: &Ping, kind: ReadingKind, range_m: Option<f64>, model_m: Option<f64>) -> String {
    let ranger = ping.ranger.as_ref().map(|id| format!("{id}, ")).unwrap_or_default();
    let mut text = format!("{ranger}{:.1}\u{b0} {}", ping.azimuth_deg, kind.label());
    if let Some(range) = range_m {
        text += &format!(" {range:.3} m");
    }
    if let Some(model) = model_m {
        text += &format!(", predicted {model:.3} m");
    }
    if let Some(path) = ping.sound_path().filter(|path| !path.interactions.is_empty()) {
        text += &format!(" via {}", path.describe());
    }
    text
}
