//! What a receiver could have reported of one firing.

use smallvec::SmallVec;
use sonard_model::{
    acoustics::{Combining, Detection, Detector, Listening, PulseArrival, Receiver},
    model::{Ear, ObservationPoint, Prediction, TooCostly},
    reading::PingStatus,
};

/// Thresholds that are looked at, decibels to both sides of the nominal one.
pub(crate) const SPAN_DB: f64 = 12.0;
/// Least step from one to the next, decibels.
const STEP_DB: f64 = 0.25;
/// Margins between which time walk is found out, decibels to both sides.
const WALK_DB: f64 = 0.5;
/// Just above where an echo is lost.
const ABOVE_DB: f64 = 0.02;
/// Margin below which time walk is not followed, decibels.
const LEAST_MARGIN_DB: f64 = 0.1;
/// Later than time walk explains by this much is another rise of the envelope, metres.
const JUMP_M: f64 = 0.003;
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
    /// What its range gains with the threshold, metres a decibel (time walk).
    pub(crate) walk_m_per_db: f64,
}

/// The readings of a firing from the lowest threshold up; the last holds for all thresholds above.
pub(crate) type Candidates = SmallVec<[Candidate; 3]>;

/// Asks the model what a receiver would report at thresholds other than its own.
pub(crate) struct Listener {
    receiver: Receiver,
    /// Thresholds that are looked at, decibels to both sides of the nominal one.
    span_db: f64,
}

/// What a receiver with some threshold detects.
struct Detected {
    detection: Detection,
    /// The threshold, decibels above the nominal one.
    by_db: f64,
    /// The threshold up to which its envelope reaches, decibels above the nominal one; infinite of silence.
    reaches_db: f64,
}

/// A detection as far as it takes to tell whether another one is of the same rise.
struct Told {
    status: PingStatus,
    range_m: f64,
    arrival: Option<PulseArrival>,
    /// The threshold, decibels above the nominal one.
    by_db: f64,
}

impl Listener {
    /// For thresholds up to `span_db` decibels to both sides of the nominal one.
    pub(crate) fn new(receiver: &Receiver, phases: Phases, span_db: f64) -> Self {
        // Steps in which ranges are told, and whole cycles, would hide how they move.
        let mut receiver = receiver.clone();
        (receiver.range_step_m, receiver.detector) = (0.0, Detector::Envelope);
        if phases == Phases::Unknown && receiver.combining == Combining::Coherent {
            receiver.combining = Combining::Incoherent;
        }
        Self { receiver, span_db }
    }

    /// All that a firing could come to.
    pub(crate) fn candidates(
        &self,
        point: &ObservationPoint,
        direction_rad: f64,
    ) -> Result<Candidates, TooCostly> {
        point.hear(direction_rad, |ear| {
            ear.listen(&self.receiver, |listening| self.rising(ear, listening))
        })
    }

