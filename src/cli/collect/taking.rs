//! One scan into a file of its own.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use tokio_serial::SerialStream;

use super::bar::Bar;
use crate::{
    cli::{Failure, runtime::Interrupts, scan::scan_failure},
    ranger::{Ranger, ScanError, ScanJob, Sink},
    scan::{Event, EventKind, Record, ScanView, Session},
    store::{LogWriter, StoreError},
};

/// How long a record may wait for the disk: a power cut costs the scan under way all the same.
const SYNC: Duration = Duration::from_secs(5);

/// A scan that is over, with its file closed and on the disk.
pub(super) struct Taken {
    pub(super) view: Option<ScanView>,
    /// Why the device gave up, if it did.
    pub(super) lost: Option<Failure>,
    pub(super) wall_s: f64,
}

/// Takes a scan into `path`.
///
/// # Errors
/// When the file can't be written: what is in it is cut.
pub(super) async fn take(
    ranger: &mut Ranger<SerialStream>,
    (job, session): (&ScanJob, Session),
    path: &Path,
    bar: &Bar,
    interrupts: &Interrupts,
) -> Result<Taken, Failure> {
    let refuse = |error: StoreError| Failure::device(&error, error.help());
    let log = LogWriter::open(path).map_err(refuse)?.with_sync_interval(SYNC);
    let mut sink = Taking { log, records: Vec::new(), bar };
    sink.record(&Record::Session(Box::new(session))).map_err(refuse)?;
    let began = Instant::now();
    ranger.reanchor();
    let outcome = ranger.scan(job, &mut sink, interrupts.clone().reason()).await;
    let wall_s = began.elapsed().as_secs_f64();
    let lost = match outcome {
        Ok(_) => None,
        Err(error @ ScanError::Device(_)) => Some(scan_failure(error)),
        Err(error) => return Err(scan_failure(error)),
    };
    sink.log.close().map_err(refuse)?;
    let view = ScanView::from_records(sink.records).pop();
    Ok(Taken { view, lost, wall_s })
}

/// Marks the end of a file that does not count, so that it says so itself.
///
/// # Errors
/// When the disk is full or fails.
pub(super) fn mark(path: &Path, why: &str) -> Result<(), Failure> {
    let event = Event {
        time: jiff::Timestamp::now(),
        kind: EventKind::Gap,
        detail: format!("this scan does not count: {why}"),
    };
    LogWriter::open(path)
        .and_then(|mut log| log.append(&Record::Event(event)).and_then(|()| log.close()))
        .map_err(|error| Failure::device(&error, error.help()))
}

struct Taking<'a> {
    log: LogWriter,
    records: Vec<Record>,
    bar: &'a Bar,
}

impl Sink for Taking<'_> {
    fn record(&mut self, record: &Record) -> Result<(), StoreError> {
        self.log.append(record)?;
        if matches!(record, Record::Ping(_)) {
            self.bar.beam();
        }
        self.records.push(record.clone());
        Ok(())
    }
}
