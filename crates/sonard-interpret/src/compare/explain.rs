//! What would explain readings better than what they were predicted with: each change by itself, with its gain
//! in likelihood.
//!
//! A path is stationary in the points of its interactions (Fermat), so to first order its length changes by what
//! moves explicitly alone: `dL = sum dp . (u_in - u_out)`, with the unit directions of propagation before and
//! after each point, and `-(u_departure + u_arrival) . dx` for the transducer. So records with paths are enough,
//! and nothing is predicted again. A heading moves no path of a transducer on the axis, but all arcs: it is
//! looked for by setting readings beside the predictions of neighbouring beams. A threshold moves where arcs end:
//! it follows from the margins of predictions beside echoes and silences.
//!
//! A residual is Gaussian, or once in ten from anywhere (`likelihood`). First-order
//! changes of paths hold for some centimetres and degrees; what is farther off has to be localised.

mod fit;
mod found;
mod likelihood;
mod shift;
#[cfg(test)]
mod tests;
mod together;

use glam::DVec3;
use sonard_model::geometry::DVec2;
use sonard_records::{InteractionKind, Ping, ScanView};

use self::{
    fit::{Fit, fit},
    found::Pair,
    shift::{Headings, Thresholds},
    together::Together,
};
use super::Judged;

pub use found::{Estimate, Explanation};

/// Changes with less gain in log-likelihood than this are noise.
const LEAST_GAIN: f64 = 10.0;
/// And so are estimates below this many standard deviations.
const LEAST_SIGMAS: f64 = 3.0;
/// Shares of the pairs of echoes that a change has to explain: as many arcs as it has values can always be fitted, so
/// one that moves all readings has to explain more than one that moves a wall.
const LEAST_BY_WALL: f64 = 0.05;
const LEAST_BY_ONE: f64 = 0.15;
const LEAST_TOGETHER: f64 = 0.35;
/// Pairs of echoes that are kept; of more, every second, fourth and so on.
const MOST_PAIRS: usize = 20_000;

/// Gathers scans one by one; holds at most [`MOST_PAIRS`] pairs.
#[derive(Debug, Default)]
pub(super) struct Explainer {
    pairs: Vec<Pair>,
    walls: Vec<String>,
    seen: usize,
    /// Every so many pairs are kept.
    stride: usize,
    headings: Headings,
    together: Together,
    thresholds: Thresholds,
}

