//! A scene and the poses in it, drawn until they fit.

mod furnish;
mod room;
mod write;

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
    seed::{Of, rng},
    spec::{Loaded, SceneKeys},
};

/// What was drawn again because it did not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Redrawn {
    /// Scenes that no furniture or no pose found room in, or that were none.
    pub scenes: u64,
    /// Places of furniture that something was in the way at.
    pub furniture: u64,
    /// Poses where nothing could stand.
    pub poses: u64,
    /// Poses with more echo paths than can be found.
    pub costly: u64,
}

impl std::ops::AddAssign for Redrawn {
    fn add_assign(&mut self, more: Self) {
        self.scenes += more.scenes;
        self.furniture += more.furniture;
        self.poses += more.poses;
        self.costly += more.costly;
    }
}

/// A scene is drawn again at most so often: whatever fits more seldom is a fault of the specification.
const MOST_SCENES: u32 = 200;
/// For each pose so many places are tried at most before the scene is drawn again.
const PLACES_A_POSE: usize = 200;

/// A scene with all that is drawn for it.
#[derive(Debug)]
pub(crate) struct Drawn {
    /// Its number in the set, from 1.
    pub(crate) number: u64,
    /// Its kind, an index into the specification's.
    pub(crate) kind: usize,
    pub(crate) scene: Arc<Scene>,
    pub(crate) poses: Vec<Pose>,
    /// An index into the specification's sensors.
    pub(crate) sensor: usize,
    /// Height of the transducer, metres.
    pub(crate) sensor_z_m: Option<f64>,
    pub(crate) air: Air,
    pub(crate) noise: ReceiverNoise,
    /// What goes on being drawn for this scene: poses in place of others.
    pub(crate) rng: Pcg64,
    pub(crate) redrawn: Redrawn,
}

/// Why a drawing is not taken.
#[derive(Debug)]
enum Unfit {
    Furniture,
    Scene,
    Poses,
}

impl Unfit {
    const fn in_words(&self) -> &'static str {
        match self {
            Self::Furniture => {
                "its furniture finds no place: draw fewer or smaller pieces, or larger rooms"
            }
            Self::Scene => "its walls make no scene: draw larger rooms or smaller notches",
            Self::Poses => {
                "nothing can stand in it: draw larger rooms, or give poses less clearance"
            }
        }
    }
}

/// The scene of a number, from 1.
///
/// # Errors
/// In words why none fits.
pub(crate) fn scene(loaded: &Loaded, number: u64) -> Result<Drawn, &'static str> {
    let mut rng = rng(&loaded.sha256, Of::Scene(number));
    let mut redrawn = Redrawn::default();
    let mut last = Unfit::Scene;
    for _ in 0..MOST_SCENES {
        match attempt(loaded, &mut rng, &mut redrawn) {
            Ok((kind, scene, poses, sensor_z_m)) => {
                let sensor = rng.random_range(0..loaded.sensors.len());
                let (air, noise) = (air(loaded, &mut rng), noise(loaded, &mut rng));
                let scene = Arc::new(scene);
                return Ok(Drawn {
                    number,
                    kind,
                    scene,
                    poses,
                    sensor,
                    sensor_z_m,
                    air,
                    noise,
                    rng,
                    redrawn,
                });
            }
            Err(unfit) => {
                redrawn.scenes += 1;
                last = unfit;
            }
        }
    }
    Err(last.in_words())
}

/// Kind, scene, poses, and the transducer's height.
type Attempt = (usize, Scene, Vec<Pose>, Option<f64>);

