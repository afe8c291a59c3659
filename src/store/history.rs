//! The scans in a folder of logs, newest first, found without reading any log twice.
//!
//! Logs only grow, so what was read of one is remembered as places in it, and the next question
//! reads on from there. Readings themselves are not kept: a scan that is asked for is read then.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom},
    path::PathBuf,
};

use uuid::Uuid;

use super::{log_files, read_log};
use crate::scan::{
    MAX_LINE_BYTES, Provenance, Record, ScanEnd, ScanStart, ScanView, SceneRef, decode_line,
};

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
    session: Option<SessionPlace>,
    /// Where the last session stands that has the text of its scene, and which scene.
    text: Option<(u64, Option<SceneRef>)>,
    scans: Vec<Place>,
}

#[derive(Debug, Clone)]
struct SessionPlace {
    at: u64,
    /// The session before it that has the text of the same scene, if it has none itself.
    text_at: Option<u64>,
    provenance: Provenance,
    scene: Option<SceneRef>,
}

#[derive(Debug, Clone)]
struct Place {
    from: u64,
    to: u64,
    session: Option<SessionPlace>,
    start: ScanStart,
    end: Option<ScanEnd>,
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
        let mut newest = Vec::new();
        for log in self.recent()? {
            let index = self.read_on(&log)?;
            let wanted = most - newest.len();
            newest.extend(index.scans.iter().rev().take(wanted).map(|place| place.summary(&log)));
            if newest.len() == most {
                break;
            }
        }
        Ok(newest)
    }

    /// A scan with its readings; `None` if the newest logs have no such scan.
    ///
    /// # Errors
    /// When the folder or a log in it can't be read.
    pub fn scan(&mut self, scan: Uuid) -> io::Result<Option<ScanView>> {
        for log in self.recent()? {
            let places = &self.read_on(&log)?.scans;
            if let Some(place) = places.iter().rev().find(|place| place.start.scan == scan) {
                let place = place.clone();
                return self.read(&log, &place);
            }
        }
        Ok(None)
    }

    /// A scan without its readings, and its log; `None` if the newest logs have no such scan.
    ///
    /// # Errors
    /// When the folder or a log in it can't be read.
    pub fn outline(&mut self, scan: Uuid) -> io::Result<Option<(ScanView, PathBuf)>> {
        for log in self.recent()? {
            let path = self.folder.join(&log);
            let places = &self.read_on(&log)?.scans;
            if let Some(place) = places.iter().rev().find(|place| place.start.scan == scan) {
                let mut records = read_session(&mut BufReader::new(File::open(&path)?), place)?;
                records.push(Record::ScanStart(place.start.clone()));
                return Ok(ScanView::from_records(records).pop().map(|view| (view, path)));
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

    fn read(&self, log: &str, place: &Place) -> io::Result<Option<ScanView>> {
        let mut file = BufReader::new(File::open(self.folder.join(log))?);
        let mut records = read_session(&mut file, place)?;
        file.seek(SeekFrom::Start(place.from))?;
        for line in read_log(file.take(place.to - place.from)) {
            records.extend(line?.record);
        }
        let views = ScanView::from_records(records);
        Ok(views.into_iter().find(|view| view.scan == place.start.scan))
    }
}

/// The session of a scan, after the one before it that has the text of its scene.
fn read_session(file: &mut BufReader<File>, place: &Place) -> io::Result<Vec<Record>> {
    let places =
        place.session.iter().flat_map(|session| session.text_at.into_iter().chain([session.at]));
    let mut records = Vec::new();
    for at in places {
        file.seek(SeekFrom::Start(at))?;
        records
            .extend(read_log(file.by_ref()).next().transpose()?.and_then(|line| line.record.ok()));
    }
    Ok(records)
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
                self.session = Some(SessionPlace { at, text_at, provenance, scene });
            }
            Some(Ok(Record::ScanStart(start))) => {
                let session = self.session.clone();
                self.scans.push(Place { from: at, to: self.read_to, session, start, end: None });
            }
            Some(Ok(Record::ScanEnd(end))) => {
                let of = self.scans.iter_mut().rev().find(|place| place.start.scan == end.scan);
                if let Some(place) = of {
                    (place.to, place.end) = (self.read_to, Some(end));
                }
            }
            // Damaged lines are `sonard log verify`'s business.
            _ => {
                if let Some(place) = self.scans.last_mut().filter(|place| place.end.is_none()) {
                    place.to = self.read_to;
                }
            }
        }
    }
}

impl Place {
    fn summary(&self, log: &str) -> PastScan {
        PastScan {
            log: log.to_owned(),
            start: self.start.clone(),
            end: self.end.clone(),
            provenance: self.session.as_ref().map(|session| session.provenance),
            scene: self.session.as_ref().and_then(|session| session.scene.clone()),
        }
    }
}