    /// From the lowest threshold up. A higher one is passed no earlier, so that time runs forward, too.
    fn rising(&self, ear: &Ear, listening: &mut Listening) -> Candidates {
        let mut found = Candidates::new();
        let mut last: Option<Detected> = None;
        let (mut by_db, mut ready_us) = (-self.span_db, 0.0);
        while by_db < self.span_db && found.len() < MOST {
            let mut next = detected(listening, by_db, ready_us);
            ready_us = next.detection.echoes_us.first().copied().unwrap_or(ready_us);
            let until_db = self.lost(listening, by_db, &next, ready_us);
            if by_db < 0.0 && until_db > 0.0 {
                // What is reported at the usual threshold is told as it is there.
                let usual = detected(listening, 0.0, ready_us);
                if self.is_same(&next, usual.told().as_ref()) {
                    (next, by_db) = (usual, 0.0);
                }
            }
            match found.last_mut() {
                Some(known)
                    if last
                        .as_ref()
                        .is_some_and(|last| self.is_same(last, next.told().as_ref())) =>
                {
                    known.until_db = known.until_db.max(until_db);
                }
                _ => {
                    let spread_db = self.spread_db(&next.detection);
                    let walk_m_per_db = self.walk_m_per_db(until_db - by_db);
                    let prediction = ear.prediction(next.detection.clone());
                    found.push(Candidate { prediction, until_db, spread_db, walk_m_per_db });
                    last = Some(next);
                }
            }
            by_db = until_db.max(by_db + STEP_DB) + ABOVE_DB;
        }
        found
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

    /// What the range of an arrival that reaches so far above the threshold gains with the threshold.
    fn walk_m_per_db(&self, margin_db: f64) -> f64 {
        let (low_db, high_db) = ((margin_db - WALK_DB).max(0.0), margin_db.max(0.0) + WALK_DB);
        let [late_m, early_m] = [low_db, high_db].map(|db| self.receiver.time_walk_m(db));
        (late_m - early_m) / (high_db - low_db)
    }

    /// The threshold at which an arrival is no longer reported that is at `from_db`. The peak of its envelope says
    /// so, unless another follows so closely that the peak is that one's.
    fn lost(
        &self,
        listening: &mut Listening,
        from_db: f64,
        reported: &Detected,
        ready_us: f64,
    ) -> f64 {
        let (said_db, span_db) = (reported.reaches_db, self.span_db);
        let beyond = if said_db < span_db { said_db - STEP_DB } else { span_db };
        if said_db.is_infinite() || beyond <= from_db {
            return said_db.min(span_db.max(from_db));
        }
        let mut is_reported = |by_db: f64| {
            let rise = listening.rise(factor(by_db), ready_us);
            let told = rise.map(|rise| Told {
                status: rise.status,
                range_m: rise.range_m,
                arrival: rise.arrival,
                by_db,
            });
            self.is_same(reported, told.as_ref())
        };
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

    /// Whether two detections are of the same rise of the envelope, one at a higher threshold: of the same arrival, and
    /// no later than that arrival takes to rise further. Where arrivals overlap the first may fade before the next one
    /// drives the envelope on, and a little more of threshold makes the echo centimetres later.
    fn is_same(&self, reported: &Detected, higher: Option<&Told>) -> bool {
        let (one, higher) = match (reported.told(), higher) {
            (None, None) => return true,
            (Some(one), Some(higher)) => (one, higher),
            _ => return false,
        };
        let is_same_arrival = match (&one.arrival, &higher.arrival) {
            (Some(one), Some(other)) => (one.length_m - other.length_m).abs() < 1e-6,
            (None, None) => true,
            _ => false,
        };
        if one.status != higher.status || !is_same_arrival {
            return false;
        }
        // At the very top, where a pulse is flat, its rise takes any time.
        let margin_db = |of: &Told| (reported.reaches_db - of.by_db).max(LEAST_MARGIN_DB);
        let walk_m = |of: &Told| self.receiver.time_walk_m(margin_db(of));
        let later_m = higher.range_m - one.range_m;
        later_m < JUMP_M || later_m - (walk_m(higher) - walk_m(&one)) < JUMP_M
    }
}

impl Detected {
    /// `None` of silence.
    fn told(&self) -> Option<Told> {
        let Detection { status, range_m, arrival, .. } = self.detection;
        Some(Told { status, range_m: range_m?, arrival, by_db: self.by_db })
    }
}

/// What a receiver detects whose threshold is higher by so many decibels.
fn detected(listening: &mut Listening, by_db: f64, ready_us: f64) -> Detected {
    // The time that a firing with another threshold is late by stays in: `with_threshold` would take it out.
    let detection = listening.detect(factor(by_db), ready_us);
    let margin_db = detection.margin_db.unwrap_or(0.0).max(0.0);
    let reaches_db = if detection.status.has_range() { by_db + margin_db } else { f64::INFINITY };
    Detected { detection, by_db, reaches_db }
}

fn factor(by_db: f64) -> f64 {
    10f64.powf(by_db / 20.0)
}
