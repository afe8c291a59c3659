//! Bounds of multiple echoes.

use crate::acoustics::Disc;

/// Largest contribution of any last path.
#[derive(Clone, Copy)]
pub(crate) struct BestLastPath {
    weight: f64,
    weight_per_m: f64,
}

impl BestLastPath {
    /// Computes the bound from paths by length and weight.
    pub(crate) fn from_paths(paths: impl Iterator<Item = (f64, f64)>) -> Self {
        paths.fold(Self { weight: 0.0, weight_per_m: 0.0 }, |best, (length_m, weight)| Self {
            weight: best.weight.max(weight),
            weight_per_m: best.weight_per_m.max(weight / length_m),
        })
    }

    /// Largest factor of a last path after paths of this length: `weight / L (length + L)`.
    pub(crate) fn last_factor(&self, length_m: f64) -> f64 {
        self.weight + self.weight_per_m * length_m
    }

    /// Upper bound of an echo that begins with a path of this length and weight and is reflected by
    /// the face once.
    pub(crate) fn after(&self, face: &Disc, length_m: f64, weight: f64) -> f64 {
        // The disc scatters at most like the whole disc in phase, and at most twice a mirror.
        let scatters = face.strength_m() / length_m * self.last_factor(length_m);
        weight * scatters.min(2.0 * face.face.reflectance * self.weight)
    }
}
