//! Angular index: echoes in bins by the azimuth of their maximum amplitude, so that a beam
//! direction visits only echoes nearby.

use std::f64::consts::{PI, TAU};

use super::{echo::PathEcho, pattern::PatternEnvelope};
use crate::geometry::{signed_angle_rad, wrap_pi};

/// Number of direction bins.
const BINS: usize = 360;

/// Echoes by the azimuth of their maximum amplitude.
#[derive(Debug, Default)]
pub(crate) struct DirectionIndex {
    /// Entries, sorted by bin.
    entries: Vec<DirectionEntry>,
    /// Index in `entries` where each bin begins, and the end of the last.
    bins: Vec<u32>,
    /// Largest reach of the entries, in bins.
    reach: i64,
}

/// Directional data of an echo.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DirectionEntry {
    /// Direction half way between departure and arrival.
    pub(crate) middle_rad: f64,
    /// Offset of the departure to one side of the middle and of the arrival to the other.
    pub(crate) half_rad: f64,
    pub(crate) amplitude: f64,
    /// Offset from the middle beyond which the echo is too weak.
    pub(crate) reach_rad: f64,
    pub(crate) echo: u32,
}

impl DirectionEntry {
    /// Creates an entry; `None` if the echo is too weak in all directions.
    ///
    /// At `y` off the middle, the axis is `|y| + h` off one end and at least `||y| - h|` off the
    /// other. The pattern's product reaches a level only if its smaller factor does and its larger
    /// one reaches the root of that level.
    pub(crate) fn new(
        echo: &PathEcho,
        index: u32,
        envelope: &PatternEnvelope,
        floor: f64,
    ) -> Option<Self> {
        let half_rad = 0.5 * signed_angle_rad(echo.departure, echo.arrival);
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
    /// Creates the index by a counting sort.
    pub(crate) fn new(entries: &[DirectionEntry]) -> Self {
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
        Self { entries: sorted, bins, reach: (reach_rad / TAU * BINS as f64).ceil() as i64 }
    }

    /// Visits the entries of echoes numbered below `end` within their reach of a direction in (-pi,
    /// pi], together with the offset of each.
    pub(crate) fn near<'a>(
        &'a self,
        direction_rad: f64,
        end: u32,
        mut visit: impl FnMut(&'a DirectionEntry, f64),
    ) {
        if self.entries.is_empty() {
            return;
        }
        let mut part = |from: i64, to: i64| {
            let at = |bin: i64| self.bins[bin.clamp(0, BINS as i64) as usize] as usize;
            for entry in &self.entries[at(from)..at(to).max(at(from))] {
                let off_rad = wrap_once(direction_rad - entry.middle_rad);
                if off_rad.abs() <= entry.reach_rad && entry.echo < end {
                    visit(entry, off_rad);
                }
            }
        };
        let bins = BINS as i64;
        let middle = bin(direction_rad) as i64;
        let reach = self.reach;
        if 2 * reach + 1 >= bins {
            return part(0, bins);
        }
        let (from, to) = (middle - reach, middle + reach + 1);
        part(from, to);
        // Wraps around the circle.
        if from < 0 {
            part(from + bins, bins);
        }
        if to > bins {
            part(0, to - bins);
        }
    }
}

/// Bin of an angle in (-pi, pi].
fn bin(angle_rad: f64) -> usize {
    (((angle_rad + PI) / TAU * BINS as f64) as usize).min(BINS - 1)
}

/// Wraps the difference of two angles in (-pi, pi] into that range.
pub(crate) fn wrap_once(angle_rad: f64) -> f64 {
    if angle_rad > PI {
        angle_rad - TAU
    } else if angle_rad < -PI {
        angle_rad + TAU
    } else {
        angle_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        acoustics::{BeamPattern, Sensor},
        geometry::DVec2,
        model::paths::echo::Via,
    };

    #[test]
    fn angles_wrap_once() {
        let quarter = PI / 2.0;
        for (angle_rad, expected_rad) in
            [(3.0 * quarter, -quarter), (-3.0 * quarter, quarter), (1.0, 1.0), (-3.0, -3.0)]
        {
            assert!((wrap_once(angle_rad) - expected_rad).abs() < 1e-15, "{angle_rad}");
        }
        assert_eq!((wrap_once(PI), wrap_once(-PI)), (PI, -PI));
    }

    /// For any departure and arrival, each direction in which the pattern leaves the echo above the
    /// floor is within the reach, and the index visits it there.
    #[test]
    fn reach_covers_detectable_echoes() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let beam = BeamPattern::new(&sensor, 343.0);
        let envelope = PatternEnvelope::new(&beam);
        let floor = 0.001;
        let mut detectable = 0;
        for (apart_deg, amplitude) in
            [(0.0, 0.9), (10.0, 0.9), (25.0, 0.5), (-40.0, 0.9), (70.0, 1.0), (5.0, 0.0011)]
        {
            for middle_deg in [0.0_f64, 100.0, 179.0, -178.0] {
                let [departure_rad, arrival_rad] =
                    [-0.5, 0.5].map(|half| (middle_deg + half * apart_deg).to_radians());
                let echo = PathEcho {
                    length_m: 2.0,
                    amplitude,
                    phase_rad: 0.0,
                    departure: DVec2::from_angle(departure_rad),
                    arrival: DVec2::from_angle(arrival_rad),
                    rise_rad: [0.0; 2],
                    image: 0,
                    slopes: [0; 2],
                    is_repeated: false,
                    via: Via::Walls { node: 0 },
                };
                let entry = DirectionEntry::new(&echo, 7, &envelope, floor);
                let index = DirectionIndex::new(entry.as_slice());
                for at in -1800..1800 {
                    let direction_rad = (f64::from(at) * 0.1).to_radians();
                    let one_way = |end: f64| beam.one_way(wrap_pi(end - direction_rad));
                    if amplitude * one_way(departure_rad) * one_way(arrival_rad) >= floor {
                        detectable += 1;
                        let mut visits = 0;
                        index.near(direction_rad, u32::MAX, |entry, off_rad| {
                            visits += 1;
                            let off = wrap_pi(direction_rad - middle_deg.to_radians());
                            assert!(entry.echo == 7 && (off_rad - off).abs() < 1e-9);
                        });
                        assert_eq!(visits, 1, "{apart_deg} {amplitude} {middle_deg} at {at}");
                    }
                }
            }
        }
        assert!(detectable > 5000, "{detectable}");
        // The bound is useful: far off the axis nothing is visited.
        let narrow = DirectionIndex::new(&[]);
        narrow.near(0.0, u32::MAX, |_, _| panic!("nothing is there"));
    }
}
