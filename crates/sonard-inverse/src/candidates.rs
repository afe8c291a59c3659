//! What a receiver could have reported of one firing.

use smallvec::SmallVec;
use sonard_model::{
    acoustics::Receiver,
    model::{ObservationPoint, Prediction, TooCostly},
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

/// The first echo for a range of thresholds.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// What is read.
    pub(crate) prediction: Prediction,
    /// Up to this threshold, decibels above the nominal one.
    pub(crate) until_db: f64,
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

impl Listener {
    pub(crate) fn new(receiver: &Receiver, with_walk: bool) -> Self {
        Self { receiver: receiver.clone(), threshold: receiver.threshold, with_walk }
    }

    fn ping(
        &mut self,
        point: &ObservationPoint,
        direction_rad: f64,
        by_db: f64,
    ) -> Result<Candidate, TooCostly> {
        // The time that a firing with another threshold is late by stays in: `with_threshold` would take it out.
        self.receiver.threshold = self.threshold * 10f64.powf(by_db / 20.0);
        let prediction = point.ping_with(&self.receiver, direction_rad)?;
        let margin_db = prediction.margin_db.unwrap_or(0.0).max(0.0);
        let until_db =
            if prediction.status.has_range() { by_db + margin_db } else { f64::INFINITY };
        Ok(Candidate { prediction, until_db, walk_m_per_db: 0.0 })
    }

    /// All that a firing could come to.
    pub(crate) fn candidates(
        &mut self,
        point: &ObservationPoint,
        direction_rad: f64,
    ) -> Result<Candidates, TooCostly> {
        let usual = self.ping(point, direction_rad, 0.0)?;
        let mut found = Candidates::new();
        // What comes before it at lower thresholds.
        let mut by_db = -SPAN_DB;
        while by_db < 0.0 && found.len() < MOST {
            let mut lower = self.ping(point, direction_rad, by_db)?;
            if is_same(&lower.prediction, &usual.prediction) {
                break;
            }
            lower.walk_m_per_db = self.walk(point, direction_rad, by_db, &lower)?;
            lower.until_db = self.lost(point, direction_rad, by_db, &lower, 0.0)?;
            by_db = lower.until_db.max(by_db + STEP_DB) + ABOVE_DB;
            push(&mut found, lower);
        }
        // And once it is lost.
        let (mut by_db, mut next) = (0.0, usual);
        while found.len() < MOST {
            next.walk_m_per_db = self.walk(point, direction_rad, by_db, &next)?;
            next.until_db = self.lost(point, direction_rad, by_db, &next, SPAN_DB)?;
            by_db = next.until_db.max(by_db + STEP_DB) + ABOVE_DB;
            push(&mut found, next);
            if by_db >= SPAN_DB {
                break;
            }
            next = self.ping(point, direction_rad, by_db)?;
        }
        Ok(found)
    }

    /// How the range of an arrival that is reported at `by_db` moves with the threshold.
    fn walk(
        &mut self,
        point: &ObservationPoint,
        direction_rad: f64,
        by_db: f64,
        reported: &Candidate,
    ) -> Result<f64, TooCostly> {
        if !self.with_walk {
            return Ok(0.0);
        }
        for step_db in [WALK_DB, -WALK_DB] {
            let beside = self.ping(point, direction_rad, by_db + step_db)?.prediction;
            let ranges = beside.range_m.zip(reported.prediction.range_m);
            if let (true, Some((other_m, range_m))) =
                (is_same(&beside, &reported.prediction), ranges)
            {
                return Ok((other_m - range_m) / step_db);
            }
        }
        Ok(0.0)
    }

    /// The threshold at which an arrival is no longer reported that is at `from_db`. The peak of its envelope says
    /// so, unless another follows so closely that the peak is that one's.
    fn lost(
        &mut self,
        point: &ObservationPoint,
        direction_rad: f64,
        from_db: f64,
        reported: &Candidate,
        most_db: f64,
    ) -> Result<f64, TooCostly> {
        let said_db = reported.until_db;
        let beyond = if said_db < most_db { said_db - STEP_DB } else { most_db };
        if said_db.is_infinite() || beyond <= from_db {
            return Ok(said_db.min(most_db.max(from_db)));
        }
        let mut is_reported = |by_db: f64| {
            let read = self.ping(point, direction_rad, by_db)?;
            Ok(is_same(&read.prediction, &reported.prediction))
        };
        if is_reported(beyond)? {
            return Ok(said_db);
        }
        let (mut low, mut high) = (from_db, beyond);
        while high - low > STEP_DB {
            let middle = 0.5 * (low + high);
            if is_reported(middle)? { low = middle } else { high = middle }
        }
        Ok(0.5 * (low + high))
    }
}

/// Adds a reading, or has the last one hold on if it is of the same arrival.
fn push(found: &mut Candidates, next: Candidate) {
    match found.last_mut() {
        Some(last) if is_same(&last.prediction, &next.prediction) => {
            last.until_db = last.until_db.max(next.until_db);
        }
        last => {
            // Thresholds rise from one to the next.
            let from_db = last.map_or(f64::NEG_INFINITY, |last| last.until_db);
            found.push(Candidate { until_db: next.until_db.max(from_db), ..next });
        }
    }
}

/// Whether two readings are of the same arrival. Their ranges may part: at a higher threshold an echo is later by the
/// time that its pulse takes to rise.
fn is_same(one: &Prediction, other: &Prediction) -> bool {
    let length_m = |prediction: &Prediction| match prediction.status.has_range() {
        true => prediction.arrival.as_ref().map(|arrival| arrival.length_m),
        false => None,
    };
    one.status == other.status
        && match (length_m(one), length_m(other)) {
            (Some(one_m), Some(other_m)) => (one_m - other_m).abs() < 1e-6,
            (None, None) => true,
            _ => false,
        }
}
