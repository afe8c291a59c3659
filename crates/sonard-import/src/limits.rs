//! Ranges of LaserScan and Range messages, by REP 117, the messages' definitions and the limits beside them.

use sonard_model::reading::PingStatus;

use crate::Mapping;

/// The least and the greatest range that a message states, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    pub(crate) least: f64,
    pub(crate) most: f64,
}

/// Meaning of a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Told {
    /// No reading: REP 117's NaN.
    Nothing,
    Without(PingStatus),
    /// A range in the message's unit.
    Echo(f64),
}

/// Counts of the assumptions about limits and ranges of a file.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LimitNotes {
    pub(crate) readings: u64,
    zeros: u64,
    without_limits: u64,
    fixed_distance: u64,
    fixed_m: f64,
    beyond_most: u64,
    most: f64,
}

impl Limits {
    /// Reads a range by what the mapping and the limits say.
    pub(crate) fn tell(self, range: f64, mapping: &Mapping, notes: &mut LimitNotes) -> Told {
        notes.readings += 1;
        if range.is_nan() {
            return Told::Nothing;
        }
        if range.is_finite() && mapping.is_no_echo(range) {
            return Told::Without(PingStatus::NoEcho);
        }
        // REP 117 has -inf for what is too near; drivers write 0 where nothing came back.
        if range.is_finite() && range <= 0.0 {
            notes.zeros += 1;
            return Told::Without(PingStatus::NoEcho);
        }
        let has_limits = self.most > 0.0 && self.most >= self.least && !self.least.is_nan();
        if !has_limits {
            notes.without_limits += 1;
            return match range {
                f64::INFINITY => Told::Without(PingStatus::NoEcho),
                f64::NEG_INFINITY => Told::Without(PingStatus::MinRange),
                range => Told::Echo(range),
            };
        }
        // sensor_msgs/Range: such a ranger tells -inf for something nearer than its distance, +inf for nothing.
        if self.least == self.most {
            notes.fixed_distance += 1;
            notes.fixed_m = self.most;
            let is_near = range < self.most || (range.is_finite() && range <= self.most);
            return Told::Without(if is_near { PingStatus::MinRange } else { PingStatus::NoEcho });
        }
        if range == f64::NEG_INFINITY || range <= self.least.max(0.0) {
            Told::Without(PingStatus::MinRange)
        } else if range == f64::INFINITY {
            Told::Without(PingStatus::NoEcho)
        } else if range >= self.most {
            if range > self.most {
                notes.beyond_most += 1;
                notes.most = self.most;
            }
            Told::Without(PingStatus::NoEcho)
        } else {
            Told::Echo(range)
        }
    }
}

impl LimitNotes {
    /// A line for each assumption.
    pub(crate) fn lines(&self) -> Vec<String> {
        let of = self.readings;
        let mut lines = Vec::new();
        if self.zeros > 0 {
            lines.push(format!(
                "{} of {of} ranges are 0 or less, which REP 117 has no meaning for: taken as no echo, as by --no-echo 0",
                self.zeros
            ));
        }
        if self.without_limits > 0 {
            lines.push(format!(
                "{} of {of} ranges come without limits (max_range is 0 or below min_range): taken without any",
                self.without_limits
            ));
        }
        if self.fixed_distance > 0 {
            lines.push(format!(
                "{} of {of} readings are of a fixed-distance ranger (min_range = max_range = {}): they detect only whether \
                 something is nearer",
                self.fixed_distance, self.fixed_m
            ));
        }
        if self.beyond_most > 0 {
            lines.push(format!(
                "{} of {of} ranges are beyond max_range = {}: taken as no echo",
                self.beyond_most, self.most
            ));
        }
        lines
    }

    /// Checks whether all ranges are finite and beyond the greatest, which a wrong unit makes them.
    pub(crate) const fn are_all_beyond(&self) -> bool {
        self.readings > 0 && self.beyond_most == self.readings
    }

    pub(crate) const fn most(&self) -> f64 {
        self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tell(least: f64, most: f64, range: f64) -> Told {
        Limits { least, most }.tell(range, &Mapping::default(), &mut LimitNotes::default())
    }

    #[test]
    fn ranges_mean_what_rep_117_and_their_definition_say() {
        use Told::{Echo, Nothing, Without};
        let (near, none) = (Without(PingStatus::MinRange), Without(PingStatus::NoEcho));
        for (least, most, range, told) in [
            (0.02, 4.0, f64::NEG_INFINITY, near),
            (0.02, 4.0, f64::INFINITY, none),
            (0.02, 4.0, 1.0, Echo(1.0)),
            (0.02, 4.0, 0.01, near),
            (0.02, 4.0, 4.0, none),
            (0.02, 4.0, 5.0, none),
            (0.02, 4.0, 0.0, none),
            // Limits that make no sense limit nothing.
            (0.0, 0.0, 1.0, Echo(1.0)),
            (4.0, 0.02, 1.0, Echo(1.0)),
            (0.1, f64::NAN, 1.0, Echo(1.0)),
            // A ranger of one distance.
            (0.5, 0.5, f64::NEG_INFINITY, near),
            (0.5, 0.5, f64::INFINITY, none),
            (0.5, 0.5, 0.5, near),
        ] {
            assert_eq!(tell(least, most, range), told, "{least} {most} {range}");
        }
        assert!(matches!(tell(0.02, 4.0, f64::NAN), Nothing));
    }
}
