//! Replacement of a log that cannot be continued: its sync failed, or its path names another file.

use std::fs;

use jiff::Timestamp;
use sonard_records::{Event, EventKind, Record, decode_line, encode_line};

use super::{LogFolder, LogWriter};
use crate::{Displacement, StoreError};

/// File that is to be replaced.
#[derive(Debug, Default)]
pub(super) struct Replacement {
    /// Number of its records that are written again.
    repeated: u64,
    /// Number of synced records among the repeated ones.
    repeated_synced: u64,
    /// Truncated file, from which the repeated records are removed.
    truncated: Option<LogWriter>,
}

impl LogFolder {
    /// Compares the open file with the file at its path and starts a new one if they differ. To be
    /// called every few seconds; the cost is two stat(2).
    ///
    /// - Removed or truncated file: its records since the last call, and the current scan, are
    ///   written to the new file.
    /// - Moved, replaced or hidden file: it keeps its records, and the current scan is finished in
    ///   it.
    /// - File with text of another program: it keeps its readable records.
    ///
    /// # Errors
    /// Returns an error if the new file cannot be written; retried with the next call or record.
    pub fn inspect(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let Some(writer) = &self.writer else { return Ok(()) };
        // Ignores paths that cannot be examined.
        let Ok(displacement) = writer.displacement() else { return Ok(()) };
        if matches!(displacement, None | Some(Displacement::Moved)) {
            self.retained.confirm();
        }
        let Some(displacement) = displacement else { return Ok(()) };
        let detail = format!("{} {displacement}", self.file_name());
        if displacement == Displacement::Moved {
            if self.retained.is_in_scan() {
                if !self.is_displaced {
                    self.incident = Some(format!("{detail}; its scan is finished there"));
                }
                self.is_displaced = true;
                return Ok(());
            }
            let synced = self.writer.as_mut().map_or(Ok(()), LogWriter::sync);
            self.handle_failure(synced, now).ok();
        }
        self.replace(detail, Some(displacement), now);
        self.writer(now).map(drop)
    }

    /// Returns the description of a replacement since the last call.
    pub fn take_incident(&mut self) -> Option<String> {
        self.incident.take()
    }

    /// File name of the current log.
    pub(super) fn file_name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Closes the file; the next record starts a new one with an event about the gap. Records that
    /// the displacement loses are written again.
    pub(super) fn replace(
        &mut self,
        mut gap: String,
        displacement: Option<Displacement>,
        now: Timestamp,
    ) {
        // Until a replacement exists, a further gap only adds an event.
        if self.replacement.is_none() {
            let is_lost = displacement.is_some_and(Displacement::loses_records);
            match self.retained.discarded() {
                n @ 1.. if is_lost => gap += &format!("; its last {n} record(s) are lost"),
                _ => {}
            }
            let writer = self.release_writer();
            let mut repeated = self.retained.count();
            if !is_lost {
                // Another program's text within a line makes that line unreadable.
                let is_changed = matches!(displacement, Some(Displacement::Resized { .. }));
                let changed = writer.as_ref().filter(|_| is_changed);
                let missing = changed.and_then(|log| log.missing(self.retained.lines()).ok());
                let missing = missing.unwrap_or_default();
                repeated = missing.iter().filter(|&&byte| byte == b'\n').count() as u64;
                let note = format!("the other records of this scan are in {}", self.file_name());
                self.retained.restart_with(&missing, &gap_line(note, now).0);
            }
            let unsynced = self.appended_before - self.synced_before - self.uncertain;
            self.uncertain += unsynced.saturating_sub(repeated);
            let is_truncated = is_lost && displacement != Some(Displacement::Removed);
            self.replacement = Some(Replacement {
                repeated,
                repeated_synced: repeated.saturating_sub(unsynced),
                truncated: writer.filter(|_| is_truncated),
            });
        }
        self.is_displaced = false;
        self.incident = Some(gap.clone());
        let (line, event) = gap_line(gap, now);
        self.retained.push(&line, &event);
    }

    /// Creates the replacement with the current session and the retained lines. On failure the new
    /// file is removed.
    pub(super) fn begin_replacement(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let fail = |source| StoreError::Open { path: self.folder.clone(), source };
        fs::create_dir_all(&self.folder).map_err(fail)?;
        self.name_next_file(now);
        let mut writer = self.open_writer()?;
        if let Err(error) = self.write_beginning(&mut writer) {
            drop(writer);
            // All its records are written again by the next attempt.
            let _ = fs::remove_file(&self.path);
            return Err(match error {
                // The following record is not in any log; `Sync` would indicate the opposite.
                StoreError::Sync { path, source, .. } => StoreError::Write { path, source },
                error => error,
            });
        }
        self.has_no_scan = !self.retained.is_in_scan();
        self.lacks_session = self.session.is_none();
        self.writer = Some(writer);
        let replaced = self.replacement.take().unwrap_or_default();
        self.appended_before = self.appended_before.saturating_sub(replaced.repeated);
        self.synced_before = self.synced_before.saturating_sub(replaced.repeated_synced);
        if let Some(truncated) = replaced.truncated {
            self.withdraw_repeated(truncated);
        }
        Ok(())
    }

    /// Writes and syncs the first records.
    fn write_beginning(&self, writer: &mut LogWriter) -> Result<(), StoreError> {
        if let Some(session) = &self.session {
            writer.append(&Record::Session(session.clone()))?;
        }
        for line in self.retained.lines().split_inclusive(|&byte| byte == b'\n') {
            let line = line.trim_ascii_end();
            if let Ok(record) = decode_line(line) {
                writer.append_line(line, &record)?;
            }
        }
        writer.sync()
    }

    /// Removes records that were written again from the end of a truncated file, and the file if
    /// nothing else is in it.
    fn withdraw_repeated(&self, mut truncated: LogWriter) {
        let withdrawn = truncated.withdraw(self.retained.lines()).and_then(|length| {
            let is_in_place = truncated.displacement()?.is_none();
            if length == 0 && is_in_place { fs::remove_file(truncated.path()) } else { Ok(()) }
        });
        if let Err(error) = withdrawn {
            tracing::warn!(
                "{} may repeat records of {} ({error}): remove the older file",
                truncated.path().display(),
                self.path.display()
            );
        }
    }
}

/// Creates an event about a gap, as line and record.
fn gap_line(detail: String, time: Timestamp) -> (Vec<u8>, Record) {
    let event = Record::Event(Event { time, kind: EventKind::Gap, detail });
    let mut line = Vec::new();
    // Only numbers can be invalid in a record.
    let _ = encode_line(&event, &mut line);
    (line, event)
}
