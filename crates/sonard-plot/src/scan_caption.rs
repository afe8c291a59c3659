//! Caption of a picture of scans: scene, pose, sensor, air, engine, provenance, counts.

use sonard_interpret::compare::compare;
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_records::{
    EventKind, Provenance, ScanView, Session,
    text::{format_count, format_length},
};

/// Title with the scene and the pose in it.
pub(super) fn title(views: &[ScanView], scene: Option<&Scene>) -> String {
    let name = scene_name(views, scene);
    let poses: Vec<Pose> = distinct_poses(views);
    match poses.as_slice() {
        [] => format!("{name}, pose unknown"),
        [pose] => match pose_name(pose, scene) {
            Some(pose_name) => format!("{name}, pose {pose_name}"),
            None => format!("{name} at ({:.3}, {:.3}) m", pose.x_m, pose.y_m),
        },
        many => {
            let names: Vec<_> = many.iter().filter_map(|pose| pose_name(pose, scene)).collect();
            match names.len() == many.len() && names.len() <= MAX_NAMED_POSES {
                true => format!("{name}, poses {}", names.join(", ")),
                false => format!("{name}, {} poses", many.len()),
            }
        }
    }
}

/// Maximum number of poses whose names are listed in a title.
const MAX_NAMED_POSES: usize = 4;

/// Name of the scene that is drawn, or else of those in the log.
fn scene_name(views: &[ScanView], scene: Option<&Scene>) -> String {
    if let Some(scene) = scene {
        return scene.name.clone();
    }
    let logged = views.iter().filter_map(|view| view.session.as_ref()?.scene.as_ref());
    let names = logged.map(|scene| scene.name.clone());
    distinct(names, "scene").unwrap_or_else(|| "scan without a scene".to_owned())
}

/// Provenance of the readings as a short label; `None` if all are from hardware.
pub(super) fn badge(views: &[ScanView]) -> Option<&'static str> {
    badge_among(views.iter().filter_map(|view| Some(view.session.as_ref()?.provenance)))
}

/// Badge for readings of several sources: any source other than hardware takes precedence.
#[must_use]
pub fn badge_among(sources: impl IntoIterator<Item = Provenance>) -> Option<&'static str> {
    let mut hardware = None;
    for provenance in sources {
        if provenance != Provenance::Hardware {
            return badge_for(Some(provenance));
        }
        hardware = Some(provenance);
    }
    badge_for(hardware)
}

/// Badge in the corner of every picture of readings: their provenance, `None` for hardware.
#[must_use]
pub fn badge_for(provenance: Option<Provenance>) -> Option<&'static str> {
    match provenance {
        Some(Provenance::Hardware) => None,
        Some(Provenance::Emulator) => Some("EMULATOR, not hardware"),
        Some(Provenance::Mock) => Some("MOCK, not hardware"),
        Some(Provenance::Simulated) => Some("SIMULATED, nothing measured"),
        Some(Provenance::Imported) => Some("IMPORTED data"),
        Some(Provenance::Replay) => Some("REPLAY of an earlier log"),
        None => Some("PROVENANCE UNKNOWN"),
    }
}

/// Lines below the title.
pub(super) fn lines(views: &[ScanView]) -> Vec<String> {
    let mut lines = Vec::new();
    // The title counts several poses.
    let mut parts: Vec<String> = match distinct_poses(views).as_slice() {
        [only] => vec![pose(only)],
        _ => Vec::new(),
    };
    let sessions = || views.iter().filter_map(|view| view.session.as_deref());
    parts.extend(distinct(sessions().map(sensor), "sensor"));
    parts.extend(distinct(sessions().map(air), "air condition"));
    parts.extend(distinct(sessions().filter_map(engine), "model"));
    if !parts.is_empty() {
        lines.push(parts.join(" \u{b7} "));
    }
    lines.push(counts(views));
    lines.extend(agreement(views));
    let events: Vec<String> = views
        .iter()
        .flat_map(|view| &view.events)
        .take(3)
        .map(|event| format!("{} {}", kind(event.kind), event.detail))
        .collect();
    if !events.is_empty() {
        lines.push(format!("Events: {}", events.join("; ")));
    }
    lines
}

