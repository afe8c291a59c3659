//! Range checks of single values.

use super::SensorError;

pub(super) fn positive(field: &'static str, value: f64) -> Result<(), SensorError> {
    hold(value.is_finite() && value > 0.0, field, value, "a finite number greater than 0")
}

pub(super) fn within_half_turn(
    field: &'static str,
    value: f64,
    from: f64,
) -> Result<(), SensorError> {
    let expected = "up to 180 degrees, and none_beyond_deg at least full_within_deg";
    hold((from..=180.0).contains(&value), field, value, expected)
}

pub(super) fn not_negative(field: &'static str, value: f64) -> Result<(), SensorError> {
    hold(value.is_finite() && value >= 0.0, field, value, "a finite number, 0 or more")
}

pub(super) fn not_positive(field: &'static str, value: f64) -> Result<(), SensorError> {
    hold(value.is_finite() && value <= 0.0, field, value, "a finite number, 0 or less")
}

pub(super) fn within(
    field: &'static str,
    value: f64,
    max: f64,
    expected: &'static str,
) -> Result<(), SensorError> {
    hold(value.abs() <= max, field, value, expected)
}

pub(super) fn from_0_to(field: &'static str, value: f64, max: f64) -> Result<(), SensorError> {
    let expected = if max > 1.0 { "from 0 to 100" } else { "from 0 to 1" };
    hold((0.0..=max).contains(&value), field, value, expected)
}

pub(super) fn at_most_1(field: &'static str, value: f64) -> Result<(), SensorError> {
    hold((0.0..=1.0).contains(&value), field, value, "from 0 to 1")
}

fn hold(
    holds: bool,
    field: &'static str,
    value: f64,
    expected: &'static str,
) -> Result<(), SensorError> {
    if holds { Ok(()) } else { Err(SensorError::OutOfRange { field, value, expected }) }
}
