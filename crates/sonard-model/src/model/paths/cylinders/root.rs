//! Zeros of monotone functions.

/// Evaluates the cubic (Hermite) with these values and slopes at two arguments.
pub(crate) fn cubic([from, to]: [f64; 2], values: [f64; 2], slopes: [f64; 2], at: f64) -> f64 {
    let width = to - from;
    let share = (at - from) / width;
    let rest = 1.0 - share;
    let straight = values[0] + share * (values[1] - values[0]);
    let rise = values[1] - values[0];
    let bends = rest * (width * slopes[0] - rise) - share * (width * slopes[1] - rise);
    straight + share * rest * bends
}

/// An end of the interval in which a zero is searched.
#[derive(Debug, Clone, Copy)]
pub(crate) struct End {
    pub(crate) at: f64,
    /// Value and slope of the function at `at`.
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

/// Approximate zero of a monotone function, by the cubic of its inverse.
pub(crate) fn zero_near([from, to]: [End; 2]) -> f64 {
    cubic_zero([from, to])
        .unwrap_or_else(|| (from.at * to.value - to.at * from.value) / (to.value - from.value))
}

/// Zero of the cubic of the inverse function; `None` if it is not between the ends.
fn cubic_zero([from, to]: [End; 2]) -> Option<f64> {
    let slopes = [from.slope.recip(), to.slope.recip()];
    let near = cubic([from.value, to.value], [from.at, to.at], slopes, 0.0);
    (from.at < near && near < to.at).then_some(near)
}

/// Maximum number of steps; ten are usual.
const MAX_STEPS: usize = 100;

/// Finds the zero of a monotone function between two arguments with values of opposite sign
/// (otherwise returns the end that is closer to zero), to within `exact` of the function. `f`
/// returns value and slope. Each step approximates the inverse function by a cubic through both
/// arguments, which converges faster than Newton's method, then by Newton's method or bisection.
///
/// Invariant: the zero lies between `low` and `high`, at which the function has opposite signs;
/// both only approach each other.
pub(crate) fn zero_between(
    ends: [End; 2],
    exact: f64,
    mut f: impl FnMut(f64) -> (f64, f64),
) -> f64 {
    let [mut low, mut high] = ends;
    let falls = high.value < 0.0;
    if (low.value < 0.0) == falls {
        return if low.value.abs() <= high.value.abs() { low.at } else { high.at };
    }
    let mut at = zero_near(ends);
    for _ in 0..MAX_STEPS {
        if !(low.at < at && at < high.at) {
            at = 0.5 * (low.at + high.at);
            if at <= low.at || at >= high.at {
                break;
            }
        }
        let (here, slope) = f(at);
        if here.abs() < exact {
            break;
        }
        let end = if (here < 0.0) == falls { &mut high } else { &mut low };
        *end = End { at, value: here, slope };
        let next = cubic_zero([low, high]).unwrap_or(at - here / slope);
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

    fn ends(at: [f64; 2], f: impl Fn(f64) -> (f64, f64)) -> [End; 2] {
        at.map(|at| {
            let (value, slope) = f(at);
            End { at, value, slope }
        })
    }

    #[test]
    fn cubic_interpolates_its_ends() {
        let of = |x: f64| 2.0 * x.powi(3) - x * x + 3.0;
        let slope = |x: f64| 6.0 * x * x - 2.0 * x;
        let (at, values, slopes) = ([-1.0, 2.0], [-1.0, 2.0].map(of), [-1.0, 2.0].map(slope));
        for x in [-1.0, -0.3, 0.0, 1.1, 2.0] {
            assert!((cubic(at, values, slopes, x) - of(x)).abs() < 1e-12, "{x}");
        }
        // A cubic that leaves its ends is replaced by the straight line.
        let steep =
            [End { at: 0.0, value: -1.0, slope: 1e-3 }, End { at: 1.0, value: 1.0, slope: 1.0 }];
        assert_eq!(zero_near(steep), 0.5);
    }

    #[test]
    fn zeros_take_few_steps() {
        let calls = Cell::new(0);
        let cube = |x: f64| {
            calls.set(calls.get() + 1);
            (x.powi(3) - 2.0, 3.0 * x * x)
        };
        let found = zero_between(ends([0.0, 2.0], cube), 1e-13, cube);
        assert!((found - 2_f64.cbrt()).abs() < 1e-13, "{found}");
        assert!(calls.get() <= 12, "{} steps", calls.get());
        // A falling function, whose slope is misleading: bisection keeps the zero between the ends.
        let falls =
            |x: f64| (-(40.0 * (x - 0.3)).atan(), -40.0 / (1.0 + (40.0 * (x - 0.3)).powi(2)));
        let found = zero_between(ends([0.0, 1.0], falls), 1e-12, falls);
        assert!((found - 0.3).abs() < 1e-12, "{found}");
    }

    #[test]
    fn no_sign_change_returns_nearer_end() {
        let never = |_: f64| -> (f64, f64) { panic!("nothing to look for") };
        let of = |value: f64| move |_: f64| (value, 1.0);
        let [a, _] = ends([1.0, 2.0], of(0.5));
        let [low, _] = ends([1.0, 2.0], of(-3.0));
        let [[_, far], [_, near]] = [3.0, -0.5].map(|value| ends([1.0, 2.0], of(value)));
        assert_eq!(zero_between([a, far], 1e-9, never), 1.0);
        assert_eq!(zero_between([low, near], 1e-9, never), 2.0);
    }
}
