//! Other places to begin from: a fit ends in the next best explanation, which need not be the best.
//!
//! Where readings hold something little, a fit may go past the answer and settle where other arrivals explain the same
//! readings about as well: a weak echo that is told late for one of a path that is shorter, a wall for the next. So the
//! directions that are held least are searched beside where it ended. What is likelier there is followed, and what
//! is nearly as likely widens the intervals.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::{
    FitError, Search, Settled, State,
    journal::{Found, listed},
    one_of_many,
    polish::FAR_BELOW,
    settle::STAGES,
};
use crate::{
    candidates::Phases,
    likelihood::{ErrorModel, READINGS_OF_ARC},
    watch::Progress,
};

/// Directions that are searched.
const DIRECTIONS: usize = 2;
/// Places on each side, and how far apart, in standard deviations of what a rough look leaves in doubt.
const PLACES: (i32, f64) = (6, 0.5);
/// A rough look: spread of ranges, metres, of the threshold, decibels, and the share of clutter.
pub(super) const ROUGH: (f64, f64, f64) = (0.03, 3.0, 0.05);
/// A close one, by which places are told apart.
pub(super) const CLOSE: (f64, f64, f64) = (0.005, 1.5, 0.03);
/// Directions of less doubt than this share of what was believed are held well enough.
const LEAST_SHARE: f64 = 0.1;
/// Places that are followed to their ends, and the stage that these begin with.
const FOLLOWED: usize = 2;
const STAGE: usize = STAGES.len() - 1;
/// Places from which a thorough fit goes on to where it ends, how many of them are left by way of that stage, too, and how
/// many of these ends are polished.
const ENDS: usize = 8;
const STAGED: usize = 2;
const POLISHED: usize = 3;
/// Ends from elsewhere that are polished where a sweep heard little.
const POLISHED_OPEN: usize = 6;

/// Somewhere beside the end of a fit.
pub(super) struct Place {
    pub(super) values: DVector<f64>,
    /// Log-posterior with spreads by which places are told apart.
    pub(super) value: f64,
}

impl Settled {
    fn place(&self) -> Place {
        Place { values: self.values.clone(), value: self.value }
    }
}

