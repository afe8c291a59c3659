//! Index of the scans in a folder of logs.
//!
//! Logs only grow, so each query continues reading at the end of the previous one. The index stores
//! only offsets; the records of a scan are read on request.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom},
    path::{Path, PathBuf},
    sync::Arc,
};

use sonard_records::{
    MAX_LINE_BYTES, Ping, Provenance, Record, RecordErrorKind, ScanEnd, ScanStart, ScanView,
    SceneRef, decode_line,
};
use uuid::Uuid;

use super::{log_files, read_log};

/// Number of newest logs that are indexed, which bounds memory.
const MAX_LOGS: usize = 8;

/// Prefix of ping records, the majority of lines, which the index skips.
const PING_PREFIX: &[u8] = br#"{"type":"ping","#;

/// Index of the scans in a folder of logs.
#[derive(Debug)]
pub struct LogIndex {
    folder: PathBuf,
    logs: BTreeMap<String, Index>,
}

/// Summary of a logged scan.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedScan {
    /// Name of the log.
    pub log: String,
    /// First record of the scan.
    pub start: ScanStart,
    /// Last record of the scan; `None` for a running or interrupted scan.
    pub end: Option<ScanEnd>,
    /// Origin of the readings, if recorded.
    pub provenance: Option<Provenance>,
    /// Scene of the model's predictions.
    pub scene: Option<SceneRef>,
}

/// Index of one log.
#[derive(Debug, Default)]
struct Index {
    read_to: u64,
    session: Option<Arc<SessionPlace>>,
    /// Offset of the last session with a scene text, and the scene.
    text: Option<(u64, Option<SceneRef>)>,
    scans: Vec<ScanLines>,
}

/// Offsets of a scan's lines. A log may contain tens of thousands of scans, so their records are
/// read on request.
#[derive(Debug, Clone)]
struct ScanLines {
    scan: Uuid,
    from: u64,
    to: u64,
    end_at: Option<u64>,
    session: Option<Arc<SessionPlace>>,
}

#[derive(Debug, Clone)]
struct SessionPlace {
    at: u64,
    /// Offset of an earlier session with the text of the same scene, if this session has none.
    text_at: Option<u64>,
    provenance: Provenance,
    scene: Option<SceneRef>,
}

/// Location of a scan's records in a log, for reading line by line.
#[derive(Debug, Clone)]
pub struct ScanSpan {
    /// Scan without readings and events.
    pub view: ScanView,
    /// Path of the log.
    pub path: PathBuf,
    from: u64,
    to: u64,
}

