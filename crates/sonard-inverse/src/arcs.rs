//! Arcs that the scene does not explain: consecutive readings of something that it lacks.
//!
//! A chair leg, a person or the robot's own body answers tens of beams in a row with nearly equal ranges, and hides what is
//! behind it. Charged one by one, as if each had come from nowhere, such readings would bend whatever parameter explains
//! some of them. So each reading of a sweep has a hidden state that is kept from beam to beam more often than it changes:
//! of the scene, or of something else. The likelihood of a sweep sums over all sequences of states by the forward
//! recursion of a hidden Markov model, and the backward recursion gives each reading's posterior probability of being of
//! the scene (Rabiner, "A tutorial on hidden Markov models", Proc. IEEE 77, 1989, section III).

use crate::{likelihood::ErrorModel, sweep::Outcome};

/// A reading, as likely as each state makes it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Emission {
    pub(crate) heard: Outcome,
    /// Density if it is of the scene.
    pub(crate) of_scene: f64,
}

/// What a sweep's readings say about the states of its beams.
#[derive(Debug, Clone, Default)]
pub(crate) struct States {
    pub(crate) log_likelihood: f64,
    /// By beam, the posterior probability that its reading is of the scene.
    pub(crate) of_scene: Vec<f64>,
    pub(crate) counts: Counts,
}

/// Expected numbers of beams.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Counts {
    /// All.
    pub(crate) all: f64,
    /// Of something else than the scene.
    pub(crate) of_else: f64,
    /// Silent ones of these.
    pub(crate) silent_of_else: f64,
    /// Those after which an arc of something else goes on, and those after which it ends.
    pub(crate) staying: f64,
    pub(crate) leaving: f64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.all += other.all;
        self.of_else += other.of_else;
        self.silent_of_else += other.silent_of_else;
        self.staying += other.staying;
        self.leaving += other.leaving;
    }
}

/// Probabilities of both states, of the scene and of something else.
type Both = [f64; 2];

/// Log-likelihood of a sweep's readings, in the order of their directions.
pub(crate) fn log_likelihood(readings: impl Iterator<Item = Emission>, errors: &ErrorModel) -> f64 {
    Forward::new(readings, errors).map(|step| step.norm.ln()).sum()
}

/// The same with what the readings say about each state.
pub(crate) fn states(readings: &[Emission], errors: &ErrorModel) -> States {
    if errors.arcs == 0.0 {
        return alone(readings);
    }
    let steps: Vec<Step> = Forward::new(readings.iter().copied(), errors).collect();
    let changes = errors.changes();
    let mut counts = Counts { all: readings.len() as f64, ..Counts::default() };
    let mut of_scene = vec![0.0; readings.len()];
    // Probability of all later readings by the state of this one, over their probability after the earlier ones.
    let mut later: Both = [1.0, 1.0];
    for at in (0..steps.len()).rev() {
        let Step { states, .. } = steps[at];
        let of_else = states[1] * later[1];
        of_scene[at] = states[0] * later[0];
        counts.of_else += of_else;
        counts.silent_of_else += if readings[at].heard == Outcome::Silence { of_else } else { 0.0 };
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
    States { log_likelihood, of_scene, counts }
}

/// The same where nothing is looked for but the scene.
fn alone(readings: &[Emission]) -> States {
    States {
        log_likelihood: readings.iter().map(|reading| reading.of_scene.ln()).sum(),
        of_scene: vec![1.0; readings.len()],
        counts: Counts { all: readings.len() as f64, ..Counts::default() },
    }
}

/// A beam of the forward recursion.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// Probabilities of its states, given its reading and those before it.
    states: Both,
    /// Density of its reading, given those before it.
    norm: f64,
    /// Density of its reading, by the state before it and its own.
    densities: [Both; 2],
}

/// The forward recursion.
struct Forward<'a, I> {
    readings: I,
    errors: &'a ErrorModel,
    changes: [Both; 2],
    /// The beam before, with its states.
    before: Option<(Emission, Both)>,
}

impl<'a, I: Iterator<Item = Emission>> Forward<'a, I> {
    fn new(readings: I, errors: &'a ErrorModel) -> Self {
        Self { readings, errors, changes: errors.changes(), before: None }
    }
}

impl<I: Iterator<Item = Emission>> Iterator for Forward<'_, I> {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        let reading = self.readings.next()?;
        let first = self.errors.of_else(None, reading.heard);
        let densities = match self.before {
            None => [[reading.of_scene, first]; 2],
            Some((before, _)) => {
                let follows = self.errors.of_else(Some(before.heard), reading.heard);
                [[reading.of_scene, first], [reading.of_scene, follows]]
            }
        };
        let prior = |to: usize| match self.before {
            None => [1.0 - self.errors.arcs, self.errors.arcs][to] * densities[0][to],
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
        Some(Step { states, norm, densities })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn echo(range_m: f64, of_scene: f64) -> Emission {
        Emission { heard: Outcome::Echo { range_m }, of_scene }
    }

    /// Two silences, an arc at 0.7 m, echoes that the scene makes likely, and two of something near.
    fn readings() -> Vec<Emission> {
        let without = |heard: Outcome, of_scene: f64| Emission { heard, of_scene };
        vec![
            without(Outcome::Silence, 0.9),
            without(Outcome::Silence, 0.01),
            echo(0.7, 1e-4),
            echo(0.702, 3.0),
            echo(0.699, 1e-3),
            echo(1.4, 300.0),
            echo(1.41, 0.2),
            without(Outcome::Near, 0.02),
            without(Outcome::Near, 0.7),
        ]
    }

    /// The probability of the readings with one sequence of states.
    fn joint(readings: &[Emission], is_else: &[bool], errors: &ErrorModel) -> f64 {
        let changes = errors.changes();
        let mut joint = 1.0;
        for at in 0..readings.len() {
            let own = usize::from(is_else[at]);
            let before = at.checked_sub(1).map(|before| usize::from(is_else[before]));
            joint *= match before {
                None => [1.0 - errors.arcs, errors.arcs][own],
                Some(before) => changes[before][own],
            };
            joint *= match (own, before) {
                (0, _) => readings[at].of_scene,
                (_, Some(1)) => errors.of_else(Some(readings[at - 1].heard), readings[at].heard),
                _ => errors.of_else(None, readings[at].heard),
            };
        }
        joint
    }

    #[test]
    fn recursions_sum_over_all_sequences_of_states() {
        let readings = readings();
        let errors = ErrorModel { arc_beams: 3.0, ..ErrorModel::rough(0.002, 1.0, 4.0) };
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
        // The arc is of something else, the echo that fits to the millimetre is not.
        assert!(states.of_scene[2] < 0.01 && states.of_scene[5] > 0.9, "{:?}", states.of_scene);
    }

    /// Also of a whole sweep that the scene explains nowhere, which an arc of something else would explain 10^1000 times as
    /// well.
    #[test]
    fn without_arcs_every_reading_stands_alone() {
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

    /// The same sweep with arcs: all of it is of one, and nothing overflows.
    #[test]
    fn a_sweep_may_be_one_arc() {
        let errors = ErrorModel { arcs: 1e-3, ..ErrorModel::rough(0.002, 1.0, 4.0) };
        let states = states(&[echo(0.7, 1e-4); 400], &errors);
        assert!((states.counts.of_else - 400.0).abs() < 1e-3, "{:?}", states.counts);
        assert!(states.of_scene.iter().all(|of_scene| (0.0..1e-3).contains(of_scene)));
    }
}
