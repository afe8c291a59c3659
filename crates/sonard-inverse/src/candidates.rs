//! What a receiver could have reported of one firing.

use smallvec::SmallVec;
use sonard_model::{
    acoustics::{Combining, Detection, Latch, Receiver},
    model::{Ear, ObservationPoint, Prediction, TooCostly},
};

/// Thresholds that are looked at, decibels to both sides of the nominal one.
pub(crate) const SPAN_DB: f64 = 12.0;
/// Least step from one to the next, decibels.
const STEP_DB: f64 = 0.25;
/// Step by which time walk is found out, decibels.
const WALK_DB: f64 = 0.5;
/// Just above where an echo is lost.
const ABOVE_DB: f64 = 0.02;
/// More than this many changes of the first echo are not followed.
const MOST: usize = 12;

/// Whether it is known with which phases arrivals meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phases {
    /// Walls and ranger are known to a small part of a wavelength.
    Known,
    /// They are not: what overlaps adds up by its power, as it does on average.
    Unknown,
}

/// The first echo for a range of thresholds.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// What is read.
    pub(crate) prediction: Prediction,
    /// Up to this threshold, decibels above the nominal one.
    pub(crate) until_db: f64,
    /// By how much that may be off, because it is not known with which phase its arrival meets others: a standard
    /// deviation, decibels.
    pub(crate) spread_db: f64,
    /// What its range gains with the threshold, metres a decibel (time walk); 0 unless it is asked for.
    pub(crate) walk_m_per_db: f64,
}

/// The readings of a firing from the lowest threshold up; the last holds for all thresholds above.
pub(crate) type Candidates = SmallVec<[Candidate; 3]>;

/// Asks the model what a receiver would report at thresholds other than its own.
pub(crate) struct Listener {
    receiver: Receiver,
    threshold: f64,
    /// Whether time walk is asked for: a firing or two more for each candidate.
    with_walk: bool,
}

/// What a receiver with some threshold detects.
struct Detected {
    detection: Detection,
    /// The threshold up to which its envelope reaches, decibels above the nominal one; infinite of silence.
    reaches_db: f64,
}

impl Listener {
    pub(crate) fn new(receiver: &Receiver, phases: Phases, with_walk: bool) -> Self {
        // Steps in which ranges are told would hide how they move.
        let mut receiver = receiver.clone();
        receiver.range_step_m = 0.0;
        if phases == Phases::Unknown && receiver.combining == Combining::Coherent {
            receiver.combining = Combining::Incoherent;
        }
        Self { threshold: receiver.threshold, receiver, with_walk }
    }

    /// All that a firing could come to.
    pub(crate) fn candidates(
        &mut self,
        point: &ObservationPoint,
        direction_rad: f64,
    ) -> Result<Candidates, TooCostly> {
        point.hear(direction_rad, |ear| self.rising(ear))
    }

    /// From the lowest threshold up. A higher one is passed no earlier, so that time runs forward, too.
    fn rising(&mut self, ear: &Ear) -> Candidates {
        let mut found = Candidates::new();
        let mut last: Option<Detection> = None;
        let (mut by_db, mut ready_us) = (-SPAN_DB, 0.0);
        while by_db < SPAN_DB && found.len() < MOST {
            let mut next = self.detect(ear, by_db, ready_us);
            ready_us = next.detection.echoes_us.first().copied().unwrap_or(ready_us);
            let until_db = self.lost(ear, by_db, &next, ready_us);
            if by_db < 0.0 && until_db > 0.0 {
                // What is reported at the usual threshold is told as it is there.
                let usual = self.detect(ear, 0.0, ready_us);
                if is_same(&usual.detection, &next.detection) {
                    (next, by_db) = (usual, 0.0);
                }
            }
            match found.last_mut() {
                Some(known) if last.as_ref().is_some_and(|last| is_same(last, &next.detection)) => {
                    known.until_db = known.until_db.max(until_db);
                }
                _ => {
                    let spread_db = self.spread_db(&next.detection);
                    let walk_m_per_db = self.walk(ear, by_db, &next.detection);
                    let prediction = ear.prediction(next.detection.clone());
                    found.push(Candidate { prediction, until_db, spread_db, walk_m_per_db });
                    last = Some(next.detection);
                }
            }
            by_db = until_db.max(by_db + STEP_DB) + ABOVE_DB;
        }
        found
    }

