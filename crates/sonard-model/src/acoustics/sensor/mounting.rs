//! Mounting position of a transducer.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{SensorError, figures::within};
use crate::geometry::DVec2;

/// Position of the transducer relative to the rotation axis, with which it rotates.
///
/// Ranges are half the path length, measured from the face or from the midpoint between transmitter
/// and receiver. An obstacle straight ahead is `ahead_m` farther from the axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mounting {
    /// Forward offset of the face's centre from the axis, metres.
    pub ahead_m: f64,
    /// Left offset of the face's centre from the axis, metres.
    pub left_m: f64,
    /// Distance between the centres of separate transmitter and receiver, metres, with the
    /// transmitter on the left. 0 for a common transducer.
    pub separation_m: f64,
    /// Height of the centre in a scene with heights, metres.
    pub z_m: Option<f64>,
    /// Upward tilt of the axis, degrees.
    pub tilt_deg: f64,
}

impl Mounting {
    /// Positions of transmitter and receiver for a rotation axis at `axis` and a beam in
    /// `direction_rad`.
    #[must_use]
    pub fn transducer_positions(&self, axis: DVec2, direction_rad: f64) -> [DVec2; 2] {
        let turn = DVec2::from_angle(direction_rad);
        [0.5, -0.5].map(|side| {
            let left_m = self.left_m + side * self.separation_m;
            axis + turn.rotate(DVec2::new(self.ahead_m, left_m))
        })
    }

    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns `true` for a single transducer on the axis itself, whose position does not depend on
    /// rotation.
    #[must_use]
    pub fn is_on_axis(&self) -> bool {
        self.ahead_m == 0.0 && self.left_m == 0.0 && self.separation_m == 0.0
    }

    pub(super) fn check(&self) -> Result<(), SensorError> {
        let Self { ahead_m, left_m, separation_m, z_m, tilt_deg } = *self;
        within("mounting.ahead_m", ahead_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.left_m", left_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.separation_m", separation_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.z_m", z_m.unwrap_or(0.0), 1000.0, "from -1000 to 1000 metres")?;
        within("mounting.tilt_deg", tilt_deg, 90.0, "from -90 to 90 degrees")
    }
}
