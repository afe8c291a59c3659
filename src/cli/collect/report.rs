//! The report of a collection: one page of Markdown, with pictures beside it.

use std::fmt::Write as _;

use jiff::Timestamp;

use super::refuse;
use crate::{
    cli::{Failure, Outcome as Done},
    collect::{
        CheckKeys, CollectionKeys, Conditions, Figures, Folder, History, INPUTS, NamedPose,
        Outcome, Repeatability, Take, repeatability,
    },
    compare::{Comparison, compare},
    plot::{Picture, Timeline, draw_scans, draw_scene, draw_timelines},
    scan::ScanView,
    scene::Scene,
    store::load,
};

/// Scans that are drawn over each other at most: more of them hide what is below.
const DRAWN: usize = 12;
const PICTURES: &str = "report";

/// Writes report and pictures into the folder.
pub(super) fn write(folder: &Folder, history: &History) -> Done {
    let Some(plan) = history.plans.last() else {
        return Err(Failure::input("there is no plan in the journal", "nothing was collected yet"));
    };
    let keys: CollectionKeys = serde_json::from_value(plan.keys.clone()).unwrap_or_default();
    let scene = scene(folder)?;
    let mut text = head(history, &keys);
    if let Some(scene) = &scene {
        draw(folder, "overview", &overview(scene, history))?;
        text += "![The poses in the scene](report/overview.svg)\n\n";
    }
    text += "## Poses\n\nResiduals are measured minus predicted range over the pairs of echoes; spread is \
             the standard deviation of a beam's range over the repeats.\n\n\
             | pose | where | scans | agree | median residual | 90 % within | spread | 90 % within | \
             unsteady beams |\n|---|---|---|---|---|---|---|---|---|\n";
    let mut details = String::new();
    for (&number, pose) in &history.poses {
        let views = views(folder, history, number)?;
        let row =
            Row { number, pose, compared: compare(&views).0, repeat: repeatability(&views).0 };
        text += &row.line();
        if !views.is_empty() {
            let name = format!("pose-{number:03}");
            let drawn = &views[..views.len().min(DRAWN)];
            draw(folder, &name, &draw_scans(drawn, scene.as_ref()))?;
            let label = pose.label();
            let _ = write!(details, "### {number}: {label}\n\n{}", conditions(&pose.conditions));
            let _ = write!(details, "![Scans at {label}](report/{name}.svg)\n\n");
        }
    }
    text += &fates(history);
    draw(folder, "drift", &drift(history, &keys.checks))?;
    text +=
        "\n## Drift\n\n![Temperature, bias, agreement and index over time](report/drift.svg)\n\n";
    text += &format!("## Scans\n\n{details}");
    folder.write("report.md", text.as_bytes()).map_err(|error| refuse(&error))
}

/// What there is, from when to when, by what.
fn head(history: &History, keys: &CollectionKeys) -> String {
    let wanted = history.wanted();
    let accepted: Vec<&Take> = history.accepted().collect();
    let given_up = wanted.iter().filter(|slot| history.is_given_up(**slot)).count();
    let beams: u64 = accepted.iter().map(|take| u64::from(take.figures.beams)).sum();
    let missing: u64 = accepted.iter().map(|take| u64::from(take.figures.missing)).sum();
    let mut text = format!("# {}\n\n", keys.collection.name);
    let _ = writeln!(
        text,
        "{} of {} scans, {} set aside, {given_up} given up; {beams} beams, {missing} without a usable \
         reading.",
        accepted.len(),
        wanted.len(),
        history.set_aside().count(),
    );
    let times = || accepted.iter().filter_map(|take| take.started);
    if let (Some(first), Some(last)) = (times().min(), times().max()) {
        let _ = writeln!(
            text,
            "Begun {first:.0}, last scan {last:.0}, in {} runs.",
            history.starts.len()
        );
    }
    let seconds: f64 = accepted.iter().filter_map(|take| take.wall_s).sum();
    let _ = writeln!(text, "Scanning took {seconds:.0} s in all.\n");
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
            "The plan was changed {} times; journal.jsonl keeps each.\n",
            history.plans.len() - 1
        );
    }
    text
}

/// One pose of the table.
struct Row<'a> {
    number: u32,
    pose: &'a NamedPose,
    compared: Comparison,
    repeat: Repeatability,
}

impl Row<'_> {
    fn line(&self) -> String {
        let mm = |m: Option<f64>| m.map_or_else(|| "-".into(), |m| format!("{:.1} mm", 1e3 * m));
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
            mm(compared.median_residual_m),
            mm(compared.p90_abs_residual_m),
            mm(repeat.median_spread_m),
            mm(repeat.p90_spread_m),
            repeat.unsteady,
        )
    }
}

