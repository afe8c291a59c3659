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
    f: impl Fn(f64) -> (f64, f64),
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
