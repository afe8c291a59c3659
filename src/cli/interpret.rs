//! `sonard interpret`.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use comfy_table::{CellAlignment, Table};

use super::{
    Failure, Outcome,
    answer::answer,
    compare::RULED,
    findings::{FindingsArgs, Seen},
    logs::first_of,
    numbers::{not_negative, positive, probability},
    picture::scene_for,
    sweeps::for_each_sweep,
};
use crate::{
    interpret::{Extents, Feature, FeatureKind, Noise, Settings, interpret},
    plot::draw_features,
    scan::ScanView,
};

/// Options of `sonard interpret`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs of scans by one ranger, from one place or more, or folders of such; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// JSON instead of text; one object a feature
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    files: FindingsArgs,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); only draws its walls, in
    /// place of those of the scene in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Strength of an edge's echo, sigma_E: for the boundary between edges and the rest
    #[arg(long, value_name = "S", default_value_t = Settings::default().sigma_e, value_parser = positive)]
    sigma_e: f64,
    /// How far a reading may be from its arc's mean, millimetres
    #[arg(long, value_name = "MM", default_value_t = 10.0, value_parser = positive)]
    depth_tolerance_mm: f64,
    /// Ratio of a head-on wall's echo to the noise, decibels [default: no noise]
    #[arg(long, value_name = "DB")]
    snr_db: Option<f64>,
    /// Standard deviation of each beam's azimuth beside the step, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = not_negative)]
    azimuth_sigma_deg: f64,
    /// Standard deviation of the heading from scan to scan, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = not_negative)]
    heading_sigma_deg: f64,
    /// Report nothing less probable than this
    #[arg(long, value_name = "P", default_value_t = Settings::default().min_confidence, value_parser = probability)]
    min_confidence: f64,
}

pub(super) const ABOUT: &str = "\
Classify planes, corners and edges in scans.

After O. Bozma and R. Kuc (IEEE PAMI 13, 1991): beams with the same range form an arc. An arc narrower than \
b(r), half way between what the sensor gives edges and what it gives planes and corners, is an edge. A plane is \
seen in the same direction from a second position, a corner is not. Beyond the paper, an arc may have another \
cause: reflections by several walls, multiple echoes between a wall and the ranger, a round body. That has a \
probability too, which grows with the number of nearer arcs in front of it. `sonard-papers benchmark interpret` \
measures how often the claims are true. Repeats from one pose count as one scan. With one scan, planes and \
corners stay `unresolved`, with the position for the next scan that decides most of them; give the log of that \
scan too, and they are decided.";

const HELP: &str = "\
Examples:
  sonard simulate --scene plane-corner-edge --pose fig13 --sensor bozma-kuc-60khz -o one.jsonl
  sonard interpret one.jsonl -o one.png
  sonard interpret one.jsonl two.jsonl --json
  sonard interpret one.jsonl two.jsonl -o features.geojson -o features.mcap

A feature's bearing is counter-clockwise from the heading of the scan it was first seen in. Why \
one is unresolved: second_position (plane or corner), translation (the places are too near to \
each other), lost (not seen again), ambiguous (several arcs fit, or none), interference \
(something nearer covers a part of the arc), cut_off (the scan ends in it), extent (fits neither), \
reflections (behind what may be walls: the sound may have come by way of them), min_range (closer than \
can be measured, or so near to that that a part may be).
Exit codes: 0 done, also if nothing was found, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let targets = args.files.targets()?;
    let (scans, features) = find(args)?;
    answer(args.json, &features, |out| print(out, &features))?;
    let mut seen = Seen::default();
    scans.iter().for_each(|scan| seen.add(scan));
    targets.write(&seen.place(None, &[], &features), || {
        let scene = scene_for(&first_of(&args.logs), &scans, args.scene.as_deref())?;
        Ok(draw_features(&scans, scene.as_ref(), &features))
    })
}

