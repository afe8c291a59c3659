//! Walls as mirrors: reflectance, loss and scattering.

use crate::geometry::{DVec2, Mirror};

/// Data of a wall for beam tracing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallMirror {
    pub(crate) mirror: Mirror,
    /// [`Mirror::rotor`].
    pub(crate) rotor: DVec2,
    /// Amplitude of the mirror reflection; see [`Material::mirror_amplitude`](crate::scene::Material::mirror_amplitude).
    pub(crate) gain: f64,
    /// Length of air with the same loss, metres; 0 without absorption.
    pub(crate) loss_m: f64,
    /// Share of the energy that the wall scatters; see
    /// [`Material::scattered_energy`](crate::scene::Material::scattered_energy).
    pub(crate) scatter: f64,
    /// Lower and upper end, metres; `None` for an unlimited wall.
    pub(crate) z_m: Option<[f64; 2]>,
}
