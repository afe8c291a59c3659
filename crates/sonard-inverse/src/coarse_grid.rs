//! Coarse grid of predicted readings over a scene, for global localization without an initial
//! guess.

use std::sync::OnceLock;

use rayon::prelude::*;
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};
use thiserror::Error;

use crate::{
    fit::Prior,
    progress::{FitObserver, NoObserver},
    sweep::{FitSweep, RangeOutcome},
    world::{SimulatorSet, World, WorldError},
};

/// Number of directions at each grid point, 3 degrees apart.
pub(crate) const DIRECTIONS: usize = 120;
/// Range that represents no echo, metres: far from every echo.
const SILENCE_M: f32 = 1e3;
/// Standard deviation of ranges between grid points, relative to the spacing.
const SPREAD: f32 = 0.5;
/// Cap on the residual of a reading, in standard deviations.
const MAX_SPREADS: f32 = 3.0;
/// Maximum number of grid points; beyond it the grid is made coarser.
const MAX_PLACES: f64 = 40_000.0;
/// Number of grid points that is cheap enough for a finer grid than the default.
const FEW_PLACES: f64 = 4_000.0;
/// Default spacing for small scenes and for others, metres. Near a wall, where its echo falls into
/// the blanking interval, readings change within centimetres.
const USUAL_SPACING_M: (f64, f64) = (0.05, 0.1);
/// Minimum distance between matches, metres.
const APART_M: f64 = 0.2;
/// Margin outside the outermost wall of a scene without a closed room, metres.
pub(crate) const MARGIN_M: f64 = 1.0;

/// Predicted readings of a world on a grid of positions.
#[derive(Clone)]
pub struct CoarseGrid {
    spacing_m: f64,
    /// Likely positions: surrounded by walls, or all free ones if there are none.
    usual: GridRegion,
    /// Other free positions; their readings are predicted on demand.
    outside: Vec<DVec2>,
    outside_m: OnceLock<Vec<f32>>,
    /// Simulators of the world with the transducer on the axis.
    models: SimulatorSet,
    /// Correction of predicted ranges for delay and mounting, metres.
    shift_m: f64,
    /// Nuisance parameters fitted together with the pose of each sweep.
    pub(crate) besides: Vec<Prior>,
}

/// Positions with their predicted readings.
#[derive(Clone)]
struct GridRegion {
    places: Vec<DVec2>,
    /// [`DIRECTIONS`] ranges per position, counter-clockwise from +x, metres.
    ranges_m: Vec<f32>,
}

/// Failure to build a grid.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CoarseGridError {
    /// Invalid sensor, options or poses.
    #[error(transparent)]
    World(#[from] WorldError),
    /// No free position in the scene.
    #[error("the scene has no free position for a ranger")]
    NoPlace,
    /// Cancelled by the observer.
    #[error("stopped on request")]
    Stopped,
}

/// Candidate pose of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseMatch {
    pub(crate) pose: Pose,
    /// Robust cost; less is better.
    pub(crate) cost: f32,
}

impl CoarseGrid {
    /// Predicts readings on a grid of the given spacing, metres: at free positions surrounded by
    /// walls, or in a scene without such positions, at all free ones up to a metre outside.
    ///
    /// # Errors
    /// Invalid world, or a scene without free position.
    pub fn new(world: &World, spacing_m: f64) -> Result<Self, CoarseGridError> {
        Self::observed(world, spacing_m, &NoObserver)
    }

