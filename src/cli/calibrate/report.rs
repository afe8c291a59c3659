//! Results of a calibration as text and files.

use std::{fmt::Write as _, path::Path};

use serde::Serialize;

use crate::{
    cli::{
        Outcome,
        output::{Overwrite, Product, make_folder},
    },
    inverse::{FitResult, FitSweep, ParameterReport, World},
    scan::{
        AirRecord,
        text::{format_count, format_length},
    },
};

/// Files in the output folder.
const FILES: [&str; 7] = [
    "estimates.jsonl",
    "correlations.csv",
    "poses.jsonl",
    "sensor.json",
    "scene.json",
    "air.json",
    "report.md",
];
/// Maximum number of listed pairs of correlated parameters; many scans have hundreds.
const MAX_PAIRS: usize = 8;

/// Summarizes the quality of the fit, with the given diagnoses, one sentence per line.
pub(super) fn summarize(
    lines: &[ParameterReport],
    fitted: &FitResult,
    diagnoses: Vec<String>,
) -> Vec<String> {
    let errors = &fitted.errors;
    let mut text = vec![format!(
        "{}: {:.0} % explained, ranges within {} (standard deviation), strengths within {:.1} dB",
        format_count(fitted.readings, "reading"),
        100.0 * errors.explained(),
        format_length(errors.sigma_m),
        errors.sigma_db
    )];
    let is_furnished = errors.outlier_arc_share > 0.0;
    if is_furnished {
        text.push(format!(
            "{:.0} % are attributed to objects that are not in the scene, {:.0} beams wide on average",
            100.0 * errors.outlier_arc_share,
            errors.outlier_arc_beams
        ));
    }
    if fitted.is_poorly_explained() {
        let furniture =
            if is_furnished { "" } else { ", or allow for furniture with --search furnished" };
        text.push(format!(
            "warning: many readings are unexplained; check with `sonard locate` whether the scene is the \
                    right one, and fit further parameters with --fit{furniture}"
        ));
    }
    text.extend(diagnoses);
    let pairs = fitted.strongly_correlated();
    for &(a, b, correlation) in pairs.iter().take(MAX_PAIRS) {
        let [a, b] = [&lines[a], &lines[b]].map(ParameterReport::title);
        text.push(format!("strongly correlated: {a} and {b} ({correlation:.2})"));
    }
    if pairs.len() > MAX_PAIRS {
        let more = pairs.len() - MAX_PAIRS;
        text.push(format!(
            "strongly correlated: {more} more pairs, all in correlations.csv of --out"
        ));
    }
    text
}

/// Checks, before any work, that the files may be written to the folder.
///
/// # Errors
///
/// A file that may not be replaced.
pub(super) fn check(folder: &Path, overwrite: Overwrite) -> Outcome {
    let pictures = super::picture::FILES.into_iter();
    let files = FILES.iter().map(|name| (*name, Product::Log)).chain(pictures);
    files.into_iter().try_for_each(|(name, product)| overwrite.check_in(folder, name, product))
}

/// Writes the results as files that other verbs read.
///
/// # Errors
///
/// Write errors.
pub(super) fn write_folder(
    folder: &Path,
    overwrite: Overwrite,
    world: &World,
    sweeps: &[FitSweep],
    fitted: &FitResult,
    lines: &[ParameterReport],
    summary: &[String],
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
        fitted.world.scene.updated_text(),
        json(&AirRecord::from(&fitted.world.air)),
        format_report(lines, summary),
    ];
    FILES.iter().zip(contents).try_for_each(|(name, text)| {
        overwrite.save(&folder.join(name), Product::Log, text.as_bytes())
    })
}

/// Serializes a value as a line of JSON.
fn json(value: &impl Serialize) -> String {
    // Numbers, texts and maps with text keys can always be written.
    serde_json::to_string(value).unwrap_or_default() + "\n"
}

/// Formats the correlation matrix as CSV with the parameters' titles as headers.
fn correlations(lines: &[ParameterReport], fitted: &FitResult) -> String {
    let titles = || lines.iter().map(ParameterReport::title);
    let figures = fitted.correlations();
    let mut table = csv::Writer::from_writer(Vec::new());
    let mut rows = vec![[String::new()].into_iter().chain(titles()).collect::<Vec<_>>()];
    for (title, row) in titles().zip(figures.row_iter()) {
        rows.push(
            [title].into_iter().chain(row.iter().map(|value| format!("{value:.4}"))).collect(),
        );
    }
    // Rows of one length are always written to memory.
    rows.iter().for_each(|row| table.write_record(row).unwrap_or_default());
    let bytes = table.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn format_report(lines: &[ParameterReport], summary: &[String]) -> String {
    let mut text = String::from("# Calibration\n\n");
    for line in summary {
        let _ = writeln!(text, "{line}\n");
    }
    text.push_str(
        "| parameter | initial | prior sigma | estimate | standard deviation | identifiable |\n",
    );
    text.push_str("| --- | --- | --- | --- | --- | --- |\n");
    for line in lines {
        let identifiable = match line.remark() {
            "" => "yes".to_owned(),
            remark => format!("no: {remark}"),
        };
        let _ = writeln!(
            text,
            "| {} | {:.5} | {:.5} | {:.5} | {:.5} | {identifiable} |",
            line.title(),
            line.prior,
            line.prior_sigma,
            line.value,
            line.sigma
        );
    }
    text
}
