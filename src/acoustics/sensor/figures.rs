//! Checks of single figures.

use super::SensorError;

pub(super) fn positive(field: &'static str, value: f64) -> Result<(), SensorError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(SensorError::Figure { field, value, expected: "a finite number greater than 0" })
    }
}

pub(super) fn within_half_turn(
    field: &'static str,
    value: f64,
    from: f64,
) -> Result<(), SensorError> {
    if (from..=180.0).contains(&value) {
        Ok(())
    } else {
        let expected = "up to 180 degrees, and none_beyond_deg at least full_within_deg";
        Err(SensorError::Figure { field, value, expected })
    }
}

pub(super) fn not_negative(field: &'static str, value: f64) -> Result<(), SensorError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(SensorError::Figure { field, value, expected: "a finite number, 0 or more" })
    }
}

pub(super) fn within(
    field: &'static str,
    value: f64,
    most: f64,
    expected: &'static str,
) -> Result<(), SensorError> {
    if value.abs() <= most { Ok(()) } else { Err(SensorError::Figure { field, value, expected }) }
}

pub(super) fn at_most_1(field: &'static str, value: f64) -> Result<(), SensorError> {
    if (0.0..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(SensorError::Figure { field, value, expected: "from 0 to 1" })
    }
}
