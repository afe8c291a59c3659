//! What a ranger would read at every place of a scene, for finding a sweep's pose without a guess.

use std::sync::OnceLock;

use rayon::prelude::*;
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};
use thiserror::Error;

use crate::{
    fit::Prior,
    sweep::{Outcome, Sweep},
    watch::{Unwatched, Watch},
    world::{Models, World, WorldError},
};

/// Directions of the readings at each place, 3 degrees apart.
pub(crate) const DIRECTIONS: usize = 120;
/// What stands for silence among ranges: far from every echo.
const SILENCE_M: f32 = 1e3;
/// Spread of ranges between places of the grid, as a share of their spacing.
const SPREAD: f32 = 0.5;
/// A reading that does not fit costs as much as one this many spreads off.
const MOST_SPREADS: f32 = 3.0;
/// More places than this are not predicted at: the grid is made coarser.
const MOST_PLACES: f64 = 40_000.0;
/// As many places are cheap enough for a finer grid than usual.
const FEW_PLACES: f64 = 4_000.0;
/// The usual spacing of places, metres: of small scenes and of others. Near a wall, where its echo falls into the
/// blanking, what is read is another thing some centimetres on.
const USUAL_SPACING_M: (f64, f64) = (0.05, 0.1);
/// Matches are no nearer to each other, metres.
const APART_M: f64 = 0.2;
/// Room beside the outermost wall of a scene without a closed room, metres.
const BESIDE_M: f64 = 1.0;

/// The readings that a world has on a grid of places.
#[derive(Clone)]
pub struct Atlas {
    spacing_m: f64,
    /// Where a robot is usually: with something in most directions, or wherever it can stand.
    usual: Region,
    /// Where a ranger can stand besides, and what it would read there, once it is wanted.
    beside: Vec<DVec2>,
    beside_m: OnceLock<Vec<f32>>,
    /// By which they are predicted, with the transducer on the axis.
    models: Models,
    /// What ranges there lack, metres.
    shift_m: f64,
    /// What is fitted to each sweep besides its pose.
    pub(crate) besides: Vec<Prior>,
}

/// Places, and what would be read there.
#[derive(Clone)]
struct Region {
    places: Vec<DVec2>,
    /// [`DIRECTIONS`] ranges a place, counter-clockwise from +x, metres.
    ranges_m: Vec<f32>,
}

/// Why there is no atlas of a world.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum AtlasError {
    /// There is nothing to predict with.
    #[error(transparent)]
    World(#[from] WorldError),
    /// No place to stand.
    #[error("there is no place in the scene where a ranger could stand")]
    NoPlace,
    /// Whoever watches it wants it no longer.
    #[error("stopped on request")]
    Stopped,
}

/// A pose that a sweep may have been taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Match {
    pub(crate) pose: Pose,
    /// Less is better.
    pub(crate) cost: f32,
}

impl Atlas {
    /// Predicts on a grid with places so far apart, metres: wherever a ranger can stand with something in most
    /// directions, or in a scene without such places, wherever it can stand up to a metre beside it.
    ///
    /// # Errors
    /// When the world can't be predicted in, or has no room.
    pub fn new(world: &World, spacing_m: f64) -> Result<Self, AtlasError> {
        Self::watched(world, spacing_m, &Unwatched)
    }

    /// The same, until `watch` stops it.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`AtlasError::Stopped`].
    pub fn watched(world: &World, spacing_m: f64, watch: &dyn Watch) -> Result<Self, AtlasError> {
        let (places, spacing_m) = standing_places(&world.scene, spacing_m);
        if places.is_empty() {
            return Err(AtlasError::NoPlace);
        }
        let is_usual = |place: &DVec2| is_surrounded(&world.scene, *place);
        let (mut usual, mut beside): (Vec<_>, Vec<_>) = places.into_iter().partition(is_usual);
        if usual.is_empty() {
            std::mem::swap(&mut usual, &mut beside);
        }
        let alone = World { scene: without_robot(&world.scene), ..world.with_face_on_axis() };
        // What is met ahead is nearer to a face before the axis.
        let nearer_m = world.sensor.mounting.ahead_m;
        let shift_m = world.delay_m - nearer_m;
        let models = Models::of(&alone)?;
        let ranges_m = readings(&models, shift_m, &usual, watch)?;
        let usual = Region { places: usual, ranges_m };
        let (beside_m, besides) = (OnceLock::new(), Vec::new());
        Ok(Self { spacing_m, usual, beside, beside_m, models, shift_m, besides })
    }

