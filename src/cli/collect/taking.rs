//! One scan into a file of its own.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use tokio_serial::SerialStream;

use super::bar::Bar;
use crate::{
    cli::{Failure, runtime::Interrupts, scan::scan_failure},
    ranger::{Ranger, ScanError, ScanJob},
    scan::{Event, EventKind, Record, ScanView, Session, Sink, SinkError},
    store::{LogWriter, StoreError},
};

/// How long a record may wait for the disk: a power cut costs the scan under way all the same.
const SYNC: Duration = Duration::from_secs(5);

/// A scan that is over, with its file closed and on the disk.
pub(super) struct Taken {
    pub(super) view: Option<ScanView>,
    /// Why the device gave up, if it did.
    pub(super) lost: Option<Failure>,
    /// Whether it has to be met again, though the scan may be whole.
    pub(super) gone: bool,
    /// Whether somebody told the daemon that took it to stop.
    pub(super) stopped: bool,
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
    let mut sink = Taking::open(path, bar)?;
    sink.record(&Record::Session(Box::new(session)))?;
    let began = Instant::now();
    let outcome = ranger.scan(job, &mut sink, interrupts.clone().reason()).await;
    let wall_s = began.elapsed().as_secs_f64();
    let (lost, gone) = match outcome {
        Ok(summary) => (None, summary.not_home.is_some()),
        Err(error @ ScanError::Device(_)) => (Some(scan_failure(error)), true),
        Err(error) => return Err(scan_failure(error)),
    };
    Ok(Taken { view: sink.close()?, lost, gone, stopped: false, wall_s })
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

/// A scan's file while it is written, with what was written.
pub(super) struct Taking<'a> {
    log: LogWriter,
    records: Vec<Record>,
    bar: &'a Bar,
}

impl<'a> Taking<'a> {
    pub(super) fn open(path: &Path, bar: &'a Bar) -> Result<Self, Failure> {
        let log = LogWriter::open(path).map_err(|error| refuse(&error))?.with_sync_interval(SYNC);
        Ok(Self { log, records: Vec::new(), bar })
    }

    /// Closes the file; the scan in it, if there is one.
    pub(super) fn close(self) -> Result<Option<ScanView>, Failure> {
        self.log.close().map_err(|error| refuse(&error))?;
        Ok(ScanView::from_records(self.records).pop())
    }
}

fn refuse(error: &StoreError) -> Failure {
    Failure::device(error, error.help())
}

impl Sink for Taking<'_> {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.log.append(record)?;
        if matches!(record, Record::Ping(_)) {
            self.bar.beam();
        }
        self.records.push(record.clone());
        Ok(())
    }
}
