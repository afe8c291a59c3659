//! Where a scan's records, bar and pictures go.

mod earlier;

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
use earlier::Earlier;

const PICTURE_WIDTH_PX: u32 = 1600;

/// The log, the progress bar, and the last scan's records for the picture and the summary.
pub(super) struct Output {
    log: Option<LogWriter>,
    folder: Option<PathBuf>,
    /// What was in the folder's log before, until the first scan.
    earlier: Option<Earlier>,
    bar: ProgressBar,
    records: Vec<Record>,
}

impl Output {
    /// Opens `scan.jsonl` in `folder` (made if it isn't there), or standard output.
    pub(super) fn open(folder: Option<&Path>) -> Result<Self, Failure> {
        let (log, earlier) = match folder {
            Some(folder) => open_log(folder)?,
            None => (LogWriter::stdout(), None),
        };
        Ok(Self {
            log: Some(log),
            folder: folder.map(Path::to_path_buf),
            earlier,
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

    /// Makes sure that what is to be added to the folder's log was taken like what is in it, and says
    /// what it is added to. Asked with the session and the beginning of the first scan, before either is
    /// written.
    pub(super) fn add_to_earlier(
        &mut self,
        session: &Session,
        pose: Pose,
        plan: ScanPlan,
    ) -> Outcome {
        let Some(earlier) = self.earlier.take() else { return Ok(()) };
        earlier.agree(session, pose, plan)
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
        // Only the last scan is drawn: a thousand repeats must not fill the memory.
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

fn open_log(folder: &Path) -> Result<(LogWriter, Option<Earlier>), Failure> {
    make_folder(folder)?;
    for (name, product) in [(SVG, Product::Svg), (PNG, Product::Png)] {
        Overwrite::default().check(&folder.join(name), product)?;
    }
    let path = folder.join(LOG);
    let earlier = Earlier::of(&path)?;
    let log = LogWriter::open(&path)?;
    Ok((log.with_scenes_beside(), earlier))
}
