//! Predictions of a plan, reused for plans that differ from it in a few walls.
//!
//! A change at a distance from a stop leaves all readings there as they are that shorter paths decide
//! ([`ObservationPoint::ping_with_radius`](sonard_model::model::ObservationPoint::ping_with_radius)).
//! The others have at most the likelihood of a prediction equal to the reading, which bounds the
//! score of most plans without any prediction.

use sonard_model::geometry::{DVec2, distance_to_segment};

use super::{
    Judge,
    sweep_rays::{KnownRays, SweepPredictor, SweepRays},
};
use crate::{arrangement::Segment, post::PostShape};

/// Distance around a change within which edges belong to it, metres: walls are joined within less.
const MARGIN_M: f64 = 0.006;
/// Distance within which walls are on one line, metres.
const ON_LINE_M: f64 = 1e-9;

/// Predictions of a plan from the poses of a judge.
#[derive(Debug)]
pub(crate) struct ReferencePlan {
    walls: Vec<Segment>,
    posts: Vec<PostShape>,
    sweeps: Vec<SweepRays>,
}

impl ReferencePlan {
    /// Predictions of walls with the posts of a judge; `None` if the scene has more paths than the
    /// model follows.
    pub(crate) fn new(judge: &Judge, walls: &[Segment]) -> Option<Self> {
        Self::predicted(judge, walls, None)
    }

    /// Predictions of other walls, by those of this plan where the difference does not affect them.
    pub(crate) fn followed_by(&self, judge: &Judge, walls: &[Segment]) -> Option<Self> {
        Self::predicted(judge, walls, Some(self))
    }

    /// Same predictions for a judge with another standard deviation of ranges.
    pub(crate) fn rescored(&self, judge: &Judge) -> Self {
        let sweeps = self.sweeps.iter().enumerate();
        Self {
            walls: self.walls.clone(),
            posts: self.posts.clone(),
            sweeps: sweeps.map(|(sweep, of)| of.rescored(judge, sweep)).collect(),
        }
    }

    fn predicted(judge: &Judge, walls: &[Segment], known: Option<&Self>) -> Option<Self> {
        let simulator = judge.simulator_of(walls)?;
        let change = known.map(|known| (known, known.change_to(walls, &judge.posts)));
        let known = |sweep: usize| {
            let (known, change) = change.as_ref()?;
            Some(known.known(change, sweep, judge.poses[sweep].position()))
        };
        let of_sweep = |sweep: usize| {
            let predictor = SweepPredictor::new(judge, &simulator, sweep, &judge.poses[sweep]);
            let rays = match known(sweep) {
                Some(known) => predictor.changed(&known, &predictor.affected(&known)?),
                None => predictor.rays(),
            };
            predictor.with_echoes(rays?)
        };
        let sweeps = (0..judge.poses.len()).map(of_sweep).collect::<Option<_>>()?;
        Some(Self { walls: walls.to_vec(), posts: judge.posts.clone(), sweeps })
    }

    /// Predictions of a sweep at a place, with the distance to a change.
    pub(crate) fn known(&self, change: &PlanChange, sweep: usize, place: DVec2) -> KnownRays<'_> {
        KnownRays { of: &self.sweeps[sweep], distance_m: change.distance_m(place) }
    }

    /// Difference of this plan from another.
    pub(crate) fn change_to(&self, walls: &[Segment], posts: &[PostShape]) -> PlanChange {
        let mut changed = Vec::new();
        let is_in = |wall: &Segment, others: &[Segment]| {
            others.iter().any(|other| [wall.a, wall.b] == [other.a, other.b])
        };
        let only = |walls: &[Segment], others: &[Segment]| -> Vec<Segment> {
            walls.iter().filter(|wall| !is_in(wall, others)).copied().collect()
        };
        let [removed, added] = [only(&self.walls, walls), only(walls, &self.walls)];
        for (own, others) in [(&removed, &added), (&added, &removed)] {
            changed.extend(own.iter().flat_map(|wall| parts_outside(wall, others)));
        }
        let is_unmatched = |post: &&PostShape, others: &[PostShape]| !others.contains(post);
        let removed = self.posts.iter().filter(|post| is_unmatched(post, posts));
        let added = posts.iter().filter(|post| is_unmatched(post, &self.posts));
        PlanChange { walls: changed, posts: removed.chain(added).copied().collect() }
    }
}

/// Parts of walls, and posts, that one of two plans has.
#[derive(Debug)]
pub(crate) struct PlanChange {
    walls: Vec<[DVec2; 2]>,
    posts: Vec<PostShape>,
}

impl PlanChange {
    /// Distance from a place within which both plans are equal, metres; infinite if they are equal
    /// everywhere.
    fn distance_m(&self, place: DVec2) -> f64 {
        let to_walls = self.walls.iter().map(|&[a, b]| distance_to_segment(place, a, b));
        let to_posts = self.posts.iter().map(|post| post.center.distance(place) - post.radius_m);
        to_walls.chain(to_posts).fold(f64::INFINITY, f64::min) - MARGIN_M
    }
}

/// Parts of a wall that no other wall on its line covers.
fn parts_outside(wall: &Segment, others: &[Segment]) -> Vec<[DVec2; 2]> {
    let length_m = wall.length_m();
    let along = (wall.b - wall.a) / length_m;
    let off_m = |point: DVec2| along.perp_dot(point - wall.a).abs();
    let along_m = |point: DVec2| along.dot(point - wall.a);
    let mut covered: Vec<[f64; 2]> = others
        .iter()
        .filter(|other| off_m(other.a).max(off_m(other.b)) < ON_LINE_M)
        .map(|other| [along_m(other.a), along_m(other.b)])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    covered.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut parts = Vec::new();
    let mut from_m = 0.0;
    for [a, b] in covered.into_iter().chain([[length_m; 2]]) {
        let part = [from_m, a.min(length_m)];
        if part[0] < part[1] {
            parts.push(part);
        }
        from_m = from_m.max(b);
    }
    parts.into_iter().map(|part| part.map(|at_m| wall.a + at_m * along)).collect()
}
