//! Numbers on the command line, within what makes sense.

use std::ops::RangeInclusive;

/// More makes no sense of any quantity that is given here.
const MOST: f64 = 1e6;

/// A number within a range, as clap parses it.
pub(super) fn within(
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let value = text.parse::<f64>().ok().filter(|value| range.contains(value));
        value.ok_or_else(|| format!("give a number {}", words(&range)))
    }
}

/// More than nothing.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    within(f64::MIN_POSITIVE..=MOST)(text)
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    within(0.0..=MOST)(text)
}

pub(super) fn probability(text: &str) -> Result<f64, String> {
    within(0.0..=1.0)(text)
}

fn words(range: &RangeInclusive<f64>) -> String {
    let (least, most) = (range.start(), range.end());
    match *least {
        f64::MIN_POSITIVE => format!("greater than 0, at most {most}"),
        _ => format!("from {least} to {most}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_told_what_would_do() {
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
