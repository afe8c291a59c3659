//! Radiating face of a sensor.

use std::f64::consts::{FRAC_PI_2, PI};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    SensorError,
    figures::{not_positive, positive, within_half_turn},
};
use crate::geometry::wrap_pi;

/// Shape of the radiating face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Aperture {
    /// Circular piston in a baffle.
    Piston {
        /// Radius of the piston, metres.
        radius_m: f64,
        /// Side-lobe floor: one-way amplitude relative to the axis, decibels, times the cosine of
        /// the angle. Real faces radiate and receive more far off the axis than a piston's side
        /// lobes (mount, housing, rim). Its power adds to the piston's.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        skirts_db: Option<f64>,
    },
    /// Line aperture in the scan plane.
    Line {
        /// Half length of the line, metres.
        half_length_m: f64,
        /// Full amplitude up to this angle from the axis, degrees.
        #[serde(default = "right_angle_deg")]
        full_within_deg: f64,
        /// Zero amplitude beyond this angle, with a raised-cosine slope between the two, degrees.
        #[serde(default = "right_angle_deg")]
        none_beyond_deg: f64,
    },
    /// One-way amplitude `exp(-2 theta^2 / theta_o^2)` (Bozma and Kuc, equation 3).
    Gaussian {
        /// Half beam angle `theta_o`, degrees.
        half_angle_deg: f64,
        /// Radius of the face, metres; does not determine the beam.
        radius_m: f64,
    },
    /// Measured pattern: linear interpolation of decibels over degrees.
    Table {
        /// Points from 0 degrees and 0 decibels outwards.
        points: Vec<BeamPoint>,
        /// Radius of the face, metres; does not determine the beam.
        radius_m: f64,
    },
}

/// Point of a measured beam pattern.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BeamPoint {
    /// Angle from the axis, degrees.
    pub angle_deg: f64,
    /// One-way amplitude relative to the axis, decibels. `null` (zero amplitude) is allowed at the
    /// last point only; the amplitude falls linearly towards it.
    pub level_db: Option<f64>,
}

impl Aperture {
    /// Projected share of the face at an angle from its axis, radians: `cos` for a disc (Kuc and
    /// Siegel), the window of a line; 0 behind.
    #[must_use]
    pub fn obliquity(&self, theta_rad: f64) -> f64 {
        let theta_rad = wrap_pi(theta_rad).abs();
        match *self {
            Self::Piston { .. } => theta_rad.cos().max(0.0),
            Self::Line { full_within_deg, none_beyond_deg, .. } => {
                let theta_deg = theta_rad.to_degrees();
                if theta_deg <= full_within_deg {
                    1.0
                } else if theta_deg >= none_beyond_deg {
                    0.0
                } else {
                    let part = (theta_deg - full_within_deg) / (none_beyond_deg - full_within_deg);
                    0.5 * (1.0 + (PI * part).cos())
                }
            }
            Self::Gaussian { .. } => f64::from(u8::from(theta_rad < FRAC_PI_2)),
            Self::Table { ref points, .. } => {
                f64::from(u8::from(theta_rad.to_degrees() < outermost_deg(points)))
            }
        }
    }

    pub(super) fn check(&self) -> Result<(), SensorError> {
        match *self {
            Self::Piston { radius_m, skirts_db } => {
                positive("aperture.radius_m", radius_m)?;
                skirts_db.map_or(Ok(()), |level_db| not_positive("aperture.skirts_db", level_db))
            }
            Self::Line { half_length_m, full_within_deg, none_beyond_deg } => {
                positive("aperture.half_length_m", half_length_m)?;
                within_half_turn("aperture.full_within_deg", full_within_deg, 0.0)?;
                within_half_turn("aperture.none_beyond_deg", none_beyond_deg, full_within_deg)
            }
            Self::Gaussian { half_angle_deg, radius_m } => {
                positive("aperture.half_angle_deg", half_angle_deg)?;
                positive("aperture.radius_m", radius_m)
            }
            Self::Table { ref points, radius_m } => {
                check_points(points)?;
                positive("aperture.radius_m", radius_m)
            }
        }
    }
}

fn check_points(points: &[BeamPoint]) -> Result<(), SensorError> {
    let wrong = |field, value, expected| Err(SensorError::OutOfRange { field, value, expected });
    let (angle, level) = ("aperture.points.angle_deg", "aperture.points.level_db");
    if points.len() < 2 {
        return wrong("aperture.points (how many)", points.len() as f64, "at least two");
    }
    let mut last_deg = -1.0;
    for (i, point) in points.iter().enumerate() {
        let is_last = i + 1 == points.len();
        if !(point.angle_deg > last_deg && point.angle_deg <= 180.0) {
            return wrong(angle, point.angle_deg, "farther out than the point before, up to 180");
        }
        last_deg = point.angle_deg;
        match point.level_db {
            None if is_last => {}
            Some(level_db) if !is_last && i > 0 => not_positive(level, level_db)?,
            Some(0.0) if i == 0 && point.angle_deg == 0.0 => {}
            other => {
                let expected = "0 at 0 degrees, and null at the last point only";
                return wrong(level, other.unwrap_or(f64::NAN), expected);
            }
        }
    }
    Ok(())
}

/// Angle at which a measured pattern ends, degrees.
fn outermost_deg(points: &[BeamPoint]) -> f64 {
    points.last().map_or(0.0, |point| point.angle_deg)
}

/// One-way amplitude of a tabulated pattern at an angle from the axis, radians from 0 to pi.
pub(in crate::acoustics) fn level_at(points: &[BeamPoint], theta_rad: f64) -> f64 {
    let theta_deg = theta_rad.to_degrees();
    let after = points.partition_point(|point| point.angle_deg <= theta_deg);
    let (Some(low), Some(high)) =
        (after.checked_sub(1).and_then(|at| points.get(at)), points.get(after))
    else {
        return 0.0;
    };
    let part = (theta_deg - low.angle_deg) / (high.angle_deg - low.angle_deg);
    let amplitude = |level_db: f64| 10f64.powf(level_db / 20.0);
    match (low.level_db, high.level_db) {
        (Some(from_db), Some(to_db)) => amplitude(from_db + part * (to_db - from_db)),
        (Some(from_db), None) => (1.0 - part) * amplitude(from_db),
        (None, _) => 0.0,
    }
}

const fn right_angle_deg() -> f64 {
    90.0
}
