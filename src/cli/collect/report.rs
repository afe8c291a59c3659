//! Report of a collection: a Markdown page with pictures.

use std::fmt::Write as _;

use jiff::Timestamp;

use crate::{
    collect::{
        BeamSpread, CheckKeys, CollectError, CollectionFolder, CollectionHistory, CollectionKeys,
        Conditions, INPUTS, NamedPose, Repeatability, ScanAttempt, ScanFigures, ScanOutcome,
        repeatability,
    },
    compare::{Comparison, compare},
    plot::{Picture, Series, SeriesPoint, badge_among, draw_scans, draw_scene, draw_series},
    scan::{
        ScanView,
        text::{format_count, format_length},
    },
    scene::Scene,
    store::load,
};

/// Maximum number of overlaid scans per picture; more would hide each other.
const MAX_DRAWN: usize = 12;
/// Maximum number of poses whose spreads are drawn.
const MAX_STRIPS: usize = 6;
const PICTURES: &str = "report";
const TABLE: &str = "\
## Poses

Residuals are measured minus predicted range over the pairs of echoes; spread is the standard deviation
of a beam's range over the repeats.

| pose | position | scans | agree | median residual | 90 % within | spread | 90 % within | unsteady beams |
|---|---|---|---|---|---|---|---|---|
";

/// Writes report and pictures into the folder.
pub(super) fn write(
    folder: &CollectionFolder,
    history: &CollectionHistory,
) -> Result<(), CollectError> {
    let Some(plan) = history.plans.last() else {
        return Err(CollectError::invalid(
            "there is no plan in the journal",
            "nothing was collected yet",
        ));
    };
    let keys: CollectionKeys = serde_json::from_value(plan.keys.clone()).unwrap_or_default();
    let scene = scene(folder)?;
    let mut text = format_head(history, &keys);
    if let Some(scene) = &scene {
        draw(folder, "overview", &overview(scene, history))?;
        text += "![The poses in the scene](report/overview.svg)\n\n";
    }
    let (poses, details) = poses(folder, history, scene.as_ref())?;
    text += &poses;
    text += &format_exceptions(history);
    draw(folder, "drift", &drift(history, &keys.checks))?;
    text += "\n## Drift\n\n![Scans over time](report/drift.svg)\n\n";
    text += &format!("## Scans\n\n{details}");
    Ok(folder.write("report.md", text.as_bytes())?)
}

/// Formats the table of poses, and draws the scans at each.
fn poses(
    folder: &CollectionFolder,
    history: &CollectionHistory,
    scene: Option<&Scene>,
) -> Result<(String, String), CollectError> {
    let (mut table, mut details) = (TABLE.to_owned(), String::new());
    let mut repeated = Vec::new();
    for (&number, pose) in &history.poses {
        let views = views(folder, history, number)?;
        let (repeat, beams) = repeatability(&views);
        table += &Row { number, pose, compared: compare(&views).0, repeat }.line();
        let label = pose.label();
        if !views.is_empty() {
            let name = format!("pose-{number:03}");
            let drawn = &views[..views.len().min(MAX_DRAWN)];
            draw(folder, &name, &draw_scans(drawn, scene))?;
            let _ = write!(details, "### {number}: {label}\n\n{}", conditions(&pose.conditions));
            let _ = write!(details, "![Scans at {label}](report/{name}.svg)\n\n");
        }
        if repeat.scans > 1 {
            repeated.push((format!("{number} {label}"), repeat, beams));
        }
    }
    if !repeated.is_empty() {
        draw(folder, "repeatability", &spreads(repeated, badge(history)))?;
        table += "\n![Spread of each beam over the repeats](report/repeatability.svg)\n";
    }
    Ok((table, details))
}

