//! Localization along a course, from single sweeps and with odometry between them.
//!
//! `cargo run --release -p sonard-inverse --example courses -- COUNT [SEED] [BEAMS] [SCENE...]`
//! drives COUNT courses of eight sweeps in each scene (all shipped ones by default), up to half a
//! metre apart. Odometry errors are 5 % and 5 degrees per metre; before the fifth sweep the robot
//! is kidnapped. A first answer within 2 cm and 1 degree of the truth is correct (10 cm and 5
//! degrees with fewer than 100 beams); in a scene with point symmetry either pose is. The output is
//! the fraction of correct sweeps, and of courses that recover within a number of sweeps after the
//! kidnapping.

mod rooms;
mod symmetry;

use std::sync::Arc;

use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use rooms::{BEAMS, place, readings};
use sonard_inverse::{CoarseGrid, FitSweep, Odometry, PoseMode, Tracker, World, locate};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose, wrap_180},
    model::Options,
    scene::{Scene, shipped},
};
use symmetry::equivalent_poses;
use uuid::Uuid;

const SWEEPS: usize = 8;
const CARRIED: usize = 4;
const LEG_M: f64 = 0.5;

fn main() {
    let (numbers, names): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|text| text.parse::<u64>().is_ok());
    let number =
        |at: usize, usual: u64| numbers.get(at).and_then(|text| text.parse().ok()).unwrap_or(usual);
    let (count, seed, beams) = (number(0, 10), number(1, 1), number(2, BEAMS.into()) as usize);
    println!(
        "{:24} {:>7} {:>7} {:>7}  within 1, 2, 3 after it was carried",
        "scene", "sweeps", "alone", "course"
    );
    let is_wanted = |name: &&str| names.is_empty() || names.iter().any(|wanted| wanted == name);
    for name in shipped::names().filter(is_wanted) {
        driven_in(name, count, seed, beams);
    }
}

/// Results of the courses in a scene.
#[derive(Default)]
struct Tally {
    sweeps: u32,
    alone: u32,
    course: u32,
    /// Courses that recovered at the first, second and third sweep after the kidnapping.
    again: [u32; SWEEPS - CARRIED - 1],
    courses: u32,
}

fn driven_in(name: &str, count: u64, seed: u64, beams: usize) {
    let text = shipped::text(name).expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let mut world = World::new(scene, sensor, Air::default(), Options::default());
    world.options.max_range_m = Some(4.0);
    let atlas = match CoarseGrid::new(&world, CoarseGrid::default_spacing_m(&world.scene)) {
        Ok(atlas) => atlas,
        Err(error) => return println!("{name:24} {error}"),
    };
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut tally = Tally::default();
    for _ in 0..count {
        drive(&world, &atlas, beams, &mut rng, &mut tally);
    }
    let share =
        |of: u32, all: u32| format!("{:.1} %", 100.0 * f64::from(of) / f64::from(all.max(1)));
    let again = tally.again.map(|of| share(of, tally.courses)).join(", ");
    let Tally { sweeps, alone, course, .. } = tally;
    println!(
        "{name:24} {sweeps:>7} {:>7} {:>7}  {again}",
        share(alone, sweeps),
        share(course, sweeps)
    );
}

fn drive(world: &World, atlas: &CoarseGrid, beams: usize, rng: &mut Pcg64, tally: &mut Tally) {
    let Some(mut pose) = place(&world.scene, rng) else { return };
    let mut reported = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
    let mut course = Tracker::new(Odometry::default());
    let mut is_again = false;
    for at in 0..SWEEPS {
        if at == CARRIED {
            let Some(elsewhere) = place(&world.scene, rng) else { return };
            pose = elsewhere;
        } else if at > 0 {
            (pose, reported) = next(&world.scene, &pose, &reported, rng);
        }
        let Some(all) = readings(world, &pose, 0.0, rng) else { return };
        let every = (all.len() / beams).max(1);
        let sweep = FitSweep {
            scan: Uuid::nil(),
            pose: reported,
            beams: all.into_iter().step_by(every).collect(),
        };
        let right = equivalent_poses(world, &pose);
        let is_right = |modes: &[PoseMode]| {
            let found = modes.first();
            found.is_some_and(|mode| right.iter().any(|pose| is_there(mode, pose, beams)))
        };
        let by_course = is_right(&course.next(world, atlas, &sweep).unwrap_or_default());
        tally.sweeps += 1;
        tally.alone += u32::from(is_right(&locate(world, atlas, &sweep).unwrap_or_default()));
        tally.course += u32::from(by_course);
        if at >= CARRIED {
            is_again |= by_course;
            if let Some(of) = tally.again.get_mut(at - CARRIED) {
                *of += u32::from(is_again);
            }
        }
    }
    tally.courses += 1;
}

/// Drives at most half a metre, with odometry errors.
fn next(scene: &Scene, pose: &Pose, reported: &Pose, rng: &mut Pcg64) -> (Pose, Pose) {
    for _ in 0..100 {
        let (ahead_m, turn_deg) = (rng.random_range(0.1..LEG_M), rng.random_range(-90.0..90.0));
        let on = moved(pose, ahead_m, turn_deg);
        if scene.clearance_m(on.position()) > 0.2 && scene.check_pose(&on).is_ok() {
            let normal = |sigma: f64, rng: &mut Pcg64| -> f64 {
                let sample: f64 = StandardNormal.sample(rng);
                sigma * sample
            };
            let off_m = normal(0.05 * ahead_m, rng);
            let off_deg = normal(5.0 * ahead_m, rng);
            return (on, moved(reported, ahead_m + off_m, turn_deg + off_deg));
        }
    }
    (*pose, *reported)
}

/// Turns and drives ahead.
fn moved(pose: &Pose, ahead_m: f64, turn_deg: f64) -> Pose {
    let heading_deg = wrap_180(pose.heading_deg + turn_deg);
    let at = pose.position() + ahead_m * DVec2::from_angle(heading_deg.to_radians());
    Pose { x_m: at.x, y_m: at.y, heading_deg }
}

fn is_there(mode: &PoseMode, pose: &Pose, beams: usize) -> bool {
    let (most_m, most_deg) = if beams < 100 { (0.1, 5.0) } else { (0.02, 1.0) };
    DVec2::new(mode.x_m, mode.y_m).distance(pose.position()) < most_m
        && wrap_180(mode.heading_deg - pose.heading_deg).abs() < most_deg
}
