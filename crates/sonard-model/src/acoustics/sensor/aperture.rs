//! The radiating face.

use std::f64::consts::{FRAC_PI_2, PI};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    SensorError,
    figures::{positive, within_half_turn},
};
use crate::geometry::wrap_pi;

/// Shape of the radiating face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Aperture {
    /// Circular piston in a baffle.
    Piston {
        /// Radius, metres.
        radius_m: f64,
    },
    /// Line aperture in the plane of the scan.
    Line {
        /// Half length, metres.
        half_length_m: f64,
        /// Full strength up to this angle from the axis, degrees.
        #[serde(default = "right_angle_deg")]
        full_within_deg: f64,
        /// Nothing beyond this angle, with a cosine's slope between the two, degrees.
        #[serde(default = "right_angle_deg")]
        none_beyond_deg: f64,
    },
    /// Amplitude `exp(-2 theta^2 / theta_o^2)` one way (Bozma and Kuc, equation 3).
    Gaussian {
        /// Half beam angle `theta_o`, degrees.
        half_angle_deg: f64,
        /// Radius of the face, metres; the beam does not follow from it.
        radius_m: f64,
    },
}

impl Aperture {
    /// Share of the face that is seen at an angle from its axis, radians: `cos` for a disc (Kuc and
    /// Siegel), the line's own window; 0 behind.
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
        }
    }

    pub(super) fn check(&self) -> Result<(), SensorError> {
        match *self {
            Self::Piston { radius_m } => positive("aperture.radius_m", radius_m),
            Self::Line { half_length_m, full_within_deg, none_beyond_deg } => {
                positive("aperture.half_length_m", half_length_m)?;
                within_half_turn("aperture.full_within_deg", full_within_deg, 0.0)?;
                within_half_turn("aperture.none_beyond_deg", none_beyond_deg, full_within_deg)
            }
            Self::Gaussian { half_angle_deg, radius_m } => {
                positive("aperture.half_angle_deg", half_angle_deg)?;
                positive("aperture.radius_m", radius_m)
            }
        }
    }
}

const fn right_angle_deg() -> f64 {
    90.0
}
