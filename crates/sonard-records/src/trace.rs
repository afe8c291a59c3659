//! The echo trace of a firing, as it is drawn.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::{acoustics::EchoTrace, model::Simulator};

/// More points than this are told as so many, each the highest of its neighbours.
const MOST_POINTS: usize = 4096;

/// The echo trace that the model predicts.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TraceLine {
    /// Between its points, microseconds; the first is the firing.
    pub step_us: f64,
    /// Half the speed of sound, metres a microsecond: time times this is range.
    pub m_per_us: f64,
    /// Envelope of all arrivals together, relative to a head-on, perfectly reflecting wall.
    pub envelope: Vec<f32>,
    /// Least envelope that is noticed then.
    pub threshold: Vec<f32>,
    /// Until when the receiver is deaf, microseconds.
    pub blanking_us: f64,
}

impl TraceLine {
    /// A trace whose points are `step_us` apart.
    #[must_use]
    pub fn of(simulator: &Simulator, trace: &EchoTrace, step_us: f64) -> Self {
        let together = trace.points.len().div_ceil(MOST_POINTS).max(1);
        let pieces = || trace.points.chunks(together);
        let highest = pieces().map(|piece| piece.iter().map(|p| p.envelope).fold(0.0, f64::max));
        let threshold = pieces().filter_map(|piece| Some(piece.first()?.threshold as f32));
        Self {
            step_us: step_us * together as f64,
            m_per_us: simulator.sound_speed_m_s() * 0.5e-6,
            envelope: highest.map(|envelope| envelope as f32).collect(),
            threshold: threshold.collect(),
            blanking_us: simulator.sensor().blanking_us,
        }
    }
}
