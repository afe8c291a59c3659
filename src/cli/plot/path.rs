//! Picture of the propagation path of one beam.

use std::fmt;

use crate::{
    cli::Failure,
    geometry::wrap_pi,
    plot::{PathView, Picture, badge_for, draw_path},
    scan::{PathRecord, Ping, PingStatus, ScanView},
    scene::Scene,
};

/// Selection of a beam.
#[derive(Debug, Clone, Copy)]
pub(super) enum Beam {
    /// Index in the plan.
    Index(u32),
    /// Beam nearest to an azimuth, degrees.
    Azimuth(f64),
}

impl fmt::Display for Beam {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "number {index}"),
            Self::Azimuth(azimuth_deg) => write!(f, "near {azimuth_deg}\u{b0}"),
        }
    }
}

/// Draws the path of a beam of the first scan, from its record or its prediction.
pub(super) fn draw(
    views: &[ScanView],
    scene: Option<&Scene>,
    beam: Beam,
) -> Result<Picture, Failure> {
    let scene = scene.ok_or_else(|| {
        Failure::input("a path needs a floor plan", "give the log's scene with --scene")
    })?;
    let Some(view) = views.first() else { return Err(no_beam(views, beam)) };
    let ping = find(view, beam).ok_or_else(|| no_beam(views, beam))?;
    let pose = view.pose().ok_or_else(|| {
        Failure::input("the scan lacks its scan_start record", "choose another scan with --scan")
    })?;
    let (azimuth_deg, index) = (ping.azimuth_deg, ping.index);
    let record = ping.sound_path().ok_or_else(|| {
        Failure::input(
            format!("beam {index}, azimuth {azimuth_deg}\u{b0}, has no path: no arrival near the threshold"),
            "choose a beam with an echo; `sonard log show --readings` lists them",
        )
    })?;
    let viewpoint = view.viewpoint(ping).zip(view.polyline(ping, record));
    let (viewpoint, points) = viewpoint.ok_or_else(|| {
        let ranger = ping.ranger.as_deref().unwrap_or_default();
        Failure::input(
            format!("beam {index} is of ranger {ranger:?}, which the log's array does not have"),
            "correct the session's record",
        )
    })?;
    Ok(draw_path(&PathView {
        title: format!("{}, beam {index} at azimuth {azimuth_deg}\u{b0}", scene.name),
        lines: vec![describe_reading(ping), describe_path(record)],
        badge: badge_for(ping.provenance.or(view.session.as_ref().map(|s| s.provenance))),
        scene,
        pose,
        transducer: viewpoint.pose(),
        azimuth_deg,
        range_m: ping.range_m,
        points,
    }))
}

fn find(view: &ScanView, beam: Beam) -> Option<&Ping> {
    match beam {
        Beam::Index(index) => view.pings.iter().find(|ping| ping.index == index),
        Beam::Azimuth(azimuth_deg) => {
            let off = |ping: &&Ping| wrap_pi((ping.azimuth_deg - azimuth_deg).to_radians()).abs();
            view.pings.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
        }
    }
}

/// Describes reading and prediction.
fn describe_reading(ping: &Ping) -> String {
    let describe = |status: PingStatus, range_m: Option<f64>| match (status, range_m) {
        (PingStatus::MinRange, Some(range_m)) => format!("minimum range, {range_m:.4} m"),
        (_, Some(range_m)) => format!("echo at {range_m:.4} m"),
        (PingStatus::NoEcho, _) => "no echo".to_owned(),
        _ => "no valid reading".to_owned(),
    };
    let margin_db = ping.margin_db.or_else(|| ping.sim.as_ref()?.margin_db);
    let margin = match margin_db {
        Some(db) if db < 0.0 => {
            format!(", the strongest arrival is {:.1} dB below the threshold", -db)
        }
        Some(db) => format!(", {db:.1} dB above the threshold"),
        None => String::new(),
    };
    let model =
        ping.sim.as_ref().map(|sim| format!("; model: {}", describe(sim.status, sim.range_m)));
    format!("{}{}{margin}", describe(ping.status, ping.range_m), model.unwrap_or_default())
}

fn describe_path(record: &PathRecord) -> String {
    format!("path of {:.4} m: {}", record.length_m, record.describe())
}

fn no_beam(views: &[ScanView], beam: Beam) -> Failure {
    let last = views.first().and_then(|view| view.pings.iter().map(|ping| ping.index).max());
    let help = match last {
        Some(last) => format!("the scan's beams run from 0 to {last}"),
        None => "the scan has no readings; choose another scan with --scan".to_owned(),
    };
    Failure::input(format!("the scan has no beam {beam}"), help)
}
