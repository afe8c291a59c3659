//! Parsers of bounded numbers for options.

use std::ops::RangeInclusive;

/// Upper bound of positive numbers without a bound of their own.
const MAX: f64 = 1e6;

/// Parser of a number within a range.
pub(super) fn within(
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let value = text.parse::<f64>().ok().filter(|value| range.contains(value));
        value.ok_or_else(|| format!("give a number {}", describe(&range)))
    }
}

/// Parser of a number greater than 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    within(f64::MIN_POSITIVE..=MAX)(text)
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    within(0.0..=MAX)(text)
}

pub(super) fn probability(text: &str) -> Result<f64, String> {
    within(0.0..=1.0)(text)
}

fn describe(range: &RangeInclusive<f64>) -> String {
    let (min, max) = (range.start(), range.end());
    match *min {
        f64::MIN_POSITIVE => format!("greater than 0, at most {max}"),
        _ => format!("from {min} to {max}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_with_the_valid_range() {
        for (parsed, expected) in [
            (within(0.01..=2.0)("0.5"), Ok(0.5)),
            (within(0.01..=2.0)("3"), Err("give a number from 0.01 to 2")),
            (within(0.01..=2.0)("wide"), Err("give a number from 0.01 to 2")),
            (positive("0"), Err("give a number greater than 0, at most 1000000")),
            (not_negative("0"), Ok(0.0)),
            (not_negative("inf"), Err("give a number from 0 to 1000000")),
            (probability("NaN"), Err("give a number from 0 to 1")),
        ] {
            assert_eq!(parsed, expected.map_err(str::to_owned));
        }
    }
}
