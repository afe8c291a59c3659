//! What a receiver could have reported of one firing.

use smallvec::SmallVec;
use sonard_model::{
    acoustics::{Combining, Detector, Listening, PulseArrival, Receiver, Rise},
    model::{Arrival, FiringArrivals, ObservationPoint, TooCostly},
    reading::PingStatus,
};

/// Thresholds that are looked at, decibels to both sides of the nominal one.
pub(crate) const SPAN_DB: f64 = 12.0;
/// Least step from one to the next, decibels.
const STEP_DB: f64 = 0.25;
/// So far below where it is lost an echo is told that only lower thresholds than the usual one report, decibels.
const BELOW_DB: f64 = 0.3;
/// Just above where an echo is lost.
const ABOVE_DB: f64 = 0.02;
/// Margin below which time walk is not followed, decibels.
const LEAST_MARGIN_DB: f64 = 0.1;
/// Later than time walk explains by this much is another rise of the envelope, metres.
const JUMP_M: f64 = 0.003;
/// More than this many changes of the first echo are not followed.
const MOST: usize = 48;

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
    /// What is read, metres; `None` of silence.
    pub(crate) range_m: Option<f64>,
    /// Whether it sounded already at the end of blanking, so that its range is the least.
    pub(crate) is_near: bool,
    /// The echo that raised ECHO.
    pub(crate) arrival: Option<Arrival>,
    /// Up to this threshold, decibels above the nominal one.
    pub(crate) until_db: f64,
    /// By how much that may be off, because it is not known with which phase its arrival meets others: a standard
    /// deviation, decibels.
    pub(crate) spread_db: f64,
    /// How far its envelope reaches above the threshold that its range is told at, decibels; infinite where that moves with
    /// no threshold, as of silence and of what is there at the end of blanking.
    pub(crate) margin_db: f64,
    /// Whether how far it reaches is its arrival's strength, and next to nothing is added or taken by what sounds beside it.
    pub(crate) is_of_one: bool,
}

/// The readings of a firing from the lowest threshold up; the last holds for all thresholds above.
pub(crate) type Candidates = SmallVec<[Candidate; 3]>;

/// Asks the model what a receiver would report at thresholds other than its own.
pub(crate) struct Listener {
    receiver: Receiver,
    /// How far a lone echo has to reach above the threshold to be told, decibels.
    least_margin_db: f64,
    /// Thresholds that are looked at, decibels to both sides of the nominal one.
    span_db: f64,
    /// What the lowest and the highest of them are multiplied with.
    ends: [f64; 2],
}

/// What a receiver with some threshold reports.
struct Reported {
    rise: Rise,
    /// The threshold, decibels above the nominal one.
    by_db: f64,
    /// The most of its envelope.
    peak: f64,
    /// The threshold up to which that reaches, decibels above the nominal one.
    reaches_db: f64,
    /// Whether nothing else sounds with its arrival.
    is_lone: bool,
}

