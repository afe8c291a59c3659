//! How far a collection is, and how long it still takes.

use indicatif::{ProgressBar, ProgressStyle};

use super::preview::human;

/// A bar over all beams, with the time left by the estimate, corrected by what was measured.
pub(super) struct Bar {
    bar: ProgressBar,
    /// Estimated and measured time of the scans of this run, seconds.
    estimated_s: f64,
    measured_s: f64,
    /// Estimate for one scan, and the pause after it, seconds.
    scan_s: f64,
    pause_s: f64,
    beams_a_scan: u32,
}

impl Bar {
    pub(super) fn new(scan_s: f64, pause_s: f64, beams_a_scan: u32) -> Self {
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} beams");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        Self { bar, estimated_s: 0.0, measured_s: 0.0, scan_s, pause_s, beams_a_scan }
    }

    /// A scan begins: so many are done, of so many.
    pub(super) fn begin(&mut self, doing: &str, done: u32, of: u32) {
        if self.bar.is_finished() {
            self.bar.reset();
        }
        self.bar.set_length(u64::from(of) * u64::from(self.beams_a_scan));
        self.bar.set_position(u64::from(done) * u64::from(self.beams_a_scan));
        let left = human(self.left_s(of.saturating_sub(done)));
        self.bar.set_message(format!("{doing}, {left} left,"));
    }

    pub(super) fn beam(&self) {
        self.bar.inc(1);
    }

    /// A scan took so long.
    pub(super) fn learn(&mut self, wall_s: f64) {
        self.estimated_s += self.scan_s;
        self.measured_s += wall_s;
    }

    /// Time that so many scans more take, seconds.
    pub(super) fn left_s(&self, scans: u32) -> f64 {
        let pace = if self.estimated_s > 0.0 { self.measured_s / self.estimated_s } else { 1.0 };
        f64::from(scans) * (self.scan_s * pace + self.pause_s)
    }

    /// Estimated and measured time of the scans of this run, seconds.
    pub(super) const fn times_s(&self) -> (f64, f64) {
        (self.estimated_s, self.measured_s)
    }

    /// Prints a line above the bar.
    pub(super) fn say(&self, line: &str) {
        self.bar.suspend(|| anstream::eprintln!("{line}"));
    }

    /// Takes the bar away, for a question or for good, until the next scan begins: drawn again
    /// earlier, it would be drawn over the question.
    pub(super) fn hide(&self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_what_was_measured() {
        let mut bar = Bar::new(10.0, 2.0, 400);
        assert!((bar.left_s(5) - 60.0).abs() < 1e-9);
        bar.learn(12.0);
        bar.learn(14.0);
        assert!((bar.left_s(5) - 5.0 * (13.0 + 2.0)).abs() < 1e-9);
    }
}
