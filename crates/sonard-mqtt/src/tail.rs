//! Reads the daemon's logs on from a place, also what is written meanwhile, file after file.

use std::{
    fs::File,
    io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom},
    path::{Path, PathBuf},
};

use bytes::Bytes;
use sonard_log::log_files;
use sonard_records::{MAX_LINE_BYTES, decode_line};

use super::{
    bookmark::Bookmark,
    topics::Kind,
    window::{LogPosition, Message, Read},
};

/// The place in a folder of logs that was read to.
#[derive(Debug)]
pub(super) struct Tail {
    folder: PathBuf,
    at: LogPosition,
}

/// What reading on came to.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Piece {
    /// Why the log does not go on where it was read to, if so.
    pub(super) gap: Option<String>,
    /// The lines that follow.
    pub(super) lines: Vec<Read>,
    /// Whether these are all there are.
    pub(super) is_end: bool,
}

impl Tail {
    /// Goes on where the last daemon had come to; without that at the end of the logs, or at their beginning
    /// if all of `history` is wanted. Says what is not as it was, if that is so.
    ///
    /// # Errors
    /// When the folder can't be read, or the place not be remembered.
    pub(super) fn open(folder: &Path, history: bool) -> io::Result<(Self, Option<String>)> {
        let mut tail =
            Self { folder: folder.into(), at: LogPosition { file: "".into(), bytes: 0 } };
        let why = match Bookmark::read(folder) {
            Ok(Some(mark)) => {
                tail.at = mark.place();
                if mark.fits(folder) {
                    return Ok((tail, None));
                }
                let LogPosition { file, bytes } = &tail.at;
                format!("the broker has {file} up to byte {bytes}, and that is gone or was changed")
            }
            Ok(None) => {
                tail.at = if history { tail.next_log()? } else { tail.end()? };
                // What is written before the broker is there for the first time counts, too.
                Bookmark::write(folder, &tail.at)?;
                return Ok((tail, None));
            }
            Err(error) => format!("what the broker has is not known: {error}"),
        };
        tail.at = tail.next_log()?;
        let told = format!("{why}: sent again from the beginning of {}", tail.at.file);
        Ok((tail, Some(told)))
    }

    /// The place that was read to.
    pub(super) const fn place(&self) -> &LogPosition {
        &self.at
    }

    /// The following lines, until there are so many bytes of them.
    ///
    /// # Errors
    /// When a log can't be read.
    pub(super) fn read(&mut self, most_bytes: usize) -> io::Result<Piece> {
        let mut piece = Piece::default();
        let mut read = 0;
        while read < most_bytes {
            // If there is a log after this one, nothing more is written to this.
            let next = self.log_after(&self.at.file)?;
            match self.read_log(most_bytes - read, &mut piece.lines) {
                Ok(more) => read += more,
                // What was read before it comes first.
                Err(error) if is_gone(&error) && !piece.lines.is_empty() => return Ok(piece),
                Err(error) if is_gone(&error) => {
                    let next = self.next_log()?;
                    let before = std::mem::replace(&mut self.at, next);
                    let LogPosition { file, bytes } = before;
                    piece.gap = Some(format!(
                        "{file} was removed or cut before the broker had all from byte {bytes} on: \
                         sent on from the beginning of {}",
                        self.at.file
                    ));
                    return Ok(piece);
                }
                Err(error) => return Err(error),
            }
            if read >= most_bytes {
                return Ok(piece);
            }
            match next {
                Some(next) => self.at = LogPosition { file: next.into(), bytes: 0 },
                None => {
                    piece.is_end = true;
                    return Ok(piece);
                }
            }
        }
        Ok(piece)
    }

    /// How much there is in the logs behind a place, bytes.
    ///
    /// # Errors
    /// When the folder can't be read.
    pub(super) fn behind(&self, place: &LogPosition) -> io::Result<u64> {
        let files = log_files(&self.folder)?;
        let behind = files.iter().filter(|file| *file.name >= *place.file);
        let all: u64 = behind.map(|file| file.bytes).sum();
        Ok(all.saturating_sub(place.bytes))
    }

    /// Whole lines of the log at hand, and how many bytes they are.
    fn read_log(&mut self, most_bytes: usize, lines: &mut Vec<Read>) -> io::Result<usize> {
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
        while read < most_bytes {
            line.clear();
            let limit = MAX_LINE_BYTES as u64 + 2;
            let length = reader.by_ref().take(limit).read_until(b'\n', &mut line)?;
            let is_whole = line.ends_with(b"\n");
            // A line without its newline is still being written; one too long for a record is passed over
            // piece by piece.
            if length == 0 || (!is_whole && (length as u64) < limit) {
                break;
            }
            self.at.bytes += length as u64;
            let message = message(&line).filter(|_| is_whole && !is_rest);
            is_rest = !is_whole;
            lines.push(Read { message, after: self.at.clone() });
            read += length;
        }
        Ok(read)
    }

    /// Where to go on if not where it was: the log after it, itself from its beginning if it is there, or else
    /// the oldest there is.
    fn next_log(&self) -> io::Result<LogPosition> {
        let files = log_files(&self.folder)?;
        let from = files.iter().find(|file| *file.name >= *self.at.file).or(files.first());
        Ok(LogPosition { file: from.map_or("", |file| &file.name).into(), bytes: 0 })
    }

    fn log_after(&self, name: &str) -> io::Result<Option<String>> {
        let files = log_files(&self.folder)?;
        Ok(files.into_iter().map(|file| file.name).find(|other| **other > *name))
    }

    /// The end of the newest log, which is being written.
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

/// What is sent of a line.
fn message(line: &[u8]) -> Option<Message> {
    let line = line.trim_ascii_end();
    let kind = Kind::of(&decode_line(line).ok()?);
    Some(Message { kind, payload: Bytes::copy_from_slice(line) })
}

#[cfg(test)]
mod tests;
