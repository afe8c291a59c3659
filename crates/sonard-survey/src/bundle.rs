//! Joint estimate of poses and virtual features (bundle adjustment).

use nalgebra::DMatrix;
use sonard_model::geometry::{DVec2, Pose, wrap_pi};

use crate::{
    arc::Arc,
    feature::VirtualFeature,
    normal::{NormalEquations, move_pose, pose_column},
    odometry::Move,
};

/// Standard deviation of the range of an arc, metres.
pub(crate) const SIGMA_M: f64 = 0.004;
/// Residuals beyond so many standard deviations count linearly.
const ROBUST: f64 = 1.5;
const MAX_STEPS: usize = 40;

/// Virtual feature with the arcs that support it.
#[derive(Debug, Clone)]
pub(crate) struct SupportedFeature<'a> {
    pub(crate) feature: VirtualFeature,
    pub(crate) arcs: Vec<&'a Arc>,
}

/// Poses, all but the first of which are free, with the features.
pub(crate) struct Bundle<'a, 'b> {
    pub(crate) poses: &'b mut Vec<Pose>,
    pub(crate) features: &'b mut Vec<SupportedFeature<'a>>,
    /// Odometry between consecutive poses; empty without odometry.
    pub(crate) moves: &'b [Move],
}

impl Bundle<'_, '_> {
    /// Minimizes the robust residuals and returns the covariance of the free poses (x and y in
    /// metres, heading in radians); `None` if they are not determined.
    pub(crate) fn solve(&mut self) -> Option<DMatrix<f64>> {
        let mut normal = self.equations();
        let mut damping = 1e-4;
        for _ in 0..MAX_STEPS {
            let Some(step) = normal.step(damping) else { break };
            let before = (self.poses.clone(), self.features.clone());
            self.apply(step.as_slice());
            let changed = self.equations();
            let gain = normal.loss() - changed.loss();
            if gain < 0.0 {
                (*self.poses, *self.features) = before;
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
                continue;
            }
            (normal, damping) = (changed, 0.3 * damping);
            if gain < 1e-6 {
                break;
            }
        }
        let free = 3 * self.poses.len().saturating_sub(1);
        let covariance = normal.covariance()?;
        Some(covariance.view((0, 0), (free, free)).into_owned())
    }

    fn equations(&self) -> NormalEquations {
        let free = 3 * self.poses.len().saturating_sub(1);
        let mut normal = NormalEquations::new(free + 2 * self.features.len());
        for (at, of) in self.features.iter().enumerate() {
            let columns = [free + 2 * at, free + 2 * at + 1];
            for arc in &of.arcs {
                let pose = &self.poses[arc.sweep];
                add_arc(&mut normal, &of.feature, (columns, pose_column(arc.sweep)), arc, pose);
            }
        }
        for (at, step) in self.moves.iter().enumerate().take(self.poses.len().saturating_sub(1)) {
            let pair = [&self.poses[at], &self.poses[at + 1]];
            step.add_to(&mut normal, pair, [pose_column(at), pose_column(at + 1)]);
        }
        normal
    }

    fn apply(&mut self, step: &[f64]) {
        let free = 3 * self.poses.len().saturating_sub(1);
        for (pose, by) in self.poses.iter_mut().skip(1).zip(step.chunks(3)) {
            move_pose(pose, [by[0], by[1], by[2]]);
        }
        for (of, by) in self.features.iter_mut().zip(step[free..].chunks(2)) {
            of.feature = of.feature.moved([by[0], by[1]]);
        }
    }
}

/// Adds range and bearing of an arc; the columns are those of the feature and of the x of the pose,
/// unless that is fixed.
fn add_arc(
    normal: &mut NormalEquations,
    feature: &VirtualFeature,
    (columns, of_pose): ([usize; 2], Option<usize>),
    arc: &Arc,
    pose: &Pose,
) {
    let place = arc.place(pose);
    let (range_m, bearing_rad) = feature.predict(place);
    let rates = feature.derivatives(place);
    let place_by_turn = arc.face_of(pose).perp();
    let row = |by_feature: [f64; 2], by_place: DVec2, by_turn: f64| {
        let mut row = vec![(columns[0], by_feature[0]), (columns[1], by_feature[1])];
        if let Some(at) = of_pose {
            let by_turn = by_turn + by_place.dot(place_by_turn);
            row.extend([(at, by_place.x), (at + 1, by_place.y), (at + 2, by_turn)]);
        }
        row
    };
    let range = row(rates.range_by_feature, rates.range_by_place, 0.0);
    normal.add(&range, arc.range_m - range_m, arc.errors.sigma_m(SIGMA_M), ROBUST);
    // The arc is at its azimuth from the heading: a turn of the pose reduces the predicted azimuth.
    let bearing = row(rates.bearing_by_feature, rates.bearing_by_place, -1.0);
    let off_rad = wrap_pi(pose.direction_rad(arc.azimuth_deg) - bearing_rad);
    normal.add(&bearing, off_rad, arc.sigma_deg().to_radians(), ROBUST);
}

/// Fits one feature to its arcs at given poses and returns its robust loss, nats.
pub(crate) fn fit_feature(of: &mut SupportedFeature, poses: &[Pose]) -> f64 {
    let equations = |feature: &VirtualFeature, arcs: &[&Arc]| {
        let mut normal = NormalEquations::new(2);
        for arc in arcs {
            add_arc(&mut normal, feature, ([0, 1], None), arc, &poses[arc.sweep]);
        }
        normal
    };
    let mut normal = equations(&of.feature, &of.arcs);
    for _ in 0..10 {
        let Some(step) = normal.step(1e-6) else { break };
        let moved = of.feature.moved([step[0], step[1]]);
        let changed = equations(&moved, &of.arcs);
        if changed.loss() >= normal.loss() - 1e-9 {
            break;
        }
        (of.feature, normal) = (moved, changed);
    }
    normal.loss()
}
