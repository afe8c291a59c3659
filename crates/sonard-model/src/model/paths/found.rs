//! Search result: the echo paths between a transmitter and a receiver, and their descriptions.

use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};

use super::{
    diffraction::single, echo::PathEcho, interactions::EchoPath, pattern::TwoWayBound,
    prepare::Paths, traced::Traced,
};
use crate::{
    acoustics::{Image, Incidence, Incident},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, TooCostly, engine::mirrored},
    reading::PathKind,
};

/// Echo paths, shortest first, with the rays their interactions are reconstructed from.
pub(super) struct FoundEchoes {
    /// Scene of the search, up to the length in its settings.
    pub(super) paths: Paths,
    pub(super) traced: Traced,
    pub(super) echoes: Vec<PathEcho>,
    /// Lead of each echo's pulse; empty if all are 0. See [`Self::pulse`].
    leads_m: Vec<f64>,
    /// Cache of full paths: neighbouring directions request the same few.
    described: Mutex<HashMap<u32, EchoPath>>,
}

/// Arrival of an echo's pulse.
pub(super) struct EchoPulse {
    pub(super) length_m: f64,
    pub(super) phase_rad: f64,
    /// Ratio of the pulse's amplitude to that of its path.
    pub(super) gain: f64,
}

impl FoundEchoes {
    /// Searches between transmitter and receiver. With `bound`, only detectable echoes by cylinders
    /// are included.
    pub(super) fn between(
        paths: Paths,
        [transmitter, receiver]: [DVec2; 2],
        bound: Option<&TwoWayBound>,
    ) -> Result<Self, TooCostly> {
        let (traced, echoes) = paths.trace(transmitter, receiver, bound)?;
        let lead_m = |echo| single::lead_m(&paths.plan, &traced.out, traced.back(), echo);
        let leads_m = match paths.plan.corners.max_lead_m > 0.0 {
            true => echoes.iter().map(lead_m).collect(),
            false => Vec::new(),
        };
        Ok(Self { paths, traced, echoes, leads_m, described: Mutex::default() })
    }

    /// Returns the arrival of an echo's pulse. The pulse of a post returns by its surface, while
    /// the path runs to its axis; the carrier is unchanged and the pulse has spread less.
    pub(super) fn pulse(&self, index: u32) -> EchoPulse {
        let PathEcho { length_m, phase_rad, .. } = self.echoes[index as usize];
        match self.leads_m.get(index as usize) {
            None | Some(0.0) => EchoPulse { length_m, phase_rad, gain: 1.0 },
            Some(lead_m) => {
                let pulse_m = length_m - lead_m;
                let lead_rad = self.paths.plan.settings.wave_number_per_m * lead_m;
                let phase_rad = wrap_pi(phase_rad - lead_rad);
                EchoPulse { length_m: pulse_m, phase_rad, gain: pulse_m / length_m }
            }
        }
    }

    /// Returns `true` if pulses may arrive in a different order than their path lengths.
    pub(super) fn is_reordered(&self) -> bool {
        !self.leads_m.is_empty()
    }

    /// Number of echoes whose pulses may arrive after running up to a length, metres.
    pub(super) fn count_within(&self, length_m: f64) -> usize {
        let max_m = length_m + self.paths.plan.corners.max_lead_m;
        self.echoes.partition_point(|echo| echo.length_m <= max_m)
    }

    /// Returns the full description of an echo that arrives with an amplitude.
    pub(super) fn arrival(&self, index: u32, amplitude: f64) -> Arrival {
        // A thread that panicked leaves only complete paths behind.
        let mut described = self.described.lock().unwrap_or_else(PoisonError::into_inner);
        let path = || self.paths.path(&self.traced, &self.echoes[index as usize]);
        let path = described.entry(index).or_insert_with(path).clone();
        let EchoPulse { length_m, phase_rad, gain } = self.pulse(index);
        Arrival {
            length_m,
            amplitude,
            path_amplitude: gain * path.amplitude,
            phase_rad,
            departure_rad: path.departure_rad,
            arrival_rad: path.arrival_rad,
            path: path.path,
        }
    }

    /// Returns the incidence of an echo, for a transmitter and a receiver that point in world
    /// directions, radians.
    pub(super) fn incident(&self, index: u32, axes_rad: [f64; 2]) -> Incident {
        let (paths, traced) = (&self.paths, &self.traced);
        let echo = &self.echoes[index as usize];
        let image = match echo.via.kind() {
            PathKind::Specular => mirrored(paths.reflection_count(traced, echo)),
            PathKind::Diffracted => {
                let view = single::view(&paths.plan, &traced.out, traced.back(), echo);
                view.map_or(Image::PointScatterer, Image::Diffracted)
            }
            PathKind::Scattered => Image::PointScatterer,
        };
        let [leaving_rad, arriving_rad] = [
            wrap_pi(echo.departure.to_angle() - axes_rad[0]),
            wrap_pi(echo.arrival.to_angle() - axes_rad[1]),
        ];
        let EchoPulse { length_m, gain, .. } = self.pulse(index);
        Incident {
            strength: gain * echo.amplitude,
            incidence: Incidence { leaving_rad, arriving_rad, length_m, image },
        }
    }
}
