//! Cache of the propagation paths at an observation point between requests.

use std::sync::Arc;

use self_cell::self_cell;
use sonard_model::{
    geometry::Pose,
    model::{ObservationPoint, Simulator},
};

self_cell!(
    /// Observation point together with the simulator that it borrows from.
    struct OwnedPoint {
        owner: Arc<Simulator>,
        #[not_covariant]
        dependent: ObservationPoint,
    }
);

/// Cached observation point of a robot pose and axis position.
pub(crate) struct ObservationCache {
    /// Pose of the robot, whose body is part of the simulator's scene.
    robot: Pose,
    /// Position of the scanning axis; the heading is ignored.
    axis: Pose,
    point: OwnedPoint,
}

impl ObservationCache {
    /// Computes the paths at an axis position.
    pub(crate) fn new(simulator: Arc<Simulator>, robot: Pose, axis: Pose) -> Self {
        let point = OwnedPoint::new(simulator, |simulator| simulator.at(axis.position()));
        Self { robot, axis, point }
    }

    /// Returns `true` if the cache is valid for a robot pose and axis position.
    pub(crate) fn is_at(&self, robot: &Pose, axis: &Pose) -> bool {
        self.robot == *robot && self.axis.position() == axis.position()
    }

    /// Calls a function with the simulator and the observation point.
    pub(crate) fn with<T>(
        &self,
        observe: impl FnOnce(&Simulator, &ObservationPoint<'_>) -> T,
    ) -> T {
        self.point.with_dependent(|simulator, point| observe(simulator, point))
    }
}