/// Formats the header: counts, dates, devices, scene and sensor.
fn format_head(history: &CollectionHistory, keys: &CollectionKeys) -> String {
    let requested = history.requested();
    let accepted: Vec<&ScanAttempt> = history.accepted().collect();
    let given_up = requested.iter().filter(|slot| history.is_given_up(**slot)).count();
    let beams: u64 = accepted.iter().map(|take| u64::from(take.figures.beams)).sum();
    let missing: u64 = accepted.iter().map(|take| u64::from(take.figures.missing)).sum();
    let mut text = format!("# {}\n\n", keys.collection.name);
    let _ = writeln!(
        text,
        "{} of {}, {} rejected, {given_up} failed; {}, {missing} without a usable reading.",
        accepted.len(),
        format_count(requested.len(), "scan"),
        history.set_aside().count(),
        format_count(beams, "beam"),
    );
    let times = || accepted.iter().filter_map(|take| take.started);
    if let (Some(first), Some(last)) = (times().min(), times().max()) {
        let _ = writeln!(
            text,
            "First scan {first:.0}, last {last:.0}; started {}.",
            format_count(history.starts.len(), "time")
        );
    }
    // The sum of an empty iterator is -0; scans recovered from an earlier run have no duration.
    let seconds = accepted.iter().filter_map(|take| take.wall_s).fold(0.0, |sum, one| sum + one);
    let _ = writeln!(text, "Scanning time {seconds:.0} s.\n");
    for start in &history.starts {
        let device = &start.device;
        let provenance = serde_json::to_value(start.provenance).unwrap_or_default();
        let _ = writeln!(
            text,
            "- {:.0}: {} {} (firmware {}){}",
            start.time,
            provenance.as_str().unwrap_or("ranger"),
            device.serial,
            device.firmware,
            listed(&start.conditions)
        );
    }
    let plan = history.plans.last();
    let scene = plan.map_or("", |plan| plan.scene.name.as_str());
    let sensor = &keys.sensor.sensor;
    let _ = write!(text, "\nScene {scene}, sensor {sensor}. {}\n", conditions(&keys.conditions));
    if history.plans.len() > 1 {
        let _ = writeln!(
            text,
            "The plan was changed {}; journal.jsonl contains each version.\n",
            format_count(history.plans.len() - 1, "time")
        );
    }
    text
}

/// Row of the table of poses.
struct Row<'a> {
    number: u32,
    pose: &'a NamedPose,
    compared: Comparison,
    repeat: Repeatability,
}

impl Row<'_> {
    fn line(&self) -> String {
        let length = |length_m: Option<f64>| length_m.map_or_else(|| "-".into(), format_length);
        let Self { number, pose, compared, repeat } = self;
        let share = compared.agree_fraction;
        format!(
            "| {number} {} | {:.3}, {:.3}, {:.1}\u{b0} | {} | {} | {} | {} | {} | {} | {} |\n",
            pose.label(),
            pose.pose.x_m,
            pose.pose.y_m,
            pose.pose.heading_deg,
            repeat.scans,
            share.map_or_else(|| "-".into(), |share| format!("{:.1} %", 100.0 * share)),
            length(compared.median_residual_m),
            length(compared.p90_abs_residual_m),
            length(repeat.median_spread_m),
            length(repeat.p90_spread_m),
            repeat.unsteady,
        )
    }
}

/// Lists rejected scans, failed poses, and accepted scans with findings, with reasons.
fn format_exceptions(history: &CollectionHistory) -> String {
    let mut text = String::new();
    let mut aside = String::new();
    for take in history.set_aside() {
        let what = if take.outcome == ScanOutcome::Incomplete { "interrupted" } else { "rejected" };
        let reasons = take.incomplete_reason.clone().unwrap_or_else(|| reasons(take));
        let _ = writeln!(aside, "| {} | {what} | {reasons} |", take.file);
    }
    if !aside.is_empty() {
        let _ = write!(
            text,
            "\n## Rejected and retaken\n\n| file | | reason |\n|---|---|---|\n{aside}"
        );
    }
    let given_up: Vec<_> = history.given_up.iter().filter(|s| history.is_given_up(**s)).collect();
    if !given_up.is_empty() {
        text += "\n## Failed\n\n";
        for slot in given_up {
            let _ = writeln!(text, "- pose {}, repeat {}", slot.pose, slot.repeat);
        }
    }
    let noted: Vec<_> = history.accepted().filter(|take| !take.findings.is_empty()).collect();
    if !noted.is_empty() {
        text += "\n## Findings\n\n";
        for take in noted {
            let _ = writeln!(text, "- {}: {}", take.file, reasons(take));
        }
    }
    text
}

fn reasons(take: &ScanAttempt) -> String {
    let details: Vec<_> = take.findings.iter().map(|finding| finding.detail.as_str()).collect();
    details.join("; ")
}

/// Draws the scene with the collection's poses instead of its own.
fn overview(scene: &Scene, history: &CollectionHistory) -> Picture {
    let name = |number: u32, pose: &NamedPose| match &pose.name {
        Some(name) => format!("{number} {name}"),
        None => number.to_string(),
    };
    let poses =
        history.poses.iter().map(|(&number, pose)| (name(number, pose), pose.pose)).collect();
    draw_scene(&Scene { poses, ..scene.clone() })
}

/// Returns the label of readings that are not from a real ranger.
fn badge(history: &CollectionHistory) -> Option<&'static str> {
    badge_among(history.starts.iter().map(|start| start.provenance))
}

