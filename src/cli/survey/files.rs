//! Files of a survey.

use std::path::Path;

use serde::Serialize;

use super::{Args, Input, picture, summary};
use crate::{
    cli::{
        Failure, Outcome,
        output::{Overwrite, Product, make_folder},
    },
    scan::AirRecord,
    survey::Survey,
};

const FILES: [&str; 4] = ["scene.json", "poses.csv", "survey.json", "report.md"];
/// Files of fitted numbers.
const FITTED_FILES: [&str; 2] = ["sensor.json", "air.json"];

/// Checks, before any work, that the files may be written to the folder.
///
/// # Errors
///
/// A file that may not be replaced.
pub(super) fn check(args: &Args, overwrite: Overwrite) -> Outcome {
    let folder: &Path = &args.out;
    let fitted = if args.fit.is_empty() { &[][..] } else { &FITTED_FILES[..] };
    let texts = FILES.iter().chain(fitted).map(|name| (*name, Product::Log));
    let all = texts.chain(picture::FILES);
    all.into_iter().try_for_each(|(name, product)| overwrite.check_in(folder, name, product))
}

/// Writes all files to the output folder.
///
/// # Errors
///
/// Write errors, or a plan that is no valid scene.
pub(super) fn write(args: &Args, overwrite: Overwrite, input: &Input, found: &Survey) -> Outcome {
    make_folder(&args.out)?;
    let scene = found.scene("survey", args.closed);
    scene.build().map_err(|error| {
        Failure::input(error, "the survey found no walls: give sweeps with more echoes")
    })?;
    let contents = [scene.text(), poses(found), json(found), summary::markdown(input, found)];
    FILES.iter().zip(contents).try_for_each(|(name, text)| {
        overwrite.save(&args.out.join(name), Product::Log, text.as_bytes())
    })?;
    if let Some(fitted) = &found.fitted {
        let air = &input.world.air;
        let air = air.with_temperature_for_sound_speed(fitted.sound_speed_m_s);
        let air = AirRecord::from(&air.unwrap_or(input.world.air));
        for (name, text) in FITTED_FILES.iter().zip([json(&fitted.sensor), json(&air)]) {
            overwrite.save(&args.out.join(name), Product::Log, text.as_bytes())?;
        }
    }
    picture::write(args, overwrite, input, found)
}

/// Serializes a value as lines of JSON.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// Poses as CSV with their standard deviations.
fn poses(found: &Survey) -> String {
    let mut text = "scan,x_m,y_m,heading_deg,sigma_x_m,sigma_y_m,sigma_heading_deg\n".to_owned();
    for of in &found.poses {
        let pose = of.pose;
        let sigma = |value: Option<f64>| value.map_or_else(String::new, |of| format!("{of:.6}"));
        let [x, y] = [0, 1].map(|at: usize| sigma(of.sigma_m.map(|sigma| sigma[at])));
        text += &format!(
            "{},{:.6},{:.6},{:.5},{x},{y},{}\n",
            of.scan,
            pose.x_m,
            pose.y_m,
            pose.heading_deg,
            sigma(of.sigma_heading_deg)
        );
    }
    text
}
