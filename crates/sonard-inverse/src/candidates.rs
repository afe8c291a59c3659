//! Candidate readings of one firing as a function of the detection threshold.

use smallvec::SmallVec;
use sonard_model::{
    acoustics::{Combining, Detector, DetectorBank, EchoRise, PulseArrival, Receiver},
    model::{Arrival, FiringArrivals, ObservationPoint, TooCostly},
    reading::PingStatus,
};

/// Range of thresholds scanned, decibels on either side of the nominal one.
pub(crate) const SPAN_DB: f64 = 12.0;
/// Minimum step between thresholds, decibels.
const STEP_DB: f64 = 0.25;
/// Distance below its detection limit at which an echo is evaluated if only lower thresholds than
/// the nominal one report it, decibels.
const BELOW_DB: f64 = 0.3;
/// Offset just above a detection limit, decibels.
const ABOVE_DB: f64 = 0.02;
/// Minimum margin for the evaluation of time walk, decibels.
const MIN_MARGIN_DB: f64 = 0.1;
/// Delay beyond the time walk that indicates another rise of the envelope, metres.
const JUMP_M: f64 = 0.003;
/// Maximum number of candidates per firing.
const MAX_CANDIDATES: usize = 48;

/// Knowledge of the relative phases of arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phases {
    /// Coherent sum: geometry is known to a small fraction of a wavelength.
    Known,
    /// Incoherent sum: overlapping arrivals add by power, as on average.
    Unknown,
}

/// First echo for an interval of thresholds.
#[derive(Debug, Clone)]
pub(crate) struct ThresholdCandidate {
    /// Reported range, metres; `None` without echo.
    pub(crate) range_m: Option<f64>,
    /// Whether the signal is present at the end of blanking, so that the minimum range is reported.
    pub(crate) is_near: bool,
    /// Arrival that triggers ECHO.
    pub(crate) arrival: Option<Arrival>,
    /// Upper end of the interval, decibels above the nominal threshold.
    pub(crate) until_db: f64,
    /// Standard deviation of that end due to unknown phases, decibels.
    pub(crate) spread_db: f64,
    /// Margin of the envelope above the threshold at which the range is evaluated, decibels;
    /// infinite if the range does not depend on the threshold (no echo, minimum range).
    pub(crate) margin_db: f64,
    /// Whether the envelope is dominated by the arrival itself.
    pub(crate) is_of_one: bool,
}

/// Candidates of a firing from the lowest threshold up; the last holds for all higher
/// thresholds.
pub(crate) type CandidateList = SmallVec<[ThresholdCandidate; 3]>;

/// Scan of a simulated receiver over thresholds.
pub(crate) struct ThresholdScan {
    receiver: Receiver,
    /// Minimum margin of an isolated echo for detection, decibels.
    min_margin_db: f64,
    /// Maximum time walk between two thresholds of an isolated echo, metres.
    max_walk_m: f64,
    /// Range of thresholds scanned, decibels on either side of the nominal one.
    span_db: f64,
    /// Amplitude factors of the lowest and the highest threshold.
    ends: [f64; 2],
}

/// Detection by a receiver at one threshold.
struct ReportedRise {
    rise: EchoRise,
    /// Threshold, decibels above the nominal one.
    by_db: f64,
    /// Peak of the envelope.
    peak: f64,
    /// Threshold up to which the peak reaches, decibels above the nominal one.
    reaches_db: f64,
    /// Whether no other arrival overlaps.
    is_lone: bool,
}

impl ReportedRise {
    fn is_of_one(&self) -> bool {
        /// Maximum relative contribution of other arrivals.
        const OTHERS: f64 = 0.1;
        let of = |arrival: &PulseArrival| (self.peak / arrival.amplitude - 1.0).abs() < OTHERS;
        self.is_lone || self.rise.arrival.as_ref().is_some_and(of)
    }
}

impl ThresholdScan {
    /// Scan of thresholds up to `span_db` decibels on either side of the nominal one.
    pub(crate) fn new(receiver: &Receiver, phases: Phases, span_db: f64) -> Self {
        // Quantized ranges, and whole cycles, would hide derivatives.
        let mut receiver = receiver.clone();
        (receiver.range_step_m, receiver.detector) = (0.0, Detector::Envelope);
        if phases == Phases::Unknown && receiver.combining == Combining::Coherent {
            receiver.combining = Combining::Incoherent;
        }
        let min_margin_db = receiver.min_margin_db();
        let [latest_m, earliest_m] =
            [MIN_MARGIN_DB, f64::INFINITY].map(|db| receiver.time_walk_m(db));
        let (max_walk_m, ends) = (latest_m - earliest_m, [-span_db, span_db].map(factor));
        Self { receiver, min_margin_db, max_walk_m, span_db, ends }
    }