    /// Predicts like [`new`](Self::new), with cancellation by `watch`.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`CoarseGridError::Stopped`].
    pub fn observed(
        world: &World,
        spacing_m: f64,
        watch: &dyn FitObserver,
    ) -> Result<Self, CoarseGridError> {
        let (places, spacing_m) = free_positions(&world.scene, spacing_m);
        if places.is_empty() {
            return Err(CoarseGridError::NoPlace);
        }
        let is_usual = |place: &DVec2| is_surrounded(&world.scene, *place);
        let (mut usual, mut outside): (Vec<_>, Vec<_>) = places.into_iter().partition(is_usual);
        if usual.is_empty() {
            std::mem::swap(&mut usual, &mut outside);
        }
        let alone = World { scene: without_robot(&world.scene), ..world.with_face_on_axis() };
        // Targets ahead are nearer to a transducer in front of the axis.
        let nearer_m = world.sensor.mounting.ahead_m;
        let shift_m = world.delay_m - nearer_m;
        let models = SimulatorSet::new(&alone)?;
        let ranges_m = readings(&models, shift_m, &usual, watch)?;
        let usual = GridRegion { places: usual, ranges_m };
        let (outside_m, besides) = (OnceLock::new(), Vec::new());
        Ok(Self { spacing_m, usual, outside, outside_m, models, shift_m, besides })
    }

    /// Adds nuisance parameters to be fitted with the pose of each sweep, such as the threshold of
    /// a ranger other than the calibrated one. Priors of single sweeps are ignored.
    #[must_use]
    pub fn with_nuisance(mut self, mut priors: Vec<Prior>) -> Self {
        priors.retain(|prior| prior.parameter.sweep().is_none());
        self.besides = priors;
        self
    }

    /// Suitable spacing for a scene, metres: finer for smaller scenes.
    #[must_use]
    pub fn default_spacing_m(scene: &Scene) -> f64 {
        let (min_m, max_m) = USUAL_SPACING_M;
        extent(scene).map_or(max_m, |(low, high)| {
            let size = high - low;
            (size.x * size.y / FEW_PLACES).sqrt().clamp(min_m, max_m)
        })
    }

    /// Distance between neighbouring grid points, metres.
    #[must_use]
    pub const fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// Number of likely positions.
    #[must_use]
    pub const fn places(&self) -> usize {
        self.usual.places.len()
    }

    /// Area of the likely positions, square metres.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        self.places() as f64 * self.spacing_m.powi(2)
    }

    /// Simulators of a world, shared with the grid's where possible.
    pub(crate) fn models(&self, world: &World) -> Result<SimulatorSet, WorldError> {
        self.models.changed_to(&world.with_face_on_axis())
    }

    /// Best-matching poses among the likely positions, best first, without near duplicates.
    pub(crate) fn matches(&self, world: &World, sweep: &FitSweep, count: usize) -> Vec<PoseMatch> {
        let GridRegion { places, ranges_m } = &self.usual;
        self.matches_of(places, ranges_m, world, sweep, count)
    }

    /// Best-matching poses among all other positions, predicted on first use.
    pub(crate) fn matches_outside(
        &self,
        world: &World,
        sweep: &FitSweep,
        count: usize,
        watch: &dyn FitObserver,
    ) -> Result<Vec<PoseMatch>, CoarseGridError> {
        let ranges_m = match self.outside_m.get() {
            Some(known) => known,
            None => {
                let found = readings(&self.models, self.shift_m, &self.outside, watch)?;
                self.outside_m.get_or_init(|| found)
            }
        };
        Ok(self.matches_of(&self.outside, ranges_m, world, sweep, count))
    }

    fn matches_of(
        &self,
        places: &[DVec2],
        ranges_m: &[f32],
        world: &World,
        sweep: &FitSweep,
        count: usize,
    ) -> Vec<PoseMatch> {
        let measured = resampled(world, sweep);
        if measured.is_empty() {
            return Vec::new();
        }
        let spread_m = SPREAD * self.spacing_m as f32;
        let mut all: Vec<(f32, usize, usize)> = ranges_m
            .par_chunks_exact(DIRECTIONS)
            .enumerate()
            .flat_map_iter(|(place, ranges_m)| {
                best_turns(&measured, ranges_m, spread_m)
                    .map(move |(cost, turn)| (cost, place, turn))
            })
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut found: Vec<PoseMatch> = Vec::new();
        for (cost, place, turn) in all {
            let heading_deg = 360.0 * turn as f64 / DIRECTIONS as f64;
            let [x_m, y_m] = places[place].to_array();
            let pose = Pose { x_m, y_m, heading_deg };
            let apart_m = APART_M.max(2.0 * self.spacing_m);
            if found.iter().all(|known| is_apart(&known.pose, &pose, apart_m)) {
                found.push(PoseMatch { pose, cost });
            }
            if found.len() == count {
                break;
            }
        }
        found
    }
}