    /// The same for sweeps to each of which more than its pose is to be fitted: the threshold of a ranger that is not the
    /// one that was calibrated. What is of single sweeps among the priors is left out.
    #[must_use]
    pub fn fitting(mut self, mut priors: Vec<Prior>) -> Self {
        priors.retain(|prior| prior.parameter.sweep().is_none());
        self.besides = priors;
        self
    }

    /// The spacing that suits a scene, metres: the finer, the smaller it is.
    #[must_use]
    pub fn usual_spacing_m(scene: &Scene) -> f64 {
        let (least_m, most_m) = USUAL_SPACING_M;
        extent(scene).map_or(most_m, |(low, high)| {
            let size = high - low;
            (size.x * size.y / FEW_PLACES).sqrt().clamp(least_m, most_m)
        })
    }

    /// Distance of neighbouring places, metres.
    #[must_use]
    pub const fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// How many places there are where a robot usually is.
    #[must_use]
    pub const fn places(&self) -> usize {
        self.usual.places.len()
    }

    /// Where a robot usually is, square metres.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        self.places() as f64 * self.spacing_m.powi(2)
    }

    /// Models of a world that may be the one predicted with.
    pub(crate) fn models(&self, world: &World) -> Result<Models, WorldError> {
        self.models.changed_to(&world.with_face_on_axis())
    }

    /// The poses that a sweep fits best, best first, none near a better one: where a robot usually is.
    pub(crate) fn matches(&self, world: &World, sweep: &Sweep, count: usize) -> Vec<Match> {
        let Region { places, ranges_m } = &self.usual;
        self.matches_of(places, ranges_m, world, sweep, count)
    }

    /// The same for all other places. What would be read there is predicted the first time.
    pub(crate) fn matches_beside(
        &self,
        world: &World,
        sweep: &Sweep,
        count: usize,
        watch: &dyn Watch,
    ) -> Result<Vec<Match>, AtlasError> {
        let ranges_m = match self.beside_m.get() {
            Some(known) => known,
            None => {
                let found = readings(&self.models, self.shift_m, &self.beside, watch)?;
                self.beside_m.get_or_init(|| found)
            }
        };
        Ok(self.matches_of(&self.beside, ranges_m, world, sweep, count))
    }

    fn matches_of(
        &self,
        places: &[DVec2],
        ranges_m: &[f32],
        world: &World,
        sweep: &Sweep,
        count: usize,
    ) -> Vec<Match> {
        let heard = resampled(world, sweep);
        if heard.is_empty() {
            return Vec::new();
        }
        let spread_m = SPREAD * self.spacing_m as f32;
        let mut all: Vec<(f32, usize, usize)> = ranges_m
            .par_chunks_exact(DIRECTIONS)
            .enumerate()
            .flat_map_iter(|(place, ranges_m)| {
                best_turns(&heard, ranges_m, spread_m).map(move |(cost, turn)| (cost, place, turn))
            })
            .collect();
        all.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut found: Vec<Match> = Vec::new();
        for (cost, place, turn) in all {
            let heading_deg = 360.0 * turn as f64 / DIRECTIONS as f64;
            let [x_m, y_m] = places[place].to_array();
            let pose = Pose { x_m, y_m, heading_deg };
            let apart_m = APART_M.max(2.0 * self.spacing_m);
            if found.iter().all(|known| is_apart(&known.pose, &pose, apart_m)) {
                found.push(Match { pose, cost });
            }
            if found.len() == count {
                break;
            }
        }
        found
    }
}

