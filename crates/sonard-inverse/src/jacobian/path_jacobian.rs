//! Jacobians of propagation paths, cached: neighbouring beams share the same few paths.

use std::collections::HashMap;

use smallvec::SmallVec;
use sonard_model::{
    geometry::DVec2,
    model::{Arrival, Interaction, Path},
};

use super::{FiringGeometry, JacobianBuilder, material_rate_db};
use crate::{
    bearing::Bearing,
    motion::{SceneMotion, length_derivative},
};

/// Cache of path Jacobians for firings from one position.
pub(super) struct PathCache<'a> {
    finder: &'a JacobianBuilder<'a>,
    /// Relevant parameters.
    concerning: Vec<u32>,
    /// Jacobians by the address of the interactions, which is stable while the path is kept.
    paths: HashMap<*const Interaction, PathJacobian>,
}

/// Derivatives of a path by the parameters.
pub(super) struct PathJacobian {
    path: Path,
    /// Positions of transmitter and receiver.
    ends: [DVec2; 2],
    bearing: Option<Bearing>,
    /// Derivatives by parameter, without direction-dependent ones.
    pub(super) steady: SmallVec<[(u32, PathDerivative); 4]>,
}

/// Derivative of a path by one parameter, per unit.
#[derive(Clone, Copy, Default)]
pub(super) struct PathDerivative {
    /// Two-way length, metres.
    pub(super) longer_m: f64,
    /// Departure and arrival directions, radians.
    pub(super) turned_rad: [f64; 2],
    /// Level due to materials, decibels.
    pub(super) louder_db: f64,
}

impl<'a> PathCache<'a> {
    pub(super) fn new(finder: &'a JacobianBuilder<'a>, concerning: Vec<u32>) -> Self {
        Self { finder, concerning, paths: HashMap::new() }
    }

    /// Jacobian of the path of an arrival.
    pub(super) fn get(&mut self, arrival: &Arrival, firing: &FiringGeometry) -> &PathJacobian {
        let (finder, concerning) = (self.finder, &self.concerning);
        self.paths
            .entry(arrival.path.interactions.as_ptr())
            .or_insert_with(|| PathJacobian::new(finder, concerning, arrival, firing))
    }
}

impl PathJacobian {
    fn new(
        finder: &JacobianBuilder,
        concerning: &[u32],
        arrival: &Arrival,
        firing: &FiringGeometry,
    ) -> Self {
        let (scene, ends) = (firing.simulator.scene(), firing.ends);
        let bearing = Bearing::new(&arrival.path, ends, scene);
        let path = arrival.path.clone();
        let mut rates = Self { path, ends, bearing, steady: SmallVec::new() };
        let moved = |&at: &u32| {
            let motion = finder.steady[at as usize].as_ref();
            let moved = motion.map(|motion| rates.moved(firing, motion));
            let louder_db = material_rate_db(finder.parameters[at as usize], scene, &rates.path);
            (at, PathDerivative { louder_db, ..moved.unwrap_or_default() })
        };
        rates.steady = concerning.iter().map(moved).collect();
        rates
    }

    /// Derivative for a motion of transducer and scene.
    pub(super) fn moved(&self, firing: &FiringGeometry, motion: &SceneMotion) -> PathDerivative {
        let scene = firing.simulator.scene();
        let z_m = firing.simulator.sensor_z_m().unwrap_or(0.0);
        let bearing = self.bearing.as_ref();
        PathDerivative {
            longer_m: length_derivative(&self.path, self.ends, z_m, scene, motion),
            turned_rad: bearing.map_or([0.0; 2], |bearing| bearing.derivatives(scene, motion)),
            louder_db: 0.0,
        }
    }
}
