//! Outputs of a scan: log, progress bar and pictures.

mod existing;

use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};

use crate::{
    cli::{
        Failure, Outcome,
        output::{Overwrite, Product, make_folder},
    },
    geometry::Pose,
    plot,
    scan::{Record, ScanPlan, ScanView, Session, Sink, SinkError},
    scene::Scene,
    store::LogWriter,
};
use existing::ExistingLog;

const PICTURE_WIDTH_PX: u32 = 1600;

/// Log, progress bar, and the last scan's records for picture and summary.
pub(super) struct Output {
    log: Option<LogWriter>,
    folder: Option<PathBuf>,
    /// Previous contents of the folder's log, until the first scan.
    existing: Option<ExistingLog>,
    bar: ProgressBar,
    records: Vec<Record>,
}

impl Output {
    /// Opens `scan.jsonl` in `folder` (created if missing), or standard output.
    pub(super) fn open(folder: Option<&Path>) -> Result<Self, Failure> {
        let (log, existing) = match folder {
            Some(folder) => open_log(folder)?,
            None => (LogWriter::stdout(), None),
        };
        Ok(Self {
            log: Some(log),
            folder: folder.map(Path::to_path_buf),
            existing,
            bar: ProgressBar::hidden(),
            records: Vec::new(),
        })
    }

    pub(super) fn begin_scan(&mut self, number: u32, count: u32, beams: u32) {
        self.bar = ProgressBar::new(beams.into());
        if let Ok(style) = ProgressStyle::with_template(
            "{msg} {wide_bar} {pos}/{len} beams, {per_sec}, {eta} left",
        ) {
            self.bar.set_style(style);
        }
        let message = if count > 1 { format!("scan {number} of {count}") } else { "scan".into() };
        self.bar.set_message(message);
    }

    pub(super) fn end_scan(&mut self) {
        self.bar.finish_and_clear();
    }

    /// Returns the last scan.
    pub(super) fn views(&self) -> Vec<ScanView> {
        ScanView::from_records(self.records.iter().cloned())
    }

    pub(super) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Checks that the new scans have the same setup as those in the folder's log, and reports what
    /// they are appended to. Must be called before session and first scan start are written.
    pub(super) fn check_same_setup(
        &mut self,
        session: &Session,
        pose: Pose,
        plan: ScanPlan,
    ) -> Outcome {
        let Some(existing) = self.existing.take() else { return Ok(()) };
        existing.check_same_setup(session, pose, plan)
    }

    /// Writes a record outside a scan.
    pub(super) fn record(&mut self, record: &Record) -> Outcome {
        Ok(Sink::record(self, record)?)
    }

    /// Closes the log and draws the pictures.
    pub(super) fn close(mut self, scene: &Scene) -> Outcome {
        if let Some(log) = self.log.take() {
            log.close()
                .or_else(|error| if error.is_broken_pipe() { Ok(()) } else { Err(error) })?;
        }
        let Some(folder) = &self.folder else { return Ok(()) };
        let views = self.views();
        let Some(view) = views.last().filter(|view| !view.pings.is_empty()) else { return Ok(()) };
        let picture = plot::draw_scan(view, Some(scene));
        let png = picture.to_png(PICTURE_WIDTH_PX).map_err(|error| {
            Failure::device(format!("cannot draw the scan: {error}"), "the log is complete")
        })?;
        let overwrite = Overwrite::default();
        overwrite.save(&folder.join(SVG), Product::Svg, picture.to_svg().as_bytes())?;
        overwrite.save(&folder.join(PNG), Product::Png, &png)
    }
}

impl Sink for Output {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        if let Some(log) = &mut self.log {
            log.append(record)?;
            if matches!(record, Record::ScanEnd(_)) {
                log.sync()?;
            }
        }
        if matches!(record, Record::Ping(_)) {
            self.bar.inc(1);
        }
        // Only the last scan is drawn: the records of many repeats would fill the memory.
        if matches!(record, Record::ScanStart(_)) {
            self.records.retain(|record| matches!(record, Record::Session(_)));
        }
        self.records.push(record.clone());
        Ok(())
    }
}

const LOG: &str = "scan.jsonl";
const SVG: &str = "scan.svg";
const PNG: &str = "scan.png";

fn open_log(folder: &Path) -> Result<(LogWriter, Option<ExistingLog>), Failure> {
    make_folder(folder)?;
    for (name, product) in [(SVG, Product::Svg), (PNG, Product::Png)] {
        Overwrite::default().check(&folder.join(name), product)?;
    }
    let path = folder.join(LOG);
    let existing = ExistingLog::read(&path)?;
    let log = LogWriter::open(&path)?;
    Ok((log.with_scene_folder(), existing))
}
