//! An angular index: echoes in bins by the direction in which they are heard best, so that an azimuth asks
//! those near it alone.

use std::f64::consts::{PI, TAU};

use super::{echo::Echo, pattern::PatternEnvelope};
use crate::geometry::{turn_rad, wrap_pi};

/// Directions are sorted into this many bins.
const BINS: usize = 360;

/// Echoes by the direction in which they are heard best.
#[derive(Debug, Default)]
pub(crate) struct DirectionIndex {
    /// Bin by bin.
    entries: Vec<Entry>,
    /// Index at which each bin begins in `entries`, and the end of the last.
    bins: Vec<u32>,
    /// The widest reach of its entries.
    reach_rad: f64,
}

/// An echo as an azimuth needs it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    /// Half way between departure and arrival.
    pub(crate) middle_rad: f64,
    /// Departure is this far on one side of the middle, arrival on the other.
    pub(crate) half_rad: f64,
    pub(crate) amplitude: f64,
    /// Farther off the middle it is too weak.
    pub(crate) reach_rad: f64,
    pub(crate) echo: u32,
}

impl Entry {
    /// `None` if it is too weak in all directions.
    ///
    /// `y` off the middle, the axis is `|y| + h` off one end and at least `||y| - h|` off the
    /// other. The pattern's product reaches a level only if its smaller factor does, and its
    /// larger one reaches the root of it.
    pub(crate) fn of(
        echo: &Echo,
        index: u32,
        envelope: &PatternEnvelope,
        floor: f64,
    ) -> Option<Self> {
        let half_rad = 0.5 * turn_rad(echo.departure, echo.arrival);
        let level = floor / echo.amplitude;
        let wide = envelope.reach_rad(level) - half_rad.abs();
        if wide < 0.0 {
            return None;
        }
        let reach_rad = wide.min(envelope.reach_rad(level.sqrt()) + half_rad.abs());
        let middle_rad = wrap_pi(echo.departure.to_angle() + half_rad);
        Some(Self { middle_rad, half_rad, amplitude: echo.amplitude, reach_rad, echo: index })
    }
}

impl DirectionIndex {
    /// Sorts by counting.
    pub(crate) fn new(entries: &[Entry]) -> Self {
        let mut bins = vec![0_u32; BINS + 1];
        for entry in entries {
            bins[bin(entry.middle_rad) + 1] += 1;
        }
        for i in 0..BINS {
            bins[i + 1] += bins[i];
        }
        let mut next = bins.clone();
        let mut sorted = entries.to_vec();
        for entry in entries {
            let free = &mut next[bin(entry.middle_rad)];
            sorted[*free as usize] = *entry;
            *free += 1;
        }
        let reach_rad = entries.iter().map(|entry| entry.reach_rad).fold(0.0, f64::max);
        Self { entries: sorted, bins, reach_rad }
    }

    /// Tells the entries within their reach of a direction in (-pi, pi], and how far off each is.
    pub(crate) fn near<'a>(&'a self, direction_rad: f64, mut tell: impl FnMut(&'a Entry, f64)) {
        if self.entries.is_empty() {
            return;
        }
        let mut part = |from: i64, to: i64| {
            let at = |bin: i64| self.bins[bin.clamp(0, BINS as i64) as usize] as usize;
            for entry in &self.entries[at(from)..at(to).max(at(from))] {
                let off_rad = wrap_once(direction_rad - entry.middle_rad);
                if off_rad.abs() <= entry.reach_rad {
                    tell(entry, off_rad);
                }
            }
        };
        let bins = BINS as i64;
        let middle = bin(direction_rad) as i64;
        let reach = (self.reach_rad / TAU * BINS as f64).ceil() as i64;
        if 2 * reach + 1 >= bins {
            return part(0, bins);
        }
        let (from, to) = (middle - reach, middle + reach + 1);
        part(from, to);
        // What leaves the circle on one side comes in on the other.
        part(from + bins, bins);
        part(0, to - bins);
    }
}

/// The bin of an angle in (-pi, pi].
fn bin(angle_rad: f64) -> usize {
    (((angle_rad + PI) / TAU * BINS as f64) as usize).min(BINS - 1)
}

/// The difference of two angles in (-pi, pi], brought into that range.
pub(crate) fn wrap_once(angle_rad: f64) -> f64 {
    if angle_rad > PI {
        angle_rad - TAU
    } else if angle_rad < -PI {
        angle_rad + TAU
    } else {
        angle_rad
    }
}
