//! Settings of the search: what counts as an echo path.

use crate::acoustics::edge::EdgeLaw;

/// Usual [`Settings::repeated_contacts_above`]: with 20 dB below the threshold for the weakest, down to the
/// threshold itself. In a room with a round body there are a hundred times more of them at each 20 dB
/// less.
pub const REPEATED_CONTACTS_ABOVE: f64 = 10.0;

/// Limits of the path search, and the physics along paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Longest path there and back, metres.
    pub max_path_m: f64,
    /// Most mirror reflections; `None`: as many as length and amplitude allow.
    pub max_order: Option<u16>,
    /// Weakest amplitude, before the beam pattern, relative to a head-on, rigid wall.
    pub floor: f64,
    /// Floor of echoes that touch cylinders more than once, or a cylinder and an upright edge, over `floor`; see
    /// [`REPEATED_CONTACTS_ABOVE`]. 1: as far as all others.
    pub repeated_contacts_above: f64,
    /// Longest path, metres, up to which these too are followed down to `floor`: where all that came
    /// back so far may still overlap when the receiver opens.
    pub crowded_m: f64,
    /// Edge law; `None`: mirror reflections only.
    pub edge_law: Option<EdgeLaw>,
    /// Also paths with two diffractions at upright edges, by the same law at each.
    pub double_diffraction: bool,
    /// Attenuation of the amplitude in air, nepers a metre.
    pub absorption_np_per_m: f64,
    /// Wave number `2 pi f / c`, radians a metre.
    pub wave_number_per_m: f64,
    /// Height of the transducer in a scene with heights, metres; `None`: see [`usual_z_m`].
    pub sensor_z_m: Option<f64>,
    /// Elevation of the transducer's axis, radians.
    pub tilt_rad: f64,
    /// Height of the strip of a rough wall that it hears: the integral of the beam pattern's fourth
    /// power over the rise, radians. 0: rough walls only mirror.
    pub scatter_height_rad: f64,
    /// Also the straight path from the transmitter to a receiver elsewhere, and by floor and ceiling.
    pub direct: bool,
}

/// The height of a transducer of which nothing is said, metres: half a metre above the floor, or
/// half way up to a low ceiling.
#[must_use]
pub fn usual_z_m(floor_z_m: Option<f64>, ceiling_z_m: Option<f64>) -> f64 {
    let floor_z_m = floor_z_m.or(ceiling_z_m.map(|ceiling| ceiling - 1.0)).unwrap_or(0.0);
    let middle_m = ceiling_z_m.map_or(f64::INFINITY, |ceiling| 0.5 * (ceiling - floor_z_m));
    floor_z_m + middle_m.min(0.5)
}

impl Settings {
    pub(crate) fn allows(&self, order: u16) -> bool {
        self.max_order.is_none_or(|most| order <= most)
    }

    /// The length of air that leaves a share `gain` of the amplitude; 0 without absorption.
    pub(crate) fn same_loss_m(&self, gain: f64) -> f64 {
        if self.absorption_np_per_m > 0.0 { -gain.ln() / self.absorption_np_per_m } else { 0.0 }
    }

    /// The longest path over perfect walls that is strong enough.
    pub(crate) fn audible_m(&self) -> f64 {
        if self.absorption_np_per_m > 0.0 { self.same_loss_m(self.floor) } else { self.max_path_m }
    }

    pub(crate) fn air_gain(&self, length_m: f64) -> f64 {
        (-self.absorption_np_per_m * length_m).exp()
    }

    /// The weakest echo that is asked for of those of at least this length: of those that touch cylinders more than
    /// once, or a cylinder and an edge, only the stronger ones.
    pub(crate) fn contact_floor(&self, is_repeated: bool, least_m: f64) -> f64 {
        if !is_repeated || least_m <= self.crowded_m {
            self.floor
        } else {
            self.repeated_contacts_above * self.floor
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ranger_stands_half_a_metre_up_or_half_way_to_a_low_ceiling() {
        for (floor_z_m, ceiling_z_m, expected_m) in [
            (Some(0.0), Some(2.5), 0.5),
            (Some(-2.0), Some(0.5), -1.5),
            (Some(0.2), Some(1.0), 0.6),
            (Some(0.3), None, 0.8),
            (None, Some(2.0), 1.5),
            (None, None, 0.5),
        ] {
            let found_m = usual_z_m(floor_z_m, ceiling_z_m);
            assert!(
                (found_m - expected_m).abs() < 1e-12,
                "{floor_z_m:?} {ceiling_z_m:?}: {found_m}"
            );
        }
    }

    #[test]
    fn floors_follow_from_length_and_contacts() {
        let settings = Settings {
            floor: 0.002,
            repeated_contacts_above: 10.0,
            crowded_m: 0.8,
            absorption_np_per_m: 0.2,
            max_order: Some(3),
            ..crate::model::paths::tests::LOSSLESS
        };
        let floors = [(false, 5.0), (true, 0.7), (true, 0.8), (true, 0.9)]
            .map(|(is_repeated, length_m)| settings.contact_floor(is_repeated, length_m));
        assert_eq!(floors, [0.002, 0.002, 0.002, 0.02]);
        assert_eq!([3, 4].map(|order| settings.allows(order)), [true, false]);
        // exp(-0.2 l) is 0.002 after 31 m.
        assert!((settings.air_gain(settings.audible_m()) - 0.002).abs() < 1e-12);
        assert!((settings.same_loss_m(0.5) - 0.5_f64.ln() / -0.2).abs() < 1e-12);
        let lossless = Settings { absorption_np_per_m: 0.0, ..settings };
        assert_eq!((lossless.same_loss_m(0.5), lossless.audible_m()), (0.0, 20.0));
    }
}
