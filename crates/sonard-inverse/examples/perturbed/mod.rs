//! True worlds with the initial assumptions about them.

use std::{f64::consts::TAU, sync::Arc};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use sonard_inverse::{FitOptions, FitSweep, Parameter, Prior, Search, World};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::Options,
    scene::{Cylinder, Scene, shipped},
};
use uuid::Uuid;

use crate::{
    error_model::ERRORS,
    rooms::{place, readings},
};

/// Errors of the assumptions in addition to pose, air, threshold and a wall.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kinds {
    pub(crate) mounting: bool,
    pub(crate) furniture: bool,
    /// Restriction to scenes without a robot body, which multiplies the duration of a fit by 100.
    pub(crate) bodiless: bool,
    /// Search strategy of the fit.
    pub(crate) search: Option<Search>,
}

/// True world, assumed world, and a sweep.
pub(crate) struct PerturbedWorld {
    pub(crate) scene: &'static str,
    /// True world without the furniture.
    pub(crate) truth: World,
    pub(crate) assumed: World,
    /// Sweep with its true pose.
    pub(crate) true_sweep: FitSweep,
    /// Sweep without the furniture.
    pub(crate) unobstructed: FitSweep,
    /// Sweep with the assumed pose.
    pub(crate) assumed_sweep: FitSweep,
    pub(crate) fit: FitOptions,
    /// Change of each parameter from the assumed to the true world.
    pub(crate) expected: Vec<f64>,
}

/// Number of furniture cylinders missing in the scene (legs and bins), and their radii, metres.
const PIECES: usize = 5;
const RADII_M: (f64, f64) = (0.015, 0.2);

impl PerturbedWorld {
    pub(crate) fn random(seed: u64, kinds: Kinds) -> Option<Self> {
        let mut rng = Pcg64::seed_from_u64(seed);
        let names: Vec<&'static str> = shipped::names().collect();
        let name = names[rng.random_range(0..names.len())];
        let scene = Arc::new(Scene::from_json(shipped::text(name)?).ok()?);
        if kinds.bodiless && scene.robot.is_some() {
            return None;
        }
        let sensor = Sensor::preset("senscomp-6500").ok()?;
        let mut assumed = World::new(scene, sensor, Air::default(), Options::default());
        assumed.options.max_range_m = Some(4.0);
        let pose = place(&assumed.scene, &mut rng)?;
        let mut off = |max: f64| rng.random_range(-max..max);
        let (wall_m, shift, turn_deg) = (off(0.05), DVec2::new(off(0.1), off(0.1)), off(8.0));
        let (air_c, threshold_db) = (off(8.0), off(6.0));
        let wall = rng.random_range(0..assumed.scene.walls.len());
        let warmer = Air::new(20.0 + air_c, 50.0, 101.325).ok()?.sound_speed_m_s();
        let faster = warmer / assumed.air.sound_speed_m_s() - 1.0;
        // Changes from the assumed world to the truth, with the standard deviations of their
        // uniform distributions.
        let mut changes = vec![
            (Parameter::X(0), -shift.x, 0.058),
            (Parameter::Y(0), -shift.y, 0.058),
            (Parameter::Heading(0), -turn_deg, 4.6),
            (Parameter::SoundSpeed, faster, 0.008),
            (Parameter::Threshold, threshold_db, 3.5),
            (Parameter::Wall(wall), wall_m, 0.029),
        ];
        if kinds.mounting {
            let mut off = || rng.random_range(-0.03..0.03);
            changes.extend([(Parameter::Ahead, off(), 0.0173), (Parameter::Left, off(), 0.0173)]);
        }
        let by: Vec<_> = changes.iter().map(|(parameter, by, _)| (parameter, *by)).collect();
        let truth = assumed.changed(&by).ok()?;
        if truth.scene.check_pose(&pose).is_err() {
            return None;
        }
        let measured = match kinds.furniture {
            true => with_furniture(&truth, &pose, &mut Pcg64::seed_from_u64(!seed))?,
            false => truth.clone(),
        };
        let read = |world: &World, rng: &mut Pcg64| readings(world, &pose, ERRORS.sigma_db, rng);
        let unobstructed = read(&truth, &mut rng.clone())?;
        let beams = read(&measured, &mut rng)?;
        let true_sweep = FitSweep { scan: Uuid::nil(), pose, beams };
        let unobstructed = FitSweep { beams: unobstructed, ..true_sweep.clone() };
        let assumed_pose = Pose {
            x_m: pose.x_m + shift.x,
            y_m: pose.y_m + shift.y,
            heading_deg: pose.heading_deg + turn_deg,
        };
        let assumed_sweep = FitSweep { pose: assumed_pose, ..true_sweep.clone() };
        let expected = changes.iter().map(|(_, by, _)| *by).collect();
        let priors =
            changes.into_iter().map(|(parameter, _, sigma)| Prior { parameter, sigma }).collect();
        let fit = FitOptions {
            priors,
            initial_sigma_m: 0.15,
            max_turn_deg: 12.0,
            min_sigma_m: 2e-4,
            min_sigma_db: 0.1,
            search: kinds.search.unwrap_or(match kinds.furniture {
                true => Search::Furnished,
                false => Search::Thorough,
            }),
        };
        Some(Self {
            scene: name,
            truth,
            assumed,
            true_sweep,
            unobstructed,
            assumed_sweep,
            fit,
            expected,
        })
    }
}

/// World with furniture in view of the robot, 15 cm to 3 m away.
fn with_furniture(world: &World, pose: &Pose, rng: &mut Pcg64) -> Option<World> {
    let mut scene = Scene::clone(&world.scene);
    let material = *scene.materials.values().next()?;
    let at = pose.position();
    for number in 0..PIECES {
        let piece = (0..10_000).find_map(|_| {
            let (far_m, radius_m) =
                (rng.random_range(0.15..3.0), rng.random_range(RADII_M.0..RADII_M.1));
            let center = at + far_m * DVec2::from_angle(rng.random_range(0.0..TAU));
            let is_free = scene.clearance_m(center) > radius_m + 0.02 && far_m > radius_m + 0.15;
            let id = format!("furniture {number}").into();
            let is_visible =
                is_free && scene.walls.iter().all(|wall| !cross(at, center, wall.a, wall.b));
            is_visible.then_some(Cylinder { id, center, radius_m, material, z_m: None })
        })?;
        scene.cylinders.push(piece);
    }
    scene.check_pose(pose).ok()?;
    Some(World { scene: Arc::new(scene), ..world.clone() })
}

/// Checks the intersection of two segments.
fn cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let sides = |a: DVec2, b: DVec2, c: DVec2, d: DVec2| {
        (b - a).perp_dot(c - a) * (b - a).perp_dot(d - a) < 0.0
    };
    sides(a, b, c, d) && sides(c, d, a, b)
}
