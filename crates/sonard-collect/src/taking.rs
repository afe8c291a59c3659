//! One scan into a file of its own.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use sonard_device::ranger::{Ranger, ScanError, ScanJob};
use sonard_log::LogWriter;
use sonard_records::{Event, EventKind, Record, ScanView, Session, Sink, SinkError};
use sonard_runtime::interrupts::Interrupts;
use tokio::io::{AsyncRead, AsyncWrite};

use super::Halt;

/// How long a record may wait for the disk: a power cut costs the scan under way all the same.
const SYNC: Duration = Duration::from_secs(5);

/// A scan that is over, with its file closed and on the disk.
#[derive(Debug)]
pub struct Taken {
    /// The scan, if the file holds one.
    pub view: Option<ScanView>,
    /// Why the device gave up, if it did.
    pub lost: Option<Halt>,
    /// Whether it has to be met again, though the scan may be whole.
    pub gone: bool,
    /// Whether somebody told the daemon that took it to stop.
    pub stopped: bool,
    /// How long it took, seconds.
    pub wall_s: f64,
}

/// Takes a scan with a ranger of one's own, whose session is the file's first record.
///
/// # Errors
/// When the file can't be written: what is in it is cut.
pub async fn take<L: AsyncRead + AsyncWrite + Unpin>(
    ranger: &mut Ranger<L>,
    (job, session): (&ScanJob, Session),
    path: &Path,
    beam: &(dyn Fn() + Sync),
    interrupts: &Interrupts,
) -> Result<Taken, Halt> {
    let mut sink = Taking::open(path, beam)?;
    sink.record(&Record::Session(Box::new(session)))?;
    let began = Instant::now();
    let outcome = ranger.scan(job, &mut sink, interrupts.clone().reason()).await;
    let wall_s = began.elapsed().as_secs_f64();
    let (lost, gone) = match outcome {
        Ok(summary) => (None, summary.not_home.is_some()),
        Err(error @ ScanError::Device(_)) => (Some(error.into()), true),
        Err(error) => return Err(error.into()),
    };
    Ok(Taken { view: sink.close()?, lost, gone, stopped: false, wall_s })
}

/// Marks the end of a file that does not count, so that it says so itself.
///
/// # Errors
/// When the disk is full or fails.
pub(super) fn mark(path: &Path, why: &str) -> Result<(), Halt> {
    let event = Event {
        time: jiff::Timestamp::now(),
        kind: EventKind::Gap,
        detail: format!("this scan does not count: {why}"),
    };
    let marked = LogWriter::open(path)
        .and_then(|mut log| log.append(&Record::Event(event)).and_then(|()| log.close()));
    Ok(marked?)
}

/// A scan's file while it is written, with what was written.
pub(super) struct Taking<'a> {
    log: LogWriter,
    records: Vec<Record>,
    beam: &'a (dyn Fn() + Sync),
}

impl<'a> Taking<'a> {
    pub(super) fn open(path: &Path, beam: &'a (dyn Fn() + Sync)) -> Result<Self, Halt> {
        let log = LogWriter::open(path)?.with_sync_interval(SYNC);
        Ok(Self { log, records: Vec::new(), beam })
    }

    /// Closes the file; the scan in it, if there is one.
    pub(super) fn close(self) -> Result<Option<ScanView>, Halt> {
        self.log.close()?;
        Ok(ScanView::from_records(self.records).pop())
    }
}

impl Sink for Taking<'_> {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.log.append(record)?;
        if matches!(record, Record::Ping(_)) {
            (self.beam)();
        }
        self.records.push(record.clone());
        Ok(())
    }
}
