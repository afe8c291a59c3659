//! Acoustic properties of surfaces, and how strongly they reflect.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Acoustic properties of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub struct Material {
    /// Amplitude of the mirror reflection relative to the incident wave, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub reflectance: f64,
    /// Share of the unabsorbed sound that is scattered instead of mirrored, 0 to 1.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: f64,
}

/// Property of a material that readings depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaterialProperty {
    /// Natural logarithm of the reflectance.
    LogReflectance,
    /// Roughness.
    Roughness,
}

impl Material {
    /// Perfectly reflecting, smooth surface.
    pub const RIGID: Self = Self::smooth(1.0);

    /// Smooth surface with this amplitude reflectance, 0 to 1.
    #[must_use]
    pub const fn smooth(reflectance: f64) -> Self {
        Self { reflectance, roughness: 0.0 }
    }

    /// Amplitude of the mirror reflection relative to the incident wave: a rough surface scatters a
    /// share of the energy that it does not absorb.
    #[must_use]
    pub fn mirror_amplitude(&self) -> f64 {
        self.reflectance * (1.0 - self.roughness).sqrt()
    }

    /// Share of the incident energy that is scattered.
    #[must_use]
    pub fn scattered_energy(&self) -> f64 {
        self.reflectance.powi(2) * self.roughness
    }

    /// Derivatives of the natural logarithms of the mirrored and of the scattered amplitude by a
    /// property. Shares of the energy below 2 % count as 2 %: near zero, a small change multiplies
    /// the amplitude.
    #[must_use]
    pub fn log_amplitude_rates(&self, property: MaterialProperty) -> [f64; 2] {
        const MIN_SHARE: f64 = 0.02;
        match property {
            MaterialProperty::LogReflectance => [1.0, 1.0],
            MaterialProperty::Roughness => {
                [-0.5 / (1.0 - self.roughness).max(MIN_SHARE), 0.5 / self.roughness.max(MIN_SHARE)]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_conserved() {
        for (reflectance, roughness) in [(1.0, 0.3), (0.9, 1.0), (0.7, 0.0)] {
            let material = Material { reflectance, roughness };
            let energy = material.mirror_amplitude().powi(2) + material.scattered_energy();
            assert!((energy - reflectance * reflectance).abs() < 1e-12, "{material:?}");
        }
    }

    #[test]
    fn rates_are_derivatives() {
        const STEP: f64 = 1e-6;
        let log_amplitudes = |material: &Material| {
            [material.mirror_amplitude().ln(), 0.5 * material.scattered_energy().ln()]
        };
        for (reflectance, roughness) in [(0.9, 0.3), (0.5, 0.05), (0.7, 0.9)] {
            let material = Material { reflectance, roughness };
            for property in [MaterialProperty::LogReflectance, MaterialProperty::Roughness] {
                let changed = |by: f64| match property {
                    MaterialProperty::LogReflectance => {
                        Material { reflectance: reflectance * by.exp(), ..material }
                    }
                    MaterialProperty::Roughness => {
                        Material { roughness: roughness + by, ..material }
                    }
                };
                let [low, high] = [-STEP, STEP].map(|by| log_amplitudes(&changed(by)));
                let rates = material.log_amplitude_rates(property);
                for (rate, (low, high)) in rates.into_iter().zip(low.into_iter().zip(high)) {
                    let numeric = (high - low) / (2.0 * STEP);
                    assert!((rate - numeric).abs() < 1e-7, "{material:?}: {rate}, {numeric}");
                }
            }
        }
    }
}