impl Explainer {
    /// Takes in a scan with its beams.
    pub(super) fn add(&mut self, scan: &ScanView, beams: &[Judged<'_>]) {
        self.stride = self.stride.max(1);
        for beam in beams {
            self.thresholds.add(beam.ping);
            let Some(residual_m) = beam.residual_m else { continue };
            self.seen += 1;
            if !(self.seen - 1).is_multiple_of(self.stride) {
                continue;
            }
            let pair = self.pair(scan, beam.ping, residual_m);
            self.pairs.extend(pair);
            if self.pairs.len() > MOST_PAIRS {
                let mut place = 0;
                self.pairs.retain(|_| {
                    place += 1;
                    place % 2 == 1
                });
                self.stride *= 2;
            }
        }
        if let Some(start) = &scan.start {
            self.headings.add(&start.plan, beams);
            let pairs = beams.iter().map(|beam| self.pair(scan, beam.ping, 0.0)).collect();
            self.together.add(&start.plan, beams, pairs);
        }
    }

    /// `None` of a reading without a predicted path that says its points.
    fn pair(&mut self, scan: &ScanView, ping: &Ping, residual_m: f64) -> Option<Pair> {
        let path = ping.sim.as_ref()?.path.as_ref()?;
        let points = path.polyline(scan.viewpoint(ping)?.ends())?;
        let is_level = path.interactions.iter().all(|met| met.id != "floor" && met.id != "ceiling");
        if !is_level {
            // What the ends' heights are is the model's to know.
            return None;
        }
        let run = |pair: &[DVec2]| (pair[1] - pair[0]).normalize_or_zero();
        let runs: Vec<DVec2> = points.windows(2).map(run).collect();
        let (first, last) = (runs.first()?, runs.last()?);
        // Half of it, because a range is half a path.
        let mut by_place = 0.5 * (*last - *first);
        let mut by_wall: Vec<(u16, f64)> = Vec::new();
        for (met, runs) in path.interactions.iter().zip(runs.windows(2)) {
            let turn = runs[0] - runs[1];
            match met.kind {
                InteractionKind::Reflection => {
                    let wall = self.number(&met.id)?;
                    match by_wall.iter_mut().find(|(known, _)| *known == wall) {
                        Some((_, gain)) => *gain += 0.5 * turn.length(),
                        None => by_wall.push((wall, 0.5 * turn.length())),
                    }
                }
                InteractionKind::Transducer => by_place += 0.5 * turn,
                InteractionKind::Diffraction | InteractionKind::Scattering => {}
            }
        }
        let measured_m = ping.range_m.unwrap_or_default();
        Some(Pair { measured_m, residual_m, by_place, by_wall })
    }

    fn number(&mut self, wall: &str) -> Option<u16> {
        let known = self.walls.iter().position(|known| known == wall);
        let at = known.unwrap_or_else(|| {
            self.walls.push(wall.to_owned());
            self.walls.len() - 1
        });
        u16::try_from(at).ok()
    }

    /// What would explain the readings better, most gain first.
    pub(super) fn finish(self) -> Vec<Explanation> {
        let mut found: Vec<Explanation> = Vec::new();
        let of = |gain: &dyn Fn(&Pair) -> DVec3| {
            fit(self.pairs.iter().map(|pair| (pair.residual_m, gain(pair))))
        };
        let place = of(&|pair| pair.by_place.extend(0.0));
        found.extend(self.explanation("pose", &[("x_m", 0), ("y_m", 1)], place));
        // What the measured range is to be multiplied by comes off the residual.
        let speed = of(&|pair| DVec3::new(0.0, 0.0, -pair.measured_m));
        found.extend(self.explanation("sound_speed", &[("percent", 2)], speed));
        let offset = of(&|_| DVec3::NEG_X);
        found.extend(self.explanation("range_offset", &[("offset_m", 0)], offset));
        for (name, number) in self.walls.iter().zip(0..) {
            let wall = of(&|pair| {
                let by_wall = pair.by_wall.iter().find(|(wall, _)| *wall == number);
                DVec3::new(by_wall.map_or(0.0, |(_, gain)| *gain), 0.0, 0.0)
            });
            found.extend(self.explanation(&format!("wall {name}"), &[("offset_m", 0)], wall));
        }
        found.extend(self.headings.explanation());
        found.extend(self.thresholds.explanation());
        let explains =
            |found: &Explanation, share: f64| f64::from(found.explains) >= share * self.seen as f64;
        found.retain(|found| {
            let is_far = |estimate: &Estimate| estimate.value.abs() > LEAST_SIGMAS * estimate.sigma;
            let is_of_wall = found.change.starts_with("wall ");
            let least = if is_of_wall { LEAST_BY_WALL } else { LEAST_BY_ONE };
            // Of a threshold it is silences that are explained.
            let is_shared = found.change == "threshold" || explains(found, least);
            found.gain >= LEAST_GAIN && is_shared && found.estimates.iter().any(is_far)
        });
        found.sort_by(|one, other| other.gain.total_cmp(&one.gain));
        // All at once explain more than one of them; what counts is by how much.
        let most = found.first().map_or(0.0, |best| best.gain);
        let together = self
            .together
            .explanation()
            .filter(|all| all.gain > most + LEAST_GAIN && explains(all, LEAST_TOGETHER));
        found.splice(0..0, together);
        found
    }

    fn explanation(
        &self,
        change: &str,
        values: &[(&'static str, usize)],
        fit: Option<Fit>,
    ) -> Option<Explanation> {
        let fit = fit?;
        Some(Explanation {
            change: change.to_owned(),
            estimates: values.iter().map(|&(name, at)| fit.estimate(name, at)).collect(),
            gain: fit.gain * self.stride as f64,
            explains: fit.explains * self.stride as u32,
        })
    }
}
