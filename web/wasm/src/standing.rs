//! A ranger that stands somewhere, and goes on standing there between requests.

use std::sync::Arc;

use self_cell::self_cell;
use sonard_model::{
    geometry::Pose,
    model::{ObservationPoint, Simulator},
};

self_cell!(
    /// The paths from an observation point, found once, beside the simulator that they are of.
    struct Kept {
        owner: Arc<Simulator>,
        #[not_covariant]
        dependent: ObservationPoint,
    }
);

/// A ranger's axis at a place.
pub(crate) struct Standing {
    /// The robot's pose, which its body is around.
    robot: Pose,
    /// Where the axis is; its heading means nothing.
    axis: Pose,
    kept: Kept,
}

impl Standing {
    pub(crate) fn new(simulator: Arc<Simulator>, robot: Pose, axis: Pose) -> Self {
        let kept = Kept::new(simulator, |simulator| simulator.at(axis.position()));
        Self { robot, axis, kept }
    }

    /// Whether it is there already.
    pub(crate) fn is_at(&self, robot: &Pose, axis: &Pose) -> bool {
        self.robot == *robot && self.axis.position() == axis.position()
    }

    /// Looks from there.
    pub(crate) fn look<T>(&self, see: impl FnOnce(&Simulator, &ObservationPoint<'_>) -> T) -> T {
        self.kept.with_dependent(|simulator, point| see(simulator, point))
    }
}
