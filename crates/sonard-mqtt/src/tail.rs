//! Follows the daemon's logs from a position, file after file, including lines written meanwhile.

use std::{
    fs::File,
    io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom},
    path::{Path, PathBuf},
};

use bytes::Bytes;
use sonard_log::log_files;
use sonard_records::{MAX_LINE_BYTES, decode_line};

use super::{
    checkpoint::LogCheckpoint,
    in_flight::{LogLine, LogPosition, RecordMessage},
    topics::MessageKind,
};

/// Reader of a folder of logs, with its position.
#[derive(Debug)]
pub(super) struct Tail {
    folder: PathBuf,
    at: LogPosition,
}

/// Result of a read.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct TailChunk {
    /// Description of a gap, if the log does not continue at the position.
    pub(super) gap: Option<String>,
    /// Complete lines after the position.
    pub(super) lines: Vec<LogLine>,
    /// `true` if no further lines are available.
    pub(super) is_end: bool,
}

impl Tail {
    /// Resumes at the checkpoint of the previous daemon. Without a checkpoint, starts at the end of
    /// the logs, or at their beginning with `history`. Also returns a description of a gap, if the
    /// checkpoint does not match the logs.
    ///
    /// # Errors
    /// If the folder can't be read, or the checkpoint not be written.
    pub(super) fn open(folder: &Path, history: bool) -> io::Result<(Self, Option<String>)> {
        let mut tail =
            Self { folder: folder.into(), at: LogPosition { file: "".into(), bytes: 0 } };
        let reason = match LogCheckpoint::read(folder) {
            Ok(Some(checkpoint)) => {
                tail.at = checkpoint.position();
                if checkpoint.matches(folder) {
                    return Ok((tail, None));
                }
                let LogPosition { file, bytes } = &tail.at;
                format!("{file}, which the broker has up to byte {bytes}, was removed or changed")
            }
            Ok(None) => {
                tail.at = if history { tail.next_log()? } else { tail.end()? };
                // Records written before the first connection are published, too.
                LogCheckpoint::write(folder, &tail.at)?;
                return Ok((tail, None));
            }
            Err(error) => format!("the position of the broker is not known: {error}"),
        };
        tail.at = tail.next_log()?;
        let gap = format!("{reason}: sent again from the beginning of {}", tail.at.file);
        Ok((tail, Some(gap)))
    }

    /// Position up to which the logs were read.
    pub(super) const fn place(&self) -> &LogPosition {
        &self.at
    }

    /// Reads further lines, up to about `max_bytes`.
    ///
    /// # Errors
    /// If a log can't be read.
    pub(super) fn read(&mut self, max_bytes: usize) -> io::Result<TailChunk> {
        let mut chunk = TailChunk::default();
        let mut read = 0;
        while read < max_bytes {
            // A log with a successor is not written any more.
            let next = self.log_after(&self.at.file)?;
            match self.read_log(max_bytes - read, &mut chunk.lines) {
                Ok(more) => read += more,
                // Lines read before the gap are returned first.
                Err(error) if is_gone(&error) && !chunk.lines.is_empty() => return Ok(chunk),
                Err(error) if is_gone(&error) => {
                    let next = self.next_log()?;
                    let before = std::mem::replace(&mut self.at, next);
                    let LogPosition { file, bytes } = before;
                    chunk.gap = Some(format!(
                        "{file} was removed or cut before its records from byte {bytes} on were \
                         published: continued at the beginning of {}",
                        self.at.file
                    ));
                    return Ok(chunk);
                }
                Err(error) => return Err(error),
            }
            if read >= max_bytes {
                return Ok(chunk);
            }
            match next {
                Some(next) => self.at = LogPosition { file: next.into(), bytes: 0 },
                None => {
                    chunk.is_end = true;
                    return Ok(chunk);
                }
            }
        }
        Ok(chunk)
    }

    /// Size of the logs after a position, bytes.
    ///
    /// # Errors
    /// If the folder can't be read.
    pub(super) fn behind(&self, place: &LogPosition) -> io::Result<u64> {
        let files = log_files(&self.folder)?;
        let behind = files.iter().filter(|file| *file.name >= *place.file);
        let all: u64 = behind.map(|file| file.bytes).sum();
        Ok(all.saturating_sub(place.bytes))
    }

    /// Reads complete lines of the current log. Returns their length in bytes.
    fn read_log(&mut self, max_bytes: usize, lines: &mut Vec<LogLine>) -> io::Result<usize> {
        if self.at.file.is_empty() {
            return Ok(0);
        }
        let mut file = File::open(self.folder.join(&*self.at.file))?;
        if file.metadata()?.len() < self.at.bytes {
            return Err(io::ErrorKind::NotFound.into());
        }
        file.seek(SeekFrom::Start(self.at.bytes))?;
        let mut reader = BufReader::with_capacity(1 << 16, file);
        let mut read = 0;
        let mut line = Vec::new();
        let mut is_rest = false;
        while read < max_bytes {
            line.clear();
            let limit = MAX_LINE_BYTES as u64 + 2;
            let length = reader.by_ref().take(limit).read_until(b'\n', &mut line)?;
            let is_whole = line.ends_with(b"\n");
            // A line without newline is still being written; a line too long for a record is
            // skipped in parts.
            if length == 0 || (!is_whole && (length as u64) < limit) {
                break;
            }
            self.at.bytes += length as u64;
            let message = message(&line).filter(|_| is_whole && !is_rest);
            is_rest = !is_whole;
            lines.push(LogLine { message, after: self.at.clone() });
            read += length;
        }
        Ok(read)
    }

    /// Position to continue at after a gap: the same log from its beginning if it exists, else the
    /// next one, else the oldest.
    fn next_log(&self) -> io::Result<LogPosition> {
        let files = log_files(&self.folder)?;
        let from = files.iter().find(|file| *file.name >= *self.at.file).or(files.first());
        Ok(LogPosition { file: from.map_or("", |file| &file.name).into(), bytes: 0 })
    }

    fn log_after(&self, name: &str) -> io::Result<Option<String>> {
        let files = log_files(&self.folder)?;
        Ok(files.into_iter().map(|file| file.name).find(|other| **other > *name))
    }

    /// End of the newest log, which is being written.
    fn end(&self) -> io::Result<LogPosition> {
        let newest = log_files(&self.folder)?.pop();
        Ok(newest.map_or(LogPosition { file: "".into(), bytes: 0 }, |file| LogPosition {
            file: file.name.into(),
            bytes: file.bytes,
        }))
    }
}

fn is_gone(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::NotFound
}

/// Message for a line, if it is a valid record.
fn message(line: &[u8]) -> Option<RecordMessage> {
    let line = line.trim_ascii_end();
    let kind = MessageKind::for_record(&decode_line(line).ok()?);
    Some(RecordMessage { kind, payload: Bytes::copy_from_slice(line) })
}

#[cfg(test)]
mod tests;
