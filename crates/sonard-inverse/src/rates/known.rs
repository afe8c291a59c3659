//! What propagation paths gain with the parameters, found out once for each: neighbouring beams hear the same few.

use std::collections::HashMap;

use smallvec::SmallVec;
use sonard_model::{
    geometry::DVec2,
    model::{Arrival, Interaction, Path},
};

use super::{Firing, RateFinder, material_rate_db};
use crate::{
    bearing::Bearing,
    motion::{Motion, length_rate},
};

/// The paths that were asked about, of firings from one place.
pub(super) struct KnownPaths<'a> {
    finder: &'a RateFinder<'a>,
    /// The parameters that matter there.
    concerning: Vec<u32>,
    /// By where their interactions lie in memory, which stay there as long as the path is kept.
    paths: HashMap<*const Interaction, PathRates>,
}

/// What a path gains with the parameters.
pub(super) struct PathRates {
    path: Path,
    /// Transmitter and receiver.
    ends: [DVec2; 2],
    bearing: Option<Bearing>,
    /// By parameter; without what moves another way in each direction.
    pub(super) steady: SmallVec<[(u32, Moved); 4]>,
}

/// What a path gains for each unit of a parameter.
#[derive(Clone, Copy, Default)]
pub(super) struct Moved {
    /// In length there and back, metres.
    pub(super) longer_m: f64,
    /// In its directions of departure and of arrival, radians.
    pub(super) turned_rad: [f64; 2],
    /// In strength, by what it meets, decibels.
    pub(super) louder_db: f64,
}

impl<'a> KnownPaths<'a> {
    pub(super) fn new(finder: &'a RateFinder<'a>, concerning: Vec<u32>) -> Self {
        Self { finder, concerning, paths: HashMap::new() }
    }

    /// Of the path of an arrival.
    pub(super) fn of(&mut self, arrival: &Arrival, firing: &Firing) -> &PathRates {
        let (finder, concerning) = (self.finder, &self.concerning);
        self.paths
            .entry(arrival.path.interactions.as_ptr())
            .or_insert_with(|| PathRates::new(finder, concerning, arrival, firing))
    }
}

impl PathRates {
    fn new(finder: &RateFinder, concerning: &[u32], arrival: &Arrival, firing: &Firing) -> Self {
        let (scene, ends) = (firing.simulator.scene(), firing.ends);
        let bearing = Bearing::new(&arrival.path, ends, scene);
        let path = arrival.path.clone();
        let mut rates = Self { path, ends, bearing, steady: SmallVec::new() };
        let moved = |&at: &u32| {
            let motion = finder.steady[at as usize].as_ref();
            let moved = motion.map(|motion| rates.moved(firing, motion));
            let louder_db = material_rate_db(finder.parameters[at as usize], scene, &rates.path);
            (at, Moved { louder_db, ..moved.unwrap_or_default() })
        };
        rates.steady = concerning.iter().map(moved).collect();
        rates
    }

    /// What it gains where transducer and scene move.
    pub(super) fn moved(&self, firing: &Firing, motion: &Motion) -> Moved {
        let scene = firing.simulator.scene();
        let z_m = firing.simulator.sensor_z_m().unwrap_or(0.0);
        let bearing = self.bearing.as_ref();
        Moved {
            longer_m: length_rate(&self.path, self.ends, z_m, scene, motion),
            turned_rad: bearing.map_or([0.0; 2], |bearing| bearing.rates(scene, motion)),
            louder_db: 0.0,
        }
    }
}