    /// Collects all candidates of a firing into `found`.
    pub(crate) fn candidates(
        &self,
        point: &ObservationPoint,
        direction_rad: f64,
        found: &mut CandidateList,
    ) -> Result<(), TooCostly> {
        point.evaluate(direction_rad, |firing| {
            found.clear();
            firing.evaluate_thresholds(&self.receiver, |bank| {
                self.scan(firing, bank, found);
            });
        })
    }

    /// Scans upwards. A higher threshold is crossed no earlier, so time runs forward as well.
    fn scan(&self, firing: &FiringArrivals, bank: &mut DetectorBank, found: &mut CandidateList) {
        let mut last: Option<ReportedRise> = None;
        let (mut by_db, mut ready_us) = (-self.span_db, 0.0);
        while by_db < self.span_db && found.len() < MAX_CANDIDATES {
            let Some(rise) = bank.first_rise(self.factor(by_db), ready_us) else {
                // No echo at any higher threshold.
                found.push(ThresholdCandidate::no_echo(self.span_db));
                return;
            };
            ready_us = rise.passed_us;
            let first = Self::reported(bank, rise, by_db);
            let (next, until_db) = self.at_likely_threshold(bank, first, ready_us);
            by_db = until_db.max(next.by_db + STEP_DB) + ABOVE_DB;
            let is_same = |last: &ReportedRise| self.is_same(last, &next.rise, next.by_db);
            match found.last_mut() {
                Some(known) if last.as_ref().is_some_and(is_same) => known.extend(until_db, &next),
                _ => {
                    found.push(self.candidate(firing, &next, until_db));
                    last = Some(next);
                }
            }
        }
    }

    /// Evaluates a rise at the nominal threshold if that reports it, else near the highest one that
    /// does, since thresholds near the nominal one are likelier. Returns its detection limit as
    /// well.
    fn at_likely_threshold(
        &self,
        bank: &mut DetectorBank,
        first: ReportedRise,
        ready_us: f64,
    ) -> (ReportedRise, f64) {
        let until_db = self.lost(bank, &first, ready_us);
        let at_db = (until_db - BELOW_DB).min(0.0);
        if first.by_db >= at_db {
            return (first, until_db);
        }
        let Some(rise) = self.same_at(bank, &first, at_db, ready_us) else {
            return (first, until_db);
        };
        let evaluated = match self.needs_peak(until_db) {
            true => Self::reported(bank, rise, at_db),
            false => ReportedRise { rise, by_db: at_db, ..first },
        };
        // The effective threshold drifts while an echo rises: a later evaluation is more accurate.
        let until_db =
            if evaluated.is_lone { self.lost(bank, &evaluated, ready_us) } else { until_db };
        (evaluated, until_db)
    }

    fn candidate(
        &self,
        firing: &FiringArrivals,
        reported: &ReportedRise,
        until_db: f64,
    ) -> ThresholdCandidate {
        let rise = &reported.rise;
        ThresholdCandidate {
            range_m: Some(rise.range_m),
            is_near: rise.status == PingStatus::MinRange,
            arrival: rise.arrival.map(|arrival| firing.arrival(&arrival)),
            until_db,
            spread_db: self.spread_db(reported),
            margin_db: match rise.status {
                PingStatus::Echo => until_db - reported.by_db,
                _ => f64::INFINITY,
            },
            is_of_one: reported.is_of_one(),
        }
    }

    /// Rise detected at a threshold, with the reach of its envelope.
    fn reported(bank: &mut DetectorBank, rise: EchoRise, by_db: f64) -> ReportedRise {
        let (peak, margin_db) = bank.peak(&rise);
        let (reaches_db, is_lone) = (by_db + margin_db.max(0.0), bank.is_isolated());
        ReportedRise { rise, by_db, peak, reaches_db, is_lone }
    }

    /// Returns `true` if the peak of a rise detected up to a threshold is still needed: for its
    /// phase spread, or for higher thresholds.
    fn needs_peak(&self, until_db: f64) -> bool {
        self.receiver.combining == Combining::Incoherent || until_db < self.span_db
    }

