//! Reads a log line by line.

use std::{
    fmt, fs,
    io::{self, BufRead, Read},
    path::{Path, PathBuf},
};

use sonard_records::{FaultKind, MAX_LINE_BYTES, Record, RecordError, decode_line};

use super::{FileKind, HEAD_BYTES, StoreError};

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// One line of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Number of the line, from 1.
    pub number: u64,
    /// Where it begins in the file, bytes.
    pub offset: u64,
    /// How long it is, bytes without the newline.
    pub length: u64,
    /// The line as it stands, without the newline; of a line longer than
    /// [`MAX_LINE_BYTES`] only the beginning.
    pub bytes: Vec<u8>,
    /// Whether a newline ends it. Only the last line can be without one: cut off, or still being
    /// written.
    pub ended: bool,
    /// The record, or why there is none.
    pub record: Result<Record, LineError>,
}

/// A line that is not a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineError {
    /// Number of the line, from 1.
    pub line: u64,
    /// What is wrong, where on the line, and in which field.
    pub fault: RecordError,
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.fault)
    }
}

impl std::error::Error for LineError {}

impl LineError {
    /// Passes damaged lines on, for the caller to report, but rejects a log of another format.
    ///
    /// # Errors
    /// [`StoreError::UnsupportedFormat`] if the line is a session of another format.
    pub fn reject_other_format(self, path: &Path) -> Result<Self, StoreError> {
        match self.fault.kind {
            FaultKind::UnsupportedFormat => {
                Err(StoreError::UnsupportedFormat { path: path.into(), fault: self })
            }
            _ => Ok(self),
        }
    }
}

/// Every line of a log, damaged ones included, in order.
///
/// Memory stays bounded whatever the file holds. An item is an error only when reading itself
/// failed; nothing follows it.
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
        // The newline and a carriage return before it come on top of the longest record.
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

    /// Reads on to the newline and keeps nothing. Gives the bytes read in all, and whether a
    /// newline came.
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
        kind: FaultKind::Torn,
        column: None,
        field: None,
        message: format!("the last line is torn: it ends after {length} byte(s), in mid-record"),
    }
}

fn too_long_fault(length: u64) -> RecordError {
    RecordError {
        kind: FaultKind::TooLong,
        column: None,
        field: None,
        message: format!("{length} bytes long; a record has at most {MAX_LINE_BYTES}"),
    }
}

/// A log read whole: what could be read, and what could not.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loaded {
    /// The records, in order.
    pub records: Vec<Record>,
    /// The lines that hold none, in order.
    pub damaged: Vec<LineError>,
}

/// Reads a whole log from a file, or from standard input for `-`.
///
/// Damaged lines are not an error; whoever calls shows them.
///
/// # Errors
/// When the file can't be opened or read, or has a session of another format.
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
        return refuse_other(path, Box::new(io::stdin().lock()));
    }
    let fail = |source| StoreError::Unreadable { path: PathBuf::from(path), source };
    let file = fs::File::open(path).map_err(fail)?;
    if file.metadata().map_err(fail)?.is_dir() {
        return Err(fail(io::ErrorKind::IsADirectory.into()));
    }
    refuse_other(path, Box::new(io::BufReader::with_capacity(HEAD_BYTES, file)))
}

/// Names what is plainly no log instead of finding fault with each of its lines.
fn refuse_other(path: &Path, mut reader: Box<dyn BufRead>) -> Result<Box<dyn BufRead>, StoreError> {
    let fail = |source| StoreError::Read { path: path.into(), source };
    let kind = FileKind::of(reader.fill_buf().map_err(fail)?);
    if kind.is_no_log() { Err(StoreError::NoLog { path: path.into(), kind }) } else { Ok(reader) }
}
