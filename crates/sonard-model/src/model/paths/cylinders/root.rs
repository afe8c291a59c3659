//! Zeros of monotone functions.

/// Steps at most; ten are usual.
const MOST_STEPS: usize = 100;

/// Zero of a monotone function between two arguments where it has the values `at_ends`, whose signs
/// differ (else the end that is closer to zero), to within `exact` of the function. `f` gives value
/// and slope: Newton's method, kept between the arguments by halving.
///
/// Invariant: the zero lies between `low` and `high`, at which the function has opposite signs; both only
/// approach each other.
pub(crate) fn zero_between(
    [mut low, mut high]: [f64; 2],
    at_ends: [f64; 2],
    exact: f64,
    mut f: impl FnMut(f64) -> (f64, f64),
) -> f64 {
    let [at_low, at_high] = at_ends;
    if (at_low < 0.0) == (at_high < 0.0) {
        return if at_low.abs() <= at_high.abs() { low } else { high };
    }
    let mut at = (low * at_high - high * at_low) / (at_high - at_low);
    for _ in 0..MOST_STEPS {
        if !(low < at && at < high) {
            at = 0.5 * (low + high);
            if at <= low || at >= high {
                break;
            }
        }
        let (here, slope) = f(at);
        if here.abs() < exact {
            break;
        }
        if (here < 0.0) == (at_low < 0.0) {
            low = at;
        } else {
            high = at;
        }
        let next = at - here / slope;
        if (next - at).abs() <= f64::EPSILON * at.abs() {
            break;
        }
        at = next;
    }
    at
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn zeros_are_found_in_few_steps() {
        let asked = Cell::new(0);
        let cubic = |x: f64| {
            asked.set(asked.get() + 1);
            (x.powi(3) - 2.0, 3.0 * x * x)
        };
        let found = zero_between([0.0, 2.0], [-2.0, 6.0], 1e-13, cubic);
        assert!((found - 2_f64.cbrt()).abs() < 1e-13, "{found}");
        assert!(asked.get() <= 10, "{} steps", asked.get());
        // One that falls, and whose slope leads astray: halving keeps it between the ends.
        let falls =
            |x: f64| (-(40.0 * (x - 0.3)).atan(), -40.0 / (1.0 + (40.0 * (x - 0.3)).powi(2)));
        let found = zero_between([0.0, 1.0], [falls(0.0).0, falls(1.0).0], 1e-12, falls);
        assert!((found - 0.3).abs() < 1e-12, "{found}");
    }

    #[test]
    fn without_a_change_of_sign_it_is_the_end_nearer_to_zero() {
        let never = |_: f64| -> (f64, f64) { panic!("nothing to look for") };
        assert_eq!(zero_between([1.0, 2.0], [0.5, 3.0], 1e-9, never), 1.0);
        assert_eq!(zero_between([1.0, 2.0], [-3.0, -0.5], 1e-9, never), 2.0);
    }
}
