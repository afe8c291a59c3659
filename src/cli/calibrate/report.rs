//! What a calibration found, as lines and files.

use std::{fmt::Write as _, path::Path};

use serde::Serialize;
use uuid::Uuid;

use super::what::name;
use crate::{
    acoustics::Aperture,
    cli::{
        Outcome,
        output::{Overwrite, Product, make_folder},
    },
    inverse::{Fit, Fitted, Parameter, Sweep, World},
    scan::AirRecord,
};

/// Files of the folder.
const FILES: [&str; 6] =
    ["estimates.jsonl", "poses.jsonl", "sensor.json", "scene.json", "air.json", "report.md"];

/// An estimate, as it is told.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Line {
    /// What it is.
    pub(super) name: String,
    /// Of which scan, if it is of one alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    scan: Option<Uuid>,
    /// The value found.
    pub(super) value: f64,
    /// Less what it was.
    change: f64,
    /// Standard deviation.
    pub(super) sigma: f64,
    /// 95 % lie from here
    pub(super) low: f64,
    /// to here.
    pub(super) high: f64,
    /// What it was.
    pub(super) prior: f64,
    /// How sure that was.
    prior_sigma: f64,
    /// Whether the readings say more than was believed.
    pub(super) identified: bool,
}

impl Line {
    pub(super) fn title(&self) -> String {
        match self.scan {
            Some(scan) => format!("{} of {:08x}", self.name, scan.as_fields().0),
            None => self.name.clone(),
        }
    }
}

/// The estimates of a fit, as values of what is in files.
pub(super) fn lines(world: &World, sweeps: &[Sweep], what: &Fit, fitted: &Fitted) -> Vec<Line> {
    let of = |(prior, estimate): (&crate::inverse::Prior, &crate::inverse::Estimate)| {
        let parameter = &prior.parameter;
        let value = |by: f64| value(world, sweeps, parameter, by);
        let half_width = 1.959_964 * estimate.sigma;
        // A logarithm or a share is told as what it makes of the figure.
        let per_unit = |sigma: f64| {
            0.5 * (value(estimate.change + sigma) - value(estimate.change - sigma)).abs()
        };
        Line {
            name: name(parameter, world),
            scan: parameter.sweep().and_then(|at| sweeps.get(at)).map(|sweep| sweep.scan),
            value: value(estimate.change),
            change: value(estimate.change) - value(0.0),
            sigma: per_unit(estimate.sigma),
            low: value(estimate.change - half_width),
            high: value(estimate.change + half_width),
            prior: value(0.0),
            prior_sigma: per_unit(prior.sigma),
            identified: estimate.identified,
        }
    };
    what.priors.iter().zip(&fitted.estimates).map(of).collect()
}

/// What a parameter's figure is after a change.
fn value(world: &World, sweeps: &[Sweep], parameter: &Parameter, by: f64) -> f64 {
    let pose = |at: usize| sweeps.get(at).map(|sweep| sweep.pose);
    let mounting = &world.sensor.mounting;
    match parameter {
        Parameter::X(at) => pose(*at).map_or(by, |pose| pose.x_m + by),
        Parameter::Y(at) => pose(*at).map_or(by, |pose| pose.y_m + by),
        Parameter::Heading(at) => pose(*at).map_or(by, |pose| pose.heading_deg + by),
        Parameter::HeadingZero => world.heading_zero_deg + by,
        Parameter::Gear => world.gear * (1.0 + by),
        Parameter::Ahead => mounting.ahead_m + by,
        Parameter::Left => mounting.left_m + by,
        Parameter::Height => world.sensor_z_m().map_or(by, |z_m| z_m + by),
        Parameter::SoundSpeed => world.air.sound_speed_m_s() * (1.0 + by),
        Parameter::Delay => world.delay_m + by,
        Parameter::Threshold => 20.0 * world.sensor.threshold.log10() + by,
        Parameter::ThresholdRise => (world.sensor.threshold_rise_db_per_m + by).max(0.0),
        Parameter::Skirts => match world.sensor.aperture {
            Aperture::Piston { skirts_db: Some(db), .. } => (db + by).min(0.0),
            _ => by,
        },
        Parameter::Aperture => world.sensor.half_width_m() * by.exp(),
        Parameter::Reflectance(name) => {
            world.scene.materials.get(name).map_or(1.0, |material| material.reflectance) * by.exp()
        }
        Parameter::Wall(_) => by,
    }
}

/// How well it fits, in sentences.
pub(super) fn fit_words(lines: &[Line], fitted: &Fitted) -> Vec<String> {
    let errors = &fitted.errors;
    let mut said = vec![format!(
        "{} readings: {:.0} % explained, ranges within {:.1} mm (standard deviation), strengths within {:.1} dB",
        fitted.readings,
        100.0 * (1.0 - errors.clutter),
        1e3 * errors.sigma_m,
        errors.sigma_db
    )];
    if errors.clutter > 0.3 {
        said.push(
            "doubt: a good part of the readings is not explained; see `sonard locate` whether the scene is the \
             right one, and free what else may be wrong with --fit"
                .to_owned(),
        );
    }
    for (one, other, correlation) in strongest(fitted) {
        let [one, other] = [&lines[one], &lines[other]].map(Line::title);
        said.push(format!("hardly told apart: {one} and {other} (correlation {correlation:.2})"));
    }
    said
}

/// Pairs of parameters, by their place in the list, that can hardly be told apart.
fn strongest(fitted: &Fitted) -> Vec<(usize, usize, f64)> {
    let sigma = |at: usize| fitted.covariance[(at, at)].sqrt();
    let mut found = Vec::new();
    for one in 0..fitted.estimates.len() {
        for other in 0..one {
            let correlation = fitted.covariance[(one, other)] / (sigma(one) * sigma(other));
            if correlation.abs() > 0.95 {
                found.push((other, one, correlation));
            }
        }
    }
    found
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
    lines: &[Line],
) -> Outcome {
    make_folder(folder)?;
    let mut sensor = fitted.world.sensor.clone();
    if sensor != world.sensor {
        sensor.name = format!("{}-calibrated", sensor.name);
        let source = "fitted by `sonard calibrate`: see report.md";
        for (field, changed) in [
            ("aperture", sensor.aperture != world.sensor.aperture),
            ("threshold", sensor.threshold != world.sensor.threshold),
            (
                "threshold_rise_db_per_m",
                sensor.threshold_rise_db_per_m != world.sensor.threshold_rise_db_per_m,
            ),
            ("mounting", sensor.mounting != world.sensor.mounting),
        ] {
            if changed {
                sensor.sources.insert(field.to_owned(), source.to_owned());
            }
        }
    }
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
        poses,
        json(&sensor),
        fitted.world.scene.rewritten(),
        json(&AirRecord::from(&fitted.world.air)),
        report(lines, fitted),
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

fn report(lines: &[Line], fitted: &Fitted) -> String {
    let mut text = String::from("# Calibration\n\n");
    for line in fit_words(lines, fitted) {
        let _ = writeln!(text, "{line}\n");
    }
    text.push_str(
        "| parameter | was | believed within | is | standard deviation | told by the readings |\n",
    );
    text.push_str("| --- | --- | --- | --- | --- | --- |\n");
    for line in lines {
        let told = if line.identified { "yes" } else { "no: left at its prior" };
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
