//! Progress of a collection on the terminal.

use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use super::{report, terminal::Terminal};
use crate::{
    collect::{CollectError, CollectionFolder, CollectionHistory, Observer},
    scan::text::format_count,
};

/// Terminal of a collection: a bar over all beams, messages above it, and questions.
pub(super) struct TerminalObserver {
    bar: ProgressBar,
    terminal: Terminal,
    beams_per_scan: u32,
}

impl TerminalObserver {
    pub(super) fn new(beams_per_scan: u32) -> Self {
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} beams");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        Self { bar, terminal: Terminal::default(), beams_per_scan }
    }
}

impl Observer for TerminalObserver {
    fn scan_started(&self, doing: &str, done: u32, of: u32, left_s: f64) {
        if self.bar.is_finished() {
            self.bar.reset();
        }
        self.bar.set_length(u64::from(of) * u64::from(self.beams_per_scan));
        self.bar.set_position(u64::from(done) * u64::from(self.beams_per_scan));
        self.bar.set_message(format!("{doing}, {} left,", human_duration(left_s)));
    }

    fn beam_recorded(&self) {
        self.bar.inc(1);
    }

    /// Prints a line above the bar.
    fn message(&self, line: &str) {
        self.bar.suspend(|| notice!("{line}"));
    }

    fn scans_planned(&self, scans: u32, left_s: f64) {
        notice!("{} to take, about {}", format_count(scans, "scan"), human_duration(left_s));
    }

    /// Removes the bar until the next scan begins: an earlier redraw would cover a question.
    fn measuring_paused(&self) {
        self.bar.finish_and_clear();
    }

    async fn prompt(&mut self, question: &str) -> Option<String> {
        self.terminal.prompt(question).await
    }

    fn write_report(
        &self,
        folder: &CollectionFolder,
        history: &CollectionHistory,
    ) -> Result<(), CollectError> {
        report::write(folder, history)
    }
}

pub(super) fn human_duration(seconds: f64) -> HumanDuration {
    HumanDuration(Duration::from_secs_f64(seconds.clamp(0.0, 1e9)))
}
