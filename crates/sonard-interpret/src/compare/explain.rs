//! Single changes of the model that would fit the readings better than their predictions, each
//! with its gain in log-likelihood.
//!
//! A path is stationary in the points of its interactions (Fermat). To first order its length
//! therefore changes only by the explicit displacement: `dL = sum dp . (u_in - u_out)`, with the
//! unit directions of propagation before and after each point, and
//! `-(u_departure + u_arrival) . dx` for the transducer. Records with paths are sufficient;
//! nothing has to be predicted again.
//!
//! A heading error changes no path of a transducer on the axis, but rotates all arcs. It is found
//! by comparing readings with the predictions of neighbouring beams. A threshold error moves the
//! ends of arcs. It follows from the predicted margins of echoes and missing echoes.
//!
//! Residuals follow a Gaussian with 10 % uniform outliers ([`likelihood`]). First-order path
//! changes hold for some centimetres and degrees; larger errors require localization.

mod combined;
mod explanation;
mod fit;
mod likelihood;
mod shift;
#[cfg(test)]
mod tests;

use glam::DVec3;
use sonard_model::geometry::DVec2;
use sonard_records::{InteractionKind, Ping, ScanView};

use self::{
    combined::CombinedFit,
    explanation::LinearizedPair,
    fit::{LinearFit, fit},
    shift::{BeamShifts, HeadingLikelihood, ThresholdLikelihood},
};
use super::{ClassifiedPing, keep_every_second};

pub use explanation::{ChangeEstimate, ChangedQuantity, Explanation};

/// Changes with a smaller gain in log-likelihood are noise.
const MIN_GAIN: f64 = 10.0;
/// Estimates below this many standard deviations are noise.
const MIN_SIGMAS: f64 = 3.0;
// Fractions of the echo pairs that a change has to explain. As many arcs as a change has
// parameters can always be fitted, so a change that moves all readings must explain more than one
// that moves a single wall.
const MIN_SHARE_WALL: f64 = 0.05;
const MIN_SHARE_SINGLE: f64 = 0.15;
const MIN_SHARE_COMBINED: f64 = 0.35;
/// Maximum number of echo pairs kept; beyond it the pairs are decimated by powers of two.
const MAX_PAIRS: usize = 20_000;

/// Search for better-fitting changes, fed scan by scan; holds at most [`MAX_PAIRS`] pairs.
/// Gathers scans one by one; holds at most [`MAX_PAIRS`] pairs.
#[derive(Debug, Default)]
pub(super) struct Explainer {
    pairs: Vec<LinearizedPair>,
    walls: Vec<String>,
    seen: usize,
    /// Decimation factor of the kept pairs.
    stride: usize,
    /// Beam shifts of the first suitable scan; scans with different shifts are not rotated.
    shifts: Option<BeamShifts>,
    headings: HeadingLikelihood,
    combined: CombinedFit,
    thresholds: ThresholdLikelihood,
}