    fn detect(&mut self, ear: &Ear, by_db: f64, ready_us: f64) -> Detected {
        // The time that a firing with another threshold is late by stays in: `with_threshold` would take it out.
        self.receiver.threshold = self.threshold * 10f64.powf(by_db / 20.0);
        let detection = ear.detect(&self.receiver, Latch::First, ready_us);
        let margin_db = detection.margin_db.unwrap_or(0.0).max(0.0);
        let reaches_db =
            if detection.status.has_range() { by_db + margin_db } else { f64::INFINITY };
        Detected { detection, reaches_db }
    }

    /// By how much the strength of an arrival may be off that meets others with unknown phases. Of two sounds whose
    /// amplitudes have the ratio `r`, the sum's level spreads by 6.1 `r` decibels for small `r` and by 7.8 for 1, once
    /// all phases are equally likely.
    fn spread_db(&self, detection: &Detection) -> f64 {
        const DB_OF_RATIO: f64 = 6.5;
        if self.receiver.combining != Combining::Incoherent {
            return 0.0;
        }
        let both = detection.arrival.zip(detection.amplitude);
        let beside = both.map_or(0.0, |(arrival, all)| (all / arrival.amplitude).powi(2) - 1.0);
        DB_OF_RATIO * beside.clamp(0.0, 1.0).sqrt()
    }

    /// How the range of an arrival that is reported at `by_db` moves with the threshold.
    fn walk(&mut self, ear: &Ear, by_db: f64, reported: &Detection) -> f64 {
        if !self.with_walk {
            return 0.0;
        }
        for step_db in [WALK_DB, -WALK_DB] {
            let beside = self.detect(ear, by_db + step_db, 0.0).detection;
            let ranges = beside.range_m.zip(reported.range_m);
            if let (true, Some((other_m, range_m))) = (is_same(&beside, reported), ranges) {
                return (other_m - range_m) / step_db;
            }
        }
        0.0
    }

    /// The threshold at which an arrival is no longer reported that is at `from_db`. The peak of its envelope says
    /// so, unless another follows so closely that the peak is that one's.
    fn lost(&mut self, ear: &Ear, from_db: f64, reported: &Detected, ready_us: f64) -> f64 {
        let said_db = reported.reaches_db;
        let beyond = if said_db < SPAN_DB { said_db - STEP_DB } else { SPAN_DB };
        if said_db.is_infinite() || beyond <= from_db {
            return said_db.min(SPAN_DB.max(from_db));
        }
        let mut is_reported =
            |by_db: f64| is_same(&self.detect(ear, by_db, ready_us).detection, &reported.detection);
        if is_reported(beyond) {
            return said_db;
        }
        let (mut low, mut high) = (from_db, beyond);
        while high - low > STEP_DB {
            let middle = 0.5 * (low + high);
            if is_reported(middle) { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

/// Whether two detections are of the same arrival. Their ranges may part: at a higher threshold an echo is later by the
/// time that its pulse takes to rise.
fn is_same(one: &Detection, other: &Detection) -> bool {
    let length_m = |detection: &Detection| match detection.status.has_range() {
        true => detection.arrival.map(|arrival| arrival.length_m),
        false => None,
    };
    one.status == other.status
        && match (length_m(one), length_m(other)) {
            (Some(one_m), Some(other_m)) => (one_m - other_m).abs() < 1e-6,
            (None, None) => true,
            _ => false,
        }
}