impl LogIndex {
    /// Creates an empty index of the logs in `folder`.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, logs: BTreeMap::new() }
    }

    /// Returns at most `max` of the newest scans, newest first.
    ///
    /// # Errors
    /// Returns an error if the folder or a log cannot be read.
    pub fn newest(&mut self, max: usize) -> io::Result<Vec<LoggedScan>> {
        Ok(self.list(None, max)?.unwrap_or_default())
    }

    /// Returns at most `max` scans before the given one, newest first; `None` if the given scan is
    /// not in the index.
    ///
    /// # Errors
    /// Returns an error if the folder or a log cannot be read.
    pub fn before(&mut self, scan: Uuid, max: usize) -> io::Result<Option<Vec<LoggedScan>>> {
        self.list(Some(scan), max)
    }

    fn list(
        &mut self,
        mut before: Option<Uuid>,
        max: usize,
    ) -> io::Result<Option<Vec<LoggedScan>>> {
        let mut listed = Vec::new();
        for log in self.recent()? {
            let mut scans = self.update(&log)?.scans.iter().rev();
            if before.is_some_and(|scan| !scans.any(|lines| lines.scan == scan)) {
                continue;
            }
            before = None;
            let scans: Vec<ScanLines> = scans.take(max - listed.len()).cloned().collect();
            let mut file = BufReader::new(File::open(self.folder.join(&log))?);
            for lines in scans {
                listed.extend(lines.summary(&log, &mut file)?);
            }
            if listed.len() == max {
                break;
            }
        }
        Ok(Some(listed).filter(|_| before.is_none()))
    }

    /// Locates a scan; `None` if the scan is not in the index.
    ///
    /// # Errors
    /// Returns an error if the folder or a log cannot be read.
    pub fn scan_span(&mut self, scan: Uuid) -> io::Result<Option<ScanSpan>> {
        for log in self.recent()? {
            let path = self.folder.join(&log);
            let scans = &self.update(&log)?.scans;
            if let Some(lines) = scans.iter().rev().find(|lines| lines.scan == scan) {
                return lines.scan_span(path);
            }
        }
        Ok(None)
    }

    /// Lists the names of the newest logs, newest first, and drops the indices of others.
    fn recent(&mut self) -> io::Result<Vec<String>> {
        let files = log_files(&self.folder)?;
        let recent: Vec<String> =
            files.into_iter().rev().take(MAX_LOGS).map(|file| file.name).collect();
        self.logs.retain(|name, _| recent.contains(name));
        Ok(recent)
    }

    /// Indexes the lines added to a log since the last call.
    fn update(&mut self, log: &str) -> io::Result<&Index> {
        let index = self.logs.entry(log.to_owned()).or_default();
        let mut file = File::open(self.folder.join(log))?;
        if file.metadata()?.len() < index.read_to {
            // A shorter file is a different one, for instance after a repair.
            *index = Index::default();
        }
        file.seek(SeekFrom::Start(index.read_to))?;
        let mut reader = BufReader::with_capacity(1 << 16, file);
        let mut line = Vec::new();
        loop {
            line.clear();
            let limit = MAX_LINE_BYTES as u64 + 2;
            let length = reader.by_ref().take(limit).read_until(b'\n', &mut line)? as u64;
            // A line without newline is still being written. A line too long for a record is
            // skipped in chunks.
            if length == 0 || (!line.ends_with(b"\n") && length < limit) {
                return Ok(index);
            }
            index.add_line(&line, length);
        }
    }
}

/// Reads the record at an offset.
fn record_at(file: &mut BufReader<File>, at: u64) -> io::Result<Option<Record>> {
    file.seek(SeekFrom::Start(at))?;
    Ok(read_log(file.by_ref()).next().transpose()?.and_then(|line| line.record.ok()))
}

impl Index {
    /// Adds the next line, including its newline.
    fn add_line(&mut self, line: &[u8], length: u64) {
        let at = self.read_to;
        self.read_to += length;
        let is_ping = line.starts_with(PING_PREFIX);
        let record = (!is_ping).then(|| decode_line(line.trim_ascii_end()));
        match record {
            Some(Ok(Record::Session(session))) => {
                let (provenance, scene) = (session.provenance, session.scene);
                if session.scene_text.is_some() {
                    self.text = Some((at, scene.clone()));
                }
                let text = self.text.as_ref();
                let text = text.filter(|(_, text_of)| *text_of == scene && scene.is_some());
                let text_at = text.map(|(text_at, _)| *text_at).filter(|text_at| *text_at != at);
                self.session = Some(Arc::new(SessionPlace { at, text_at, provenance, scene }));
            }
            // Scans of another log format have no readable session.
            Some(Err(fault)) if fault.kind == RecordErrorKind::UnsupportedFormat => {
                self.session = None;
            }
            Some(Ok(Record::ScanStart(start))) => {
                let session = self.session.clone();
                let (scan, to) = (start.scan, self.read_to);
                self.scans.push(ScanLines { scan, from: at, to, end_at: None, session });
            }
            Some(Ok(Record::ScanEnd(end))) => {
                let ended = self.scans.iter_mut().rev().find(|lines| lines.scan == end.scan);
                if let Some(lines) = ended {
                    (lines.to, lines.end_at) = (self.read_to, Some(at));
                }
            }
            // Damaged lines are reported by `sonard log verify`.
            _ => {
                if let Some(lines) = self.scans.last_mut().filter(|lines| lines.end_at.is_none()) {
                    lines.to = self.read_to;
                }
            }
        }
    }
}

