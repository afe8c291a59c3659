//! Outlier arcs: consecutive readings of an object that the scene lacks.
//!
//! A chair leg, a person or the robot's own body returns tens of beams in a row with nearly equal
//! ranges, and hides what is behind it. As independent outliers, such readings would bias whatever
//! parameter explains some of them. So each reading of a sweep has a hidden state that persists
//! from beam to beam: scene or outlier. The likelihood of a sweep sums over all state sequences by
//! the forward recursion of a hidden Markov model. The backward recursion gives each reading's
//! posterior probability of the scene state (Rabiner, "A tutorial on hidden Markov models", Proc.
//! IEEE 77, 1989, section III).

use crate::{likelihood::ErrorModel, sweep::RangeOutcome};

/// Reading with its emission density in the scene state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Emission {
    pub(crate) measured: RangeOutcome,
    /// Density in the scene state.
    pub(crate) of_scene: f64,
}

/// Posterior of the states of a sweep.
#[derive(Debug, Clone, Default)]
pub(crate) struct StatePosterior {
    pub(crate) log_likelihood: f64,
    /// Posterior probability of the scene state, by beam.
    pub(crate) of_scene: Vec<f64>,
    pub(crate) counts: OutlierCounts,
}

/// Expected numbers of beams.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct OutlierCounts {
    /// Total number of beams.
    pub(crate) all: f64,
    /// Beams in outlier arcs.
    pub(crate) of_else: f64,
    /// Beams without echo in outlier arcs.
    pub(crate) silent_of_else: f64,
    /// Transitions within an outlier arc.
    pub(crate) staying: f64,
    /// Transitions from an outlier arc to the scene.
    pub(crate) leaving: f64,
}

impl std::ops::AddAssign for OutlierCounts {
    fn add_assign(&mut self, other: Self) {
        self.all += other.all;
        self.of_else += other.of_else;
        self.silent_of_else += other.silent_of_else;
        self.staying += other.staying;
        self.leaving += other.leaving;
    }
}

/// Probabilities of the scene and the outlier state.
type StatePair = [f64; 2];

/// Log-likelihood of the readings of a sweep, in order of direction.
pub(crate) fn log_likelihood(readings: impl Iterator<Item = Emission>, errors: &ErrorModel) -> f64 {
    Forward::new(readings, errors).map(|step| step.norm.ln()).sum()
}

/// Log-likelihood and state posteriors of the readings of a sweep (forward-backward algorithm).
pub(crate) fn states(readings: &[Emission], errors: &ErrorModel) -> StatePosterior {
    if errors.outlier_arc_share == 0.0 {
        return alone(readings);
    }
    let steps: Vec<ForwardStep> = Forward::new(readings.iter().copied(), errors).collect();
    let changes = errors.changes();
    let mut counts = OutlierCounts { all: readings.len() as f64, ..OutlierCounts::default() };
    let mut of_scene = vec![0.0; readings.len()];
    // Density of all later readings given the state of this one, normalized by the forward pass.
    let mut later: StatePair = [1.0, 1.0];
    for at in (0..steps.len()).rev() {
        let ForwardStep { states, .. } = steps[at];
        let of_else = states[1] * later[1];
        of_scene[at] = states[0] * later[0];
        counts.of_else += of_else;
        counts.silent_of_else +=
            if readings[at].measured == RangeOutcome::NoEcho { of_else } else { 0.0 };
        let Some(before) = at.checked_sub(1) else { break };
        let (before, own) = (steps[before].states, steps[at]);
        let pass = |from: usize, to: usize| {
            changes[from][to] * own.densities[from][to] / own.norm * later[to]
        };
        counts.staying += before[1] * pass(1, 1);
        counts.leaving += before[1] * pass(1, 0);
        later = [0, 1].map(|from| pass(from, 0) + pass(from, 1));
    }
    let log_likelihood = steps.iter().map(|step| step.norm.ln()).sum();
    StatePosterior { log_likelihood, of_scene, counts }
}

/// Result without outlier arcs: all readings in the scene state.
fn alone(readings: &[Emission]) -> StatePosterior {
    StatePosterior {
        log_likelihood: readings.iter().map(|reading| reading.of_scene.ln()).sum(),
        of_scene: vec![1.0; readings.len()],
        counts: OutlierCounts { all: readings.len() as f64, ..OutlierCounts::default() },
    }
}

/// Step of the forward recursion.
#[derive(Debug, Clone, Copy)]
struct ForwardStep {
    /// State probabilities, given this reading and all before.
    states: StatePair,
    /// Density of the reading, given those before it.
    norm: f64,
    /// Density of the reading, by the previous and the current state.
    densities: [StatePair; 2],
}

/// Forward recursion over the readings.
struct Forward<'a, I> {
    readings: I,
    errors: &'a ErrorModel,
    changes: [StatePair; 2],
    /// Previous beam with its state probabilities.
    before: Option<(Emission, StatePair)>,
}

impl<'a, I: Iterator<Item = Emission>> Forward<'a, I> {
    fn new(readings: I, errors: &'a ErrorModel) -> Self {
        Self { readings, errors, changes: errors.changes(), before: None }
    }
}

