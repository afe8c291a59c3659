//! Paths by which a plan explains arcs.

use sonard_model::model::{Mechanism, Path, Prediction, Reflector};

use crate::{
    arc::{Arc, find_arcs},
    arrangement::{LineArrangement, PieceSet, Run},
    judge::{Judge, Predictions, outcome_of},
    posed::PosedPlan,
    range_errors::RangeErrors,
    readings::{Outcome, Readings},
    workspace::Workspace,
};

/// Arc that a plan explains.
pub(crate) struct ExplainedArc<'a> {
    pub(crate) arc: &'a Arc,
    /// Beams whose predicted range agrees.
    pub(crate) beams: Vec<usize>,
    /// Prediction of the middle one.
    pub(crate) prediction: &'a Prediction,
}

impl ExplainedArc<'_> {
    /// Measured minus predicted ranges of the beams that agree, metres.
    pub(crate) fn range_errors_m(
        &self,
        readings: &Readings,
        predictions: &[Prediction],
    ) -> Vec<f64> {
        let error = |&at: &usize| match (readings.beams[at].outcome, outcome_of(&predictions[at])) {
            (Outcome::Echo(measured_m), Outcome::Echo(expected_m)) => Some(measured_m - expected_m),
            _ => None,
        };
        self.beams.iter().filter_map(error).collect()
    }

    /// Path of the echo.
    pub(crate) fn path(&self) -> Option<&Path> {
        self.prediction.arrival.as_ref().map(|arrival| &arrival.path)
    }
}

/// Explanation of an arc by the predictions of its sweep: at least `share` of its beams agree
/// within `gate_m`.
pub(crate) fn explain<'a>(
    arc: &'a Arc,
    readings: &Readings,
    predictions: &'a [Prediction],
    gate_m: f64,
    share: f64,
) -> Option<ExplainedArc<'a>> {
    let agrees = |at: &usize| {
        let pair = (readings.beams[*at].outcome, outcome_of(&predictions[*at]));
        matches!(pair, (Outcome::Echo(a), Outcome::Echo(b)) if (a - b).abs() < gate_m)
    };
    let beams: Vec<usize> = arc.beams.iter().copied().filter(agrees).collect();
    if beams.is_empty() || (beams.len() as f64) < share * arc.beams.len() as f64 {
        return None;
    }
    let prediction = &predictions[beams[beams.len() / 2]];
    Some(ExplainedArc { arc, beams, prediction })
}

/// Arcs that predictions leave unexplained.
pub(crate) fn unexplained<'a>(workspace: &'a Workspace, predictions: &Predictions) -> Vec<&'a Arc> {
    const SHARE: f64 = 0.5;
    let gate_m = workspace.errors.explained_m();
    let is_left = |arc: &&Arc| {
        let (readings, predictions) = (&workspace.readings[arc.sweep], &predictions[arc.sweep]);
        explain(arc, readings, predictions, gate_m, SHARE).is_none()
    };
    workspace.arcs.iter().flatten().filter(is_left).collect()
}

/// Arcs that a plan leaves unexplained: all of them if its scene is invalid.
pub(crate) fn unexplained_by<'a>(posed: &PosedPlan, workspace: &'a Workspace<'a>) -> Vec<&'a Arc> {
    // Predictions are independent of the standard deviation.
    let judge = Judge::of(workspace, posed, 1.0);
    match judge.predictions(&posed.plan.segments(&posed.walls)) {
        Some((_, predictions)) => unexplained(workspace, &predictions),
        None => workspace.arcs.iter().flatten().collect(),
    }
}

/// Pieces of walls that a path of an explained arc meets.
pub(crate) fn touched_pieces(
    plan: &LineArrangement,
    walls: &PieceSet,
    judge: &Judge,
) -> Option<PieceSet> {
    const GATE_M: f64 = 0.02;
    const SHARE: f64 = 0.4;
    let gate_m = judge.workspace.errors.gate_m(GATE_M);
    let (_, predictions) = judge.predictions(&plan.segments(walls))?;
    let runs = plan.runs(walls);
    let mut touched = PieceSet::new(plan.pieces());
    for arc in judge.workspace.arcs.iter().flatten() {
        let (readings, predictions) = (&judge.readings()[arc.sweep], &predictions[arc.sweep]);
        if let Some(explained) = explain(arc, readings, predictions, gate_m, SHARE)
            && let Some(path) = explained.path()
        {
            mark(plan, &runs, path, &mut touched);
        }
    }
    Some(touched)
}

/// Marks the pieces at which a path is reflected.
fn mark(plan: &LineArrangement, runs: &[Run], path: &Path, touched: &mut PieceSet) {
    for interaction in path.interactions.iter() {
        if let Mechanism::Reflection(Reflector::Wall(wall)) = interaction.mechanism
            && let Some(run) = runs.get(wall as usize)
        {
            let along_m = plan.lines[run.line].along_m(interaction.point);
            touched.set(plan.piece(run.line, plan.piece_at(run.line, along_m)), true);
        }
    }
}

/// Arcs of the predictions of a sweep.
pub(crate) fn predicted_arcs(
    sweep: usize,
    readings: &Readings,
    predictions: &[Prediction],
    errors: RangeErrors,
) -> Vec<Arc> {
    let mut predicted = readings.clone();
    for (beam, prediction) in predicted.beams.iter_mut().zip(predictions) {
        beam.outcome = outcome_of(prediction);
    }
    find_arcs(sweep, &predicted, errors)
}
