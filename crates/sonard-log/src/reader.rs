//! Reading of logs line by line, with damaged lines reported individually.

use std::{
    fmt, fs,
    io::{self, BufRead, Read},
    path::{Path, PathBuf},
};

use sonard_records::{MAX_LINE_BYTES, Record, RecordError, RecordErrorKind, decode_line};

use super::{FileKind, HEAD_BYTES, StoreError};

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Line of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Line number, from 1.
    pub number: u64,
    /// Offset in the file, bytes.
    pub offset: u64,
    /// Length without the newline, bytes.
    pub length: u64,
    /// Content without the newline; truncated for a line longer than [`MAX_LINE_BYTES`].
    pub bytes: Vec<u8>,
    /// `true` if the line ends with a newline. Only the last line can lack one, because of a torn
    /// or unfinished write.
    pub ended: bool,
    /// Decoded record, or the fault of the line.
    pub record: Result<Record, LineError>,
}

/// Line that is not a valid record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineError {
    /// Line number, from 1.
    pub line: u64,
    /// Fault with its column and field.
    pub fault: RecordError,
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.fault)
    }
}

impl std::error::Error for LineError {}

impl LineError {
    /// Returns a damaged line for the caller to report, but rejects a log of another format.
    ///
    /// # Errors
    /// [`StoreError::UnsupportedFormat`] if the line is a session of another format.
    pub fn reject_other_format(self, path: &Path) -> Result<Self, StoreError> {
        match self.fault.kind {
            RecordErrorKind::UnsupportedFormat => {
                Err(StoreError::UnsupportedFormat { path: path.into(), fault: self })
            }
            _ => Ok(self),
        }
    }
}

/// Iterates over all lines of a log, including damaged ones.
///
/// Memory is bounded for any content. An item is an error only if reading fails, which ends the
/// iteration.
pub fn read_log<R: BufRead>(reader: R) -> Lines<R> {
    Lines { reader, number: 0, offset: 0, done: false }
}

/// Iterator over the lines of a log; see [`read_log`].
#[derive(Debug)]
pub struct Lines<R> {
    reader: R,
    number: u64,
    offset: u64,
    done: bool,
}

impl<R: BufRead> Iterator for Lines<R> {
    type Item = io::Result<Line>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let next = self.read_line().transpose();
        self.done = !matches!(next, Some(Ok(Line { ended: true, .. })));
        next
    }
}

impl<R: BufRead> Lines<R> {
    fn read_line(&mut self) -> io::Result<Option<Line>> {
        let mut bytes = Vec::with_capacity(512);
        // Two bytes for a carriage return and a newline after the longest record.
        let limit = MAX_LINE_BYTES as u64 + 2;
        let mut read = self.reader.by_ref().take(limit).read_until(b'\n', &mut bytes)? as u64;
        if read == 0 {
            return Ok(None);
        }
        let mut ended = bytes.pop_if(|last| *last == b'\n').is_some();
        let too_long = !ended && read == limit;
        if too_long {
            (read, ended) = self.skip_rest(read)?;
        }
        let (number, offset) = (self.number + 1, self.offset);
        self.number = number;
        self.offset += read;
        let length = read - u64::from(ended);
        let record =
            if too_long { Err(too_long_fault(length)) } else { decode(&bytes, number, ended) };
        let record = record.map_err(|fault| LineError { line: number, fault });
        Ok(Some(Line { number, offset, length, bytes, ended, record }))
    }

    /// Skips the rest of a line; returns the total of read bytes, and `true` if a newline was
    /// found.
    fn skip_rest(&mut self, mut read: u64) -> io::Result<(u64, bool)> {
        let mut scrap = Vec::new();
        loop {
            scrap.clear();
            let more = self.reader.by_ref().take(1 << 16).read_until(b'\n', &mut scrap)?;
            read += more as u64;
            if scrap.last() == Some(&b'\n') {
                return Ok((read, true));
            }
            if more == 0 {
                return Ok((read, false));
            }
        }
    }
}

pub(super) fn decode(bytes: &[u8], number: u64, ended: bool) -> Result<Record, RecordError> {
    let bytes = match number {
        1 => bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes),
        _ => bytes,
    };
    decode_line(bytes).map_err(|fault| if ended { fault } else { torn_fault(bytes.len() as u64) })
}

fn torn_fault(length: u64) -> RecordError {
    RecordError {
        kind: RecordErrorKind::Truncated,
        column: None,
        field: None,
        message: format!("the last line is torn: it ends within a record after {length} byte(s)"),
    }
}

fn too_long_fault(length: u64) -> RecordError {
    RecordError {
        kind: RecordErrorKind::TooLong,
        column: None,
        field: None,
        message: format!("{length} bytes long; a record has at most {MAX_LINE_BYTES}"),
    }
}

/// Content of a log: records and damaged lines.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loaded {
    /// Valid records, in order.
    pub records: Vec<Record>,
    /// Faults of the other lines, in order.
    pub damaged: Vec<LineError>,
}

/// Reads a complete log from a file, or from standard input for `-`.
///
/// Damaged lines are returned for the caller to report.
///
/// # Errors
/// Returns an error if the file cannot be read, or has a session of another format.
pub fn load(path: &Path) -> Result<Loaded, StoreError> {
    let reader = open_for_reading(path)?;
    let mut loaded = Loaded::default();
    for line in read_log(reader) {
        match line.map_err(|source| StoreError::Read { path: path.into(), source })?.record {
            Ok(record) => loaded.records.push(record),
            Err(error) => loaded.damaged.push(error.reject_other_format(path)?),
        }
    }
    Ok(loaded)
}

/// Opens a file, or standard input for `-`, for [`read_log`].
pub fn open_for_reading(path: &Path) -> Result<Box<dyn BufRead>, StoreError> {
    if path == Path::new("-") {
        return reject_other_kind(path, Box::new(io::stdin().lock()));
    }
    let fail = |source| StoreError::Unreadable { path: PathBuf::from(path), source };
    let file = fs::File::open(path).map_err(fail)?;
    if file.metadata().map_err(fail)?.is_dir() {
        return Err(fail(io::ErrorKind::IsADirectory.into()));
    }
    reject_other_kind(path, Box::new(io::BufReader::with_capacity(HEAD_BYTES, file)))
}

/// Rejects files of other kinds with one error, instead of a fault per line.
fn reject_other_kind(
    path: &Path,
    mut reader: Box<dyn BufRead>,
) -> Result<Box<dyn BufRead>, StoreError> {
    let fail = |source| StoreError::Read { path: path.into(), source };
    let kind = FileKind::detect(reader.fill_buf().map_err(fail)?);
    if kind.cannot_be_log() {
        Err(StoreError::NotALog { path: path.into(), kind })
    } else {
        Ok(reader)
    }
}