/// What would be read at each of some places.
fn readings(
    models: &Models,
    shift_m: f64,
    places: &[DVec2],
    watch: &dyn Watch,
) -> Result<Vec<f32>, AtlasError> {
    let shown = |range_m: Option<f64>| range_m.map_or(SILENCE_M, |far_m| (far_m + shift_m) as f32);
    let mut ranges_m = vec![SILENCE_M; DIRECTIONS * places.len()];
    let predict = |(ranges_m, place): (&mut [f32], &DVec2)| {
        if watch.stops() {
            return Err(AtlasError::Stopped);
        }
        let pose = Pose { x_m: place.x, y_m: place.y, heading_deg: 0.0 };
        models.at(&pose, |_, point| {
            for (direction, known_m) in ranges_m.iter_mut().enumerate() {
                let direction_rad = std::f64::consts::TAU * direction as f64 / DIRECTIONS as f64;
                *known_m = shown(point.ping(direction_rad)?.range_m);
            }
            Ok(())
        })?;
        Ok(())
    };
    ranges_m.par_chunks_exact_mut(DIRECTIONS).zip(places).try_for_each(predict)?;
    Ok(ranges_m)
}

/// Whether two poses are farther apart than that, or look elsewhere.
pub(crate) fn is_apart(one: &Pose, other: &Pose, distance_m: f64) -> bool {
    let turn_deg = sonard_model::geometry::wrap_180(one.heading_deg - other.heading_deg).abs();
    one.position().distance(other.position()) > distance_m || turn_deg > 9.0
}

fn without_robot(scene: &std::sync::Arc<Scene>) -> std::sync::Arc<Scene> {
    match scene.robot {
        None => std::sync::Arc::clone(scene),
        // Its own body hides little, and would have to be turned with it.
        Some(_) => std::sync::Arc::new(Scene { robot: None, ..Scene::clone(scene) }),
    }
}

/// The sweep's reading that looked nearest to each direction of the atlas, as places in it with ranges; a direction
/// that none looked near is left out, as is what has no range because it was too near.
fn resampled(world: &World, sweep: &Sweep) -> Vec<(usize, f32)> {
    let step_deg = 360.0 / DIRECTIONS as f64;
    let mut nearest: Vec<Option<(f64, f32)>> = vec![None; DIRECTIONS];
    let sound_speed_m_s = world.air.sound_speed_m_s();
    for beam in &sweep.beams {
        let azimuth_deg =
            (world.heading_zero_deg + world.gear * beam.azimuth_deg).rem_euclid(360.0);
        let place = azimuth_deg / step_deg;
        let off = (place - place.round()).abs();
        let range_m = match beam.heard.outcome(sound_speed_m_s) {
            Outcome::Echo { range_m } => range_m as f32,
            Outcome::Silence => SILENCE_M,
            Outcome::Near => continue,
        };
        let slot = &mut nearest[place.round() as usize % DIRECTIONS];
        if slot.is_none_or(|known| off < known.0) {
            *slot = Some((off, range_m));
        }
    }
    let of = |(at, known): (usize, Option<(f64, f32)>)| known.map(|(_, range_m)| (at, range_m));
    nearest.into_iter().enumerate().filter_map(of).collect()
}

/// The turns of the heard ranges that fit those of a place best: local minima, at most four.
fn best_turns(
    heard: &[(usize, f32)],
    ranges_m: &[f32],
    spread_m: f32,
) -> impl Iterator<Item = (f32, usize)> + use<> {
    // Twice over, so that no index has to be wrapped.
    let twice: Vec<f32> = ranges_m.iter().chain(ranges_m).copied().collect();
    let scale = 0.5 / (spread_m * spread_m);
    let most = 0.5 * MOST_SPREADS * MOST_SPREADS;
    let cost = |turn: usize| -> f32 {
        let of = |&(at, range_m): &(usize, f32)| {
            let off_m = twice[at + turn] - range_m;
            (scale * off_m * off_m).min(most)
        };
        heard.iter().map(of).sum()
    };
    let costs: Vec<f32> = (0..DIRECTIONS).map(cost).collect();
    let is_least = |&turn: &usize| {
        let [before, after] =
            [turn + DIRECTIONS - 1, turn + 1].map(|beside| costs[beside % DIRECTIONS]);
        costs[turn] <= before && costs[turn] < after
    };
    let mut least: Vec<(f32, usize)> =
        (0..DIRECTIONS).filter(is_least).map(|turn| (costs[turn], turn)).collect();
    least.sort_by(|one, other| one.0.total_cmp(&other.0));
    least.truncate(4);
    least.into_iter()
}

