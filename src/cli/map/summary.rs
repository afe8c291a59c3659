//! Summary of a map as text and JSON.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{Args, Mapped, Switch};
use crate::{interpret::Sweep, scan::text::format_count};

#[derive(Debug, Serialize)]
pub(super) struct Summary<'a> {
    map: PathBuf,
    scans: usize,
    evidence: u8,
    readings: usize,
    feature_prediction: bool,
    mean_confidence: Option<f64>,
    discarded: usize,
    poses_outside: usize,
    resolution_m: f64,
    width: usize,
    height: usize,
    origin_m: [f64; 2],
    occupied_cells: usize,
    free_cells: usize,
    unknown_cells: usize,
    #[serde(skip)]
    out: &'a Path,
}

impl Mapped {
    pub(super) fn summary<'a>(&self, args: &'a Args, taken: &[(uuid::Uuid, Sweep)]) -> Summary<'a> {
        let shape = self.grid.shape();
        let count =
            |selects: fn(f64) -> bool| self.grid.probabilities().filter(|p| selects(*p)).count();
        let predicted = args.feature_prediction == Switch::On && self.readings > 0;
        Summary {
            map: args.out.join("map.yaml"),
            scans: taken.len(),
            evidence: args.mapping().evidence(taken.len()),
            readings: self.readings,
            feature_prediction: args.feature_prediction == Switch::On,
            mean_confidence: predicted.then(|| self.confidence / self.readings as f64),
            discarded: self.discarded,
            poses_outside: self.poses_outside,
            resolution_m: shape.resolution_m,
            width: shape.width,
            height: shape.height,
            origin_m: shape.origin.into(),
            occupied_cells: count(|p| p > 0.65),
            free_cells: count(|p| p < 0.196),
            unknown_cells: count(|p| (0.196..=0.65).contains(&p)),
            out: &args.out,
        }
    }
}

impl Summary<'_> {
    /// Describes the map in the line below the picture's title.
    pub(super) fn describe_cells(&self) -> String {
        format!(
            "{}, {} \u{b7} {}x{} cells of {} m: {} occupied, {} free, {} undecided",
            format_count(self.scans, "scan"),
            format_count(self.readings, "reading"),
            self.width,
            self.height,
            self.resolution_m,
            self.occupied_cells,
            self.free_cells,
            self.unknown_cells
        )
    }

    pub(super) fn print(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(
            out,
            "{}, {} -> {}x{} cells of {} m in {}: {} occupied, {} free, {} undecided",
            format_count(self.scans, "scan"),
            format_count(self.readings, "reading"),
            self.width,
            self.height,
            self.resolution_m,
            self.out.display(),
            self.occupied_cells,
            self.free_cells,
            self.unknown_cells
        )?;
        if let Some(confidence) = self.mean_confidence {
            let discarded = format_count(self.discarded, "reading");
            writeln!(out, "mean confidence {confidence:.3}, {discarded} discarded")?;
        }
        if self.evidence > 1 {
            writeln!(out, "scan weight {} (--scan-weight)", self.evidence)?;
        }
        if self.poses_outside > 0 {
            writeln!(
                out,
                "{} outside the map: enlarge --region, or omit it",
                format_count(self.poses_outside, "pose")
            )?;
        }
        Ok(())
    }
}
