//! Check that readings are in the order of a sweep.

use std::collections::BTreeSet;

use sonard_model::geometry::{wrap_180, wrap_360};

use super::{UnitContext, implausible};
use crate::{
    ImportError, ImportedReading,
    scans::{by_direction, is_same_scan},
    sweep_end::{SAME_DEG, SweepDetector},
};

/// Minimum number of readings for the check.
const MIN_READINGS: u64 = 16;
/// Share of the steps that reverse the rotation, above which the order is random. A sweep of `n`
/// stops reverses at most `2 / n` of them; in random order it is a half on a circle, two thirds in
/// a sector.
const MAX_REVERSALS: f64 = 0.3;
/// Number of equal parts of the covered sector, and the minimum number of them with readings:
/// fewer may be the few stops of a servo.
const PARTS: usize = 16;
const MIN_OCCUPIED: usize = 13;
/// Number of counted directions per degree.
const PER_DEG: f64 = 10.0;

/// Sense of rotation from reading to reading, for readings without scan identifiers.
#[derive(Debug, Default)]
pub(super) struct SweepOrder {
    detector: SweepDetector,
    last: Option<ImportedReading>,
    readings: u64,
    poses: u64,
    /// Number of sweeps by [`SweepDetector`].
    sweeps: u64,
    /// Steps between readings at one pose, and those in the sense opposite to the one before.
    steps: u64,
    reversals: u64,
    sense: f64,
    /// Directions in units of 1 / [`PER_DEG`].
    directions: BTreeSet<u16>,
}

impl SweepOrder {
    pub(super) fn add(&mut self, reading: &ImportedReading) {
        if reading.scan.is_some() || !reading.direction_deg.is_finite() {
            return;
        }
        let last = self.last.as_ref().filter(|last| is_same_scan(last, reading));
        let step_deg = last.map(|last| wrap_180(reading.direction_deg - last.direction_deg));
        if step_deg.is_none() {
            self.poses += 1;
            self.sense = 0.0;
            self.detector = SweepDetector::default();
        }
        if self.detector.is_next(reading.direction_deg) || step_deg.is_none() {
            self.sweeps += 1;
        }
        if let Some(step_deg) = step_deg.filter(|step_deg| step_deg.abs() > SAME_DEG) {
            self.steps += 1;
            self.reversals += u64::from(step_deg * self.sense < 0.0);
            self.sense = step_deg.signum();
        }
        self.readings += 1;
        self.directions.insert(in_units(wrap_360(reading.direction_deg)));
        self.last = Some(reading.clone());
    }

    /// Rejects readings that reverse the rotation at random.
    pub(super) fn check(&self, units: &UnitContext) -> Result<(), ImportError> {
        let is_random = self.reversals as f64 > MAX_REVERSALS * self.steps as f64;
        if units.mapping.unordered
            || self.readings < MIN_READINGS
            || self.sweeps < 2 * self.poses
            || !is_random
            || self.occupied_parts() < MIN_OCCUPIED
        {
            return Ok(());
        }
        Err(implausible(
            format!(
                "the direction reverses in {} of {} steps: the readings are not in the order of a sweep",
                self.reversals, self.steps
            ),
            "give --unordered if all readings at one pose are one scan, or a column that numbers the scans (scan=COLUMN); \
             --no-unit-check splits them at each reversal"
                .to_owned(),
        ))
    }

    /// Returns how many of the [`PARTS`] of the covered sector have readings.
    fn occupied_parts(&self) -> usize {
        let directions: Vec<f64> =
            self.directions.iter().map(|units| f64::from(*units) / PER_DEG).collect();
        let (_, sorted) = by_direction(&directions);
        let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else { return 0 };
        let from_first = |deg: &f64| usize::from(in_units(wrap_360(deg - first)));
        let covered = from_first(last) + 1;
        let parts = sorted.iter().map(|deg| from_first(deg) * PARTS / covered);
        parts.collect::<BTreeSet<_>>().len()
    }
}

/// Converts a direction of 0 to 360 degrees to units of 1 / [`PER_DEG`].
fn in_units(direction_deg: f64) -> u16 {
    (direction_deg * PER_DEG).round() as u16 % (360.0 * PER_DEG) as u16
}
