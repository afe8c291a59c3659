//! A firing, and how what it hears changes beside its axis.

use sonard_model::{
    acoustics::BeamPattern,
    geometry::{DVec2, Pose, wrap_pi},
    model::{Arrival, Simulator},
};

use crate::sweep::Beam;

/// A firing.
pub(super) struct Firing<'a> {
    pub(super) simulator: &'a Simulator,
    /// Where the stepper says it points, degrees.
    pub(super) azimuth_deg: f64,
    pub(super) direction_rad: f64,
    /// Transmitter and receiver.
    pub(super) ends: [DVec2; 2],
}

/// What an arrival's level gains with the directions in which it leaves and comes, by the beam pattern: decibels a
/// radian.
pub(super) struct Flanks([f64; 2]);

impl<'a> Firing<'a> {
    pub(super) fn new(
        simulator: &'a Simulator,
        pose: &Pose,
        direction_rad: f64,
        beam: &Beam,
    ) -> Self {
        let ends = simulator.sensor().mounting.places(pose.position(), direction_rad);
        Self { simulator, azimuth_deg: beam.azimuth_deg, direction_rad, ends }
    }

    /// Beside its axis, the directions in which an arrival leaves and comes, radians.
    pub(super) fn off_rad(&self, arrival: &Arrival) -> [f64; 2] {
        [arrival.departure_rad, arrival.arrival_rad].map(|end| wrap_pi(end - self.direction_rad))
    }
}

impl Flanks {
    /// By the pattern as it is, however steep, if they are to be sharp: of an arrival that is heard alone by a ranger whose place
    /// is known well. Otherwise over half a degree to both sides, and no steeper than a main lobe's flank, so that they hold for
    /// steps of degrees: a null is steeper, but what is heard there is the sum of several arrivals.
    pub(super) fn of(arrival: &Arrival, firing: &Firing, is_sharp: bool) -> Self {
        let (by_rad, steepest) = if is_sharp { (1e-4, 2000.0) } else { (0.01, 125.0) };
        let pattern = firing.simulator.beam();
        let [leaves_rad, comes_rad] = firing.off_rad(arrival);
        let flank = |off_rad: f64| {
            let by_db = level_db(pattern, off_rad - by_rad, off_rad + by_rad);
            (by_db / (2.0 * by_rad)).clamp(-steepest, steepest)
        };
        let leaves = flank(leaves_rad);
        let comes = if comes_rad == leaves_rad { leaves } else { flank(comes_rad) };
        Self([leaves, comes])
    }

    /// What the level gains where the directions of departure and arrival turn by so much, decibels.
    pub(super) fn rate_db(&self, turned_rad: [f64; 2]) -> f64 {
        self.0.iter().zip(turned_rad).map(|(db_per_rad, rad)| db_per_rad * rad).sum()
    }
}

/// What a beam pattern's level gains from one direction beside its axis to another, decibels.
pub(super) fn level_db(pattern: &BeamPattern, from_rad: f64, to_rad: f64) -> f64 {
    let [from, to] = [from_rad, to_rad].map(|off_rad| amplitude(pattern, wrap_pi(off_rad)));
    20.0 * (to / from).log10()
}

/// Of a beam pattern, beside its axis; so much that it has a level.
pub(super) fn amplitude(pattern: &BeamPattern, off_rad: f64) -> f64 {
    pattern.one_way(off_rad).max(1e-6)
}