/// The scans that can be interpreted, and what is in them.
fn find(args: &Args) -> Result<(Vec<ScanView>, Vec<Feature>), Failure> {
    let (mut scans, mut sweeps) = (Vec::new(), Vec::new());
    let mut of_arrays = 0;
    for_each_sweep(&args.logs, |scan, sweep| {
        if scan.is_of_array() {
            of_arrays += 1;
            return;
        }
        sweeps.push((scan.scan, sweep));
        scans.push(scan);
    })?;
    if of_arrays > 0 {
        return Err(Failure::input(
            format!("{of_arrays} scan(s) are of an array: arcs need one ranger that turns"),
            "`sonard map` and `sonard lines` take an array's readings",
        ));
    }
    let Some(session) = scans.iter().find_map(|scan| scan.session.clone()) else {
        return Err(Failure::input(
            "there is no scan with its session to interpret",
            "give a log as `sonard scan` or `sonard simulate` writes it",
        ));
    };
    if scans.iter().flat_map(|scan| &scan.session).any(|other| other.sensor != session.sensor) {
        return Err(Failure::input(
            "the scans are of different sensors, whose arcs differ",
            "interpret the logs of each sensor by themselves",
        ));
    }
    let extents = Extents::of_session(&session).map_err(|error| {
        Failure::input(format!("session: {error}"), "correct the session's record in the log")
    })?;
    let features = interpret(&sweeps, &extents, &settings(args));
    Ok((scans, features))
}

fn settings(args: &Args) -> Settings {
    Settings {
        sigma_e: args.sigma_e,
        depth_tolerance_m: args.depth_tolerance_mm * 1e-3,
        noise: Noise {
            amplitude: args.snr_db.map_or(0.0, |db| 10_f64.powf(-db / 20.0)),
            azimuth_deg: args.azimuth_sigma_deg,
            heading_deg: args.heading_sigma_deg,
        },
        min_confidence: args.min_confidence,
        ..Settings::default()
    }
}

fn print(out: &mut impl Write, features: &[Feature]) -> io::Result<()> {
    if features.is_empty() {
        return writeln!(out, "no feature: every beam is silent");
    }
    let mut table = Table::new();
    table.load_style(RULED).set_header([
        "kind",
        "bearing",
        "range",
        "extent",
        "b(r)",
        "beta",
        "corner's",
        "confidence",
        "else",
        "why open",
    ]);
    for feature in features {
        table.add_row(row(feature));
    }
    for column in table.column_iter_mut().skip(1).take(8) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(out, "{table}")?;
    let mut said = Vec::new();
    for next in features.iter().filter_map(|feature| feature.next) {
        if !said.contains(&next.direction_deg) {
            said.push(next.direction_deg);
            writeln!(
                out,
                "next scan: {:.1} cm in direction {:.1} degrees, at ({:.4}, {:.4}) m, decides {} \
                 (planes at least {:.1} cm wide, corners' sides {:.1} cm)",
                100.0 * next.delta_m,
                next.direction_deg,
                next.x_m,
                next.y_m,
                next.decides,
                100.0 * next.least_plane_m,
                100.0 * next.least_corner_m
            )?;
        }
    }
    Ok(())
}

fn row(feature: &Feature) -> [String; 10] {
    // Adding zero makes -0 plain.
    let hundredths = |value: f64| (value * 100.0).round() / 100.0 + 0.0;
    let degrees =
        |value: Option<f64>| value.map_or("-".into(), |value| format!("{:.2}", hundredths(value)));
    let kind = match feature.kind {
        FeatureKind::Plane => "plane",
        FeatureKind::Corner => "corner",
        FeatureKind::Edge => "edge",
        FeatureKind::Unresolved => "unresolved",
    };
    let reason = serde_json::to_value(feature.reason).ok();
    let reason = reason.and_then(|reason| reason.as_str().map(str::to_owned));
    [
        kind.into(),
        format!("{:.2}", feature.bearing_deg),
        feature.range_m.map_or("-".into(), |m| format!("{m:.3} m")),
        format!("{:.2}", feature.extent_deg),
        degrees(feature.boundary_deg),
        degrees(feature.beta_deg),
        degrees(feature.beta_corner_deg),
        format!("{:.4}", feature.confidence),
        format!("{:.4}", feature.probabilities.other),
        reason.unwrap_or_default(),
    ]
}
