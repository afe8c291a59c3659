//! `sonard log annotate`.

use std::{
    collections::HashMap,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use uuid::Uuid;

use super::super::{
    logs::for_each_record,
    map::{EXTEND_M, MAX_RANGE_M},
    output::{OutPath, Overwrite, Product},
};
use super::{Failure, Outcome};
use crate::{
    geometry::wrap_360,
    interpret::{
        Extents, Sweep,
        prediction::{FeaturePrediction, PredictionSettings},
    },
    scan::{Ping, PingStatus, Record, ScanView, Session},
};

/// Options of `sonard log annotate`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// Where to write it with confidences [default: standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Take longer ranges as silence, metres [default: the sensor's, at most 5]
    #[arg(long, value_name = "M")]
    max_range: Option<f64>,
    /// Exponent of the confidence with the distance of the feature
    #[arg(long, value_name = "E", default_value_t = 2.0)]
    exponent: f64,
    /// How far walls are taken to go on beyond what was seen of them, metres
    #[arg(long, value_name = "M", default_value_t = EXTEND_M)]
    extend: f64,
}

const HELP: &str = "\
Examples:
  sonard log annotate run.jsonl --out trusted.jsonl
  sonard plot trusted.jsonl --kind confidence -o trusted.png

Feature Prediction goes through the scans in the order of the log, as in `sonard map`, and every \
ping that it weighs gets a confidence: 0.5 where nothing speaks against it, less where a feature \
predicted from other readings does. Every other record is written as it was read; lines that are no \
records are left out and named. The log itself is not touched.

Exit codes: 0 done, 2 wrong usage or input, 3 the file can't be written.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(range_m) = args.max_range.filter(|range_m| !(range_m.is_finite() && *range_m > 0.0))
    {
        let help = "give a length in metres, greater than 0";
        return Err(Failure::input(format!("--max-range is {range_m}"), help));
    }
    if let Some(out) = &args.out {
        args.overwrite.check(out, Product::Log)?;
    }
    let mut records = Vec::new();
    for_each_record(&args.log, |record| records.push(record))?;
    let confidences = confidences(args, &records)?;
    if confidences.is_empty() {
        return Err(Failure::input(
            format!("{}: there is no scan with its session and pose to weigh", args.log.display()),
            "give a log as `sonard scan` or `sonard simulate` writes it",
        ));
    }
    let mut bytes = Vec::new();
    for mut record in records {
        if let Record::Ping(ping) = &mut record {
            ping.confidence = confidences.get(&key(ping)).copied().filter(|_| is_weighed(ping));
        }
        serde_json::to_writer(&mut bytes, &record)
            .map_err(|error| Failure::device(error, "this record can't be written"))?;
        bytes.push(b'\n');
    }
    match &args.out {
        Some(out) => args.overwrite.save(out, Product::Log, &bytes),
        None => write_out(&bytes).or_else(|error| Failure::from_write("standard output", &error)),
    }
}

fn write_out(bytes: &[u8]) -> io::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    out.write_all(bytes)?;
    out.flush()
}

/// A stop of a scan: readings of one stop have one confidence.
type Stop = (Uuid, i64);

/// The confidence of each stop. Each session begins with nothing predicted.
fn confidences(args: &Args, records: &[Record]) -> Result<HashMap<Stop, f64>, Failure> {
    let mut found = HashMap::new();
    let mut predictor: Option<(Arc<Session>, FeaturePrediction)> = None;
    for scan in ScanView::from_records(records.iter().cloned()) {
        let Some(session) = &scan.session else { continue };
        let sweep = match Sweep::of(&scan) {
            Ok(sweep) => sweep,
            Err(error) => {
                let log = Path::display(&args.log);
                anstream::eprintln!("{log}: scan {} has no confidences: {error}", scan.scan);
                continue;
            }
        };
        let same = predictor.take().filter(|(known, _)| Arc::ptr_eq(known, session));
        let (_, predicted) = match same {
            Some(known) => predictor.insert(known),
            None => {
                let fresh = FeaturePrediction::new(settings(args, session)?);
                predictor.insert((Arc::clone(session), fresh))
            }
        };
        for (beam, worth) in sweep.beams.iter().zip(predicted.assess(&sweep)) {
            found.insert((scan.scan, millionths(beam.azimuth_deg)), worth.confidence);
        }
    }
    Ok(found)
}

fn settings(args: &Args, session: &Session) -> Result<PredictionSettings, Failure> {
    let extents = Extents::of_session(session).map_err(|error| {
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

fn key(ping: &Ping) -> Stop {
    (ping.scan, millionths(wrap_360(ping.azimuth_deg)))
}

/// Azimuths of one stop agree to this.
fn millionths(azimuth_deg: f64) -> i64 {
    (azimuth_deg * 1e6).round() as i64
}

/// Whether a reading counts: one that was lost or is doubtful says nothing.
const fn is_weighed(ping: &Ping) -> bool {
    matches!(ping.status, PingStatus::Echo | PingStatus::NoEcho | PingStatus::MinRange)
}
