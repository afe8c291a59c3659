//! Sampling of a scene and its poses by rejection.

mod furnish;
mod room;
mod scene_file;

use std::sync::Arc;

use rand::{Rng, RngExt as _};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use sonard_model::{
    acoustics::{Air, ReceiverNoise},
    geometry::{DVec2, Pose},
    scene::Scene,
};

use crate::{
    seed::{RandomStream, rng},
    spec::{LoadedSpec, SpecSceneKeys},
};

/// Numbers of rejected draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RejectedDraws {
    /// Scenes without room for furniture or poses, or with invalid walls.
    pub scenes: u64,
    /// Positions of furniture with a collision.
    pub furniture: u64,
    /// Poses in occupied space or too close to a surface.
    pub poses: u64,
    /// Poses with too many echo paths.
    pub costly: u64,
}

impl std::ops::AddAssign for RejectedDraws {
    fn add_assign(&mut self, more: Self) {
        self.scenes += more.scenes;
        self.furniture += more.furniture;
        self.poses += more.poses;
        self.costly += more.costly;
    }
}

/// Maximum number of draws of a scene; lower acceptance is a fault of the specification.
const MAX_SCENES: u32 = 200;
/// Maximum number of positions drawn per pose before the scene is rejected.
const MAX_POSITIONS_PER_POSE: usize = 200;

/// Sampled scene with poses, sensor, air and noise.
#[derive(Debug)]
pub(crate) struct SampledScene {
    /// Number of the scene in the set, from 1.
    pub(crate) number: u64,
    /// Index of the kind of scene in the specification.
    pub(crate) kind: usize,
    pub(crate) scene: Arc<Scene>,
    pub(crate) poses: Vec<Pose>,
    /// Index of the sensor in the specification.
    pub(crate) sensor: usize,
    /// Height of the transducer, metres.
    pub(crate) sensor_z_m: Option<f64>,
    pub(crate) air: Air,
    pub(crate) noise: ReceiverNoise,
    /// Generator for replacements of poses.
    pub(crate) rng: Pcg64,
    pub(crate) rejected_draws: RejectedDraws,
}

/// Reason for rejecting a draw.
#[derive(Debug)]
enum Rejection {
    Furniture,
    Scene,
    Poses,
}

impl Rejection {
    const fn message(&self) -> &'static str {
        match self {
            Self::Furniture => {
                "no free position for its furniture: use fewer or smaller pieces, or larger rooms"
            }
            Self::Scene => "its walls are not a valid scene: use larger rooms or smaller notches",
            Self::Poses => "no free space for a pose: use larger rooms, or less clearance of poses",
        }
    }
}

/// Samples the scene with this number, from 1.
///
/// # Errors
/// Returns the reason for rejection if no draw fits.
pub(crate) fn scene(loaded: &LoadedSpec, number: u64) -> Result<SampledScene, &'static str> {
    let mut rng = rng(&loaded.sha256, RandomStream::Scene(number));
    let mut redrawn = RejectedDraws::default();
    let mut last = Rejection::Scene;
    for _ in 0..MAX_SCENES {
        match attempt(loaded, &mut rng, &mut redrawn) {
            Ok((kind, scene, poses, sensor_z_m)) => {
                let sensor = rng.random_range(0..loaded.sensors.len());
                let (air, noise) = (air(loaded, &mut rng), noise(loaded, &mut rng));
                let scene = Arc::new(scene);
                return Ok(SampledScene {
                    number,
                    kind,
                    scene,
                    poses,
                    sensor,
                    sensor_z_m,
                    air,
                    noise,
                    rng,
                    rejected_draws: redrawn,
                });
            }
            Err(rejection) => {
                redrawn.scenes += 1;
                last = rejection;
            }
        }
    }
    Err(last.message())
}

/// Kind, scene, poses, and height of the transducer.
type Attempt = (usize, Scene, Vec<Pose>, Option<f64>);

