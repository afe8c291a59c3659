//! `sonard log annotate`.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::super::output::{OutPath, Overwrite};
use super::{
    Failure, Outcome,
    rewrite::{PendingRecords, rewrite},
};
use crate::{
    geometry::wrap_360,
    interpret::{
        Extents, Sweep,
        mapping::{MAX_RANGE_M, MapSettings},
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
    /// Maximum range, metres, instead of the sensor's; longer ranges count as no echo [default: the
    /// sensor's, at most 5]
    #[arg(long, value_name = "M")]
    max_range: Option<f64>,
    /// Exponent of the decrease of confidence with the feature's distance
    #[arg(long, value_name = "E", default_value_t = 2.0)]
    exponent: f64,
    /// Extension of walls beyond their observed part, metres
    #[arg(long, value_name = "M", default_value_t = MapSettings::default().extend_m)]
    extend: f64,
}

const HELP: &str = "\
Examples:
  sonard log annotate run.jsonl -o trusted.jsonl
  sonard plot trusted.jsonl --kind confidence -o trusted.png

Feature Prediction processes the scans in the order of the log, as in `sonard map`. Every valid \
ping gets a confidence: 0.5 without contradiction, less if a feature predicted from other readings \
contradicts it. All other records are copied unchanged; lines that are not records are skipped and \
reported. The log itself is not modified.

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(range_m) = args.max_range.filter(|range_m| !(range_m.is_finite() && *range_m > 0.0))
    {
        let help = "give a length in metres, greater than 0";
        return Err(Failure::input(format!("--max-range is {range_m}"), help));
    }
    let (mut annotator, mut any_confidence) =
        (ConfidenceAnnotator { args, of_session: None }, false);
    let waiting = PendingRecords::default();
    let to = (args.output.as_ref(), args.overwrite);
    let written = rewrite(
        &args.log,
        to,
        &waiting,
        |_| {},
        |scan| {
            let found = annotator.confidences(&scan)?;
            any_confidence |= !found.is_empty();
            Ok(Box::new(move |ping: &mut Ping| {
                let found = found.get(&azimuth_key(ping.azimuth_deg)).copied();
                ping.confidence = found.filter(|_| is_informative(ping));
            }))
        },
    )?;
    if !any_confidence {
        return Err(Failure::input(
            format!("{}: no scan with a session and a pose", args.log.display()),
            "give a log written by `sonard scan` or `sonard simulate`",
        ));
    }
    written.finish()
}

/// Confidences of a scan's steps, by azimuth in millionths of a degree; all readings of a step
/// share one.
type Confidences = HashMap<i64, f64>;

/// Feature Prediction over the scans of a session; each session starts without features.
struct ConfidenceAnnotator<'a> {
    args: &'a Args,
    of_session: Option<(Arc<Session>, FeaturePrediction)>,
}

impl ConfidenceAnnotator<'_> {
    /// Returns the confidence of each step of a scan; empty, with a notice, for an unsuitable scan.
    fn confidences(&mut self, scan: &ScanView) -> Result<Confidences, Failure> {
        let Some(session) = &scan.session else { return Ok(Confidences::new()) };
        let sweep = match Sweep::from_scan(scan) {
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
        Ok(of_stops
            .map(|(beam, worth)| (azimuth_key(beam.azimuth_deg), worth.confidence))
            .collect())
    }
}

fn settings(args: &Args, session: &Session) -> Result<PredictionSettings, Failure> {
    let extents = Extents::from_session(session).map_err(|error| {
        Failure::input(format!("session: {error}"), "correct the session's record in the log")
    })?;
    let max_range_m = args.max_range.unwrap_or(extents.max_range_m.min(MAX_RANGE_M));
    let plane_deg = extents.plane_corner_deg(1.0, 1.0);
    Ok(PredictionSettings {
        exponent: args.exponent,
        extend_m: args.extend,
        ..PredictionSettings::stepper(plane_deg, max_range_m)
    })
}

/// Azimuth in millionths of a degree, which identifies a step.
fn azimuth_key(azimuth_deg: f64) -> i64 {
    (wrap_360(azimuth_deg) * 1e6).round() as i64
}

/// Returns `true` for readings with information; lost and uncertain ones have none.
const fn is_informative(ping: &Ping) -> bool {
    matches!(ping.status, PingStatus::Echo | PingStatus::NoEcho | PingStatus::MinRange)
}
