//! A log written again, its readings changed by what their whole scan says.

use std::{
    cell::RefCell,
    collections::{HashMap, VecDeque},
    path::Path,
};

use uuid::Uuid;

use super::super::{
    logs::for_each_scan_of,
    output::{OutPath, Overwrite, closed, records_to},
};
use super::{Failure, Outcome};
use crate::{
    scan::{Ping, Record, ScanView},
    store::{RecordWriter, StoreError},
};

/// What is done to each reading of a scan.
pub(in crate::cli) type PingChange = Box<dyn Fn(&mut Ping)>;

/// A log that is written in full and not yet in its place.
pub(in crate::cli) struct Rewritten<'a> {
    waiting: &'a RefCell<VecDeque<Record>>,
    /// Scans that have ended and whose end is not written.
    ready: HashMap<Uuid, PingChange>,
    /// Nobody, once its reader has gone.
    out: Option<Box<dyn RecordWriter>>,
}

/// Records that were read and not written: at most those from the oldest scan on that has not ended.
pub(in crate::cli) type Waiting = RefCell<VecDeque<Record>>;

/// Writes the records of a log in their order, those between readings changed by `change`, and readings by what
/// `of_scan` says once their scan has been read. Lines that hold no record are left out and named.
///
/// # Errors
/// The log can't be read, or what the two refuse; nothing is at the output's name then.
pub(in crate::cli) fn rewrite<'a>(
    log: &Path,
    (out, overwrite): (Option<&OutPath>, Overwrite),
    waiting: &'a Waiting,
    change: impl Fn(&mut Record),
    mut of_scan: impl FnMut(ScanView) -> Result<PingChange, Failure>,
) -> Result<Rewritten<'a>, Failure> {
    let out = Some(records_to(out.map(|out| &**out), overwrite)?);
    let mut written = Rewritten { waiting, ready: HashMap::new(), out };
    for_each_scan_of(
        log,
        |record| {
            let mut record = record.clone();
            change(&mut record);
            waiting.borrow_mut().push_back(record);
        },
        |scan| {
            let id = scan.scan;
            written.ready.insert(id, of_scan(scan)?);
            written.write_ready()
        },
    )?;
    Ok(written)
}

impl Rewritten<'_> {
    /// Writes up to the first reading whose scan has not ended.
    fn write_ready(&mut self) -> Outcome {
        while let Some(record) = self.next_ready() {
            self.write(record)?;
        }
        Ok(())
    }

    fn next_ready(&self) -> Option<Record> {
        let mut waiting = self.waiting.borrow_mut();
        let is_ready = match waiting.front()? {
            Record::Ping(ping) => self.ready.contains_key(&ping.scan),
            _ => true,
        };
        if is_ready { waiting.pop_front() } else { None }
    }

    fn write(&mut self, mut record: Record) -> Outcome {
        match &mut record {
            Record::Ping(ping) => {
                if let Some(change) = self.ready.get(&ping.scan) {
                    change(ping);
                }
            }
            Record::ScanEnd(end) => drop(self.ready.remove(&end.scan)),
            _ => {}
        }
        let Some(out) = &mut self.out else { return Ok(()) };
        match out.write(&record) {
            Err(error) if error.is_broken_pipe() => self.out = None,
            Err(error @ StoreError::Record { .. }) => {
                return Err(Failure::input(error, "correct the record in the log"));
            }
            written => written?,
        }
        Ok(())
    }

    /// Puts the log in its place.
    pub(in crate::cli) fn finish(mut self) -> Outcome {
        let left: Vec<_> = self.waiting.borrow_mut().drain(..).collect();
        left.into_iter().try_for_each(|record| self.write(record))?;
        self.out.map_or(Ok(()), |out| closed(out.finish()))
    }
}
