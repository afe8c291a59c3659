//! Worlds beside what is believed of them.

use std::{f64::consts::TAU, sync::Arc};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use sonard_inverse::{Fit, Parameter, Prior, Search, Sweep, World};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::Options,
    scene::{Cylinder, Scene, shipped},
};
use uuid::Uuid;

use crate::{
    rooms::{place, readings},
    spread::SPREAD,
};

/// What may be wrong besides pose, air, threshold and a wall.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kinds {
    pub(crate) mounting: bool,
    pub(crate) furniture: bool,
    /// Only scenes without a robot's body, beside which a fit takes a hundred times as long.
    pub(crate) bodiless: bool,
    /// How parameters are looked for, whatever is wrong.
    pub(crate) search: Option<Search>,
}

/// A world, what is believed of it, and a sweep in it.
pub(crate) struct Wrong {
    pub(crate) scene: &'static str,
    /// Without the furniture.
    pub(crate) truth: World,
    pub(crate) believed: World,
    /// The sweep with its pose.
    pub(crate) there: Sweep,
    /// As it would be read without the furniture.
    pub(crate) unhindered: Sweep,
    /// The sweep with what is believed of its pose.
    pub(crate) here: Sweep,
    pub(crate) fit: Fit,
    /// By parameter, what leads from what is believed to the truth.
    pub(crate) expected: Vec<f64>,
}

/// Pieces of furniture that the scene lacks: legs and bins of these radii, metres.
const PIECES: usize = 5;
const RADII_M: (f64, f64) = (0.015, 0.2);

impl Wrong {
    pub(crate) fn drawn(seed: u64, kinds: Kinds) -> Option<Self> {
        let mut rng = Pcg64::seed_from_u64(seed);
        let names: Vec<&'static str> = shipped::names().collect();
        let name = names[rng.random_range(0..names.len())];
        let scene = Arc::new(Scene::from_json(shipped::text(name)?).ok()?);
        if kinds.bodiless && scene.robot.is_some() {
            return None;
        }
        let sensor = Sensor::preset("senscomp-6500").ok()?;
        let mut believed = World::new(scene, sensor, Air::default(), Options::default());
        believed.options.max_range_m = Some(4.0);
        let pose = place(&believed.scene, &mut rng)?;
        let mut off = |most: f64| rng.random_range(-most..most);
        let (wall_m, shift, turn_deg) = (off(0.05), DVec2::new(off(0.1), off(0.1)), off(8.0));
        let (air_c, threshold_db) = (off(8.0), off(6.0));
        let wall = rng.random_range(0..believed.scene.walls.len());
        let warmer = Air::new(20.0 + air_c, 50.0, 101.325).ok()?.sound_speed_m_s();
        let faster = warmer / believed.air.sound_speed_m_s() - 1.0;
        // From what is believed to the truth, with the standard deviation of a uniform distribution so wide.
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
        let truth = believed.changed(&by).ok()?;
        if truth.scene.check_pose(&pose).is_err() {
            return None;
        }
        let measured = match kinds.furniture {
            true => furnished(&truth, &pose, &mut Pcg64::seed_from_u64(!seed))?,
            false => truth.clone(),
        };
        let read = |world: &World, rng: &mut Pcg64| readings(world, &pose, SPREAD.sigma_db, rng);
        let unhindered = read(&truth, &mut rng.clone())?;
        let beams = read(&measured, &mut rng)?;
        let there = Sweep { scan: Uuid::nil(), pose, beams };
        let unhindered = Sweep { beams: unhindered, ..there.clone() };
        let said = Pose {
            x_m: pose.x_m + shift.x,
            y_m: pose.y_m + shift.y,
            heading_deg: pose.heading_deg + turn_deg,
        };
        let here = Sweep { pose: said, ..there.clone() };
        let expected = changes.iter().map(|(_, by, _)| *by).collect();
        let priors =
            changes.into_iter().map(|(parameter, _, sigma)| Prior { parameter, sigma }).collect();
        let fit = Fit {
            priors,
            widest_m: 0.15,
            widest_turn_deg: 12.0,
            least_sigma_m: 2e-4,
            least_sigma_db: 0.1,
            search: kinds.search.unwrap_or(match kinds.furniture {
                true => Search::Furnished,
                false => Search::Thorough,
            }),
        };
        Some(Self { scene: name, truth, believed, there, unhindered, here, fit, expected })
    }
}

/// The same world with furniture that the robot is in sight of, within 3 m and no nearer than 15 cm.
fn furnished(world: &World, pose: &Pose, rng: &mut Pcg64) -> Option<World> {
    let mut scene = Scene::clone(&world.scene);
    let material = *scene.materials.values().next()?;
    let at = pose.position();
    for number in 0..PIECES {
        let piece = (0..10_000).find_map(|_| {
            let (far_m, radius_m) =
                (rng.random_range(0.15..3.0), rng.random_range(RADII_M.0..RADII_M.1));
            let center = at + far_m * DVec2::from_angle(rng.random_range(0.0..TAU));
            let stands = scene.clearance_m(center) > radius_m + 0.02 && far_m > radius_m + 0.15;
            let id = format!("furniture {number}").into();
            let is_seen =
                stands && scene.walls.iter().all(|wall| !cross(at, center, wall.a, wall.b));
            is_seen.then_some(Cylinder { id, center, radius_m, material, z_m: None })
        })?;
        scene.cylinders.push(piece);
    }
    scene.check_pose(pose).ok()?;
    Some(World { scene: Arc::new(scene), ..world.clone() })
}

/// Whether two stretches cross each other.
fn cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let sides = |a: DVec2, b: DVec2, c: DVec2, d: DVec2| {
        (b - a).perp_dot(c - a) * (b - a).perp_dot(d - a) < 0.0
    };
    sides(a, b, c, d) && sides(c, d, a, b)
}
