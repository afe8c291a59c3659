//! `sonard log annotate`.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::super::output::{OutPath, Overwrite};
use super::{
    Failure, Outcome,
    rewrite::{Waiting, rewrite},
};
use crate::{
    geometry::wrap_360,
    interpret::{
        Extents, Sweep,
        mapping::{MAX_RANGE_M, Mapping},
        prediction::{FeaturePrediction, PredictionSettings},
    },
    scan::{Ping, PingStatus, ScanView, Session},
};

/// Options of `sonard log annotate`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// File to write; the log with confidences goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Treat ranges beyond this as no echo, metres [default: the sensor's, at most 5]
    #[arg(long, value_name = "M")]
    silent_beyond: Option<f64>,
    /// Exponent of the confidence with the distance of the feature
    #[arg(long, value_name = "E", default_value_t = 2.0)]
    exponent: f64,
    /// How far walls are extended beyond their observed part, metres
    #[arg(long, value_name = "M", default_value_t = Mapping::default().extend_m)]
    extend: f64,
}

const HELP: &str = "\
Examples:
  sonard log annotate run.jsonl -o trusted.jsonl
  sonard plot trusted.jsonl --kind confidence -o trusted.png

Feature Prediction goes through the scans in the order of the log, as in `sonard map`, and every \
ping that it weighs gets a confidence: 0.5 where nothing speaks against it, less where a feature \
predicted from other readings does. Every other record is written as it was read; lines that are no \
records are left out and named. The log itself is not touched.

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(range_m) =
        args.silent_beyond.filter(|range_m| !(range_m.is_finite() && *range_m > 0.0))
    {
        let help = "give a length in metres, greater than 0";
        return Err(Failure::input(format!("--silent-beyond is {range_m}"), help));
    }
    let (mut predictor, mut any) = (Predictor { args, of_session: None }, false);
    let waiting = Waiting::default();
    let to = (args.output.as_ref(), args.overwrite);
    let written = rewrite(
        &args.log,
        to,
        &waiting,
        |_| {},
        |scan| {
            let found = predictor.confidences(&scan)?;
            any |= !found.is_empty();
            Ok(Box::new(move |ping: &mut Ping| {
                let found = found.get(&stop(ping.azimuth_deg)).copied();
                ping.confidence = found.filter(|_| is_weighed(ping));
            }))
        },
    )?;
    if !any {
        return Err(Failure::input(
            format!("{}: there is no scan with its session and pose to weigh", args.log.display()),
            "give a log as `sonard scan` or `sonard simulate` writes it",
        ));
    }
    written.finish()
}

/// Confidences of a scan's stops, by azimuth in millionths of a degree: readings of one stop have one.
type Confidences = HashMap<i64, f64>;

/// Feature Prediction through the scans of a session; each session begins with nothing predicted.
struct Predictor<'a> {
    args: &'a Args,
    of_session: Option<(Arc<Session>, FeaturePrediction)>,
}

impl Predictor<'_> {
    /// The confidence of each stop of a scan; none if it can't be weighed, which is told.
    fn confidences(&mut self, scan: &ScanView) -> Result<Confidences, Failure> {
        let Some(session) = &scan.session else { return Ok(Confidences::new()) };
        let sweep = match Sweep::of(scan) {
            Ok(sweep) => sweep,
            Err(error) => {
                let log = Path::display(&self.args.log);
                notice!("{log}: scan {} has no confidences: {error}", scan.scan);
                return Ok(Confidences::new());
            }
        };
        let same = self.of_session.take().filter(|(known, _)| Arc::ptr_eq(known, session));
        let (_, predicted) = match same {
            Some(known) => self.of_session.insert(known),
            None => {
                let fresh = FeaturePrediction::new(settings(self.args, session)?);
                self.of_session.insert((Arc::clone(session), fresh))
            }
        };
        let assessed = predicted.assess(&sweep);
        let of_stops = sweep.beams.iter().zip(assessed);
        Ok(of_stops.map(|(beam, worth)| (stop(beam.azimuth_deg), worth.confidence)).collect())
    }
}

fn settings(args: &Args, session: &Session) -> Result<PredictionSettings, Failure> {
    let extents = Extents::of_session(session).map_err(|error| {
        Failure::input(format!("session: {error}"), "correct the session's record in the log")
    })?;
    let max_range_m = args.silent_beyond.unwrap_or(extents.max_range_m.min(MAX_RANGE_M));
    let plane_deg = extents.plane_corner_deg(1.0, 1.0);
    Ok(PredictionSettings {
        exponent: args.exponent,
        extend_m: args.extend,
        ..PredictionSettings::stepper(plane_deg, max_range_m)
    })
}

/// An azimuth in millionths of a degree: those of one stop agree to this.
fn stop(azimuth_deg: f64) -> i64 {
    (wrap_360(azimuth_deg) * 1e6).round() as i64
}

/// Whether a reading counts: one that was lost or is doubtful says nothing.
const fn is_weighed(ping: &Ping) -> bool {
    matches!(ping.status, PingStatus::Echo | PingStatus::NoEcho | PingStatus::MinRange)
}
