//! Places that a robot reaches by a straight move from a stop.

use sonard_model::geometry::{DVec2, Pose, distance_to_segment, signed_angle_rad};

use crate::{
    arrangement::Segment,
    judge::Judge,
    moves::crosses,
    post::PostShape,
    readings::{Outcome, Readings},
};

/// Clearance of places and moves from walls and posts, metres.
const CLEAR_M: f64 = 0.25;
/// Minimum distance of a place from all stops, metres.
const MIN_MOVE_M: f64 = 0.15;
/// Minimum spacing of places, metres.
const SPACING_M: f64 = 0.2;
/// Minimum angle from a move within which readings show an obstacle on it, degrees.
const AHEAD_DEG: f64 = 12.0;

/// Free floor around the stops of a course.
pub(super) struct FreeSpace<'a> {
    pub(super) walls: &'a [Segment],
    pub(super) posts: &'a [PostShape],
    pub(super) poses: &'a [Pose],
    pub(super) judge: &'a Judge<'a>,
}

impl FreeSpace<'_> {
    /// Places on a grid through the first stop that are reachable within a distance of a stop,
    /// metres; the grid is as fine as at most `max_count` of them allow.
    pub(super) fn places(&self, reach_m: f64, max_count: usize) -> Vec<DVec2> {
        const WIDER: f64 = 1.2;
        /// Maximum number of places of a grid that are tried.
        const MAX_TRIED: f64 = 1e5;
        let stops = || self.poses.iter().map(Pose::position);
        let low = stops().fold(DVec2::INFINITY, DVec2::min) - reach_m;
        let high = stops().fold(DVec2::NEG_INFINITY, DVec2::max) + reach_m;
        let Some(first) = stops().next().filter(|_| max_count > 0) else { return Vec::new() };
        let mut spacing_m = SPACING_M.max(((high - low).element_product() / MAX_TRIED).sqrt());
        loop {
            let [from, to] = [low, high].map(|end| ((end - first) / spacing_m).round().as_ivec2());
            let rows = (from.y..=to.y).flat_map(|row| (from.x..=to.x).map(move |at| (at, row)));
            let place = |(column, row): (i32, i32)| {
                first + spacing_m * DVec2::new(f64::from(column), f64::from(row))
            };
            let places: Vec<DVec2> =
                rows.map(place).filter(|at| self.is_reachable(*at, reach_m)).collect();
            if places.len() <= max_count {
                return places;
            }
            spacing_m *= WIDER;
        }
    }

    fn is_reachable(&self, place: DVec2, reach_m: f64) -> bool {
        let distance_m = |pose: &Pose| pose.position().distance(place);
        self.poses.iter().all(|pose| distance_m(pose) >= MIN_MOVE_M)
            && self.clearance_m([place, place]) >= CLEAR_M
            && self.poses.iter().zip(self.judge.readings()).any(|(pose, readings)| {
                distance_m(pose) <= reach_m && self.is_move_free(pose, readings, place)
            })
    }

    /// Returns `true` if a straight move keeps its clearance, or that of its beginning, from walls
    /// and posts, and no echo at its beginning is from nearer than its end.
    fn is_move_free(&self, pose: &Pose, readings: &Readings, to: DVec2) -> bool {
        let from = pose.position();
        let clear_m = CLEAR_M.min(self.clearance_m([from, from]) - 1e-9);
        let needed_m = from.distance(to) + CLEAR_M;
        let ahead_deg = AHEAD_DEG.max(0.5 * readings.step_deg);
        let is_blocking = |(azimuth_deg, outcome): (f64, Outcome)| {
            let beam = DVec2::from_angle(pose.direction_rad(azimuth_deg));
            let is_ahead = signed_angle_rad(beam, to - from).abs() < ahead_deg.to_radians();
            is_ahead && matches!(outcome, Outcome::Echo(range_m) if range_m < needed_m)
        };
        let mut beams = readings.beams.iter().map(|beam| (beam.azimuth_deg, beam.outcome));
        self.clearance_m([from, to]) >= clear_m && !beams.any(is_blocking)
    }

    /// Distance of a segment from the nearest wall or post, metres; 0 if it crosses one.
    fn clearance_m(&self, [from, to]: [DVec2; 2]) -> f64 {
        let of_wall = |wall: &Segment| {
            if crosses([from, to], [wall.a, wall.b]) {
                return 0.0;
            }
            let ends = [wall.a, wall.b].map(|end| distance_to_segment(end, from, to));
            let own = [from, to].map(|end| distance_to_segment(end, wall.a, wall.b));
            ends.into_iter().chain(own).fold(f64::INFINITY, f64::min)
        };
        let of_post = |post: &PostShape| distance_to_segment(post.center, from, to) - post.radius_m;
        let walls = self.walls.iter().map(of_wall);
        walls.chain(self.posts.iter().map(of_post)).fold(f64::INFINITY, f64::min)
    }
}