/// Draws figures of every scan over time, including rejected ones.
fn drift(history: &CollectionHistory, checks: &CheckKeys) -> Picture {
    let first = history.attempts.iter().filter_map(|take| take.started).min().unwrap_or_default();
    let hours = |at: Timestamp| at.duration_since(first).as_secs_f64() / 3600.0;
    let times = history.attempts.iter().filter_map(|take| take.started);
    let last_h = times.map(hours).fold(0.0, f64::max);
    let (scale, unit) = if last_h < 1.0 { (60.0, "minutes") } else { (1.0, "hours") };
    let strip = |title: &str, limits, of: &dyn Fn(&ScanFigures) -> Option<f64>| {
        let point = |take: &ScanAttempt| {
            Some(SeriesPoint {
                x: scale * hours(take.started?),
                y: of(&take.figures)?,
                hint: take.file.clone(),
                rejected: take.outcome != ScanOutcome::Accepted,
            })
        };
        let points = history.attempts.iter().filter_map(point).collect();
        Series { title: title.into(), points, limits }
    };
    let off = f64::from(checks.max_home_drift_steps);
    let strips = [
        strip("air temperature, C", None, &|figures| figures.temperature_c),
        strip("median of measured \u{2212} model, mm", None, &|f| Some(1e3 * f.median_residual_m?)),
        strip("agreement, %", None, &|f| Some(100.0 * f.agree_fraction?)),
        strip("index error, steps", Some([-off, off]), &|figures| {
            figures.home_drift_steps.map(f64::from)
        }),
    ];
    let along = format!("{unit} since {first:.0}");
    draw_series("Scans over time", badge(history), &[], &along, &strips)
}

/// Draws the spread of each beam's ranges at the least repeatable poses.
fn spreads(
    mut poses: Vec<(String, Repeatability, Vec<BeamSpread>)>,
    badge: Option<&str>,
) -> Picture {
    poses.sort_by(|a, b| {
        let worst = |of: &Repeatability| of.p90_spread_m.unwrap_or(0.0);
        worst(&b.1).total_cmp(&worst(&a.1))
    });
    let all = poses.len();
    poses.truncate(MAX_STRIPS);
    let strips: Vec<Series> = poses
        .into_iter()
        .map(|(label, of, beams)| {
            let point = |beam: BeamSpread| SeriesPoint {
                x: beam.azimuth_deg,
                y: 1e3 * beam.spread_m,
                hint: format!("{:.1}\u{b0}: {:.2} mm", beam.azimuth_deg, 1e3 * beam.spread_m),
                rejected: false,
            };
            Series {
                title: format!("{label}: standard deviation over {} scans, mm", of.scans),
                points: beams.into_iter().map(point).collect(),
                limits: None,
            }
        })
        .collect();
    let lines = match all > MAX_STRIPS {
        true => vec![format!("The {MAX_STRIPS} least repeatable of {all} poses")],
        false => Vec::new(),
    };
    let along = "azimuth, degrees counter-clockwise from the heading";
    draw_series("Repeatability of beams", badge, &lines, along, &strips)
}

/// Loads the accepted scans of a pose, by repeat.
fn views(
    folder: &CollectionFolder,
    history: &CollectionHistory,
    pose: u32,
) -> Result<Vec<ScanView>, CollectError> {
    let mut takes: Vec<&ScanAttempt> =
        history.accepted().filter(|take| take.slot.pose == pose).collect();
    takes.sort_by_key(|take| take.slot.repeat);
    let mut views = Vec::new();
    for take in takes {
        let loaded = load(&folder.root().join(&take.file))?;
        views.extend(ScanView::from_records(loaded.records));
    }
    Ok(views)
}

fn scene(folder: &CollectionFolder) -> Result<Option<Scene>, CollectError> {
    let path = folder.root().join(INPUTS).join("scene.json");
    let Ok(text) = std::fs::read_to_string(&path) else { return Ok(None) };
    Scene::from_json(&text).map(Some).map_err(|error| {
        CollectError::invalid(
            format!("{}: {error}", path.display()),
            "the file was modified: restore it",
        )
    })
}

fn draw(folder: &CollectionFolder, name: &str, picture: &Picture) -> Result<(), CollectError> {
    Ok(folder.write(&format!("{PICTURES}/{name}.svg"), picture.to_svg().as_bytes())?)
}

/// Formats conditions as a paragraph; empty if there are none.
fn conditions(of: &Conditions) -> String {
    if of.is_empty() { String::new() } else { format!("Conditions{}.\n\n", listed(of)) }
}

fn listed(of: &Conditions) -> String {
    let plain =
        |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let all: Vec<_> = of.iter().map(|(key, value)| format!("{key} {}", plain(value))).collect();
    if all.is_empty() { String::new() } else { format!(": {}", all.join(", ")) }
}
