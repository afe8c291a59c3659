//! An arrival as a summand of the envelope.

use num_complex::Complex64;

use crate::acoustics::EchoShape;

pub(super) struct Summand {
    pub(super) tof_us: f64,
    /// When it begins and when it is over.
    pub(super) lasts_us: [f64; 2],
    /// To be multiplied with the shape and with what the gain adds while it sounds.
    pub(super) size: f64,
    /// Phase of the carrier.
    phase_rad: f64,
    /// Size and phase, once they are wanted.
    pub(super) field: Complex64,
    has_field: bool,
    /// The most of its modulus.
    pub(super) strength: f64,
    /// The most of all that sound when it begins, itself among them: no less than of what sounds until the next begins.
    pub(super) with_others: f64,
    /// The most that its shape changes it in a microsecond.
    pub(super) steepest: f64,
    /// Its own shape; without it, the pulse's.
    pub(super) shape: Option<Box<EchoShape>>,
}

impl Summand {
    /// One that is over and only keeps its place.
    pub(super) const fn gone(tof_us: f64, lasts_us: [f64; 2]) -> Self {
        Self {
            tof_us,
            lasts_us,
            size: 0.0,
            phase_rad: 0.0,
            field: Complex64::ZERO,
            has_field: true,
            strength: 0.0,
            with_others: 0.0,
            steepest: 0.0,
            shape: None,
        }
    }

    /// One of a size and a phase of the carrier, with its own shape or that of the `pulse`; at most so strong are all
    /// `others` that are not over when it begins.
    pub(super) fn new(
        (tof_us, lasts_us): (f64, [f64; 2]),
        (size, phase_rad): (f64, f64),
        shape: Option<Box<EchoShape>>,
        pulse: &EchoShape,
        others: f64,
    ) -> Self {
        let of = shape.as_deref().unwrap_or(pulse);
        let strength = size * of.peak();
        Self {
            tof_us,
            lasts_us,
            size,
            phase_rad,
            field: Complex64::ZERO,
            has_field: false,
            strength,
            with_others: others + strength,
            steepest: size * of.steepest(),
            shape,
        }
    }

    pub(super) fn is_gone(&self) -> bool {
        self.size == 0.0
    }

    pub(super) fn find_field(&mut self) {
        if !self.has_field {
            self.field = Complex64::from_polar(self.size, self.phase_rad);
            self.has_field = true;
        }
    }
}
