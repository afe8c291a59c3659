//! Geometry of a firing, and slopes of the beam pattern off the axis.

use sonard_model::{
    acoustics::BeamPattern,
    geometry::{DVec2, Pose, wrap_pi},
    model::{Arrival, Simulator},
};

use crate::sweep::SweepFiring;

/// Firing with its simulator and geometry.
pub(super) struct FiringGeometry<'a> {
    pub(super) simulator: &'a Simulator,
    /// Azimuth of the stepper, degrees.
    pub(super) azimuth_deg: f64,
    pub(super) direction_rad: f64,
    /// Positions of transmitter and receiver.
    pub(super) ends: [DVec2; 2],
}

/// Slopes of the beam pattern in the departure and arrival directions of an arrival, dB/rad.
pub(super) struct PatternSlopes([f64; 2]);

impl<'a> FiringGeometry<'a> {
    pub(super) fn new(
        simulator: &'a Simulator,
        pose: &Pose,
        direction_rad: f64,
        beam: &SweepFiring,
    ) -> Self {
        let ends = simulator.sensor().mounting.transducer_positions(pose.position(), direction_rad);
        Self { simulator, azimuth_deg: beam.azimuth_deg, direction_rad, ends }
    }

    /// Departure and arrival directions relative to the axis, radians.
    pub(super) fn off_rad(&self, arrival: &Arrival) -> [f64; 2] {
        [arrival.departure_rad, arrival.arrival_rad].map(|end| wrap_pi(end - self.direction_rad))
    }
}

impl PatternSlopes {
    /// Slopes at the exact directions if sharp: for a dominant arrival and an accurate pose.
    /// Otherwise averaged over half a degree on either side and limited to that of a main lobe, so
    /// that they hold for steps of degrees. A null is steeper, but there several arrivals overlap.
    pub(super) fn new(arrival: &Arrival, firing: &FiringGeometry, is_sharp: bool) -> Self {
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

    /// Level change for rotations of the departure and arrival directions, decibels.
    pub(super) fn rate_db(&self, turned_rad: [f64; 2]) -> f64 {
        self.0.iter().zip(turned_rad).map(|(db_per_rad, rad)| db_per_rad * rad).sum()
    }
}

/// Level change of a beam pattern between two directions off the axis, decibels.
pub(super) fn level_db(pattern: &BeamPattern, from_rad: f64, to_rad: f64) -> f64 {
    let [from, to] = [from_rad, to_rad].map(|off_rad| amplitude(pattern, wrap_pi(off_rad)));
    20.0 * (to / from).log10()
}

/// Amplitude of a beam pattern off the axis, bounded from below.
pub(super) fn amplitude(pattern: &BeamPattern, off_rad: f64) -> f64 {
    pattern.one_way(off_rad).max(1e-6)
}
