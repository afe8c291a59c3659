//! Picture of the residuals before and after a calibration.

use std::path::Path;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::{
    cli::{
        Failure, Outcome,
        output::{Overwrite, Product},
    },
    geometry::Pose,
    inverse::{FitResult, FitSweep, World, WorldError},
    plot::{ComparedReading, badge_among, draw_before_after},
    scan::{PingStatus, Provenance, text::format_count},
};

/// Names of the picture in the output folder.
pub(super) const FILES: [(&str, Product); 2] =
    [("residuals.svg", Product::Svg), ("residuals.png", Product::Png)];
/// Maximum number of drawn readings; more are indistinguishable.
const MAX_READINGS: usize = 20_000;
const WIDTH_PX: u32 = 1600;

/// Writes the residuals of the initial and of the fitted values.
///
/// # Errors
///
/// Poses or values that the model rejects, or write errors.
pub(super) fn write(
    folder: &Path,
    overwrite: Overwrite,
    world: &World,
    sweeps: &[FitSweep],
    fitted: &FitResult,
    sources: &[Provenance],
) -> Outcome {
    let readings: usize = sweeps.iter().map(|sweep| sweep.beams.len()).sum();
    let every = readings.div_ceil(MAX_READINGS).max(1);
    let initial_poses: Vec<Pose> = sweeps.iter().map(|sweep| sweep.pose).collect();
    let compared = |world: &World, poses: &[Pose]| compare(world, sweeps, poses, every);
    let before = compared(world, &initial_poses);
    let after = compared(&fitted.world, &fitted.poses);
    let [before, after] = [before, after].map(|compared| {
        compared.map_err(|error| Failure::input(error, "the other results are complete"))
    });
    let title =
        format!("{}: calibration with {}", world.scene.name, format_count(sweeps.len(), "scan"));
    let mut lines =
        vec![format!("{}; {}", fitted.world.sensor.name, format_count(readings, "reading"))];
    if every > 1 {
        lines.push(format!("one reading in {every} is drawn and counted"));
    }
    let names = ["initial values", "fitted values"];
    let badge = badge_among(sources.iter().copied());
    let picture = draw_before_after(&title, badge, &lines, names, [&before?, &after?]);
    let png = picture.to_png(WIDTH_PX).map_err(|error| {
        Failure::device(
            format!("cannot draw the residuals: {error}"),
            "the other results are complete",
        )
    })?;
    let contents = [picture.to_svg().into_bytes(), png];
    FILES.iter().zip(contents).try_for_each(|((name, product), bytes)| {
        overwrite.save(&folder.join(name), *product, &bytes)
    })
}

/// Compares the readings with the predictions of a world.
fn compare(
    world: &World,
    sweeps: &[FitSweep],
    poses: &[Pose],
    every: usize,
) -> Result<Vec<ComparedReading>, WorldError> {
    let pairs: Vec<(&FitSweep, &Pose)> = sweeps.iter().zip(poses).collect();
    let compared: Result<Vec<Vec<_>>, _> =
        pairs.par_iter().map(|(sweep, pose)| compare_sweep(world, sweep, pose, every)).collect();
    Ok(compared?.into_iter().flatten().collect())
}

fn compare_sweep(
    world: &World,
    sweep: &FitSweep,
    pose: &Pose,
    every: usize,
) -> Result<Vec<ComparedReading>, WorldError> {
    let simulator = world.simulator(pose)?;
    let point = simulator.at(pose.position());
    let speed_m_s = world.air.sound_speed_m_s();
    sweep
        .beams
        .iter()
        .step_by(every)
        .map(|beam| {
            let prediction = point.ping(world.direction_rad(pose, beam.azimuth_deg))?;
            let is_echo = prediction.status == PingStatus::Echo;
            let predicted_m = prediction.range_m.filter(|_| is_echo);
            Ok(ComparedReading {
                azimuth_deg: beam.azimuth_deg,
                measured_m: beam.range_m(speed_m_s),
                predicted_m: predicted_m.map(|range_m| range_m + world.delay_m),
            })
        })
        .collect()
}