impl ScanLines {
    /// Reads the first and the last record; `None` if the first is no longer readable.
    fn bounds(
        &self,
        file: &mut BufReader<File>,
    ) -> io::Result<Option<(ScanStart, Option<ScanEnd>)>> {
        let Some(Record::ScanStart(start)) = record_at(file, self.from)? else { return Ok(None) };
        let end = self.end_at.map(|at| record_at(file, at)).transpose()?.flatten();
        let end = match end {
            Some(Record::ScanEnd(end)) => Some(end),
            _ => None,
        };
        Ok(Some((start, end)))
    }

    fn summary(&self, log: &str, file: &mut BufReader<File>) -> io::Result<Option<LoggedScan>> {
        let session = self.session.as_ref();
        Ok(self.bounds(file)?.map(|(start, end)| LoggedScan {
            log: log.to_owned(),
            start,
            end,
            provenance: session.map(|session| session.provenance),
            scene: session.and_then(|session| session.scene.clone()),
        }))
    }

    fn scan_span(&self, path: PathBuf) -> io::Result<Option<ScanSpan>> {
        let mut file = BufReader::new(File::open(&path)?);
        let Some((start, end)) = self.bounds(&mut file)? else { return Ok(None) };
        // An earlier session with the scene's text precedes the scan's own session.
        let sessions = self.session.iter();
        let sessions = sessions.flat_map(|session| session.text_at.into_iter().chain([session.at]));
        let mut records = Vec::new();
        for at in sessions {
            records.extend(record_at(&mut file, at)?);
        }
        records.push(Record::ScanStart(start));
        records.extend(end.map(Record::ScanEnd));
        let view = ScanView::from_records(records).pop();
        Ok(view.map(|view| ScanSpan { view, path, from: self.from, to: self.to }))
    }
}

impl ScanSpan {
    /// Iterates over the lines of the readings (`true`) or of all other records (`false`), in log
    /// order and including newlines.
    ///
    /// # Errors
    /// Returns an error if the log cannot be opened.
    pub fn lines(&self, readings: bool) -> io::Result<ScanSpanLines> {
        ScanSpanLines::open(&self.path, self.from, self.to, readings)
    }

    /// Returns the last reading of a beam, and the highest beam index of the scan.
    ///
    /// # Errors
    /// Returns an error if the log cannot be read.
    pub fn beam(&self, index: u32) -> io::Result<(Option<Ping>, Option<u32>)> {
        let scan = self.view.scan;
        let head = format!(r#"{{"type":"ping","scan":"{scan}","index":"#);
        let (mut found, mut highest) = (None, None);
        for line in self.lines(true)? {
            let line = line?;
            let Some(rest) = line.strip_prefix(head.as_bytes()) else { continue };
            let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
            let digits = rest.get(..digits).unwrap_or_default();
            let here = std::str::from_utf8(digits).ok().and_then(|text| text.parse().ok());
            highest = highest.max(here);
            if here == Some(index)
                && let Ok(Record::Ping(ping)) = decode_line(line.trim_ascii_end())
            {
                found = Some(*ping);
            }
        }
        Ok((found, highest))
    }
}

/// Iterator of [`ScanSpan::lines`], with one line in memory at a time.
#[derive(Debug)]
pub struct ScanSpanLines {
    file: io::Take<BufReader<File>>,
    readings: bool,
}

impl ScanSpanLines {
    fn open(path: &Path, from: u64, to: u64, readings: bool) -> io::Result<Self> {
        let mut file = BufReader::with_capacity(1 << 15, File::open(path)?);
        file.seek(SeekFrom::Start(from))?;
        Ok(Self { file: file.take(to.saturating_sub(from)), readings })
    }
}

impl Iterator for ScanSpanLines {
    type Item = io::Result<Vec<u8>>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let mut line = Vec::new();
            let limit = MAX_LINE_BYTES as u64 + 2;
            match self.file.by_ref().take(limit).read_until(b'\n', &mut line) {
                Ok(0) => return None,
                Ok(_) if line.starts_with(PING_PREFIX) == self.readings => return Some(Ok(line)),
                Ok(_) => {}
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
