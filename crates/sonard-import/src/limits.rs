//! Classification of the ranges of LaserScan and Range messages by REP 117, the message definitions
//! and the limits in each message.

use sonard_model::{geometry::wrap_pi, reading::PingStatus};

use crate::Mapping;

/// `range_min` and `range_max` of a message, in the unit of its ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    pub(crate) min: f64,
    pub(crate) max: f64,
}

/// Classified range of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RangeClass {
    /// NaN, which REP 117 defines as an invalid reading.
    Invalid,
    NoRange(PingStatus),
    /// Valid range, in the unit of the message.
    Echo(f64),
}

/// Counts of assumptions that were made about ranges and limits of a file.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LimitNotes {
    pub(crate) readings: u64,
    zeros: u64,
    without_limits: u64,
    fixed_distance: u64,
    fixed_m: f64,
    beyond_max: u64,
    below_min: u64,
    /// Number of finite ranges greater than zero.
    finite: u64,
    /// NaN, and null in JSON.
    invalid: u64,
    nulls: u64,
    max: f64,
    min: f64,
    /// Greatest finite `max_range`, in the unit of the messages.
    max_stated: f64,
    /// Greatest magnitude of an angle, radians.
    max_angle_rad: f64,
    scans: u64,
    /// Number and first of the scans whose `angle_max` contradicts their ranges.
    contradictions: u64,
    first_contradiction: Option<ScanAngles>,
}

/// Angles of a LaserScan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScanAngles {
    pub(crate) first_rad: f64,
    pub(crate) step_rad: f64,
    /// `angle_max`, if the message has it.
    pub(crate) max_rad: Option<f64>,
    pub(crate) beams: usize,
}

impl ScanAngles {
    /// Returns the direction of the last beam, radians.
    fn last_rad(&self) -> f64 {
        self.first_rad + self.beams.saturating_sub(1) as f64 * self.step_rad
    }

    /// Returns `true` if `angle_max` is more than one and a half steps from the last beam. Many
    /// drivers state the end of the last step instead of the last beam.
    fn contradicts_max(&self) -> bool {
        let Some(max_rad) = self.max_rad.filter(|rad| rad.is_finite()) else { return false };
        let last_rad = self.last_rad();
        let off_rad = wrap_pi(max_rad - last_rad).abs();
        last_rad.is_finite()
            && self.beams > 1
            && off_rad > 1.5 * self.step_rad.abs() + ANGLE_ROUNDING_RAD
    }
}

/// Limit of any ultrasonic ranger, metres; a greater `max_range` is in another unit.
pub(crate) const MAX_STATED_M: f64 = 60.0;
/// Greatest plausible angle of a LaserScan, radians: a revolution, with rounding.
const MAX_ANGLE_RAD: f64 = std::f64::consts::TAU + 0.1;
/// Allowance for rounded angles of a LaserScan, radians.
const ANGLE_ROUNDING_RAD: f64 = 2e-3;
/// Number of ranges below which a robot may just be near a wall.
const MIN_NEAR_READINGS: u64 = 4;

impl Limits {
    /// Classifies a range by the mapping and the limits, and counts assumptions in `notes`.
    pub(crate) fn classify(
        self,
        range: f64,
        mapping: &Mapping,
        notes: &mut LimitNotes,
    ) -> RangeClass {
        notes.readings += 1;
        if self.max.is_finite() {
            notes.max_stated = notes.max_stated.max(self.max);
        }
        if range.is_nan() {
            notes.invalid += 1;
            return RangeClass::Invalid;
        }
        if range.is_finite() && mapping.is_no_echo(range) {
            return RangeClass::NoRange(PingStatus::NoEcho);
        }
        // REP 117 uses -inf for objects that are too near; drivers write 0 where no echo was
        // received.
        if range.is_finite() && range <= 0.0 {
            notes.zeros += 1;
            return RangeClass::NoRange(PingStatus::NoEcho);
        }
        notes.finite += u64::from(range.is_finite());
        let has_limits = self.max > 0.0 && self.max >= self.min && !self.min.is_nan();
        if !has_limits {
            notes.without_limits += 1;
            return match range {
                f64::INFINITY => RangeClass::NoRange(PingStatus::NoEcho),
                f64::NEG_INFINITY => RangeClass::NoRange(PingStatus::MinRange),
                range => RangeClass::Echo(range),
            };
        }
        // sensor_msgs/Range: a fixed-distance ranger reports -inf for a detection and +inf for
        // none.
        if self.min == self.max {
            notes.fixed_distance += 1;
            notes.fixed_m = self.max;
            let is_near = range < self.max || (range.is_finite() && range <= self.max);
            return RangeClass::NoRange(if is_near {
                PingStatus::MinRange
            } else {
                PingStatus::NoEcho
            });
        }
        if range == f64::NEG_INFINITY || range <= self.min.max(0.0) {
            if range.is_finite() {
                notes.below_min += 1;
                notes.min = self.min;
            }
            RangeClass::NoRange(PingStatus::MinRange)
        } else if range == f64::INFINITY {
            RangeClass::NoRange(PingStatus::NoEcho)
        } else if range >= self.max {
            if range > self.max {
                notes.beyond_max += 1;
                notes.max = self.max;
            }
            RangeClass::NoRange(PingStatus::NoEcho)
        } else {
            RangeClass::Echo(range)
        }
    }
}