/// Predicted ranges at some positions.
fn readings(
    models: &SimulatorSet,
    shift_m: f64,
    places: &[DVec2],
    watch: &dyn FitObserver,
) -> Result<Vec<f32>, CoarseGridError> {
    let shown = |range_m: Option<f64>| range_m.map_or(SILENCE_M, |far_m| (far_m + shift_m) as f32);
    let mut ranges_m = vec![SILENCE_M; DIRECTIONS * places.len()];
    let predict = |(ranges_m, place): (&mut [f32], &DVec2)| {
        if watch.is_cancelled() {
            return Err(CoarseGridError::Stopped);
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

/// Returns `true` if two poses differ by more than a distance or by more than 9 degrees.
pub(crate) fn is_apart(a: &Pose, b: &Pose, distance_m: f64) -> bool {
    let turn_deg = sonard_model::geometry::wrap_180(a.heading_deg - b.heading_deg).abs();
    a.position().distance(b.position()) > distance_m || turn_deg > 9.0
}

fn without_robot(scene: &std::sync::Arc<Scene>) -> std::sync::Arc<Scene> {
    match scene.robot {
        None => std::sync::Arc::clone(scene),
        // The robot's own body hides little, and would have to be rotated along.
        Some(_) => std::sync::Arc::new(Scene { robot: None, ..Scene::clone(scene) }),
    }
}

/// Nearest reading of a sweep for each grid direction, as direction index and range. Directions
/// without a nearby reading and readings below the minimum range are omitted.
fn resampled(world: &World, sweep: &FitSweep) -> Vec<(usize, f32)> {
    let step_deg = 360.0 / DIRECTIONS as f64;
    let mut nearest: Vec<Option<(f64, f32)>> = vec![None; DIRECTIONS];
    let sound_speed_m_s = world.air.sound_speed_m_s();
    for beam in &sweep.beams {
        let azimuth_deg =
            (world.heading_zero_deg + world.gear * beam.azimuth_deg).rem_euclid(360.0);
        let place = azimuth_deg / step_deg;
        let off = (place - place.round()).abs();
        let range_m = match beam.outcome.outcome(sound_speed_m_s) {
            RangeOutcome::Echo { range_m } => range_m as f32,
            RangeOutcome::NoEcho => SILENCE_M,
            RangeOutcome::BelowMinRange => continue,
        };
        let slot = &mut nearest[place.round() as usize % DIRECTIONS];
        if slot.is_none_or(|known| off < known.0) {
            *slot = Some((off, range_m));
        }
    }
    let of = |(at, known): (usize, Option<(f64, f32)>)| known.map(|(_, range_m)| (at, range_m));
    nearest.into_iter().enumerate().filter_map(of).collect()
}

/// Rotations at which the measured ranges fit those of a position best: local minima, at most four.
fn best_turns(
    measured: &[(usize, f32)],
    ranges_m: &[f32],
    spread_m: f32,
) -> impl Iterator<Item = (f32, usize)> + use<> {
    // Doubled, so that no index has to wrap.
    let twice: Vec<f32> = ranges_m.iter().chain(ranges_m).copied().collect();
    let scale = 0.5 / (spread_m * spread_m);
    let max = 0.5 * MAX_SPREADS * MAX_SPREADS;
    let cost = |turn: usize| -> f32 {
        let of = |&(at, range_m): &(usize, f32)| {
            let off_m = twice[at + turn] - range_m;
            (scale * off_m * off_m).min(max)
        };
        measured.iter().map(of).sum()
    };
    let costs: Vec<f32> = (0..DIRECTIONS).map(cost).collect();
    let is_minimum = |&turn: &usize| {
        let [before, after] =
            [turn + DIRECTIONS - 1, turn + 1].map(|neighbour| costs[neighbour % DIRECTIONS]);
        costs[turn] <= before && costs[turn] < after
    };
    let mut minima: Vec<(f32, usize)> =
        (0..DIRECTIONS).filter(is_minimum).map(|turn| (costs[turn], turn)).collect();
    minima.sort_by(|a, b| a.0.total_cmp(&b.0));
    minima.truncate(4);
    minima.into_iter()
}

/// Bounding rectangle of a scene with a margin.
pub(crate) fn extent(scene: &Scene) -> Option<(DVec2, DVec2)> {
    let ends = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let round = scene.cylinders.iter().map(|cylinder| cylinder.center);
    let named = scene.poses.values().map(Pose::position);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for point in ends.chain(round).chain(named) {
        (low, high) = (low.min(point), high.max(point));
    }
    low.is_finite().then_some((low - MARGIN_M, high + MARGIN_M))
}

/// Grid of free positions, and its spacing.
fn free_positions(scene: &Scene, spacing_m: f64) -> (Vec<DVec2>, f64) {
    let Some((low, high)) = extent(scene) else { return (Vec::new(), spacing_m) };
    let size = high - low;
    let spacing_m = spacing_m.max((size.x * size.y / MAX_PLACES).sqrt());
    let [columns, rows] = (size / spacing_m).to_array().map(|count| count.ceil() as u32 + 1);
    let all: Vec<DVec2> = (0..rows)
        .flat_map(|y| (0..columns).map(move |x| DVec2::new(f64::from(x), f64::from(y))))
        .map(|cell| low + spacing_m * cell)
        .collect();
    let is_free = scene.are_accessible(&all);
    let places = all.into_iter().zip(is_free).filter(|(_, is_free)| *is_free);
    (places.map(|(place, _)| place).collect(), spacing_m)
}

/// Returns `true` if there is a wall or cylinder in three quarters of all directions.
fn is_surrounded(scene: &Scene, place: DVec2) -> bool {
    const RAYS: u32 = 24;
    let is_hit = |ray: u32| {
        let along = DVec2::from_angle(std::f64::consts::TAU * f64::from(ray) / f64::from(RAYS));
        let wall = scene.walls.iter().any(|wall| {
            let (a, b) = (wall.a - place, wall.b - place);
            let [side_a, side_b] = [along.perp_dot(a), along.perp_dot(b)];
            // The crossing with the line of the ray lies ahead.
            side_a * side_b <= 0.0 && a.perp_dot(b) * (side_b - side_a) > 0.0
        });
        wall || scene.cylinders.iter().any(|cylinder| {
            let to = cylinder.center - place;
            along.dot(to) > 0.0 && along.perp_dot(to).abs() < cylinder.radius_m
        })
    };
    4 * (0..RAYS).filter(|ray| is_hit(*ray)).count() >= 3 * RAYS as usize
}

#[cfg(test)]
mod tests {
    use sonard_model::scene::Scene;

    use super::*;

    #[test]
    fn places_within_walls_are_surrounded() {
        let room = Scene::builder("room").material("m", 1.0);
        // With an open corner, so that the scene is not a closed room.
        let room = room
            .walls("w", &[[0.2, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0], [0.0, 0.2]], "m")
            .build()
            .expect("a scene");
        for (place, expected) in
            [([1.0, 1.0], true), ([2.9, 1.9], true), ([-0.5, 1.0], false), ([1.5, 3.0], false)]
        {
            assert_eq!(is_surrounded(&room, place.into()), expected, "{place:?}");
        }
        let (places, spacing_m) = free_positions(&room, 0.1);
        let places: Vec<DVec2> =
            places.into_iter().filter(|place| is_surrounded(&room, *place)).collect();
        assert!(places.iter().all(|place| place.cmpge(DVec2::ZERO).all()), "some are outside");
        assert!(
            (places.len() as f64 * spacing_m * spacing_m - 6.0).abs() < 0.6,
            "{}",
            places.len()
        );
        // No position is surrounded by a single wall, so all count.
        let wall =
            Scene::builder("wall").material("m", 1.0).walls("w", &[[0.0, 0.0], [1.0, 0.0]], "m");
        let (places, _) = free_positions(&wall.build().expect("a scene"), 0.1);
        assert!(places.len() > 400, "{}", places.len());
    }
}
