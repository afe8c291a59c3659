//! Recording of one scan into its own log file.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use sonard_device::ranger::{Ranger, ScanError, ScanJob};
use sonard_log::LogWriter;
use sonard_records::{Event, EventKind, Record, ScanView, Session, Sink, SinkError};
use sonard_runtime::interrupts::Interrupts;
use tokio::io::{AsyncRead, AsyncWrite};

use super::CollectError;

/// Sync interval of the scan's log. A power cut invalidates the current scan anyway, so a longer
/// interval loses nothing.
const SYNC_INTERVAL: Duration = Duration::from_secs(5);

/// Finished scan whose file is closed and synced.
#[derive(Debug)]
pub struct RecordedScan {
    /// Scan read from the file's records, if present.
    pub view: Option<ScanView>,
    /// Failure that ended the scan, if any.
    pub failure: Option<CollectError>,
    /// `true` if the device must be identified again; the scan may still be complete.
    pub needs_reconnect: bool,
    /// `true` if a client stopped the daemon during the scan.
    pub stopped: bool,
    /// Duration by the wall clock, seconds.
    pub wall_s: f64,
}

/// Takes a scan with a local ranger; the session becomes the file's first record.
///
/// # Errors
/// Returns an error if the file cannot be written; the scan in it is then incomplete.
pub async fn record_scan<L: AsyncRead + AsyncWrite + Unpin>(
    ranger: &mut Ranger<L>,
    (job, session): (&ScanJob, Session),
    path: &Path,
    beam: &(dyn Fn() + Sync),
    interrupts: &Interrupts,
) -> Result<RecordedScan, CollectError> {
    let mut sink = ScanSink::open(path, beam)?;
    sink.record(&Record::Session(Box::new(session)))?;
    let began = Instant::now();
    let outcome = ranger.scan(job, &mut sink, interrupts.clone().reason()).await;
    let wall_s = began.elapsed().as_secs_f64();
    let (lost, gone) = match outcome {
        Ok(summary) => (None, summary.not_home.is_some()),
        Err(error @ ScanError::Device(_)) => (Some(error.into()), true),
        Err(error) => return Err(error.into()),
    };
    Ok(RecordedScan {
        view: sink.close()?,
        failure: lost,
        needs_reconnect: gone,
        stopped: false,
        wall_s,
    })
}

/// Appends an event to a rejected scan's file, which marks it without the journal.
///
/// # Errors
/// Returns an error if the disk is full or fails.
pub(super) fn mark_rejected(path: &Path, reason: &str) -> Result<(), CollectError> {
    let event = Event {
        time: jiff::Timestamp::now(),
        kind: EventKind::Gap,
        detail: format!("this scan does not count: {reason}"),
    };
    let marked = LogWriter::open(path)
        .and_then(|mut log| log.append(&Record::Event(event)).and_then(|()| log.close()));
    Ok(marked?)
}

/// Writer of a scan's file that keeps the written records.
pub(super) struct ScanSink<'a> {
    log: LogWriter,
    records: Vec<Record>,
    beam: &'a (dyn Fn() + Sync),
}

impl<'a> ScanSink<'a> {
    pub(super) fn open(path: &Path, beam: &'a (dyn Fn() + Sync)) -> Result<Self, CollectError> {
        let log = LogWriter::open(path)?.with_sync_interval(SYNC_INTERVAL);
        Ok(Self { log, records: Vec::new(), beam })
    }

    /// Closes the file and returns its last scan, if any.
    pub(super) fn close(self) -> Result<Option<ScanView>, CollectError> {
        self.log.close()?;
        Ok(ScanView::from_records(self.records).pop())
    }
}

impl Sink for ScanSink<'_> {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.log.append(record)?;
        if matches!(record, Record::Ping(_)) {
            (self.beam)();
        }
        self.records.push(record.clone());
        Ok(())
    }
}
