//! Replacement of a log that cannot be continued: its sync failed, or its path names another file.

use std::fs;

use jiff::Timestamp;
use sonard_records::{Event, EventKind, Record, decode_line};

use super::{LogFolder, LogWriter};
use crate::{Displacement, StoreError};

/// Maximum size of a scan's records that are copied from a removed file, bytes.
const MAX_CARRIED_BYTES: u64 = 64 << 20;

/// Contents of the file that replaces the current one.
#[derive(Debug)]
pub(super) struct Replacement {
    /// Descriptions of gaps, written as events.
    gaps: Vec<String>,
    /// Lines of the current scan, copied from a removed file.
    carried: Vec<u8>,
}

impl LogFolder {
    /// Compares the open file with the file at its path and starts a new one if they differ. The
    /// current scan is finished in a moved file, and copied from a removed one. To be called every
    /// few seconds; the cost is two stat(2).
    ///
    /// # Errors
    /// Returns an error if the new file cannot be written; retried with the next call or record.
    pub fn inspect(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let Some(writer) = &self.writer else { return Ok(()) };
        // Ignores paths that cannot be examined.
        let Ok(Some(displacement)) = writer.displacement() else { return Ok(()) };
        let detail = format!("{} {displacement}", self.file_name());
        match (displacement, &self.scan) {
            (Displacement::Moved, Some(_)) => {
                if !self.is_displaced {
                    self.incident = Some(format!("{detail}; its scan is finished there"));
                }
                self.is_displaced = true;
                Ok(())
            }
            (Displacement::Moved, None) => {
                let synced = self.writer.as_mut().map_or(Ok(()), LogWriter::sync);
                self.handle_failure(synced).ok();
                self.replace(detail, Vec::new());
                self.writer(now).map(drop)
            }
            (Displacement::Removed, Some((offset, _)))
                if writer.length().saturating_sub(*offset) <= MAX_CARRIED_BYTES =>
            {
                // Unreadable records become part of the gap.
                let carried = writer.read_from(*offset).unwrap_or_default();
                self.replace(detail, carried);
                self.writer(now).map(drop)
            }
            _ => {
                self.replace(detail, Vec::new());
                self.writer(now).map(drop)
            }
        }
    }

    /// Returns the description of a replacement since the last call.
    pub fn take_incident(&mut self) -> Option<String> {
        self.incident.take()
    }

    /// File name of the current log.
    pub(super) fn file_name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Closes the file; the next record starts a new one with an event about the gap.
    pub(super) fn replace(&mut self, gap: String, carried: Vec<u8>) {
        if let Some(writer) = &self.writer {
            self.uncertain += writer.appended() - writer.synced();
        }
        self.release_writer();
        self.is_displaced = false;
        self.incident = Some(gap.clone());
        match &mut self.replacement {
            Some(replacement) => replacement.gaps.push(gap),
            None => self.replacement = Some(Replacement { gaps: vec![gap], carried }),
        }
    }

    /// Creates the replacement with the current session, the current scan and the gaps. On failure
    /// the new file is removed.
    pub(super) fn begin_replacement(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let fail = |source| StoreError::Open { path: self.folder.clone(), source };
        fs::create_dir_all(&self.folder).map_err(fail)?;
        self.name_next_file(now);
        let mut writer = self.open_writer()?;
        let begun = self.write_beginning(&mut writer, now);
        match begun {
            Ok(offset) => {
                if let (Some(offset), Some((at, _))) = (offset, &mut self.scan) {
                    *at = offset;
                }
                self.has_no_scan = self.scan.is_none();
                self.lacks_session = self.session.is_none();
                self.replacement = None;
                self.writer = Some(writer);
                Ok(())
            }
            Err(error) => {
                drop(writer);
                // All its records are written again by the next attempt.
                let _ = fs::remove_file(&self.path);
                Err(match error {
                    // The following record is not in any log; `Sync` would indicate the opposite.
                    StoreError::Sync { path, source, .. } => StoreError::Write { path, source },
                    error => error,
                })
            }
        }
    }

    /// Writes and syncs the first records; returns the offset of the current scan, bytes.
    fn write_beginning(
        &self,
        writer: &mut LogWriter,
        now: Timestamp,
    ) -> Result<Option<u64>, StoreError> {
        let Some(Replacement { gaps, carried }) = &self.replacement else { return Ok(None) };
        if let Some(session) = &self.session {
            writer.append(&Record::Session(session.clone()))?;
        }
        let offset = writer.length();
        if let Some((_, start)) = &self.scan {
            let lines = carried.split_inclusive(|&byte| byte == b'\n');
            let lines = lines.map(|line| line.trim_ascii_end());
            let records: Vec<_> =
                lines.filter_map(|line| Some((line, decode_line(line).ok()?))).collect();
            if records.is_empty() {
                writer.append(&Record::ScanStart((**start).clone()))?;
            }
            for (line, record) in &records {
                writer.append_line(line, record)?;
            }
        }
        for gap in gaps {
            let event = Event { time: now, kind: EventKind::Gap, detail: gap.clone() };
            writer.append(&Record::Event(event))?;
        }
        writer.sync()?;
        Ok(self.scan.as_ref().map(|_| offset))
    }
}
