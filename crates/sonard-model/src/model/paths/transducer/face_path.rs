//! Echo paths as parts of multiple echoes.

use num_complex::Complex64;
use smallvec::SmallVec;

use crate::acoustics::PulseArrival;

/// An echo path in one of its directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DirectedPath {
    pub(crate) echo: u32,
    pub(crate) reversed: bool,
}

/// A sequence of paths, with a reflection at the face between consecutive ones.
#[derive(Debug, Clone)]
pub(crate) struct MultipleEcho {
    pub(crate) paths: SmallVec<[DirectedPath; 4]>,
    pub(crate) length_m: f64,
    pub(crate) phase_rad: f64,
    /// Amplitude, beam pattern included.
    pub(crate) amplitude: f64,
}

/// An echo path from the face to the face, relative to an azimuth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FacePath {
    pub(crate) path: DirectedPath,
    /// World directions of departure and return.
    pub(crate) leaves_rad: f64,
    pub(crate) returns_rad: f64,
    pub(crate) length_m: f64,
    /// Amplitude and phase, separately.
    pub(crate) amplitude: f64,
    pub(crate) phase: Complex64,
    /// `true` if the path is its own reverse.
    pub(crate) own_reverse: bool,
}

impl MultipleEcho {
    /// Returns the arrival at the receiver.
    pub(crate) fn arrival(&self, index: u32) -> PulseArrival {
        let &Self { length_m, amplitude, phase_rad, .. } = self;
        PulseArrival { length_m, amplitude, phase_rad, index }
    }
}