/// Description that all scans share, or the number of different ones.
fn distinct(descriptions: impl Iterator<Item = String>, noun: &str) -> Option<String> {
    let mut different: Vec<String> = Vec::new();
    for description in descriptions {
        if !different.contains(&description) {
            different.push(description);
        }
    }
    match different.len() {
        0 | 1 => different.pop(),
        many => Some(format_count(many, noun)),
    }
}

/// Pose of the ranger, if logged with finite numbers.
pub(super) fn pose_of(view: &ScanView) -> Option<Pose> {
    view.pose().filter(|pose| pose.position().is_finite() && pose.heading_deg.is_finite())
}

/// Distinct poses of the scans.
fn distinct_poses(views: &[ScanView]) -> Vec<Pose> {
    let mut poses: Vec<Pose> = Vec::new();
    for pose in views.iter().filter_map(pose_of) {
        if !poses.contains(&pose) {
            poses.push(pose);
        }
    }
    poses
}

const fn kind(kind: EventKind) -> &'static str {
    match kind {
        EventKind::LinkLost => "link lost",
        EventKind::Reconnected => "reconnected",
        EventKind::Reboot => "reboot",
        EventKind::Fault => "fault",
        EventKind::Gap => "gap",
        EventKind::Stopped => "stopped",
        EventKind::ClockStep => "clock step",
        EventKind::NoPrediction => "no prediction",
        EventKind::Explanation => "explanation",
    }
}

fn pose_name<'a>(pose: &Pose, scene: Option<&'a Scene>) -> Option<&'a str> {
    let poses = &scene?.poses;
    poses.iter().find(|(_, known)| *known == pose).map(|(name, _)| name.as_str())
}

fn pose(pose: &Pose) -> String {
    let heading_deg = (100.0 * pose.heading_deg).round() / 100.0;
    format!("({:.3}, {:.3}) m, heading {heading_deg}\u{b0}", pose.x_m, pose.y_m)
}

fn sensor(session: &Session) -> String {
    let sensor = &session.sensor.name;
    match &session.array {
        Some(array) => format!("{}: {} rangers {sensor}", array.name, array.rangers.len()),
        None => sensor.clone(),
    }
}

fn air(session: &Session) -> String {
    let air = &session.air;
    format!(
        "{} \u{b0}C, {} % humidity, {:.2} m/s",
        air.temperature_c, air.humidity_percent, air.sound_speed_m_s
    )
}

fn engine(session: &Session) -> Option<String> {
    session.model.as_ref().map(|model| format!("model: {}", model.engine))
}

fn counts(views: &[ScanView]) -> String {
    let beams: usize = views.iter().map(|view| view.pings.len()).sum();
    let mut parts = Vec::new();
    if views.len() > 1 {
        parts.push(format!("{} overlaid", format_count(views.len(), "scan")));
    }
    parts.push(format_count(beams, "beam"));
    let ends: Vec<_> = views.iter().filter_map(|view| view.end.as_ref()).collect();
    if ends.len() == views.len() && !ends.is_empty() {
        let missing: u64 = ends.iter().map(|end| u64::from(end.missing)).sum();
        let repaired: u64 = ends.iter().map(|end| u64::from(end.repaired)).sum();
        let duration_s: f64 = ends.iter().map(|end| end.duration_s).sum();
        parts.push(format!("{missing} missing, {repaired} repaired"));
        if duration_s > 0.0 {
            parts.push(format!("{duration_s:.1} s"));
        }
    } else {
        parts.push("scan incomplete".into());
    }
    if let Some(start) = views.first().and_then(|view| view.start.as_ref()) {
        parts.push(format!("{:.0}", start.time));
    }
    parts.join(" \u{b7} ")
}

/// Agreement of measured and predicted ranges, where both exist.
fn agreement(views: &[ScanView]) -> Option<String> {
    let (found, _) = compare(views);
    let percent = 100.0 * found.agree_fraction?;
    Some(format!(
        "of {} present in both, {} agree ({percent:.1} %) \u{b7} |residual|: median {}, \
         90 % within {}",
        format_count(found.both_echo, "echo"),
        found.agree,
        format_length(found.median_abs_residual_m?),
        format_length(found.p90_abs_residual_m?)
    ))
}
