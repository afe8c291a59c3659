//! `sonard interpret`.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use super::{
    Failure, Outcome,
    answer::print_result,
    findings::{FindingsArgs, ScanOrigin},
    logs::first_log,
    numbers::{not_negative, positive, probability},
    picture::scene_for,
    sweeps::for_each_sweep,
    table::{align_right, fit, ruled},
};
use crate::{
    interpret::{Extents, Feature, FeatureKind, InterpretSettings, Noise, interpret},
    plot::draw_features,
    scan::{ScanView, text::format_count},
};

/// Options of `sonard interpret`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs of scans by one ranger, from one or more positions, or folders of logs; - for standard
    /// input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// JSON instead of text; one object per feature
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    files: FindingsArgs,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); only its walls are drawn,
    /// instead of those of the scene in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Strength of an edge's echo, sigma_E; determines the boundary between edges and other
    /// features
    #[arg(long, value_name = "S", default_value_t = InterpretSettings::default().sigma_e, value_parser = positive)]
    sigma_e: f64,
    /// Maximum deviation of a reading from the mean of its arc, millimetres
    #[arg(long, value_name = "MM", default_value_t = 10.0, value_parser = positive)]
    depth_tolerance_mm: f64,
    /// Signal-to-noise ratio of a head-on wall's echo, decibels [default: no noise]
    #[arg(long, value_name = "DB")]
    snr_db: Option<f64>,
    /// Standard deviation of each beam's azimuth, in addition to the step, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = not_negative)]
    azimuth_sigma_deg: f64,
    /// Standard deviation of the heading from scan to scan, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = not_negative)]
    heading_sigma_deg: f64,
    /// Minimum probability of a reported feature
    #[arg(long, value_name = "P", default_value_t = InterpretSettings::default().min_confidence, value_parser = probability)]
    min_confidence: f64,
}

pub(super) const ABOUT: &str = "\
Classify planes, corners and edges in scans.

After O. Bozma and R. Kuc (IEEE PAMI 13, 1991): beams with the same range form an arc. An arc \
narrower than b(r), the mean of the widths that the sensor gives to edges and to planes and \
corners, is an edge. A plane is seen in the same direction from a second position, a corner is \
not. In addition to the paper, an arc may have another cause: reflections by several walls, \
multiple echoes between a wall and the ranger, a round body. Its probability increases with the \
number of nearer arcs in front of it. `sonard-papers benchmark interpret` measures the calibration \
of the probabilities. Repeats from one pose count as one scan. With one scan, planes and corners \
remain `unresolved`, with the position of the next scan that decides most of them; give the log of \
that scan too, and they are decided.";

const HELP: &str = "\
Examples:
  sonard simulate --scene plane-corner-edge --pose fig13 --sensor bozma-kuc-60khz -o one.jsonl
  sonard interpret one.jsonl -o one.png
  sonard interpret one.jsonl two.jsonl --json
  sonard interpret one.jsonl two.jsonl -o features.geojson -o features.mcap

A feature's bearing is counter-clockwise from the heading of the first scan that contains it. \
Reasons for unresolved: second_position (plane or corner), translation (the positions are too \
close), lost (not seen again), ambiguous (several arcs fit, or none), interference (a nearer \
object covers a part of the arc), cut_off (at the end of the scan), extent (fits neither), \
reflections (behind likely walls: possibly a multiple reflection), min_range (below the minimum \
range, or partly so).

Exit codes: 0 done, also without features, 2 wrong usage or input, 3 write \
error.";

pub(super) fn run(args: &Args) -> Outcome {
    let targets = args.files.targets()?;
    let (scans, features) = classify(args)?;
    print_result(args.json, &features, |out| print(out, &features))?;
    let mut origin = ScanOrigin::default();
    scans.iter().for_each(|scan| origin.add(scan));
    targets.write(&origin.place(None, &[], &features), || {
        let scene = scene_for(&first_log(&args.logs), &scans, args.scene.as_deref())?;
        Ok(draw_features(&scans, scene.as_ref(), &features))
    })
}

/// Reads the scans that can be interpreted, and classifies their features.
fn classify(args: &Args) -> Result<(Vec<ScanView>, Vec<Feature>), Failure> {
    let (mut scans, mut sweeps) = (Vec::new(), Vec::new());
    let mut of_arrays = 0_u64;
    for_each_sweep(&args.logs, |scan, sweep| {
        if scan.is_array_scan() {
            of_arrays += 1;
            return;
        }
        sweeps.push((scan.scan, sweep));
        scans.push(scan);
    })?;
    if of_arrays > 0 {
        return Err(Failure::input(
            format!(
                "{} of an array given: arcs need a single rotating ranger",
                format_count(of_arrays, "scan")
            ),
            "`sonard map` and `sonard lines` accept an array's readings",
        ));
    }
    let Some(session) = scans.iter().find_map(|scan| scan.session.clone()) else {
        return Err(Failure::input(
            "no scan with a session to interpret",
            "give a log written by `sonard scan` or `sonard simulate`",
        ));
    };
    if scans.iter().flat_map(|scan| &scan.session).any(|other| other.sensor != session.sensor) {
        return Err(Failure::input(
            "the scans are from different sensors, whose arcs differ",
            "interpret the logs of each sensor separately",
        ));
    }
    let extents = Extents::from_session(&session).map_err(|error| {
        Failure::input(format!("session: {error}"), "correct the session's record in the log")
    })?;
    let features = interpret(&sweeps, &extents, &settings(args));
    Ok((scans, features))
}

fn settings(args: &Args) -> InterpretSettings {
    InterpretSettings {
        sigma_e: args.sigma_e,
        depth_tolerance_m: args.depth_tolerance_mm * 1e-3,
        noise: Noise {
            amplitude: args.snr_db.map_or(0.0, |db| 10_f64.powf(-db / 20.0)),
            azimuth_deg: args.azimuth_sigma_deg,
            heading_deg: args.heading_sigma_deg,
        },
        min_confidence: args.min_confidence,
        ..InterpretSettings::default()
    }
}

fn print(out: &mut impl Write, features: &[Feature]) -> io::Result<()> {
    if features.is_empty() {
        return writeln!(out, "no features: no beam has an echo");
    }
    let mut table = ruled([
        "kind",
        "bearing",
        "range",
        "extent",
        "b(r)",
        "beta",
        "corner's",
        "confidence",
        "other",
        "reason",
    ]);
    for feature in features {
        table.add_row(row(feature));
    }
    align_right(&mut table, 1..9);
    writeln!(out, "{}", fit(table))?;
    let mut printed = Vec::new();
    for next in features.iter().filter_map(|feature| feature.next) {
        if !printed.contains(&next.direction_deg) {
            printed.push(next.direction_deg);
            writeln!(
                out,
                "next scan: {:.1} cm in direction {:.1} degrees, at ({:.4}, {:.4}) m, decides {} \
                 (planes at least {:.1} cm wide, corners' sides {:.1} cm)",
                100.0 * next.delta_m,
                next.direction_deg,
                next.x_m,
                next.y_m,
                next.decides,
                100.0 * next.min_plane_m,
                100.0 * next.min_corner_m
            )?;
        }
    }
    Ok(())
}

fn row(feature: &Feature) -> [String; 10] {
    // Adding zero converts -0 to 0.
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