impl Explainer {
    /// Adds a scan with its classified beams.
    pub(super) fn add(&mut self, scan: &ScanView, beams: &[ClassifiedPing<'_>]) {
        let shifts = scan.start.as_ref().and_then(|start| BeamShifts::for_scan(&start.plan, beams));
        let shifts = shifts
            .filter(|shifts| self.shifts.get_or_insert_with(|| shifts.clone()).is_like(shifts));
        let is_shifted = shifts.is_some() && self.combined.has_room(beams.len());
        let mut pairs = Vec::new();
        for beam in beams {
            self.thresholds.add(beam.ping);
            let is_kept = self.is_kept(beam.residual_m);
            let pair = if is_shifted || is_kept {
                self.pair(scan, beam.ping, beam.residual_m)
            } else {
                None
            };
            if is_shifted {
                pairs.push(pair.clone());
            }
            self.pairs.extend(pair.filter(|_| is_kept));
            if self.pairs.len() > MAX_PAIRS {
                keep_every_second(&mut self.pairs);
                self.stride *= 2;
            }
        }
        let Some(shifts) = shifts else { return };
        self.headings.add(&shifts, beams);
        if is_shifted {
            self.combined.add(&shifts, beams, pairs);
        }
    }

    /// Returns `true` if a pair of echoes passes the decimation.
    fn is_kept(&mut self, residual_m: Option<f64>) -> bool {
        if residual_m.is_none() {
            return false;
        }
        self.stride = self.stride.max(1);
        self.seen += 1;
        (self.seen - 1).is_multiple_of(self.stride)
    }

    /// Linearized pair of a reading; `None` without a predicted path, and for crosstalk.
    fn pair(
        &mut self,
        scan: &ScanView,
        ping: &Ping,
        residual_m: Option<f64>,
    ) -> Option<LinearizedPair> {
        let sim = ping.sim.as_ref().filter(|sim| sim.crosstalk.is_none())?;
        let path = sim.path.as_ref()?;
        let points = path.polyline(scan.viewpoint(ping)?.transducer_positions());
        let is_level =
            path.interactions.iter().all(|point| point.id != "floor" && point.id != "ceiling");
        if !is_level {
            // Only the model has the heights of the ends.
            return None;
        }
        let unit = |pair: &[DVec2]| (pair[1] - pair[0]).normalize_or_zero();
        let directions: Vec<DVec2> = points.windows(2).map(unit).collect();
        let (first, last) = (directions.first()?, directions.last()?);
        // Half, because a range is half a path length.
        let mut d_position = 0.5 * (*last - *first);
        let mut d_walls: Vec<(u16, f64)> = Vec::new();
        for (interaction, around) in path.interactions.iter().zip(directions.windows(2)) {
            let turn = around[0] - around[1];
            match interaction.kind {
                InteractionKind::Reflection => {
                    let wall = self.wall_number(&interaction.id)?;
                    match d_walls.iter_mut().find(|(known, _)| *known == wall) {
                        Some((_, derivative)) => *derivative += 0.5 * turn.length(),
                        None => d_walls.push((wall, 0.5 * turn.length())),
                    }
                }
                InteractionKind::Transducer => d_position += 0.5 * turn,
                InteractionKind::Diffraction | InteractionKind::Scattering => {}
            }
        }
        let measured_m = ping.range_m.unwrap_or_default();
        let residual_m = residual_m.unwrap_or_default();
        Some(LinearizedPair { measured_m, residual_m, d_position, d_walls })
    }

    fn wall_number(&mut self, wall: &str) -> Option<u16> {
        let known = self.walls.iter().position(|known| known == wall);
        let at = known.unwrap_or_else(|| {
            self.walls.push(wall.to_owned());
            self.walls.len() - 1
        });
        u16::try_from(at).ok()
    }

    /// Returns the changes that would fit the readings better, largest gain first.
    pub(super) fn finish(self) -> Vec<Explanation> {
        let mut found: Vec<Explanation> = Vec::new();
        let solve = |gradient: &dyn Fn(&LinearizedPair) -> DVec3| {
            fit(self.pairs.iter().map(|pair| (pair.residual_m, gradient(pair))))
        };
        let position = solve(&|pair| pair.d_position.extend(0.0));
        found.extend(self.explanation(
            "pose",
            &[(ChangedQuantity::XM, 0), (ChangedQuantity::YM, 1)],
            position,
        ));
        // The measured range scales with the speed of sound: opposite sign in the residual.
        let speed = solve(&|pair| DVec3::new(0.0, 0.0, -pair.measured_m));
        found.extend(self.explanation("sound_speed", &[(ChangedQuantity::Percent, 2)], speed));
        let offset = solve(&|_| DVec3::NEG_X);
        found.extend(self.explanation("range_offset", &[(ChangedQuantity::OffsetM, 0)], offset));
        for (name, number) in self.walls.iter().zip(0..) {
            let wall = solve(&|pair| {
                let derivative = pair.d_walls.iter().find(|(wall, _)| *wall == number);
                DVec3::new(derivative.map_or(0.0, |(_, value)| *value), 0.0, 0.0)
            });
            found.extend(self.explanation(
                &format!("wall {name}"),
                &[(ChangedQuantity::OffsetM, 0)],
                wall,
            ));
        }
        let step_deg = self.shifts.as_ref().map_or(0.0, |shifts| shifts.step_deg);
        found.extend(self.headings.explanation(step_deg));
        found.extend(self.thresholds.explanation());
        let explains =
            |found: &Explanation, share: f64| f64::from(found.explains) >= share * self.seen as f64;
        found.retain(|found| {
            let is_significant =
                |estimate: &ChangeEstimate| estimate.value.abs() > MIN_SIGMAS * estimate.sigma;
            let is_wall = found.change.starts_with("wall ");
            let min_share = if is_wall { MIN_SHARE_WALL } else { MIN_SHARE_SINGLE };
            // A threshold explains missing echoes, not pairs.
            let is_shared = found.change == "threshold" || explains(found, min_share);
            found.gain >= MIN_GAIN && is_shared && found.estimates.iter().any(is_significant)
        });
        found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        // The combined change always fits better than a single one; the extra gain decides.
        let max_gain = found.first().map_or(0.0, |best| best.gain);
        let combined = self
            .combined
            .explanation(step_deg)
            .filter(|all| all.gain > max_gain + MIN_GAIN && explains(all, MIN_SHARE_COMBINED));
        found.splice(0..0, combined);
        found
    }

    fn explanation(
        &self,
        change: &str,
        values: &[(ChangedQuantity, usize)],
        fit: Option<LinearFit>,
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