    /// Standard deviation of the level due to unknown phases of overlapping arrivals. For two with
    /// amplitude ratio `r` and uniform phases, the level of the sum has 6.1 `r` decibels for small
    /// `r`, and 7.8 for 1.
    fn spread_db(&self, ReportedRise { rise, peak, .. }: &ReportedRise) -> f64 {
        const DB_OF_RATIO: f64 = 6.5;
        if self.receiver.combining != Combining::Incoherent {
            return 0.0;
        }
        let others = rise.arrival.map_or(0.0, |arrival| (peak / arrival.amplitude).powi(2) - 1.0);
        DB_OF_RATIO * others.clamp(0.0, 1.0).sqrt()
    }

    /// Detection limit of a reported rise: the peak of its envelope, unless another arrival follows
    /// so closely that the peak belongs to that one.
    fn lost(&self, bank: &mut DetectorBank, reported: &ReportedRise, ready_us: f64) -> f64 {
        let ReportedRise { by_db: from_db, reaches_db, is_lone, .. } = *reported;
        let span_db = self.span_db;
        if is_lone {
            return (reaches_db - self.min_margin_db).max(from_db);
        }
        let beyond_db = if reaches_db < span_db { reaches_db - STEP_DB } else { span_db };
        if beyond_db <= from_db {
            return reaches_db.min(span_db.max(from_db));
        }
        let mut is_reported = |by_db: f64| self.same_at(bank, reported, by_db, ready_us).is_some();
        match is_reported(beyond_db) {
            true => reaches_db,
            false => last_of(from_db, beyond_db, is_reported),
        }
    }

    /// Returns the first rise at a higher threshold if it is the same as a reported one.
    fn same_at(
        &self,
        bank: &mut DetectorBank,
        reported: &ReportedRise,
        by_db: f64,
        ready_us: f64,
    ) -> Option<EchoRise> {
        /// Margin beyond which a rise is certainly another one, microseconds.
        const SLACK_US: f64 = 1.0;
        let us_per_m = 2e6 / self.receiver.sound_speed_m_s;
        let until_us = reported.rise.passed_us + us_per_m * (JUMP_M + self.max_walk_m) + SLACK_US;
        let rise = bank.first_rise_within(self.factor(by_db), ready_us, until_us)?;
        self.is_same(reported, &rise, by_db).then_some(rise)
    }

    /// Returns `true` if two rises, the second at a higher threshold, are the same rise of the
    /// envelope: of the same arrival, and not later than its time walk. Overlapping arrivals may
    /// fade before the next one continues the envelope; then a slightly higher threshold delays the
    /// echo by centimetres.
    fn is_same(&self, reported: &ReportedRise, higher: &EchoRise, higher_db: f64) -> bool {
        let lower = &reported.rise;
        let is_same_arrival = match (&lower.arrival, &higher.arrival) {
            (Some(a), Some(b)) => (a.length_m - b.length_m).abs() < 1e-6,
            (None, None) => true,
            _ => false,
        };
        if lower.status != higher.status || !is_same_arrival {
            return false;
        }
        let later_m = higher.range_m - lower.range_m;
        if later_m < JUMP_M {
            return true;
        }
        // At its very top a pulse is flat, and its time walk is unbounded.
        let walk_m = |by_db: f64| {
            self.receiver.time_walk_m((reported.reaches_db - by_db).max(MIN_MARGIN_DB))
        };
        later_m - (walk_m(higher_db) - walk_m(reported.by_db)) < JUMP_M
    }

    /// Amplitude factor of a threshold shift in decibels.
    fn factor(&self, by_db: f64) -> f64 {
        let [lowest, highest] = self.ends;
        match by_db / self.span_db {
            -1.0 => lowest,
            1.0 => highest,
            _ => factor(by_db),
        }
    }
}

impl ThresholdCandidate {
    /// Extends the interval to a higher threshold; the range is evaluated there unless only
    /// thresholds above the nominal one report it.
    fn extend(&mut self, until_db: f64, ReportedRise { rise, by_db, .. }: &ReportedRise) {
        let last_db = self.until_db;
        self.until_db = last_db.max(until_db);
        if *by_db <= 0.0 && self.margin_db.is_finite() {
            (self.range_m, self.margin_db) = (Some(rise.range_m), self.until_db - by_db);
        } else {
            self.margin_db += self.until_db - last_db;
        }
    }

    /// Candidate without echo, for all higher thresholds.
    const fn no_echo(until_db: f64) -> Self {
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

/// Bisects the end of a condition between a threshold where it holds and a higher one where it
/// fails.
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