impl State<'_> {
    /// The likeliest end of all beginnings, and what the other places add to the variances of its values. Where there
    /// is nothing to predict, as within a wall, there is no other beginning.
    pub(super) fn likeliest(&mut self) -> Result<(Settled, DVector<f64>), FitError> {
        let mut best = self.attempt(self.still(), 0)?;
        let mut seen: Vec<Place> = vec![best.place()];
        if self.is_astray(&best) || self.hears_little() {
            let mut ends = self.ends_from_elsewhere()?;
            ends.sort_by(|one, other| other.value.total_cmp(&one.value));
            for (number, end) in ends.into_iter().enumerate() {
                seen.push(end.place());
                if number < POLISHED_OPEN && self.hears_little() {
                    keep_likelier(&mut best, one_of_many(self.polished(end))?);
                } else {
                    keep_likelier(&mut best, Some(end));
                }
            }
        }
        if self.fit.search == Search::Quick {
            let places = self.places(&best)?;
            for place in places.iter().take(FOLLOWED) {
                keep_likelier(&mut best, one_of_many(self.attempt(place.values.clone(), STAGE))?);
            }
            let beside = self.beside(&best, &places)?;
            return Ok((best, beside));
        }
        best = self.polished(best)?;
        let places = self.places(&best)?;
        for end in self.ends(&best, &places)? {
            if end.value > best.value - FAR_BELOW {
                seen.push(end.place());
                keep_likelier(&mut best, one_of_many(self.polished(end))?);
            }
        }
        best = self.along_ridges(best)?;
        let beside = self.beside_thoroughly(&best, &places, &seen)?;
        Ok((best, beside))
    }

    /// Where fits end that begin in some places: the likeliest, each once.
    fn ends(&mut self, best: &Settled, places: &[Place]) -> Result<Vec<Settled>, FitError> {
        let close = widened(&best.errors, CLOSE);
        let mut tried: Vec<Settled> = Vec::new();
        for (number, place) in places.iter().take(ENDS).enumerate() {
            (self.values, self.phases) = (place.values.clone(), Phases::Unknown);
            let end = self.settled(close).and_then(|end| self.with_phases(end));
            tried.extend(one_of_many(end)?);
            if number < STAGED {
                tried.extend(one_of_many(self.attempt(place.values.clone(), STAGE))?);
            }
        }
        tried.sort_by(|one, other| other.value.total_cmp(&one.value));
        let mut ends: Vec<Settled> = Vec::new();
        for end in tried {
            let is_apart = |other: &Settled| self.is_apart(&end.values, &other.values);
            if ends.iter().chain([best]).all(is_apart) {
                ends.push(end);
            }
        }
        ends.truncate(POLISHED);
        Ok(ends)
    }

    /// Where a fit ends that begins there, with the spreads from this stage on.
    pub(super) fn attempt(
        &mut self,
        start: DVector<f64>,
        stage: usize,
    ) -> Result<Settled, FitError> {
        (self.values, self.phases) = (start, Phases::Unknown);
        let mut errors = self.rough_errors();
        errors.sigma_m *= STAGES[stage].0;
        self.approach(&mut errors, stage..STAGES.len())?;
        self.settle(errors)
    }

    /// Places along the directions that are held least beside where a fit ended, each improved; the likeliest first, and
    /// one of those that are the same.
    fn places(&mut self, end: &Settled) -> Result<Vec<Place>, FitError> {
        let close = widened(&end.errors, CLOSE);
        let (places, apart) = PLACES;
        let mut tried: Vec<Place> = Vec::new();
        let doubtful = self.doubtful(&end.values, &widened(&end.errors, ROUGH), Phases::Unknown)?;
        let (mut number, of) = (0, doubtful.len() * 2 * places as usize);
        for (direction, sigma) in doubtful {
            for place in (-places..=places).filter(|place| *place != 0) {
                number += 1;
                let by = f64::from(place) * apart * sigma;
                let start = self.limited(&end.values + by * &direction);
                tried.extend(self.place(start, &close, (number, of))?);
            }
        }
        Ok(self.distinct(tried, &[&end.values]))
    }

    /// A place that is improved, which of so many; nothing if there is nothing to predict with.
    pub(super) fn place(
        &mut self,
        start: DVector<f64>,
        errors: &ErrorModel,
        (place, of): (usize, usize),
    ) -> Result<Option<Place>, FitError> {
        self.place_by(|state| {
            state.watch.progress(Progress::Searching { place, of });
            state.improved(start, errors)
        })
    }

    /// The place that a search comes to; nothing if there is nothing to predict with.
    pub(super) fn place_by(
        &mut self,
        search: impl FnOnce(&mut Self) -> Result<Found, FitError>,
    ) -> Result<Option<Place>, FitError> {
        match one_of_many(self.found(search))? {
            None => Ok(None),
            Some(Found::Place { values, log_posterior: value }) => {
                Ok(Some(Place { values: DVector::from_vec(values), value }))
            }
            Some(_) => Err(FitError::OtherFit),
        }
    }

    /// Places that are apart from each other and from those known, the likeliest first.
    pub(super) fn distinct(&self, mut tried: Vec<Place>, known: &[&DVector<f64>]) -> Vec<Place> {
        tried.sort_by(|one, other| other.value.total_cmp(&one.value));
        let mut places: Vec<Place> = Vec::new();
        for place in tried {
            let known = places.iter().map(|other| &other.values).chain(known.iter().copied());
            if known.into_iter().all(|other| self.is_apart(&place.values, other)) {
                places.push(place);
            }
        }
        places
    }

    /// Where it is likelier near a place.
    fn improved(&mut self, start: DVector<f64>, errors: &ErrorModel) -> Result<Found, FitError> {
        self.values = start;
        for _ in 0..2 {
            let linear = self.linear()?;
            self.improve(&linear, errors)?;
        }
        let linear = self.linear()?;
        let log_posterior = self.value(&linear, errors);
        Ok(Found::Place { values: listed(&self.values), log_posterior })
    }

    /// What variances gain because the values may be those of other places, which explain the readings nearly as
    /// well.
    fn beside(&mut self, best: &Settled, places: &[Place]) -> Result<DVector<f64>, FitError> {
        (self.values, self.phases) = (best.values.clone(), Phases::Unknown);
        let linear = self.linear()?;
        let of_best = self.value(&linear, &widened(&best.errors, CLOSE));
        let others = places.iter().map(|place| (&place.values, odds(place.value, of_best)));
        Ok(self.spread_of(best, others.collect()))
    }

    /// As `beside`, of a thorough fit: other ends count, too, and each place once.
    fn beside_thoroughly(
        &mut self,
        best: &Settled,
        places: &[Place],
        ends: &[Place],
    ) -> Result<DVector<f64>, FitError> {
        (self.values, self.phases) = (best.values.clone(), Phases::Unknown);
        let close = widened(&best.errors, CLOSE);
        let linear = self.linear()?;
        let of_best = self.value(&linear, &close);
        // What is best with the spreads that readings have need not be so with wider ones: what is near it is the same place.
        let home = match one_of_many(self.improved(best.values.clone(), &close))? {
            Some(Found::Place { values, log_posterior }) if log_posterior > of_best => {
                Place { values: DVector::from_vec(values), value: log_posterior }
            }
            _ => Place { values: best.values.clone(), value: of_best },
        };
        let places = places.iter().map(|place| (place, home.value));
        let ends = ends.iter().map(|end| (end, best.value));
        let mut others: Vec<(&DVector<f64>, f64)> = Vec::new();
        for (place, of) in places.chain(ends) {
            let known = others.iter().map(|(values, _)| *values);
            let mut known = known.chain([&home.values, &best.values]);
            if known.all(|known| self.is_apart(&place.values, known)) {
                others.push((&place.values, odds(place.value, of)));
            }
        }
        Ok(self.spread_of(best, others))
    }

    /// Variances about the best of other values with their odds.
    fn spread_of(&self, best: &Settled, others: Vec<(&DVector<f64>, f64)>) -> DVector<f64> {
        let all: f64 = 1.0 + others.iter().map(|(_, odds)| odds).sum::<f64>();
        let mut beside = self.still();
        for (values, odds) in others {
            let away = values - &best.values;
            beside += away.component_mul(&away) * (odds / all);
        }
        beside
    }

    /// The directions, in the parameters' units, in which readings that spread so much leave the most in doubt beside
    /// what was believed, with the standard deviation in each.
    pub(super) fn doubtful(
        &mut self,
        about: &DVector<f64>,
        errors: &ErrorModel,
        phases: Phases,
    ) -> Result<Vec<(DVector<f64>, f64)>, FitError> {
        (self.values, self.phases) = (about.clone(), phases);
        let curve = self.linear()?.curve(&self.still(), errors);
        let covariance = self.covariance(curve.information).ok_or(FitError::Degenerate)?;
        let sigmas = self.prior_sigmas();
        let believed = DMatrix::from_diagonal(&sigmas.map(f64::recip));
        let of = SymmetricEigen::new(&believed * covariance * &believed);
        let mut order: Vec<usize> = (0..sigmas.len()).collect();
        order.sort_by(|one, other| of.eigenvalues[*other].total_cmp(&of.eigenvalues[*one]));
        order.retain(|&at| of.eigenvalues[at] > LEAST_SHARE * LEAST_SHARE);
        let direction = |at: usize| {
            (of.eigenvectors.column(at).component_mul(&sigmas), of.eigenvalues[at].sqrt())
        };
        Ok(order.into_iter().take(DIRECTIONS).map(direction).collect())
    }

    pub(super) fn prior_sigmas(&self) -> DVector<f64> {
        DVector::from_iterator(
            self.fit.priors.len(),
            self.fit.priors.iter().map(|prior| prior.sigma),
        )
    }

    pub(super) fn limited(&self, mut values: DVector<f64>) -> DVector<f64> {
        for (value, parameter) in values.iter_mut().zip(&self.parameters) {
            let (least, most) = self.start.limits(parameter);
            *value = value.clamp(least, most);
        }
        values
    }

    /// Whether a fit from one of two places would hardly end as from the other.
    pub(super) fn is_apart(&self, one: &DVector<f64>, other: &DVector<f64>) -> bool {
        (one - other).component_div(&self.prior_sigmas()).amax() > 0.5 * LEAST_SHARE
    }
}

/// Of a place, beside another one that is as likely as `of` or more; at most one.
fn odds(value: f64, of: f64) -> f64 {
    ((value - of) / READINGS_OF_ARC).min(0.0).exp()
}

pub(super) fn widened(
    errors: &ErrorModel,
    (sigma_m, sigma_db, clutter): (f64, f64, f64),
) -> ErrorModel {
    ErrorModel {
        sigma_m: errors.sigma_m.max(sigma_m),
        sigma_db: errors.sigma_db.max(sigma_db),
        clutter: errors.clutter.max(clutter),
        ..*errors
    }
}

pub(super) fn keep_likelier(best: &mut Settled, end: Option<Settled>) {
    if let Some(end) = end
        && end.value > best.value
    {
        *best = end;
    }
}