fn attempt(
    loaded: &LoadedSpec,
    rng: &mut Pcg64,
    redrawn: &mut RejectedDraws,
) -> Result<Attempt, Rejection> {
    let spec = &loaded.spec;
    let kind = weighted(&spec.scene, rng);
    let keys = &spec.scene[kind];
    let of_file = keys.file.as_ref().and_then(|name| loaded.scenes.get(name));
    let scene = match of_file {
        Some(scene) => scene.clone(),
        None => {
            let outline = room::outline(keys, rng);
            let pieces = furnish::furnish(&outline, &spec.furniture, rng, redrawn)?;
            scene_file::scene(spec, keys, &outline, &pieces, rng)?
        }
    };
    let is_level = scene.floor_z_m.is_some() || scene.ceiling_z_m.is_some();
    let heights = spec.heights.as_ref().filter(|_| is_level);
    let sensor_z_m =
        heights.map(|heights| heights.sensor_m.draw(rng) + scene.floor_z_m.unwrap_or_default());
    let poses = poses(loaded, &scene, spec.set.poses as usize, rng, redrawn)?;
    Ok((kind, scene, poses, sensor_z_m))
}

/// Samples a replacement of a pose with too many paths; `None` if there is none.
pub(crate) fn replacement_pose(loaded: &LoadedSpec, drawn: &mut SampledScene) -> Option<Pose> {
    let scene = Arc::clone(&drawn.scene);
    poses(loaded, &scene, 1, &mut drawn.rng, &mut drawn.rejected_draws).ok()?.pop()
}

fn weighted(kinds: &[SpecSceneKeys], rng: &mut impl Rng) -> usize {
    let all: f64 = kinds.iter().map(|kind| kind.weight).sum();
    let mut left = all * rng.random::<f64>();
    for (index, kind) in kinds.iter().enumerate() {
        left -= kind.weight;
        if left < 0.0 {
            return index;
        }
    }
    // Reached only by rounding errors.
    kinds.iter().rposition(|kind| kind.weight > 0.0).unwrap_or_default()
}

/// Samples poses in free space with the required clearance.
fn poses(
    loaded: &LoadedSpec,
    scene: &Scene,
    count: usize,
    rng: &mut Pcg64,
    redrawn: &mut RejectedDraws,
) -> Result<Vec<Pose>, Rejection> {
    let keys = &loaded.spec.poses;
    let walls = scene.walls.iter().map(|wall| (wall.a.min(wall.b), wall.a.max(wall.b)));
    let cylinders = scene.cylinders.iter().map(|cylinder| {
        // Around a cylinder without walls, poses are within one metre.
        let reach = DVec2::splat(cylinder.radius_m + 1.0);
        (cylinder.center - reach, cylinder.center + reach)
    });
    let extent = walls.chain(cylinders).reduce(|all, part| (all.0.min(part.0), all.1.max(part.1)));
    let (low, high) = extent.ok_or(Rejection::Poses)?;
    let mut poses = Vec::with_capacity(count);
    let mut tried = 0;
    while poses.len() < count {
        if tried >= MAX_POSITIONS_PER_POSE * count {
            return Err(Rejection::Poses);
        }
        let positions: Vec<Pose> = (poses.len()..count)
            .map(|_| {
                let share = DVec2::new(rng.random(), rng.random());
                let at = low + share * (high - low);
                Pose { x_m: at.x, y_m: at.y, heading_deg: keys.heading_deg.draw(rng) }
            })
            .collect();
        tried += positions.len();
        let is_free =
            scene.are_accessible(&positions.iter().map(Pose::position).collect::<Vec<_>>());
        let before = poses.len();
        poses.extend(positions.iter().zip(is_free).filter_map(|(pose, is_free)| {
            let is_clear = scene.clearance_m(pose.position()) >= keys.clearance_m;
            (is_free && is_clear).then_some(*pose)
        }));
        redrawn.poses += (positions.len() - (poses.len() - before)) as u64;
    }
    Ok(poses)
}

fn air(loaded: &LoadedSpec, rng: &mut Pcg64) -> Air {
    let keys = &loaded.spec.air;
    let drawn = Air::new(
        keys.temperature_c.draw(rng),
        keys.humidity_percent.draw(rng),
        keys.pressure_kpa.draw(rng),
    );
    // Validation guarantees that the distributions are within the validity of the model.
    drawn.unwrap_or_default()
}

fn noise(loaded: &LoadedSpec, rng: &mut Pcg64) -> ReceiverNoise {
    let keys = &loaded.spec.noise;
    ReceiverNoise { floor: keys.floor.draw(rng), jitter_us: keys.jitter_us.draw(rng) }
}
