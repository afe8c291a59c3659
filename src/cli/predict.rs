//! `sonard predict`.

use std::{path::PathBuf, sync::Arc};

use super::{
    Failure, Outcome,
    log::rewrite::{PendingRecords, rewrite},
    options::engine_options,
    output::{OutPath, Overwrite},
    predictor::Predictor,
    scene_file,
    what_if::{WhatIf, WhatIfArgs},
};
use crate::{
    model::OptionKeys,
    scan::{Ping, Record},
    scene::Scene,
};

/// Options of `sonard predict`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions,
    /// instead of the log's
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// File to write; the log with predictions goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    what_if: WhatIfArgs,
    #[command(flatten)]
    engine: OptionKeys,
}

pub(super) const ABOUT: &str = "\
Add the model's predictions to a log.

Each reading gets the model's prediction for the same position and direction, with its propagation \
path, replacing any earlier one; sessions state the scene, sensor, air and model. Measured \
readings are unchanged, except that ranges are recomputed from times of flight if the speed of \
sound differs.";

const HELP: &str = "\
Examples:
  sonard import sweep.csv --pose 1.2,0.8,90 --sensor hc-sr04 -o sweep.jsonl
  sonard predict sweep.jsonl --scene my-room.json -o predicted.jsonl
  sonard predict run.jsonl --temperature-c 15 --engine cone | sonard compare -

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let given = args.scene.as_deref().map(scene_file::load).transpose()?.map(Arc::new);
    let what_if = args.what_if.load(given.as_deref())?.with_options(engine_options(&args.engine)?);
    let mut predictor = Predictor::new(&args.log, given.as_ref(), &what_if);
    let (pending, mut any) = (PendingRecords::default(), false);
    let to = (args.output.as_ref(), args.overwrite);
    let change = |record: &mut Record| apply_assumptions(record, &what_if, given.as_deref());
    let written = rewrite(&args.log, to, &pending, change, |mut scan| {
        predictor.predict(&mut scan)?;
        any |= scan.pings.iter().any(|ping| ping.sim.is_some());
        let mut predicted: Vec<Ping> = scan.pings;
        predicted.sort_by_key(|ping| ping.index);
        Ok(Box::new(move |ping: &mut Ping| {
            // A reading that was requested again has the same index as the previous one, and the
            // same prediction.
            if let Ok(at) = predicted.binary_search_by_key(&ping.index, |known| known.index) {
                let found = &predicted[at];
                (ping.sim, ping.range_m) = (found.sim.clone(), found.range_m);
                (ping.residual_m, ping.pose) = (found.residual_m, found.pose);
            }
        }))
    })?;
    if !any {
        return Err(Failure::input(
            format!("{}: no reading to predict", args.log.display()),
            "predictions need a session, a pose and a scene: see --scene",
        ));
    }
    written.finish()
}

/// Updates sessions and scan starts to the assumptions of the predictions.
fn apply_assumptions(record: &mut Record, what_if: &WhatIf, scene: Option<&Scene>) {
    match record {
        Record::Session(session) => {
            what_if.change_session(session);
            if let Some(scene) = scene {
                session.set_scene(scene);
            }
        }
        Record::ScanStart(start) => what_if.change_start(start),
        _ => {}
    }
}
