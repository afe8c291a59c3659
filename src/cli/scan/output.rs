//! Where a scan's records, bar and pictures go.

use std::{
    fs,
    path::{Path, PathBuf},
};

use indicatif::{ProgressBar, ProgressStyle};

use crate::{
    cli::{Failure, Outcome},
    plot,
    ranger::Sink,
    scan::{Record, ScanView},
    scene::Scene,
    store::{LogWriter, StoreError},
};

const PICTURE_WIDTH_PX: u32 = 1600;

/// The log, the progress bar, and the last scan's records for the picture and the summary.
pub(super) struct Output {
    log: Option<LogWriter>,
    folder: Option<PathBuf>,
    bar: ProgressBar,
    records: Vec<Record>,
}

impl Output {
    /// Opens `scan.jsonl` in `folder` (made if it isn't there), or standard output.
    pub(super) fn open(folder: Option<&Path>) -> Result<Self, Failure> {
        let log = match folder {
            Some(folder) => open_log(folder)?,
            None => LogWriter::stdout(),
        };
        Ok(Self {
            log: Some(log),
            folder: folder.map(Path::to_path_buf),
            bar: ProgressBar::hidden(),
            records: Vec::new(),
        })
    }

    pub(super) fn begin_scan(&mut self, turn: u32, turns: u32, beams: u32) {
        self.bar = ProgressBar::new(beams.into());
        if let Ok(style) = ProgressStyle::with_template(
            "{msg} {wide_bar} {pos}/{len} beams, {per_sec}, {eta} left",
        ) {
            self.bar.set_style(style);
        }
        let message = if turns > 1 { format!("scan {turn} of {turns}") } else { "scan".into() };
        self.bar.set_message(message);
    }

    pub(super) fn end_scan(&mut self) {
        self.bar.finish_and_clear();
    }

    /// The last scan.
    pub(super) fn views(&self) -> Vec<ScanView> {
        ScanView::from_records(self.records.iter().cloned())
    }

    pub(super) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Writes a record outside a scan.
    pub(super) fn record(&mut self, record: &Record) -> Outcome {
        Sink::record(self, record).map_err(|error| Failure::device(&error, error.help()))
    }

    /// Closes the log and draws the pictures.
    pub(super) fn close(mut self, scene: &Scene) -> Outcome {
        if let Some(log) = self.log.take() {
            log.close()
                .or_else(|error| if error.is_broken_pipe() { Ok(()) } else { Err(error) })
                .map_err(|error| Failure::device(&error, error.help()))?;
        }
        let Some(folder) = &self.folder else { return Ok(()) };
        let views = self.views();
        let Some(view) = views.last().filter(|view| !view.pings.is_empty()) else { return Ok(()) };
        let picture = plot::draw_scan(view, Some(scene));
        let png = picture.to_png(PICTURE_WIDTH_PX).map_err(|error| {
            Failure::device(format!("cannot draw the scan: {error}"), "the log is complete")
        })?;
        write(&folder.join("scan.svg"), picture.to_svg().as_bytes())?;
        write(&folder.join("scan.png"), &png)
    }
}

impl Sink for Output {
    fn record(&mut self, record: &Record) -> Result<(), StoreError> {
        if let Some(log) = &mut self.log {
            log.append(record)?;
            if matches!(record, Record::ScanEnd(_)) {
                log.sync()?;
            }
        }
        if matches!(record, Record::Ping(_)) {
            self.bar.inc(1);
        }
        // Only the last scan is drawn: a thousand repeats must not fill the memory.
        if matches!(record, Record::ScanStart(_)) {
            self.records.retain(|record| matches!(record, Record::Session(_)));
        }
        self.records.push(record.clone());
        Ok(())
    }
}

fn open_log(folder: &Path) -> Result<LogWriter, Failure> {
    fs::create_dir_all(folder).map_err(|error| {
        Failure::input(
            format!("cannot make the folder {}: {error}", folder.display()),
            "give --out a folder that you may write to",
        )
    })?;
    LogWriter::open(&folder.join("scan.jsonl"))
        .map_err(|error| Failure::input(&error, error.help()))
}

fn write(path: &Path, bytes: &[u8]) -> Outcome {
    fs::write(path, bytes).map_err(|error| {
        Failure::device(
            format!("cannot write {}: {error}", path.display()),
            "the log is complete; draw it again with `sonard plot`",
        )
    })
}
