//! The echo paths that were found between a transmitter and a receiver, and what is told of each.

use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};

use super::{
    diffraction::single, echo::Echo, interactions::EchoPath, pattern::TwoWayBound, prepare::Paths,
    traced::Traced,
};
use crate::{
    acoustics::{Image, Incidence, Incident},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, TooCostly, engine::mirrored},
    reading::PathKind,
};

/// Echo paths, shortest first, with what their interactions are told from.
pub(super) struct Found {
    /// What they were searched in, up to the length in its settings.
    pub(super) paths: Paths,
    pub(super) traced: Traced,
    pub(super) echoes: Vec<Echo>,
    /// Of each echo; empty where all are 0. See [`Self::heard`].
    leads_m: Vec<f64>,
    /// The paths that were asked for: neighbouring directions ask for the same few.
    told: Mutex<HashMap<u32, EchoPath>>,
}

/// An echo as its pulse arrives.
pub(super) struct Heard {
    pub(super) length_m: f64,
    pub(super) phase_rad: f64,
    /// Its amplitude beside that of its path.
    pub(super) gain: f64,
}

impl Found {
    /// Searches between transmitter and receiver; with `bound`, for echoes by cylinders only that can be heard.
    pub(super) fn between(
        paths: Paths,
        [transmitter, receiver]: [DVec2; 2],
        bound: Option<&TwoWayBound>,
    ) -> Result<Self, TooCostly> {
        let (traced, echoes) = paths.trace(transmitter, receiver, bound)?;
        let lead_m = |echo| single::lead_m(&paths.plan, &traced.out, traced.back(), echo);
        let leads_m = match paths.plan.corners.most_lead_m > 0.0 {
            true => echoes.iter().map(lead_m).collect(),
            false => Vec::new(),
        };
        Ok(Self { paths, traced, echoes, leads_m, told: Mutex::default() })
    }

    /// An echo as its pulse arrives: that of a post by its surface, while the path is told to its axis and the carrier
    /// stays what it is. It has spread less.
    pub(super) fn heard(&self, index: u32) -> Heard {
        let Echo { length_m, phase_rad, .. } = self.echoes[index as usize];
        match self.leads_m.get(index as usize) {
            None | Some(0.0) => Heard { length_m, phase_rad, gain: 1.0 },
            Some(lead_m) => {
                let heard_m = length_m - lead_m;
                let lead_rad = self.paths.plan.settings.wave_number_per_m * lead_m;
                let phase_rad = wrap_pi(phase_rad - lead_rad);
                Heard { length_m: heard_m, phase_rad, gain: heard_m / length_m }
            }
        }
    }

    /// Whether pulses may arrive in another order than their paths' lengths have.
    pub(super) fn is_reordered(&self) -> bool {
        !self.leads_m.is_empty()
    }

    /// How many of the echoes may arrive by pulses that have run up to a length, metres.
    pub(super) fn count_within(&self, length_m: f64) -> usize {
        let most_m = length_m + self.paths.plan.corners.most_lead_m;
        self.echoes.partition_point(|echo| echo.length_m <= most_m)
    }

    /// The full account of an echo that arrives with an amplitude.
    pub(super) fn arrival(&self, index: u32, amplitude: f64) -> Arrival {
        // What another thread left behind when it panicked are whole paths.
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let path = || self.paths.path(&self.traced, &self.echoes[index as usize]);
        let path = told.entry(index).or_insert_with(path).clone();
        let Heard { length_m, phase_rad, gain } = self.heard(index);
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

    /// The incidence of an echo, for a transmitter and a receiver that point in world directions, radians.
    pub(super) fn incident(&self, index: u32, axes_rad: [f64; 2]) -> Incident {
        let (paths, traced) = (&self.paths, &self.traced);
        let echo = &self.echoes[index as usize];
        let image = match echo.via.kind() {
            PathKind::Specular => mirrored(paths.mirrors_met(traced, echo)),
            PathKind::Diffracted => {
                let view = single::view(&paths.plan, &traced.out, traced.back(), echo);
                view.map_or(Image::Lost, Image::Bent)
            }
            PathKind::Scattered => Image::Lost,
        };
        let [leaving_rad, arriving_rad] = [
            wrap_pi(echo.departure.to_angle() - axes_rad[0]),
            wrap_pi(echo.arrival.to_angle() - axes_rad[1]),
        ];
        let Heard { length_m, gain, .. } = self.heard(index);
        Incident {
            strength: gain * echo.amplitude,
            incidence: Incidence { leaving_rad, arriving_rad, length_m, image },
        }
    }
}
