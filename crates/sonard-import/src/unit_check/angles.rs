//! Statistics of angles, and their likely unit.

/// Maximum magnitude of an angle in radians, with rounding.
pub(super) const MAX_RAD: f64 = std::f64::consts::TAU + 0.02;
/// Minimum span of directions that are checked for radians; a resting ranger has none.
const MIN_SPAN: f64 = 0.05;

/// Statistics of the angles of a column, in its unit.
#[derive(Debug)]
pub(super) struct AngleStats {
    count: u64,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) all_integers: bool,
    /// True if all angles are multiples of pi / 4.
    all_eighths: bool,
    last: f64,
    changes: u64,
    /// First step between angles, and number and sum of the steps that are close to it.
    first_step: f64,
    usual_steps: u64,
    usual_sum: f64,
}

impl Default for AngleStats {
    fn default() -> Self {
        Self {
            count: 0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            all_integers: true,
            all_eighths: true,
            last: 0.0,
            changes: 0,
            first_step: 0.0,
            usual_steps: 0,
            usual_sum: 0.0,
        }
    }
}

impl AngleStats {
    pub(super) fn add(&mut self, angle: f64) {
        let step = angle - self.last;
        if self.count > 0 && step.abs() > 1e-9 {
            self.changes += 1;
            if self.first_step == 0.0 {
                self.first_step = step;
            }
            if (step - self.first_step).abs() <= 0.2 * self.first_step.abs() {
                self.usual_steps += 1;
                self.usual_sum += step;
            }
        }
        self.count += 1;
        self.last = angle;
        self.low = self.low.min(angle);
        self.high = self.high.max(angle);
        self.all_integers &= is_multiple(angle, 1.0, 1e-9);
        self.all_eighths &= is_multiple(angle, std::f64::consts::FRAC_PI_4, 6e-4);
    }

    pub(super) fn max(&self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    fn span(&self) -> f64 {
        self.high - self.low
    }

    /// Mean step of a regular sweep.
    pub(super) fn usual_step(&self) -> Option<f64> {
        let is_regular = self.usual_steps >= 8 && 5 * self.usual_steps >= 4 * self.changes;
        is_regular.then(|| (self.usual_sum / self.usual_steps as f64).abs())
    }

    /// Returns `true` if directions of more than a revolution are steps of a round angle in
    /// radians, and of none in degrees.
    fn turns_in_radians(&self) -> bool {
        let is_round = |step_deg: f64| {
            is_multiple(step_deg, 0.05, 0.004)
                || (step_deg > 0.09 && is_multiple(360.0 / step_deg, 1.0, 0.01))
        };
        !self.all_integers
            && self.usual_step().is_some_and(|step| !is_round(step) && is_round(step.to_degrees()))
    }

    /// Returns `true` if angles in degrees are more likely radians: decimals within a revolution.
    pub(super) fn directions_look_like_radians(&self) -> bool {
        let is_within = self.max() <= MAX_RAD && !self.all_integers && self.span() > MIN_SPAN;
        is_within || (self.max() > MAX_RAD && self.turns_in_radians())
    }

    /// Returns `true` if headings in degrees are more likely radians: they turn far, or are
    /// fractions of pi. A robot that drives straight has small headings in degrees.
    pub(super) fn headings_look_like_radians(&self) -> bool {
        let is_turning = self.changes >= 2 && self.span() > 1.0;
        let is_fraction = self.all_eighths && self.max() > 0.5;
        self.max() <= MAX_RAD && !self.all_integers && (is_turning || is_fraction)
    }
}

/// Returns `true` if a number is a multiple of a unit, within a tolerance.
fn is_multiple(number: f64, unit: f64, tolerance: f64) -> bool {
    (number - (number / unit).round() * unit).abs() < tolerance
}
