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
    /// The widest reach of its entries, in bins.
    reach: i64,
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
        Self { entries: sorted, bins, reach: (reach_rad / TAU * BINS as f64).ceil() as i64 }
    }

    /// Tells the entries within their reach of a direction in (-pi, pi], and how far off each is, of echoes numbered
    /// below `end`.
    pub(crate) fn near<'a>(
        &'a self,
        direction_rad: f64,
        end: u32,
        mut tell: impl FnMut(&'a Entry, f64),
    ) {
        if self.entries.is_empty() {
            return;
        }
        let mut part = |from: i64, to: i64| {
            let at = |bin: i64| self.bins[bin.clamp(0, BINS as i64) as usize] as usize;
            for entry in &self.entries[at(from)..at(to).max(at(from))] {
                let off_rad = wrap_once(direction_rad - entry.middle_rad);
                if off_rad.abs() <= entry.reach_rad && entry.echo < end {
                    tell(entry, off_rad);
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
        // What leaves the circle on one side comes in on the other.
        if from < 0 {
            part(from + bins, bins);
        }
        if to > bins {
            part(0, to - bins);
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        acoustics::{BeamPattern, Sensor},
        geometry::DVec2,
        model::paths::echo::Via,
    };

    #[test]
    fn angles_are_brought_back_by_one_turn() {
        let quarter = PI / 2.0;
        for (angle_rad, expected_rad) in
            [(3.0 * quarter, -quarter), (-3.0 * quarter, quarter), (1.0, 1.0), (-3.0, -3.0)]
        {
            assert!((wrap_once(angle_rad) - expected_rad).abs() < 1e-15, "{angle_rad}");
        }
        assert_eq!((wrap_once(PI), wrap_once(-PI)), (PI, -PI));
    }

    /// Whatever leaves and arrives where: each direction in which the pattern leaves it above the floor is
    /// within the reach, and the index tells it there.
    #[test]
    fn nothing_that_is_heard_is_out_of_reach() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let beam = BeamPattern::new(&sensor, 343.0);
        let envelope = PatternEnvelope::of(&beam);
        let floor = 0.001;
        let mut heard = 0;
        for (apart_deg, amplitude) in
            [(0.0, 0.9), (10.0, 0.9), (25.0, 0.5), (-40.0, 0.9), (70.0, 1.0), (5.0, 0.0011)]
        {
            for middle_deg in [0.0_f64, 100.0, 179.0, -178.0] {
                let [departure_rad, arrival_rad] =
                    [-0.5, 0.5].map(|half| (middle_deg + half * apart_deg).to_radians());
                let echo = Echo {
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
                let entry = Entry::of(&echo, 7, &envelope, floor);
                let index = DirectionIndex::new(entry.as_slice());
                for at in -1800..1800 {
                    let direction_rad = (f64::from(at) * 0.1).to_radians();
                    let one_way = |end: f64| beam.one_way(wrap_pi(end - direction_rad));
                    if amplitude * one_way(departure_rad) * one_way(arrival_rad) >= floor {
                        heard += 1;
                        let mut told = 0;
                        index.near(direction_rad, u32::MAX, |entry, off_rad| {
                            told += 1;
                            let off = wrap_pi(direction_rad - middle_deg.to_radians());
                            assert!(entry.echo == 7 && (off_rad - off).abs() < 1e-9);
                        });
                        assert_eq!(told, 1, "{apart_deg} {amplitude} {middle_deg} at {at}");
                    }
                }
            }
        }
        assert!(heard > 5000, "{heard}");
        // And it is a bound that bounds: far off the axis nothing is told.
        let narrow = DirectionIndex::new(&[]);
        narrow.near(0.0, u32::MAX, |_, _| panic!("nothing is there"));
    }
}
