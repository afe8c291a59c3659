//! Settings of receiver and engines, from sensor, air and options.

use std::f64::consts::{LOG10_E, TAU};

use crate::{
    acoustics::{Air, Combining, EdgeLawKind, Receiver, Sensor, edge::EdgeLaw},
    model::{FanOptions, FanSettings, Options, PathOptions, paths},
};

/// Margin below the threshold at which paths are dropped, decibels: a missing echo is still
/// explained by arrivals within it.
const MARGIN_KEPT_DB: f64 = 40.0;

/// The margin for `paths`, which would find a great many more weak paths.
const PATHS_KEPT_DB: f64 = 20.0;

/// Bozma and Kuc's scattering strength of the right-angled edge that they scanned.
const SIGMA_E: f64 = 0.095;

/// Returns the sensor's receiver with the options applied. Only `paths` has phases.
#[must_use]
pub fn receiver(sensor: &Sensor, air: &Air, options: &Options) -> Receiver {
    let paths = options.engine.paths();
    let response = paths.and_then(|paths| paths.response).unwrap_or(sensor.response);
    let sensor = Sensor { response, ..sensor.clone() };
    let mut receiver = Receiver::new(&sensor, air.sound_speed_m_s())
        .with_threshold(options.threshold.unwrap_or(sensor.threshold));
    receiver.max_range_m = options.max_range_m.unwrap_or(sensor.max_range_m);
    if paths.is_none_or(|paths| paths.ideal_receiver) {
        receiver.combining = Combining::Ideal;
    }
    receiver
}

pub(super) fn path_settings(
    sensor: &Sensor,
    air: &Air,
    options: &PathOptions,
    receiver: &Receiver,
    scatter_height_rad: f64,
) -> paths::PathSettings {
    let wave_number_per_m = TAU * sensor.frequency_hz / receiver.sound_speed_m_s;
    let law = match options.edge_law.or(sensor.edge_law) {
        None | Some(EdgeLawKind::Utd) => EdgeLaw::Utd,
        Some(EdgeLawKind::KucSiegel) => EdgeLaw::KucSiegel,
        Some(EdgeLawKind::BozmaKuc) => EdgeLaw::BozmaKuc {
            sigma: SIGMA_E,
            far_field_m: sensor.half_width_m().powi(2) * wave_number_per_m / TAU,
        },
    };
    paths::PathSettings {
        max_path_m: 2.0 * receiver.max_range_m,
        max_order: options.max_order.map(|order| order.try_into().unwrap_or(u16::MAX)),
        floor: receiver.threshold * 10f64.powf(-PATHS_KEPT_DB / 20.0),
        repeated_contact_ratio: paths::DEFAULT_REPEATED_CONTACT_RATIO,
        unrestricted_m: unrestricted_m(receiver),
        edge_law: Some(law),
        double_diffraction: options.double_diffraction,
        absorption_np_per_m: absorption_db_per_m(sensor, air, options.lossless) / (20.0 * LOG10_E),
        wave_number_per_m,
        sensor_z_m: sensor.mounting.z_m,
        tilt_rad: sensor.mounting.tilt_deg.to_radians(),
        scatter_height_rad,
        direct: false,
    }
}

/// Length of path at which the first echo can be detected, metres. For a long blanking it is
/// limited, since near a round body the number of paths multiplies with every metre.
fn unrestricted_m(receiver: &Receiver) -> f64 {
    let opens_us = receiver.blanking_us + receiver.integration_us;
    (opens_us * 1e-6 * receiver.sound_speed_m_s).min(1.0)
}

fn absorption_db_per_m(sensor: &Sensor, air: &Air, lossless: bool) -> f64 {
    if lossless || sensor.gain.compensates_absorption() {
        return 0.0;
    }
    air.absorption_db_per_m(sensor.frequency_hz)
}

pub(super) fn fan_settings(
    sensor: &Sensor,
    air: &Air,
    options: &FanOptions,
    receiver: &Receiver,
) -> FanSettings {
    FanSettings {
        spacing_rad: options.ray_spacing_deg.to_radians(),
        half_face_m: sensor.half_width_m(),
        wavelength_m: receiver.sound_speed_m_s / sensor.frequency_hz,
        absorption_db_per_m: absorption_db_per_m(sensor, air, options.lossless),
        max_path_m: 2.0 * receiver.max_range_m,
        min_amplitude: receiver.threshold * 10f64.powf(-MARGIN_KEPT_DB / 20.0),
        max_order: options.max_order.unwrap_or(u32::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2380 us of blanking and an integration of 60 us are 0.83 m of path; a long blanking counts
    /// as a metre.
    #[test]
    fn crowded_until_detection() {
        let preset = Sensor::preset("senscomp-6500").expect("a preset");
        let of = |blanking_us: f64| {
            let sensor = Sensor { blanking_us, integration_us: 60.0, ..preset.clone() };
            unrestricted_m(&Receiver::new(&sensor, 340.0))
        };
        assert!((of(2380.0) - 0.8296).abs() < 1e-9, "{}", of(2380.0));
        assert_eq!(of(5000.0), 1.0);
    }
}