impl Reported {
    fn is_of_one(&self) -> bool {
        /// Of its arrival's strength.
        const BESIDE: f64 = 0.1;
        let of = |arrival: &PulseArrival| (self.peak / arrival.amplitude - 1.0).abs() < BESIDE;
        self.is_lone || self.rise.arrival.as_ref().is_some_and(of)
    }
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
        let least_margin_db = receiver.least_margin_db();
        Self { receiver, least_margin_db, span_db, ends: [-span_db, span_db].map(factor) }
    }

    /// All that a firing could come to, in the place of what was there.
    pub(crate) fn candidates(
        &self,
        point: &ObservationPoint,
        direction_rad: f64,
        found: &mut Candidates,
    ) -> Result<(), TooCostly> {
        point.hear(direction_rad, |firing| {
            found.clear();
            firing.listen(&self.receiver, |listening| self.rising(firing, listening, found));
        })
    }

    /// From the lowest threshold up. A higher one is passed no earlier, so that time runs forward, too.
    fn rising(&self, firing: &FiringArrivals, listening: &mut Listening, found: &mut Candidates) {
        let mut last: Option<Reported> = None;
        let (mut by_db, mut ready_us) = (-self.span_db, 0.0);
        while by_db < self.span_db && found.len() < MOST {
            let Some(rise) = listening.rise(self.factor(by_db), ready_us) else {
                // And nothing by a receiver that is less sensitive.
                found.push(Candidate::silence(self.span_db));
                return;
            };
            ready_us = rise.passed_us;
            let first = Self::reported(listening, rise, by_db);
            let (next, until_db) = self.told_where_likely(listening, first, ready_us);
            by_db = until_db.max(next.by_db + STEP_DB) + ABOVE_DB;
            let is_same = |last: &Reported| self.is_same(last, &next.rise, next.by_db);
            match found.last_mut() {
                Some(known) if last.as_ref().is_some_and(is_same) => known.go_on(until_db, &next),
                _ => {
                    found.push(self.candidate(firing, &next, until_db));
                    last = Some(next);
                }
            }
        }
    }

    /// A rise as it is at the usual threshold, if that reports it, and else near the highest that does (the nearer to the usual
    /// one, the likelier), with the threshold at which it is lost.
    fn told_where_likely(
        &self,
        listening: &mut Listening,
        first: Reported,
        ready_us: f64,
    ) -> (Reported, f64) {
        let until_db = self.lost(listening, &first, ready_us);
        let at_db = (until_db - BELOW_DB).min(0.0);
        if first.by_db >= at_db {
            return (first, until_db);
        }
        let rise = listening.rise(self.factor(at_db), ready_us);
        let Some(rise) = rise.filter(|rise| self.is_same(&first, rise, at_db)) else {
            return (first, until_db);
        };
        let told = match self.is_asked_again(until_db) {
            true => Self::reported(listening, rise, at_db),
            false => Reported { rise, by_db: at_db, ..first },
        };
        // The threshold in force drifts while an echo rises: where it is told late it is known better how far it reaches.
        let until_db = if told.is_lone { self.lost(listening, &told, ready_us) } else { until_db };
        (told, until_db)
    }

    fn candidate(&self, firing: &FiringArrivals, told: &Reported, until_db: f64) -> Candidate {
        let rise = &told.rise;
        Candidate {
            range_m: Some(rise.range_m),
            is_near: rise.status == PingStatus::MinRange,
            arrival: rise.arrival.map(|arrival| firing.arrival(&arrival)),
            until_db,
            spread_db: self.spread_db(told),
            margin_db: match rise.status {
                PingStatus::Echo => until_db - told.by_db,
                _ => f64::INFINITY,
            },
            is_of_one: told.is_of_one(),
        }
    }

    /// A rise that was just told at a threshold, with how far its envelope reaches.
    fn reported(listening: &mut Listening, rise: Rise, by_db: f64) -> Reported {
        let (peak, margin_db) = listening.peak(&rise);
        let (reaches_db, is_lone) = (by_db + margin_db.max(0.0), listening.is_lone());
        Reported { rise, by_db, peak, reaches_db, is_lone }
    }

    /// Whether how far the envelope of a rise reaches, which is reported up to a threshold, is wanted any more: for its
    /// spread, or for what is reported at higher thresholds.
    fn is_asked_again(&self, until_db: f64) -> bool {
        self.receiver.combining == Combining::Incoherent || until_db < self.span_db
    }

    /// By how much the strength of an arrival may be off that meets others with unknown phases. Of two sounds whose
    /// amplitudes have the ratio `r`, the sum's level spreads by 6.1 `r` decibels for small `r` and by 7.8 for 1, once
    /// all phases are equally likely.
    fn spread_db(&self, Reported { rise, peak, .. }: &Reported) -> f64 {
        const DB_OF_RATIO: f64 = 6.5;
        if self.receiver.combining != Combining::Incoherent {
            return 0.0;
        }
        let beside = rise.arrival.map_or(0.0, |arrival| (peak / arrival.amplitude).powi(2) - 1.0);
        DB_OF_RATIO * beside.clamp(0.0, 1.0).sqrt()
    }

    /// The threshold at which what is reported no longer is. The peak of its envelope says so, unless another arrival
    /// follows so closely that the peak is that one's.
    fn lost(&self, listening: &mut Listening, reported: &Reported, ready_us: f64) -> f64 {
        let Reported { by_db: from_db, reaches_db, is_lone, .. } = *reported;
        let span_db = self.span_db;
        if is_lone {
            return (reaches_db - self.least_margin_db).max(from_db);
        }
        let beyond_db = if reaches_db < span_db { reaches_db - STEP_DB } else { span_db };
        if beyond_db <= from_db {
            return reaches_db.min(span_db.max(from_db));
        }
        let mut is_reported = |by_db: f64| {
            let rise = listening.rise(self.factor(by_db), ready_us);
            rise.is_some_and(|rise| self.is_same(reported, &rise, by_db))
        };
        match is_reported(beyond_db) {
            true => reaches_db,
            false => last_of(from_db, beyond_db, is_reported),
        }
    }

    /// Whether two rises are the same rise of the envelope, the second at a higher threshold: of the same arrival, and
    /// no later than that arrival takes to rise further. Where arrivals overlap the first may fade before the next one
    /// drives the envelope on, and a little more of threshold makes the echo centimetres later.
    fn is_same(&self, reported: &Reported, higher: &Rise, higher_db: f64) -> bool {
        let one = &reported.rise;
        let is_same_arrival = match (&one.arrival, &higher.arrival) {
            (Some(one), Some(other)) => (one.length_m - other.length_m).abs() < 1e-6,
            (None, None) => true,
            _ => false,
        };
        if one.status != higher.status || !is_same_arrival {
            return false;
        }
        let later_m = higher.range_m - one.range_m;
        if later_m < JUMP_M {
            return true;
        }
        // At the very top, where a pulse is flat, its rise takes any time.
        let walk_m = |by_db: f64| {
            self.receiver.time_walk_m((reported.reaches_db - by_db).max(LEAST_MARGIN_DB))
        };
        later_m - (walk_m(higher_db) - walk_m(reported.by_db)) < JUMP_M
    }

    /// What the threshold is multiplied with where it is higher by so many decibels.
    fn factor(&self, by_db: f64) -> f64 {
        let [lowest, highest] = self.ends;
        match by_db / self.span_db {
            -1.0 => lowest,
            1.0 => highest,
            _ => factor(by_db),
        }
    }
}

