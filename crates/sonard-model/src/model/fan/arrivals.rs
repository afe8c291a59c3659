//! All arrivals of the fan at one place.

use std::collections::HashMap;

use super::{
    Fan,
    ray::{FanCandidate, PathKey, Weighing},
};
use crate::{
    acoustics::PulseArrival,
    geometry::DVec2,
    model::{Arrival, Arrivals},
};

pub(super) struct FanArrivals<'a> {
    fan: &'a Fan,
    position: DVec2,
    /// Shortest first, each path once.
    candidates: Vec<FanCandidate>,
    /// Weighting data of the candidates, close together in memory.
    weighings: Vec<Weighing>,
}

impl<'a> FanArrivals<'a> {
    pub(super) fn trace(fan: &'a Fan, position: DVec2) -> Self {
        let mut closest = Closest::default();
        for mut ray in fan.fan(position) {
            loop {
                let (candidate, hit) = ray.advance(fan, position);
                candidate.into_iter().for_each(|candidate| closest.offer(candidate));
                let Some(hit) = hit else { break };
                if ray.travelled_m() + hit.distance_m > fan.settings.max_path_m {
                    break;
                }
                for candidate in ray.diffract(&hit, fan, position) {
                    closest.offer(candidate);
                }
                if !ray.reflect(&hit, fan) {
                    break;
                }
            }
        }
        let mut candidates: Vec<FanCandidate> = closest.0.into_values().collect();
        // Ties (a corner's two orders) are broken by the surfaces, so that results do not depend on
        // the order of a hash table.
        candidates.sort_by(|first, second| {
            first.length_m.total_cmp(&second.length_m).then_with(|| first.key.cmp(&second.key))
        });
        let weighings = candidates.iter().map(FanCandidate::weighing).collect();
        Self { fan, position, candidates, weighings }
    }
}

impl Arrivals for FanArrivals<'_> {
    fn collect_arrivals(&self, direction_rad: f64, arrivals: &mut Vec<PulseArrival>) {
        arrivals.clear();
        let facing = DVec2::from_angle(direction_rad);
        arrivals.extend(self.weighings.iter().zip(0..).filter_map(|(weighing, index)| {
            let amplitude = weighing.amplitude(&self.fan.beam, facing);
            let length_m = weighing.length_m;
            let arrival = PulseArrival { length_m, amplitude, phase_rad: 0.0, index };
            (amplitude >= self.fan.settings.min_amplitude).then_some(arrival)
        }));
    }

    fn arrival(&self, _direction_rad: f64, arrival: &PulseArrival) -> Arrival {
        let candidate = &self.candidates[arrival.index as usize];
        candidate.arrival(self.fan, self.position, arrival.amplitude)
    }
}

/// The closest ray to the receiver for each path.
#[derive(Default)]
struct Closest(HashMap<PathKey, FanCandidate>);

impl Closest {
    fn offer(&mut self, candidate: FanCandidate) {
        match self.0.get_mut(&candidate.key) {
            Some(known) if candidate.miss_m < known.miss_m => *known = candidate,
            Some(_) => {}
            None => {
                self.0.insert(candidate.key.clone(), candidate);
            }
        }
    }
}
