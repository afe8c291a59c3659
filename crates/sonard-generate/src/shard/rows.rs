//! Simulated readings at one pose.

use sonard_model::{
    acoustics::ReceiverNoise,
    geometry::Pose,
    model::{Arrival, Prediction, Simulator, TooCostly},
    scan_plan::ScanPlan,
};

use crate::{
    seed::{RandomStream, rng},
    spec::LoadedSpec,
};

/// Readings at a pose.
pub(super) struct PoseReadings {
    /// Number of the scene in the set.
    pub(super) scene: u64,
    /// Number of the pose in the scene.
    pub(super) number: u32,
    pub(super) pose: Pose,
    /// Firings in plan order.
    pub(super) firings: Vec<SimulatedFiring>,
}

/// Firing with its simulated reading.
pub(super) struct SimulatedFiring {
    pub(super) azimuth_deg: f64,
    pub(super) direction_rad: f64,
    pub(super) reading: Prediction,
    /// Echoes of the firing, if they are recorded.
    pub(super) echoes: Vec<Arrival>,
    /// Envelope of the firing, if it is recorded.
    pub(super) envelope: Vec<f32>,
}

impl PoseReadings {
    /// Simulates all firings of a plan.
    ///
    /// # Errors
    /// Returns an error if there are too many paths.
    pub(super) fn simulate(
        loaded: &LoadedSpec,
        (scene, number): (u64, u32),
        noise: &ReceiverNoise,
        simulator: &Simulator,
        pose: Pose,
        plan: &ScanPlan,
    ) -> Result<Self, TooCostly> {
        let point = simulator.at(pose.position());
        let mut rng = rng(&loaded.sha256, RandomStream::Pose(scene, number));
        let keep = &loaded.spec.keep;
        let mut firings = Vec::with_capacity(plan.beams() as usize);
        for index in 0..plan.beams() {
            let azimuth_deg = plan.azimuth_deg(index / plan.pings_per_stop);
            let direction_rad = pose.direction_rad(azimuth_deg);
            let reading = match *noise == ReceiverNoise::NONE {
                true => point.ping(direction_rad)?,
                false => point.ping_in_noise(direction_rad, noise, &mut rng)?,
            };
            let echoes = match keep.min_echo_amplitude > 0.0 {
                true => {
                    let mut echoes = point.arrivals(direction_rad)?;
                    echoes.retain(|echo| echo.amplitude >= keep.min_echo_amplitude);
                    echoes
                }
                false => Vec::new(),
            };
            let envelope = match keep.envelope_range_m > 0.0 {
                true => {
                    let trace =
                        point.trace(direction_rad, keep.envelope_range_m, keep.envelope_step_us)?;
                    trace.points.iter().map(|sample| sample.envelope as f32).collect()
                }
                false => Vec::new(),
            };
            firings.push(SimulatedFiring { azimuth_deg, direction_rad, reading, echoes, envelope });
        }
        Ok(Self { scene, number, pose, firings })
    }
}
