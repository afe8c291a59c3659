//! Predicted echo trace of a firing, for drawing.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::{acoustics::EchoTrace, model::Simulator};

/// Maximum number of points; longer traces keep the maximum of neighbouring points.
const MAX_POINTS: usize = 4096;

/// Predicted echo trace in drawable form.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TraceLine {
    /// Sample spacing, microseconds; the first sample is at firing.
    pub step_us: f64,
    /// Half the speed of sound, metres per microsecond: converts time to range.
    pub m_per_us: f64,
    /// Envelope of the summed arrivals, relative to a head-on, perfectly reflecting wall.
    pub envelope: Vec<f32>,
    /// Effective detection threshold at each sample.
    pub threshold: Vec<f32>,
    /// End of receiver blanking, microseconds.
    pub blanking_us: f64,
}

impl TraceLine {
    /// Converts a trace whose samples are `step_us` apart.
    #[must_use]
    pub fn from_trace(simulator: &Simulator, trace: &EchoTrace, step_us: f64) -> Self {
        let group_size = trace.points.len().div_ceil(MAX_POINTS).max(1);
        let groups = || trace.points.chunks(group_size);
        let highest = groups().map(|group| group.iter().map(|p| p.envelope).fold(0.0, f64::max));
        let threshold = groups().filter_map(|group| Some(group.first()?.threshold as f32));
        Self {
            step_us: step_us * group_size as f64,
            m_per_us: simulator.sound_speed_m_s() * 0.5e-6,
            envelope: highest.map(|envelope| envelope as f32).collect(),
            threshold: threshold.collect(),
            blanking_us: simulator.sensor().blanking_us,
        }
    }
}