/// What was set aside, given up, or kept with a finding, and why.
fn fates(history: &History) -> String {
    let mut text = String::new();
    let mut aside = String::new();
    for take in history.set_aside() {
        let what = if take.outcome == Outcome::Cut { "cut" } else { "refused" };
        let why = take.cut.clone().unwrap_or_else(|| why(take));
        let _ = writeln!(aside, "| {} | {what} | {why} |", take.file);
    }
    if !aside.is_empty() {
        let _ =
            write!(text, "\n## Set aside and retaken\n\n| file | | why |\n|---|---|---|\n{aside}");
    }
    let given_up: Vec<_> = history.given_up.iter().filter(|s| history.is_given_up(**s)).collect();
    if !given_up.is_empty() {
        text += "\n## Given up\n\n";
        for slot in given_up {
            let _ = writeln!(text, "- pose {}, repeat {}", slot.pose, slot.repeat);
        }
    }
    let noted: Vec<_> = history.accepted().filter(|take| !take.findings.is_empty()).collect();
    if !noted.is_empty() {
        text += "\n## Noted\n\n";
        for take in noted {
            let _ = writeln!(text, "- {}: {}", take.file, why(take));
        }
    }
    text
}

fn why(take: &Take) -> String {
    let details: Vec<_> = take.findings.iter().map(|finding| finding.detail.as_str()).collect();
    details.join("; ")
}

/// The scene with the collection's poses in place of its own.
fn overview(scene: &Scene, history: &History) -> Picture {
    let name = |number: u32, pose: &NamedPose| match &pose.name {
        Some(name) => format!("{number} {name}"),
        None => number.to_string(),
    };
    let poses =
        history.poses.iter().map(|(&number, pose)| (name(number, pose), pose.pose)).collect();
    draw_scene(&Scene { poses, ..scene.clone() })
}

fn drift(history: &History, checks: &CheckKeys) -> Picture {
    let strip = |title: &str, limits, of: &dyn Fn(&Figures) -> Option<f64>| {
        let point = |take: &Take| {
            Some((take.started?, of(&take.figures)?, take.file.clone()))
                as Option<(Timestamp, f64, String)>
        };
        Timeline {
            title: title.into(),
            points: history.accepted().filter_map(point).collect(),
            limits,
        }
    };
    let drift = f64::from(checks.max_home_drift_steps);
    let strips = [
        strip("air temperature, C", None, &|figures| figures.temperature_c),
        strip("median of measured \u{2212} model, mm", None, &|f| Some(1e3 * f.median_residual_m?)),
        strip("echo pairs that agree, %", None, &|f| Some(100.0 * f.agree_fraction?)),
        strip("index off after the scan, steps", Some([-drift, drift]), &|f| {
            f.home_drift_steps.map(f64::from)
        }),
    ];
    draw_timelines("Over time, one mark a scan that counts", &[], &strips)
}

/// The scans of a pose that count, by repeat.
fn views(folder: &Folder, history: &History, pose: u32) -> Result<Vec<ScanView>, Failure> {
    let mut takes: Vec<&Take> = history.accepted().filter(|take| take.slot.pose == pose).collect();
    takes.sort_by_key(|take| take.slot.repeat);
    let mut views = Vec::new();
    for take in takes {
        let loaded = load(&folder.root().join(&take.file))
            .map_err(|error| Failure::device(&error, error.help()))?;
        views.extend(ScanView::from_records(loaded.records));
    }
    Ok(views)
}

fn scene(folder: &Folder) -> Result<Option<Scene>, Failure> {
    let path = folder.root().join(INPUTS).join("scene.json");
    let Ok(text) = std::fs::read_to_string(&path) else { return Ok(None) };
    Scene::from_json(&text).map(Some).map_err(|error| {
        Failure::input(format!("{}: {error}", path.display()), "it was changed: put it back")
    })
}

fn draw(folder: &Folder, name: &str, picture: &Picture) -> Done {
    folder
        .write(&format!("{PICTURES}/{name}.svg"), picture.to_svg().as_bytes())
        .map_err(|error| refuse(&error))
}

/// Conditions as a paragraph; nothing if there are none.
fn conditions(of: &Conditions) -> String {
    if of.is_empty() { String::new() } else { format!("Conditions{}.\n\n", listed(of)) }
}

fn listed(of: &Conditions) -> String {
    let plain =
        |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let all: Vec<_> = of.iter().map(|(key, value)| format!("{key} {}", plain(value))).collect();
    if all.is_empty() { String::new() } else { format!(": {}", all.join(", ")) }
}