impl LimitNotes {
    /// Returns one line for each assumption.
    pub(crate) fn lines(&self) -> Vec<String> {
        let of = self.readings;
        let mut lines = Vec::new();
        if self.zeros > 0 {
            lines.push(format!(
                "{} of {of} ranges are 0 or less (not defined by REP 117): read as no echo, as with --no-echo 0",
                self.zeros
            ));
        }
        if self.without_limits > 0 {
            lines.push(format!(
                "{} of {of} ranges have no valid limits (max_range is 0 or below min_range): read without limits",
                self.without_limits
            ));
        }
        if self.fixed_distance > 0 {
            lines.push(format!(
                "{} of {of} readings are from a fixed-distance ranger (min_range = max_range = {}): it only detects whether \
                             an object is nearer",
                self.fixed_distance, self.fixed_m
            ));
        }
        if self.beyond_max > 0 {
            lines.push(format!(
                "{} of {of} ranges are beyond max_range = {}: read as no echo",
                self.beyond_max, self.max
            ));
        }
        if self.nulls > 0 {
            lines.push(format!(
                "{} of {of} ranges are null, which rosbridge writes for infinity and NaN: read as no echo",
                self.nulls
            ));
        }
        if self.invalid > 0 {
            lines.push(format!("{} of {of} ranges are NaN: skipped as invalid", self.invalid));
        }
        if let Some(angles) = self.first_contradiction {
            let last_rad = angles.last_rad();
            lines.push(format!(
                "angle_max contradicts the number of ranges in {} of {} scans (first: angle_max = {:.3} rad, but {} ranges in \
                 steps of {:.4} rad end at {last_rad:.3}): angle_min and angle_increment are used",
                self.contradictions,
                self.scans,
                angles.max_rad.unwrap_or(last_rad),
                angles.beams,
                angles.step_rad
            ));
        }
        lines
    }

    /// Counts a LaserScan.
    pub(crate) fn add_scan(&mut self, angles: ScanAngles) {
        self.scans += 1;
        for angle_rad in [angles.first_rad, angles.last_rad()] {
            if angle_rad.is_finite() {
                self.max_angle_rad = self.max_angle_rad.max(angle_rad.abs());
            }
        }
        if angles.contradicts_max() {
            self.contradictions += 1;
            self.first_contradiction.get_or_insert(angles);
        }
    }

    /// Counts ranges that are null in JSON.
    pub(crate) const fn add_nulls(&mut self, count: usize) {
        self.nulls += count as u64;
    }

    /// Returns the greatest plausible `max_range` of the messages, metres; `metres` is the length
    /// of their unit.
    pub(crate) fn max_stated_m(&self, metres: f64) -> f64 {
        let stated_m = self.max_stated * metres;
        if stated_m <= MAX_STATED_M { stated_m } else { 0.0 }
    }

    /// Returns evidence of wrong units, with advice: all ranges beyond `max_range`, all below
    /// `min_range`, or angles in degrees.
    pub(crate) fn unit_fault(&self) -> Option<(String, &'static str)> {
        if self.max_angle_rad > MAX_ANGLE_RAD {
            let what = format!(
                "angles reach {:.1} rad, which looks like degrees; a LaserScan has radians",
                self.max_angle_rad
            );
            let help = "correct angle_min and angle_increment of the driver; --no-unit-check takes them as radians";
            return Some((what, help));
        }
        if self.readings > 0 && self.beyond_max == self.readings {
            let what = format!(
                "all {} ranges are beyond max_range = {} of their messages",
                self.readings, self.max
            );
            let help = "are ranges and limits in different units? Correct the driver; --no-unit-check reads all as no echo";
            return Some((what, help));
        }
        if self.below_min >= MIN_NEAR_READINGS && self.below_min == self.finite {
            let what = format!(
                "all {} ranges are at or below min_range = {} of their messages",
                self.below_min, self.min
            );
            let help = "are ranges and limits in different units? Correct the driver; --no-unit-check takes all as too near";
            return Some((what, help));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn classify(min: f64, max: f64, range: f64) -> RangeClass {
        Limits { min, max }.classify(range, &Mapping::default(), &mut LimitNotes::default())
    }

    #[test]
    fn classifies_by_rep_117() {
        use RangeClass::{Echo, Invalid, NoRange};
        let (near, none) = (NoRange(PingStatus::MinRange), NoRange(PingStatus::NoEcho));
        for (min, max, range, expected) in [
            (0.02, 4.0, f64::NEG_INFINITY, near),
            (0.02, 4.0, f64::INFINITY, none),
            (0.02, 4.0, 1.0, Echo(1.0)),
            (0.02, 4.0, 0.01, near),
            (0.02, 4.0, 4.0, none),
            (0.02, 4.0, 5.0, none),
            (0.02, 4.0, 0.0, none),
            // Inconsistent limits are ignored.
            (0.0, 0.0, 1.0, Echo(1.0)),
            (4.0, 0.02, 1.0, Echo(1.0)),
            (0.1, f64::NAN, 1.0, Echo(1.0)),
            // Fixed-distance ranger.
            (0.5, 0.5, f64::NEG_INFINITY, near),
            (0.5, 0.5, f64::INFINITY, none),
            (0.5, 0.5, 0.5, near),
        ] {
            assert_eq!(classify(min, max, range), expected, "{min} {max} {range}");
        }
        assert!(matches!(classify(0.02, 4.0, f64::NAN), Invalid));
    }
}
