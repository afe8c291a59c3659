//! The scans in a folder of logs, newest first, found without reading any log twice.
//!
//! Logs only grow, so what was read of one is remembered as places in it, and the next question
//! reads on from there. Nothing but places is kept: a scan that is asked for is read then.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom},
    path::{Path, PathBuf},
    sync::Arc,
};

use sonard_records::{
    FaultKind, MAX_LINE_BYTES, Ping, Provenance, Record, ScanEnd, ScanStart, ScanView, SceneRef,
    decode_line,
};
use uuid::Uuid;

use super::{log_files, read_log};

/// Only so many of the newest logs are looked at: memory stays bounded after months.
const MOST_LOGS: usize = 8;

/// How every reading of a log begins; most lines need no closer look.
const READING: &[u8] = br#"{"type":"ping","#;

/// The scans in a folder of logs.
#[derive(Debug)]
pub struct History {
    folder: PathBuf,
    logs: BTreeMap<String, Index>,
}

/// One scan of a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct PastScan {
    /// Name of its log.
    pub log: String,
    /// How it began.
    pub start: ScanStart,
    /// How it ended; `None` for one under way, or broken off.
    pub end: Option<ScanEnd>,
    /// Where its readings come from, if the log says so.
    pub provenance: Option<Provenance>,
    /// The scene that the model was given.
    pub scene: Option<SceneRef>,
}

/// What is known of one log.
#[derive(Debug, Default)]
struct Index {
    read_to: u64,
    session: Option<Arc<SessionPlace>>,
    /// Where the last session stands that has the text of its scene, and which scene.
    text: Option<(u64, Option<SceneRef>)>,
    scans: Vec<ScanLines>,
}

/// A log may hold tens of thousands of scans: what is told of them is read when it is asked for.
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
    /// The session before it that has the text of the same scene, if it has none itself.
    text_at: Option<u64>,
    provenance: Provenance,
    scene: Option<SceneRef>,
}

/// The position of a scan's records in a log, to be read piece by piece.
#[derive(Debug, Clone)]
pub struct Passage {
    /// The scan, without its readings and events.
    pub view: ScanView,
    /// The log.
    pub path: PathBuf,
    from: u64,
    to: u64,
}

impl History {
    /// Of the logs in `folder`; nothing is read yet.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, logs: BTreeMap::new() }
    }

    /// The newest scans, newest first, at most so many.
    ///
    /// # Errors
    /// When the folder or a log in it can't be read.
    pub fn newest(&mut self, most: usize) -> io::Result<Vec<PastScan>> {
        Ok(self.list(None, most)?.unwrap_or_default())
    }

    /// The scans that stand before one, newest first, at most so many; `None` if the newest logs have no
    /// such scan.
    ///
    /// # Errors
    /// When the folder or a log in it can't be read.
    pub fn before(&mut self, scan: Uuid, most: usize) -> io::Result<Option<Vec<PastScan>>> {
        self.list(Some(scan), most)
    }

    fn list(&mut self, mut before: Option<Uuid>, most: usize) -> io::Result<Option<Vec<PastScan>>> {
        let mut listed = Vec::new();
        for log in self.recent()? {
            let mut places = self.read_on(&log)?.scans.iter().rev();
            if before.is_some_and(|scan| !places.any(|place| place.scan == scan)) {
                continue;
            }
            before = None;
            let places: Vec<ScanLines> = places.take(most - listed.len()).cloned().collect();
            let mut file = BufReader::new(File::open(self.folder.join(&log))?);
            for place in places {
                listed.extend(place.summary(&log, &mut file)?);
            }
            if listed.len() == most {
                break;
            }
        }
        Ok(Some(listed).filter(|_| before.is_none()))
    }

    /// Where a scan stands; `None` if the newest logs have no such scan.
    ///
    /// # Errors
    /// When the folder or a log in it can't be read.
    pub fn passage(&mut self, scan: Uuid) -> io::Result<Option<Passage>> {
        for log in self.recent()? {
            let path = self.folder.join(&log);
            let places = &self.read_on(&log)?.scans;
            if let Some(place) = places.iter().rev().find(|place| place.scan == scan) {
                return place.passage(path);
            }
        }
        Ok(None)
    }

    /// Names of the newest logs, newest first; what is known of others is forgotten.
    fn recent(&mut self) -> io::Result<Vec<String>> {
        let files = log_files(&self.folder)?;
        let recent: Vec<String> =
            files.into_iter().rev().take(MOST_LOGS).map(|file| file.name).collect();
        self.logs.retain(|name, _| recent.contains(name));
        Ok(recent)
    }

    /// Reads what a log has grown by.
    fn read_on(&mut self, log: &str) -> io::Result<&Index> {
        let index = self.logs.entry(log.to_owned()).or_default();
        let mut file = File::open(self.folder.join(log))?;
        if file.metadata()?.len() < index.read_to {
            // It was repaired: another file under the same name.
            *index = Index::default();
        }
        file.seek(SeekFrom::Start(index.read_to))?;
        let mut reader = BufReader::with_capacity(1 << 16, file);
        let mut line = Vec::new();
        loop {
            line.clear();
            let limit = MAX_LINE_BYTES as u64 + 2;
            let length = reader.by_ref().take(limit).read_until(b'\n', &mut line)? as u64;
            // A line without its newline is still being written; one too long for a record is
            // passed over piece by piece.
            if length == 0 || (!line.ends_with(b"\n") && length < limit) {
                return Ok(index);
            }
            index.take(&line, length);
        }
    }
}