impl Candidate {
    /// Its rise is reported up to another threshold, too, and told as it is there unless only thresholds above the usual one
    /// report that.
    fn go_on(&mut self, until_db: f64, Reported { rise, by_db, .. }: &Reported) {
        let last_db = self.until_db;
        self.until_db = last_db.max(until_db);
        if *by_db <= 0.0 && self.margin_db.is_finite() {
            (self.range_m, self.margin_db) = (Some(rise.range_m), self.until_db - by_db);
        } else {
            self.margin_db += self.until_db - last_db;
        }
    }

    /// For all thresholds that are higher still.
    const fn silence(until_db: f64) -> Self {
        let (range_m, arrival) = (None, None);
        Self {
            range_m,
            is_near: false,
            arrival,
            until_db,
            spread_db: 0.0,
            margin_db: f64::INFINITY,
            is_of_one: false,
        }
    }
}

/// Where, between a threshold at which something is and a higher one at which it is not, it ends, to a step.
fn last_of(from_db: f64, beyond_db: f64, mut is_there: impl FnMut(f64) -> bool) -> f64 {
    let (mut low, mut high) = (from_db, beyond_db);
    while high - low > STEP_DB {
        let middle = 0.5 * (low + high);
        if is_there(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

fn factor(by_db: f64) -> f64 {
    10f64.powf(by_db / 20.0)
}
