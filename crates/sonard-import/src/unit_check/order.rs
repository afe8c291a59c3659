//! Check that readings are in the order of a sweep.

use std::collections::BTreeSet;

use sonard_model::geometry::{wrap_180, wrap_360};

use super::{UnitContext, implausible};
use crate::{ImportError, ImportedReading, scans::is_same_scan, sweep_end::SweepDetector};

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
/// Resolution of the counted directions, in parts of a revolution.
const RESOLUTION: u16 = 3600;
/// Tolerance for equal directions, degrees.
const SAME_DEG: f64 = 1e-3;

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
        let part = wrap_360(reading.direction_deg) / 360.0 * f64::from(RESOLUTION);
        self.directions.insert(part.round() as u16 % RESOLUTION);
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
        let around = self.directions.iter().chain(self.directions.first());
        let gaps = around.clone().zip(around.skip(1)).map(|(from, to)| {
            let gap = (to + RESOLUTION - from) % RESOLUTION;
            (if gap == 0 { RESOLUTION } else { gap }, *to)
        });
        let Some((gap, first)) = gaps.max() else { return 0 };
        let covered = usize::from(RESOLUTION - gap) + 1;
        let part = |at: &u16| usize::from((at + RESOLUTION - first) % RESOLUTION) * PARTS / covered;
        self.directions.iter().map(part).collect::<BTreeSet<_>>().len()
    }
}