fn attempt(loaded: &Loaded, rng: &mut Pcg64, redrawn: &mut Redrawn) -> Result<Attempt, Unfit> {
    let spec = &loaded.spec;
    let kind = weighted(&spec.scene, rng);
    let keys = &spec.scene[kind];
    let of_file = keys.file.as_ref().and_then(|name| loaded.scenes.get(name));
    let scene = match of_file {
        Some(scene) => scene.clone(),
        None => {
            let outline = room::outline(keys, rng);
            let pieces = furnish::furnish(&outline, &spec.furniture, rng, redrawn)?;
            write::scene(spec, keys, &outline, &pieces, rng)?
        }
    };
    let is_level = scene.floor_z_m.is_some() || scene.ceiling_z_m.is_some();
    let heights = spec.heights.as_ref().filter(|_| is_level);
    let sensor_z_m =
        heights.map(|heights| heights.sensor_m.draw(rng) + scene.floor_z_m.unwrap_or_default());
    let poses = poses(loaded, &scene, spec.set.poses as usize, rng, redrawn)?;
    Ok((kind, scene, poses, sensor_z_m))
}

/// Another pose in a scene, in place of one that had too many paths; `None` if none is found.
pub(crate) fn another_pose(loaded: &Loaded, drawn: &mut Drawn) -> Option<Pose> {
    let scene = Arc::clone(&drawn.scene);
    poses(loaded, &scene, 1, &mut drawn.rng, &mut drawn.redrawn).ok()?.pop()
}

fn weighted(kinds: &[SceneKeys], rng: &mut impl Rng) -> usize {
    let all: f64 = kinds.iter().map(|kind| kind.weight).sum();
    let mut left = all * rng.random::<f64>();
    for (index, kind) in kinds.iter().enumerate() {
        left -= kind.weight;
        if left < 0.0 {
            return index;
        }
    }
    // By rounding alone.
    kinds.iter().rposition(|kind| kind.weight > 0.0).unwrap_or_default()
}

/// Poses where a ranger can stand and nothing is near.
fn poses(
    loaded: &Loaded,
    scene: &Scene,
    count: usize,
    rng: &mut Pcg64,
    redrawn: &mut Redrawn,
) -> Result<Vec<Pose>, Unfit> {
    let keys = &loaded.spec.poses;
    let walls = scene.walls.iter().map(|wall| (wall.a.min(wall.b), wall.a.max(wall.b)));
    let round = scene.cylinders.iter().map(|cylinder| {
        // Where there are no walls, a ranger stands round about.
        let reach = DVec2::splat(cylinder.radius_m + 1.0);
        (cylinder.center - reach, cylinder.center + reach)
    });
    let extent = walls.chain(round).reduce(|all, one| (all.0.min(one.0), all.1.max(one.1)));
    let (low, high) = extent.ok_or(Unfit::Poses)?;
    let mut poses = Vec::with_capacity(count);
    let mut tried = 0;
    while poses.len() < count {
        if tried >= PLACES_A_POSE * count {
            return Err(Unfit::Poses);
        }
        let places: Vec<Pose> = (poses.len()..count)
            .map(|_| {
                let share = DVec2::new(rng.random(), rng.random());
                let at = low + share * (high - low);
                Pose { x_m: at.x, y_m: at.y, heading_deg: keys.heading_deg.draw(rng) }
            })
            .collect();
        tried += places.len();
        let stands = scene.can_stand(&places.iter().map(Pose::position).collect::<Vec<_>>());
        let before = poses.len();
        poses.extend(places.iter().zip(stands).filter_map(|(pose, stands)| {
            let is_clear = scene.clearance_m(pose.position()) >= keys.clearance_m;
            (stands && is_clear).then_some(*pose)
        }));
        redrawn.poses += (places.len() - (poses.len() - before)) as u64;
    }
    Ok(poses)
}

fn air(loaded: &Loaded, rng: &mut Pcg64) -> Air {
    let keys = &loaded.spec.air;
    let drawn = Air::new(
        keys.temperature_c.draw(rng),
        keys.humidity_percent.draw(rng),
        keys.pressure_kpa.draw(rng),
    );
    // The distributions were checked to be within what air can be.
    drawn.unwrap_or_default()
}

fn noise(loaded: &Loaded, rng: &mut Pcg64) -> ReceiverNoise {
    let keys = &loaded.spec.noise;
    ReceiverNoise { floor: keys.floor.draw(rng), jitter_us: keys.jitter_us.draw(rng) }
}
