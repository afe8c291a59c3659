//! Copy of a log with readings modified per scan.

use std::{
    cell::RefCell,
    collections::{HashMap, VecDeque},
    path::Path,
};

use uuid::Uuid;

use super::super::{
    logs::for_each_record_and_scan,
    output::{OutPath, Overwrite, closed, records_to},
};
use super::{Failure, Outcome};
use crate::{
    scan::{Ping, Record, ScanView},
    store::{RecordWriter, StoreError},
};

/// Modification of each reading of a scan.
pub(in crate::cli) type PingChange = Box<dyn Fn(&mut Ping)>;

/// Rewritten log that is not yet renamed to its destination.
pub(in crate::cli) struct LogRewrite<'a> {
    pending: &'a RefCell<VecDeque<Record>>,
    /// Modifications for scans whose end has been read but not written.
    ready: HashMap<Uuid, PingChange>,
    /// `None` once the reader of the output has closed it.
    out: Option<Box<dyn RecordWriter>>,
}

/// Records that were read but not yet written: at most those since the start of the oldest open
/// scan.
pub(in crate::cli) type PendingRecords = RefCell<VecDeque<Record>>;

/// Copies the records of a log in order. `modify` modifies each record; the result of `plan_scan`
/// modifies the readings of a scan once the scan has been read. Lines that are not records are
/// skipped and reported.
///
/// # Errors
///
/// The log can't be read, or one of the functions fails; the output is then not created.
pub(in crate::cli) fn rewrite<'a>(
    log: &Path,
    (out, overwrite): (Option<&OutPath>, Overwrite),
    pending: &'a PendingRecords,
    modify: impl Fn(&mut Record),
    mut plan_scan: impl FnMut(ScanView) -> Result<PingChange, Failure>,
) -> Result<LogRewrite<'a>, Failure> {
    let out = Some(records_to(out.map(|out| &**out), overwrite)?);
    let mut written = LogRewrite { pending, ready: HashMap::new(), out };
    for_each_record_and_scan(
        log,
        |record| {
            let mut record = record.clone();
            modify(&mut record);
            pending.borrow_mut().push_back(record);
        },
        |scan| {
            let id = scan.scan;
            written.ready.insert(id, plan_scan(scan)?);
            written.write_ready()
        },
    )?;
    Ok(written)
}

impl LogRewrite<'_> {
    /// Writes up to the first reading of an open scan.
    fn write_ready(&mut self) -> Outcome {
        while let Some(record) = self.next_ready() {
            self.write(record)?;
        }
        Ok(())
    }

    fn next_ready(&self) -> Option<Record> {
        let mut pending = self.pending.borrow_mut();
        let is_ready = match pending.front()? {
            Record::Ping(ping) => self.ready.contains_key(&ping.scan),
            _ => true,
        };
        if is_ready { pending.pop_front() } else { None }
    }

    fn write(&mut self, mut record: Record) -> Outcome {
        match &mut record {
            Record::Ping(ping) => {
                if let Some(modify) = self.ready.get(&ping.scan) {
                    modify(ping);
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

    /// Renames the file to its destination.
    pub(in crate::cli) fn finish(mut self) -> Outcome {
        let rest: Vec<_> = self.pending.borrow_mut().drain(..).collect();
        rest.into_iter().try_for_each(|record| self.write(record))?;
        self.out.map_or(Ok(()), |out| closed(out.finish()))
    }
}
