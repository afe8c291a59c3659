//! Replacement of a log that can't be continued: its sync failed, or it is no longer the file that its path names.

use std::fs;

use jiff::Timestamp;
use sonard_records::{Event, EventKind, Record, decode_line};

use super::{LogFolder, LogWriter};
use crate::{Displacement, StoreError};

/// Longest part of a scan that is carried over from a removed file, bytes.
const MAX_CARRIED_BYTES: u64 = 64 << 20;

/// A file to be begun in place of one that can't be continued.
#[derive(Debug)]
pub(super) struct Replacement {
    /// Gaps that the new file reports as events.
    gaps: Vec<String>,
    /// Lines of the scan under way that only the removed file has.
    carried: Vec<u8>,
}

impl LogFolder {
    /// Compares the open file with the one that its path names, and begins a new one if they differ. A scan that is under
    /// way is finished in a file that was moved, and carried over from a file that was removed. Call it every few
    /// seconds; it costs two stat(2).
    ///
    /// # Errors
    /// When the new file can't be written; it is tried again with the next call or record.
    pub fn inspect(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let Some(writer) = &self.writer else { return Ok(()) };
        // A path that can't be examined is no proof of a displacement.
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
                self.survive(synced).ok();
                self.replace(detail, Vec::new());
                self.writer(now).map(drop)
            }
            (Displacement::Removed, Some((offset, _)))
                if writer.length().saturating_sub(*offset) <= MAX_CARRIED_BYTES =>
            {
                // What can't be read back is a part of the gap.
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

    /// Report of a log that had to be replaced, since the last call.
    pub fn take_incident(&mut self) -> Option<String> {
        self.incident.take()
    }

    /// Name of the log that is being written.
    pub(super) fn file_name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Closes the file for good; the next record begins another one with an event about the gap.
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

    /// Begins the file that replaces the last one: the session in force, the scan under way, the gaps. Nothing is left
    /// of a file that could not be begun.
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
                self.fresh = self.scan.is_none();
                self.bare = self.session.is_none();
                self.replacement = None;
                self.writer = Some(writer);
                Ok(())
            }
            Err(error) => {
                drop(writer);
                // It holds nothing that is not written again.
                let _ = fs::remove_file(&self.path);
                Err(match error {
                    // The record that is to follow is in no log, other than after a failed sync of its own.
                    StoreError::Sync { path, source, .. } => StoreError::Write { path, source },
                    error => error,
                })
            }
        }
    }

    /// Writes and syncs the first records; returns the offset of the scan under way, bytes.
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