impl<I: Iterator<Item = Emission>> Iterator for Forward<'_, I> {
    type Item = ForwardStep;

    fn next(&mut self) -> Option<ForwardStep> {
        let reading = self.readings.next()?;
        let first = self.errors.of_else(None, reading.measured);
        let densities = match self.before {
            None => [[reading.of_scene, first]; 2],
            Some((before, _)) => {
                let follows = self.errors.of_else(Some(before.measured), reading.measured);
                [[reading.of_scene, first], [reading.of_scene, follows]]
            }
        };
        let prior = |to: usize| match self.before {
            None => {
                [1.0 - self.errors.outlier_arc_share, self.errors.outlier_arc_share][to]
                    * densities[0][to]
            }
            Some((_, before)) => {
                let pass =
                    |from: usize| before[from] * self.changes[from][to] * densities[from][to];
                pass(0) + pass(1)
            }
        };
        let both = [prior(0), prior(1)];
        let norm = both[0] + both[1];
        let states = both.map(|of| of / norm);
        self.before = Some((reading, states));
        Some(ForwardStep { states, norm, densities })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn echo(range_m: f64, of_scene: f64) -> Emission {
        Emission { measured: RangeOutcome::Echo { range_m }, of_scene }
    }

    /// Two beams without echo, an arc at 0.7 m, scene echoes, and two targets below the minimum
    /// range.
    fn readings() -> Vec<Emission> {
        let without = |measured: RangeOutcome, of_scene: f64| Emission { measured, of_scene };
        vec![
            without(RangeOutcome::NoEcho, 0.9),
            without(RangeOutcome::NoEcho, 0.01),
            echo(0.7, 1e-4),
            echo(0.702, 3.0),
            echo(0.699, 1e-3),
            echo(1.4, 300.0),
            echo(1.41, 0.2),
            without(RangeOutcome::BelowMinRange, 0.02),
            without(RangeOutcome::BelowMinRange, 0.7),
        ]
    }

    /// Joint density of the readings and one state sequence.
    fn joint(readings: &[Emission], is_else: &[bool], errors: &ErrorModel) -> f64 {
        let changes = errors.changes();
        let mut joint = 1.0;
        for at in 0..readings.len() {
            let own = usize::from(is_else[at]);
            let before = at.checked_sub(1).map(|before| usize::from(is_else[before]));
            joint *= match before {
                None => [1.0 - errors.outlier_arc_share, errors.outlier_arc_share][own],
                Some(before) => changes[before][own],
            };
            joint *= match (own, before) {
                (0, _) => readings[at].of_scene,
                (_, Some(1)) => {
                    errors.of_else(Some(readings[at - 1].measured), readings[at].measured)
                }
                _ => errors.of_else(None, readings[at].measured),
            };
        }
        joint
    }

    #[test]
    fn recursions_sum_over_all_sequences() {
        let readings = readings();
        let errors = ErrorModel { outlier_arc_beams: 3.0, ..ErrorModel::rough(0.002, 1.0, 4.0) };
        let (mut all, mut staying, mut leaving) = (0.0, 0.0, 0.0);
        let mut of_scene = vec![0.0; readings.len()];
        for sequence in 0u32..1 << readings.len() {
            let is_else: Vec<bool> =
                (0..readings.len()).map(|at| sequence & (1 << at) != 0).collect();
            let joint = joint(&readings, &is_else, &errors);
            all += joint;
            for (at, of) in is_else.iter().enumerate() {
                of_scene[at] += if *of { 0.0 } else { joint };
            }
            for pair in is_else.windows(2).filter(|pair| pair[0]) {
                *(if pair[1] { &mut staying } else { &mut leaving }) += joint;
            }
        }
        let states = states(&readings, &errors);
        assert!((states.log_likelihood - all.ln()).abs() < 1e-12);
        let alone = log_likelihood(readings.iter().copied(), &errors);
        assert!((states.log_likelihood - alone).abs() < 1e-12);
        for (found, expected) in states.of_scene.iter().zip(&of_scene) {
            assert!((found - expected / all).abs() < 1e-12, "{found} {expected}");
        }
        assert!((states.counts.staying - staying / all).abs() < 1e-12, "{:?}", states.counts);
        assert!((states.counts.leaving - leaving / all).abs() < 1e-12, "{:?}", states.counts);
        // The arc is an outlier, the echo that fits to the millimetre is not.
        assert!(states.of_scene[2] < 0.01 && states.of_scene[5] > 0.9, "{:?}", states.of_scene);
    }

    /// Holds for a whole sweep that the scene does not explain, although an outlier arc would be
    /// 10^1000 times as likely.
    #[test]
    fn readings_are_independent_without_arcs() {
        let errors = ErrorModel::rough(0.002, 1.0, 4.0).without_arcs();
        let one_arc = vec![echo(0.7, 1e-4); 400];
        for readings in [readings(), one_arc] {
            let alone: f64 = readings.iter().map(|reading| reading.of_scene.ln()).sum();
            let states = states(&readings, &errors);
            assert!((states.log_likelihood - alone).abs() < 1e-9);
            let likely = log_likelihood(readings.iter().copied(), &errors);
            assert!((likely - alone).abs() < 1e-9);
            assert!(states.of_scene.iter().all(|of_scene| *of_scene == 1.0), "{states:?}");
        }
    }

    /// A sweep that is a single outlier arc does not overflow.
    #[test]
    fn whole_sweep_can_be_an_arc() {
        let errors = ErrorModel { outlier_arc_share: 1e-3, ..ErrorModel::rough(0.002, 1.0, 4.0) };
        let states = states(&[echo(0.7, 1e-4); 400], &errors);
        assert!((states.counts.of_else - 400.0).abs() < 1e-3, "{:?}", states.counts);
        assert!(states.of_scene.iter().all(|of_scene| (0.0..1e-3).contains(of_scene)));
    }
}
