//! Settings of the search: definition of an echo path.

use crate::acoustics::edge::EdgeLaw;

/// Usual [`PathSettings::repeated_contact_ratio`]: with the weakest 20 dB below the threshold,
/// down to the threshold itself. In a room with a round body their number grows a hundredfold per
/// 20 dB.
pub const DEFAULT_REPEATED_CONTACT_RATIO: f64 = 10.0;

/// Default minimum amplitude of listed paths, relative to a head-on, rigid wall.
pub const DEFAULT_MIN_AMPLITUDE: f64 = 0.001;

/// Limits of the path search, and the physics along paths.
#[derive(Debug, Clone, PartialEq)]
pub struct PathSettings {
    /// Longest path there and back, metres.
    pub max_path_m: f64,
    /// Maximum number of mirror reflections; `None` for no limit except length and amplitude.
    pub max_order: Option<u16>,
    /// Weakest amplitude, before the beam pattern, relative to a head-on, rigid wall.
    pub floor: f64,
    /// Floor, relative to `floor`, of echoes that touch cylinders more than once, or a cylinder and
    /// an upright edge; see [`DEFAULT_REPEATED_CONTACT_RATIO`]. 1 treats them like all others.
    pub repeated_contact_ratio: f64,
    /// Longest path, metres, up to which these echoes are also followed down to `floor`: all
    /// earlier arrivals may still overlap when the receiver opens.
    pub unrestricted_m: f64,
    /// Edge law; `None` for mirror reflections only.
    pub edge_law: Option<EdgeLaw>,
    /// Adds paths with two diffractions at upright edges, by the same law at each.
    pub double_diffraction: bool,
    /// Attenuation of the amplitude in air, nepers per metre.
    pub absorption_np_per_m: f64,
    /// Wave number `2 pi f / c`, radians per metre.
    pub wave_number_per_m: f64,
    /// Height of the transducer in a scene with heights, metres;
    /// `None`: see [`default_sensor_z_m`].
    pub sensor_z_m: Option<f64>,
    /// Elevation of the transducer's axis, radians.
    pub tilt_rad: f64,
    /// Effective height of the strip of a rough wall that contributes: the integral of the beam
    /// pattern's fourth power over the rise, radians. With 0 rough walls only mirror.
    pub scatter_height_rad: f64,
    /// Adds the direct path from the transmitter to a separate receiver, and that by floor and
    /// ceiling.
    pub direct: bool,
}

/// Default height of a transducer, metres: half a metre above the floor, or half way up to a low
/// ceiling.
#[must_use]
pub fn default_sensor_z_m(floor_z_m: Option<f64>, ceiling_z_m: Option<f64>) -> f64 {
    let floor_z_m = floor_z_m.or(ceiling_z_m.map(|ceiling| ceiling - 1.0)).unwrap_or(0.0);
    let middle_m = ceiling_z_m.map_or(f64::INFINITY, |ceiling| 0.5 * (ceiling - floor_z_m));
    floor_z_m + middle_m.min(0.5)
}

impl PathSettings {
    /// Returns the settings of a listing of all paths from an amplitude upwards. By default it is
    /// [`DEFAULT_MIN_AMPLITUDE`], times [`DEFAULT_REPEATED_CONTACT_RATIO`] where the search limits
    /// the number of contacts.
    #[must_use]
    pub fn listing(self, min_amplitude: Option<f64>) -> Self {
        match min_amplitude {
            Some(floor) => Self { floor, repeated_contact_ratio: 1.0, ..self },
            None => Self { floor: DEFAULT_MIN_AMPLITUDE, ..self },
        }
    }

    /// Returns the settings without echoes of more than one contact with cylinders and edges, one of
    /// them a cylinder.
    #[must_use]
    pub fn with_single_contacts(self) -> Self {
        Self { repeated_contact_ratio: f64::INFINITY, unrestricted_m: 0.0, ..self }
    }

    pub(crate) fn allows(&self, order: u16) -> bool {
        self.max_order.is_none_or(|bound| order <= bound)
    }

    /// Length of air, metres, that leaves a share `gain` of the amplitude; 0 without absorption.
    pub(crate) fn same_loss_m(&self, gain: f64) -> f64 {
        if self.absorption_np_per_m > 0.0 { -gain.ln() / self.absorption_np_per_m } else { 0.0 }
    }

    /// Longest path, metres, over perfect walls that is strong enough.
    pub(crate) fn detectable_m(&self) -> f64 {
        if self.absorption_np_per_m > 0.0 { self.same_loss_m(self.floor) } else { self.max_path_m }
    }

    pub(crate) fn air_gain(&self, length_m: f64) -> f64 {
        (-self.absorption_np_per_m * length_m).exp()
    }

    /// Amplitude floor of echoes of at least this length. It is raised for those that touch
    /// cylinders more than once, or a cylinder and an edge.
    pub(crate) fn contact_floor(&self, is_repeated: bool, min_m: f64) -> f64 {
        if !is_repeated || min_m <= self.unrestricted_m {
            self.floor
        } else {
            self.repeated_contact_ratio * self.floor
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_height() {
        for (floor_z_m, ceiling_z_m, expected_m) in [
            (Some(0.0), Some(2.5), 0.5),
            (Some(-2.0), Some(0.5), -1.5),
            (Some(0.2), Some(1.0), 0.6),
            (Some(0.3), None, 0.8),
            (None, Some(2.0), 1.5),
            (None, None, 0.5),
        ] {
            let found_m = default_sensor_z_m(floor_z_m, ceiling_z_m);
            assert!(
                (found_m - expected_m).abs() < 1e-12,
                "{floor_z_m:?} {ceiling_z_m:?}: {found_m}"
            );
        }
    }

    #[test]
    fn contact_floor_by_length() {
        let settings = PathSettings {
            floor: 0.002,
            repeated_contact_ratio: 10.0,
            unrestricted_m: 0.8,
            absorption_np_per_m: 0.2,
            max_order: Some(3),
            ..crate::model::paths::tests::LOSSLESS
        };
        let floors = [(false, 5.0), (true, 0.7), (true, 0.8), (true, 0.9)]
            .map(|(is_repeated, length_m)| settings.contact_floor(is_repeated, length_m));
        assert_eq!(floors, [0.002, 0.002, 0.002, 0.02]);
        assert_eq!([3, 4].map(|order| settings.allows(order)), [true, false]);
        // exp(-0.2 l) is 0.002 after 31 m.
        assert!((settings.air_gain(settings.detectable_m()) - 0.002).abs() < 1e-12);
        assert!((settings.same_loss_m(0.5) - 0.5_f64.ln() / -0.2).abs() < 1e-12);
        let lossless = PathSettings { absorption_np_per_m: 0.0, ..settings };
        assert_eq!((lossless.same_loss_m(0.5), lossless.detectable_m()), (0.0, 20.0));
    }
}
