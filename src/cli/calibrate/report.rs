//! What a calibration found, as lines and files.

use std::{fmt::Write as _, path::Path};

use serde::Serialize;

use crate::{
    cli::{
        Outcome,
        output::{Overwrite, Product, make_folder},
    },
    inverse::{Fitted, Sweep, Told, World},
    scan::AirRecord,
};

/// Files of the folder.
const FILES: [&str; 7] = [
    "estimates.jsonl",
    "correlations.csv",
    "poses.jsonl",
    "sensor.json",
    "scene.json",
    "air.json",
    "report.md",
];
/// So many pairs that can hardly be told apart are named: of many scans there are hundreds.
const PAIRS: usize = 8;

/// How well it fits, in sentences, with those that say what may be wrong.
pub(super) fn fit_words(lines: &[Told], fitted: &Fitted, doubts: Vec<String>) -> Vec<String> {
    let errors = &fitted.errors;
    let mut said = vec![format!(
        "{} readings: {:.0} % explained, ranges within {:.1} mm (standard deviation), strengths within {:.1} dB",
        fitted.readings,
        100.0 * errors.explained(),
        1e3 * errors.sigma_m,
        errors.sigma_db
    )];
    let is_furnished = errors.arcs > 0.0;
    if is_furnished {
        said.push(format!(
            "{:.0} % are taken for things that the scene lacks, of {:.0} beams on average",
            100.0 * errors.arcs,
            errors.arc_beams
        ));
    }
    if fitted.is_doubtful() {
        let furniture =
            if is_furnished { "" } else { ", or allow for furniture with --search furnished" };
        said.push(format!(
            "doubt: a good part of the readings is not explained; see `sonard locate` whether the scene is the \
             right one, and free what else may be wrong with --fit{furniture}"
        ));
    }
    said.extend(doubts);
    let pairs = fitted.hardly_told_apart();
    for &(one, other, correlation) in pairs.iter().take(PAIRS) {
        let [one, other] = [&lines[one], &lines[other]].map(Told::title);
        said.push(format!("hardly told apart: {one} and {other} (correlation {correlation:.2})"));
    }
    if pairs.len() > PAIRS {
        let more = pairs.len() - PAIRS;
        said.push(format!(
            "hardly told apart: {more} more pairs, all in correlations.csv of --out"
        ));
    }
    said
}

/// Whether the folder may be written to; before any work.
///
/// # Errors
/// A file of the same name in it.
pub(super) fn check(folder: &Path, overwrite: Overwrite) -> Outcome {
    FILES.iter().try_for_each(|name| overwrite.check_in(folder, name, Product::Log))
}

/// Writes what was found, as files that other verbs take.
///
/// # Errors
/// What the disk refuses.
pub(super) fn write_folder(
    folder: &Path,
    overwrite: Overwrite,
    world: &World,
    sweeps: &[Sweep],
    fitted: &Fitted,
    lines: &[Told],
    words: &[String],
) -> Outcome {
    make_folder(folder)?;
    let poses: String = sweeps
        .iter()
        .zip(&fitted.poses)
        .map(|(sweep, pose)| {
            let line = serde_json::json!({
                "scan": sweep.scan, "x_m": pose.x_m, "y_m": pose.y_m, "heading_deg": pose.heading_deg,
            });
            format!("{line}\n")
        })
        .collect();
    let estimates: String = lines.iter().map(json).collect();
    let contents = [
        estimates,
        correlations(lines, fitted),
        poses,
        json(&fitted.sensor(&world.sensor)),
        fitted.world.scene.rewritten(),
        json(&AirRecord::from(&fitted.world.air)),
        report(lines, words),
    ];
    FILES.iter().zip(contents).try_for_each(|(name, text)| {
        overwrite.save(&folder.join(name), Product::Log, text.as_bytes())
    })
}

/// A value as a line of JSON.
fn json(value: &impl Serialize) -> String {
    // Numbers, texts and maps with text keys can always be written.
    serde_json::to_string(value).unwrap_or_default() + "\n"
}

/// The matrix of correlations, each row and column under the name of its estimate.
fn correlations(lines: &[Told], fitted: &Fitted) -> String {
    let titles = || lines.iter().map(Told::title);
    let figures = fitted.correlations();
    let mut table = csv::Writer::from_writer(Vec::new());
    let mut rows = vec![[String::new()].into_iter().chain(titles()).collect::<Vec<_>>()];
    for (title, row) in titles().zip(figures.row_iter()) {
        rows.push([title].into_iter().chain(row.iter().map(|of| format!("{of:.4}"))).collect());
    }
    // Rows of one length are always written to memory.
    rows.iter().for_each(|row| table.write_record(row).unwrap_or_default());
    let bytes = table.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn report(lines: &[Told], words: &[String]) -> String {
    let mut text = String::from("# Calibration\n\n");
    for line in words {
        let _ = writeln!(text, "{line}\n");
    }
    text.push_str(
        "| parameter | was | believed within | is | standard deviation | told by the readings |\n",
    );
    text.push_str("| --- | --- | --- | --- | --- | --- |\n");
    for line in lines {
        let told = match line.remark() {
            "" => "yes".to_owned(),
            remark => format!("no: {remark}"),
        };
        let _ = writeln!(
            text,
            "| {} | {:.5} | {:.5} | {:.5} | {:.5} | {told} |",
            line.title(),
            line.prior,
            line.prior_sigma,
            line.value,
            line.sigma
        );
    }
    text
}
