//! Walls as mirrors: reflectance, loss and scattering.

use crate::{
    geometry::{DVec2, Mirror},
    scene::Material,
};

/// Data of a wall for beam tracing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallMirror {
    pub(crate) mirror: Mirror,
    /// [`Mirror::rotor`].
    pub(crate) rotor: DVec2,
    /// Amplitude of the mirror reflection; see [`mirror_gain`].
    pub(crate) gain: f64,
    /// Length of air with the same loss, metres; 0 without absorption.
    pub(crate) loss_m: f64,
    /// Share of the energy that the wall scatters; see [`scattered`].
    pub(crate) scatter: f64,
    /// Lower and upper end, metres; `None` for an unlimited wall.
    pub(crate) z_m: Option<[f64; 2]>,
}

/// Amplitude of a material's mirror reflection: a rough surface scatters a share of the energy that
/// it does not absorb.
pub(crate) fn mirror_gain(material: &Material) -> f64 {
    material.reflectance * (1.0 - material.roughness).sqrt()
}

/// Share of the energy that a material scatters.
pub(crate) fn scattered(material: &Material) -> f64 {
    material.reflectance.powi(2) * material.roughness
}
