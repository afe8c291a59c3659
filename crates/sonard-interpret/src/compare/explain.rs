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
    shift::{Headings, Thresholds, Turns},
    together::Together,
};
use super::{Judged, keep_every_second};

pub use found::{Estimate, Explanation, Quantity};

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
    /// How scans can be turned against their predictions; scans of another plan are not.
    turns: Option<Turns>,
    headings: Headings,
    together: Together,
    thresholds: Thresholds,
}

impl Explainer {
    /// Takes in a scan with its beams.
    pub(super) fn add(&mut self, scan: &ScanView, beams: &[Judged<'_>]) {
        let turns = scan.start.as_ref().and_then(|start| Turns::of(&start.plan, beams));
        let turns =
            turns.filter(|turns| self.turns.get_or_insert_with(|| turns.clone()).is_like(turns));
        let is_turned = turns.is_some() && self.together.has_room(beams.len());
        let mut pairs = Vec::new();
        for beam in beams {
            self.thresholds.add(beam.ping);
            let is_kept = self.is_kept(beam.residual_m);
            let pair = if is_turned || is_kept {
                self.pair(scan, beam.ping, beam.residual_m)
            } else {
                None
            };
            if is_turned {
                pairs.push(pair.clone());
            }
            self.pairs.extend(pair.filter(|_| is_kept));
            if self.pairs.len() > MOST_PAIRS {
                keep_every_second(&mut self.pairs);
                self.stride *= 2;
            }
        }
        let Some(turns) = turns else { return };
        self.headings.add(&turns, beams);
        if is_turned {
            self.together.add(&turns, beams, pairs);
        }
    }

    /// Whether a pair of echoes is one of those that are kept.
    fn is_kept(&mut self, residual_m: Option<f64>) -> bool {
        if residual_m.is_none() {
            return false;
        }
        self.stride = self.stride.max(1);
        self.seen += 1;
        (self.seen - 1).is_multiple_of(self.stride)
    }

    /// `None` of a reading without a predicted path, and of another firing's sound.
    fn pair(&mut self, scan: &ScanView, ping: &Ping, residual_m: Option<f64>) -> Option<Pair> {
        let sim = ping.sim.as_ref().filter(|sim| sim.crosstalk.is_none())?;
        let path = sim.path.as_ref()?;
        let points = path.polyline(scan.viewpoint(ping)?.ends());
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
        let residual_m = residual_m.unwrap_or_default();
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
        found.extend(self.explanation("pose", &[(Quantity::XM, 0), (Quantity::YM, 1)], place));
        // What the measured range is to be multiplied by comes off the residual.
        let speed = of(&|pair| DVec3::new(0.0, 0.0, -pair.measured_m));
        found.extend(self.explanation("sound_speed", &[(Quantity::Percent, 2)], speed));
        let offset = of(&|_| DVec3::NEG_X);
        found.extend(self.explanation("range_offset", &[(Quantity::OffsetM, 0)], offset));
        for (name, number) in self.walls.iter().zip(0..) {
            let wall = of(&|pair| {
                let by_wall = pair.by_wall.iter().find(|(wall, _)| *wall == number);
                DVec3::new(by_wall.map_or(0.0, |(_, gain)| *gain), 0.0, 0.0)
            });
            found.extend(self.explanation(
                &format!("wall {name}"),
                &[(Quantity::OffsetM, 0)],
                wall,
            ));
        }
        let step_deg = self.turns.as_ref().map_or(0.0, |turns| turns.step_deg);
        found.extend(self.headings.explanation(step_deg));
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
            .explanation(step_deg)
            .filter(|all| all.gain > most + LEAST_GAIN && explains(all, LEAST_TOGETHER));
        found.splice(0..0, together);
        found
    }

    fn explanation(
        &self,
        change: &str,
        values: &[(Quantity, usize)],
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
