//! Arrival as a pulse in the envelope sum.

use num_complex::Complex64;

use crate::acoustics::EchoShape;

/// Amplitude of a pulse, to be multiplied with the shape and the gain increase since firing, and
/// its carrier phase, radians.
pub(super) struct PulseSize {
    pub(super) size: f64,
    pub(super) phase_rad: f64,
}

/// Arrival with its shape and what bounds its part of the envelope.
pub(super) struct ActivePulse {
    /// Nominal time of flight, microseconds.
    pub(super) tof_us: f64,
    /// Start and end, microseconds after firing.
    pub(super) lasts_us: [f64; 2],
    /// Amplitude, to be multiplied with the shape and the gain increase since firing.
    pub(super) size: f64,
    phase_rad: f64,
    /// Amplitude and phase, computed on demand.
    pub(super) field: Complex64,
    has_field: bool,
    /// Maximum modulus over the pulse.
    pub(super) strength: f64,
    /// Total strength of all pulses active when this one begins, itself included: an upper bound
    /// until the next one begins.
    pub(super) with_others: f64,
    /// Maximum slope, per microsecond.
    pub(super) steepest: f64,
    /// Individual shape; `None` for the transmitted pulse.
    pub(super) shape: Option<Box<EchoShape>>,
}

impl ActivePulse {
    /// Placeholder for an arrival that has ended.
    pub(super) const fn placeholder(tof_us: f64, lasts_us: [f64; 2]) -> Self {
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

    /// Creates a pulse with its own shape or that of `transmitted`. `others` is the total
    /// strength of the pulses still active when it begins.
    pub(super) fn new(
        (tof_us, lasts_us): (f64, [f64; 2]),
        PulseSize { size, phase_rad }: PulseSize,
        shape: Option<Box<EchoShape>>,
        transmitted: &EchoShape,
        others: f64,
    ) -> Self {
        let own = shape.as_deref().unwrap_or(transmitted);
        let strength = size * own.peak();
        Self {
            tof_us,
            lasts_us,
            size,
            phase_rad,
            field: Complex64::ZERO,
            has_field: false,
            strength,
            with_others: others + strength,
            steepest: size * own.max_slope(),
            shape,
        }
    }

    pub(super) fn is_placeholder(&self) -> bool {
        self.size == 0.0
    }

    pub(super) fn compute_field(&mut self) {
        if !self.has_field {
            self.field = Complex64::from_polar(self.size, self.phase_rad);
            self.has_field = true;
        }
    }
}