/// The rectangle about what is in a scene, with room beside it.
fn extent(scene: &Scene) -> Option<(DVec2, DVec2)> {
    let ends = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let round = scene.cylinders.iter().map(|cylinder| cylinder.center);
    let named = scene.poses.values().map(Pose::position);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for point in ends.chain(round).chain(named) {
        (low, high) = (low.min(point), high.max(point));
    }
    low.is_finite().then_some((low - BESIDE_M, high + BESIDE_M))
}

/// A grid of places where a ranger can stand, and its spacing.
fn standing_places(scene: &Scene, spacing_m: f64) -> (Vec<DVec2>, f64) {
    let Some((low, high)) = extent(scene) else { return (Vec::new(), spacing_m) };
    let size = high - low;
    let spacing_m = spacing_m.max((size.x * size.y / MOST_PLACES).sqrt());
    let [columns, rows] = (size / spacing_m).to_array().map(|count| count.ceil() as u32 + 1);
    let all: Vec<DVec2> = (0..rows)
        .flat_map(|y| (0..columns).map(move |x| DVec2::new(f64::from(x), f64::from(y))))
        .map(|cell| low + spacing_m * cell)
        .collect();
    let stands = scene.can_stand(&all);
    let places = all.into_iter().zip(stands).filter(|(_, stands)| *stands);
    (places.map(|(place, _)| place).collect(), spacing_m)
}

/// Whether there is something in most directions.
fn is_surrounded(scene: &Scene, place: DVec2) -> bool {
    const RAYS: u32 = 24;
    let meets = |ray: u32| {
        let along = DVec2::from_angle(std::f64::consts::TAU * f64::from(ray) / f64::from(RAYS));
        let wall = scene.walls.iter().any(|wall| {
            let (a, b) = (wall.a - place, wall.b - place);
            let [side_a, side_b] = [along.perp_dot(a), along.perp_dot(b)];
            // Where it crosses the ray's line it is ahead.
            side_a * side_b <= 0.0 && a.perp_dot(b) * (side_b - side_a) > 0.0
        });
        wall || scene.cylinders.iter().any(|cylinder| {
            let to = cylinder.center - place;
            along.dot(to) > 0.0 && along.perp_dot(to).abs() < cylinder.radius_m
        })
    };
    4 * (0..RAYS).filter(|ray| meets(*ray)).count() >= 3 * RAYS as usize
}

#[cfg(test)]
mod tests {
    use sonard_model::scene::Scene;

    use super::*;

    #[test]
    fn a_place_is_surrounded_within_walls_and_not_beside_them() {
        let room = Scene::builder("room").material("m", 1.0);
        // A corner is open, so that nothing says it is a room.
        let room = room
            .walls("w", &[[0.2, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0], [0.0, 0.2]], "m")
            .build()
            .expect("a scene");
        for (place, expected) in
            [([1.0, 1.0], true), ([2.9, 1.9], true), ([-0.5, 1.0], false), ([1.5, 3.0], false)]
        {
            assert_eq!(is_surrounded(&room, place.into()), expected, "{place:?}");
        }
        let (places, spacing_m) = standing_places(&room, 0.1);
        let places: Vec<DVec2> =
            places.into_iter().filter(|place| is_surrounded(&room, *place)).collect();
        assert!(places.iter().all(|place| place.cmpge(DVec2::ZERO).all()), "some are outside");
        assert!(
            (places.len() as f64 * spacing_m * spacing_m - 6.0).abs() < 0.6,
            "{}",
            places.len()
        );
        // Beside a single wall nothing is, so all places count.
        let wall =
            Scene::builder("wall").material("m", 1.0).walls("w", &[[0.0, 0.0], [1.0, 0.0]], "m");
        let (places, _) = standing_places(&wall.build().expect("a scene"), 0.1);
        assert!(places.len() > 400, "{}", places.len());
    }
}