/// The record of the line that begins there.
fn record_at(file: &mut BufReader<File>, at: u64) -> io::Result<Option<Record>> {
    file.seek(SeekFrom::Start(at))?;
    Ok(read_log(file.by_ref()).next().transpose()?.and_then(|line| line.record.ok()))
}

impl Index {
    /// Takes in one line, given with its newline.
    fn take(&mut self, line: &[u8], length: u64) {
        let at = self.read_to;
        self.read_to += length;
        let record = (!line.starts_with(READING)).then(|| decode_line(line.trim_ascii_end()));
        match record {
            Some(Ok(Record::Session(session))) => {
                let (provenance, scene) = (session.provenance, session.scene);
                if session.scene_text.is_some() {
                    self.text = Some((at, scene.clone()));
                }
                let text = self.text.as_ref().filter(|(_, of)| *of == scene && scene.is_some());
                let text_at = text.map(|(text_at, _)| *text_at).filter(|text_at| *text_at != at);
                self.session = Some(Arc::new(SessionPlace { at, text_at, provenance, scene }));
            }
            // Scans of another log format have no session of this program.
            Some(Err(fault)) if fault.kind == FaultKind::UnsupportedFormat => self.session = None,
            Some(Ok(Record::ScanStart(start))) => {
                let session = self.session.clone();
                let (scan, to) = (start.scan, self.read_to);
                self.scans.push(ScanLines { scan, from: at, to, end_at: None, session });
            }
            Some(Ok(Record::ScanEnd(end))) => {
                let of = self.scans.iter_mut().rev().find(|place| place.scan == end.scan);
                if let Some(place) = of {
                    (place.to, place.end_at) = (self.read_to, Some(at));
                }
            }
            // Damaged lines are `sonard log verify`'s business.
            _ => {
                if let Some(place) = self.scans.last_mut().filter(|place| place.end_at.is_none()) {
                    place.to = self.read_to;
                }
            }
        }
    }
}

impl ScanLines {
    /// How it began and ended, if that can still be read.
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

    fn summary(&self, log: &str, file: &mut BufReader<File>) -> io::Result<Option<PastScan>> {
        let session = self.session.as_ref();
        Ok(self.bounds(file)?.map(|(start, end)| PastScan {
            log: log.to_owned(),
            start,
            end,
            provenance: session.map(|session| session.provenance),
            scene: session.and_then(|session| session.scene.clone()),
        }))
    }

    fn passage(&self, path: PathBuf) -> io::Result<Option<Passage>> {
        let mut file = BufReader::new(File::open(&path)?);
        let Some((start, end)) = self.bounds(&mut file)? else { return Ok(None) };
        // Before the session the one before it that has the text of its scene.
        let sessions = self.session.iter();
        let sessions = sessions.flat_map(|session| session.text_at.into_iter().chain([session.at]));
        let mut records = Vec::new();
        for at in sessions {
            records.extend(record_at(&mut file, at)?);
        }
        records.push(Record::ScanStart(start));
        records.extend(end.map(Record::ScanEnd));
        let view = ScanView::from_records(records).pop();
        Ok(view.map(|view| Passage { view, path, from: self.from, to: self.to }))
    }
}

impl Passage {
    /// The lines of its readings, or of everything else in it, in the order of the log, each with its
    /// newline.
    ///
    /// # Errors
    /// When the log can't be opened.
    pub fn lines(&self, readings: bool) -> io::Result<PassageLines> {
        PassageLines::open(&self.path, self.from, self.to, readings)
    }

    /// The last reading of a beam, and the highest index that there is.
    ///
    /// # Errors
    /// When the log can't be read.
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

/// See [`Passage::lines`]. It holds a line at a time.
#[derive(Debug)]
pub struct PassageLines {
    file: io::Take<BufReader<File>>,
    readings: bool,
}

impl PassageLines {
    fn open(path: &Path, from: u64, to: u64, readings: bool) -> io::Result<Self> {
        let mut file = BufReader::with_capacity(1 << 15, File::open(path)?);
        file.seek(SeekFrom::Start(from))?;
        Ok(Self { file: file.take(to.saturating_sub(from)), readings })
    }
}

impl Iterator for PassageLines {
    type Item = io::Result<Vec<u8>>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let mut line = Vec::new();
            let limit = MAX_LINE_BYTES as u64 + 2;
            match self.file.by_ref().take(limit).read_until(b'\n', &mut line) {
                Ok(0) => return None,
                Ok(_) if line.starts_with(READING) == self.readings => return Some(Ok(line)),
                Ok(_) => {}
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
