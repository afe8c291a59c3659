//! Other ways to a floor plan, from the same readings.

use std::error::Error;

use sonard_interpret::interpret::{
    BeamOutcome, Sweep, SweepBeam,
    lines::{LineMap, LineMapSettings},
};
use sonard_inverse::{FiringOutcome, FitSweep, World};
use sonard_model::{
    geometry::{DVec2, Pose, wrap_180},
    model::EngineOptions,
};
use sonard_survey::{
    CourseMap, NoObserver, VirtualFeature, map_course, survey,
    trial::{Comparison, Ends, RigidMotion, RoomKind, coverage},
};

use crate::{Settings, course::Course};

/// Recall and precision of the walls of one method in one room.
struct Score {
    recall: f64,
    precision: f64,
}

/// Names of the methods, in the order of their scores.
const METHODS: [&str; 5] = [
    "lines through the echoes, true poses",
    "lines through the echoes, odometry",
    "virtual lines, no model",
    "survey by echoes of first order",
    "survey",
];

/// Prints recall and precision of all methods for each kind of room.
pub(crate) fn compare_methods(settings: &Settings) -> Result<(), Box<dyn Error>> {
    println!("| kind | rooms | method | recall | precision | complete |");
    for &kind in &settings.kinds {
        let mut all: Vec<[Score; 5]> = Vec::new();
        for seed in settings.seeds.clone() {
            all.push(scores(kind, seed, settings)?);
        }
        let count = all.len().max(1) as f64;
        for (at, name) in METHODS.iter().enumerate() {
            let of = all.iter().map(|scores| &scores[at]);
            let mean = |part: fn(&Score) -> f64| of.clone().map(part).sum::<f64>() / count;
            let is_complete = |of: &&Score| of.recall.min(of.precision) > crate::COMPLETE;
            let complete = of.clone().filter(is_complete).count();
            let (recall, precision) = (mean(|of| of.recall), mean(|of| of.precision));
            println!(
                "| {kind} | {} | {name} | {recall:.3} | {precision:.3} | {complete} |",
                all.len()
            );
        }
    }
    Ok(())
}

fn scores(kind: RoomKind, seed: u64, settings: &Settings) -> Result<[Score; 5], Box<dyn Error>> {
    let course = Course::draw(kind, seed, settings)?;
    let (options, poses) = (settings.survey_options(), &course.poses);
    let truth: Vec<Ends> = course.world.scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
    let score = |walls: &[Ends]| Score {
        recall: coverage(&truth, walls, 0.02, 2.0),
        precision: coverage(walls, &truth, 0.02, 2.0),
    };
    let sound_speed_m_s = course.assumed.air.sound_speed_m_s();
    let lines = |poses: &[Pose]| score(&echo_lines(&course.sweeps, poses, sound_speed_m_s));
    let odometry: Vec<Pose> = course.sweeps.iter().map(|sweep| sweep.pose).collect();
    let map = map_course(&course.assumed, &course.sweeps, &options)?;
    let of_survey = |world: &World| -> Result<Score, Box<dyn Error>> {
        let found = survey(world, &course.sweeps, &options, &NoObserver)?;
        let Comparison { recall, precision, .. } =
            Comparison::new(&found, &course.world.scene, poses);
        Ok(Score { recall, precision })
    };
    Ok([
        lines(poses),
        lines(&odometry),
        score(&virtual_lines(&map, &course.sweeps, poses, sound_speed_m_s)),
        of_survey(&first_order(&course.assumed))?,
        of_survey(&course.assumed)?,
    ])
}

/// World whose echoes are of one reflection, or of an edge.
fn first_order(world: &World) -> World {
    let mut first = world.clone();
    if let EngineOptions::Paths(paths) = &mut first.options.engine {
        paths.max_order = Some(1);
    }
    first
}

/// Segments through the points of the echoes along their beams, merged over the sweeps (Dudek and
/// others, ICRA 1996, as `sonard lines`).
fn echo_lines(sweeps: &[FitSweep], poses: &[Pose], sound_speed_m_s: f64) -> Vec<Ends> {
    let mut map = LineMap::new(LineMapSettings::default());
    for (sweep, pose) in sweeps.iter().zip(poses) {
        let beam = |(index, beam): (u32, &sonard_inverse::SweepFiring)| SweepBeam {
            azimuth_deg: beam.azimuth_deg,
            index,
            outcome: match (beam.outcome, beam.range_m(sound_speed_m_s)) {
                (_, Some(range_m)) => BeamOutcome::Echo(range_m),
                (FiringOutcome::BelowMinRange, _) => BeamOutcome::BelowMinRange,
                _ => BeamOutcome::NoEcho,
            },
            mount: DVec2::ZERO,
        };
        let step_deg = 360.0 / sweep.beams.len() as f64;
        let beams = (0..).zip(&sweep.beams).map(beam).collect();
        map.add_sonar(&Sweep { pose: *pose, step_deg, beams, closed: true });
    }
    map.lines().iter().map(|line| line.ends).collect()
}

/// Line features of the course, each as long as the feet of the places that detect it, in the true
/// frame (as segments from votes of arcs by Tardos and others, IJRR 21(4), 2002).
fn virtual_lines(
    map: &CourseMap,
    sweeps: &[FitSweep],
    truth: &[Pose],
    sound_speed_m_s: f64,
) -> Vec<Ends> {
    const NEAR_M: f64 = 0.02;
    const NEAR_DEG: f64 = 5.0;
    let poses: Vec<Pose> = map.poses.iter().map(|of| of.pose).collect();
    let motion = RigidMotion::between(&poses, truth);
    let detects = |sweep: &FitSweep, pose: &Pose, feature: &VirtualFeature| {
        let (range_m, bearing_rad) = feature.predict(pose.position());
        sweep.beams.iter().any(|beam| {
            let off_deg = pose.heading_deg + beam.azimuth_deg - bearing_rad.to_degrees();
            let measured_m = beam.range_m(sound_speed_m_s);
            wrap_180(off_deg).abs() < NEAR_DEG
                && measured_m.is_some_and(|measured_m| (measured_m - range_m).abs() < NEAR_M)
        })
    };
    let segment = |(feature, _): &(VirtualFeature, usize)| {
        let VirtualFeature::Line { normal_rad, distance_m, .. } = *feature else { return None };
        let normal = DVec2::from_angle(normal_rad);
        let places =
            sweeps.iter().zip(&poses).filter(|(sweep, pose)| detects(sweep, pose, feature));
        let mut along_m: Vec<f64> =
            places.map(|(_, pose)| normal.perp().dot(pose.position())).collect();
        along_m.sort_by(f64::total_cmp);
        let (first_m, last_m) = (along_m.first()?, along_m.last()?);
        let at = |along_m: f64| motion.of(distance_m * normal + along_m * normal.perp());
        Some([at(*first_m), at(*last_m)])
    };
    map.features.iter().filter_map(segment).collect()
}
