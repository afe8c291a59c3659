//! Timing policies: the instant at which ECHO rises after the envelope has crossed the threshold.

use crate::acoustics::receiver::characteristics::Receiver;

/// Timing policy of an envelope detector.
pub(super) trait EchoTiming {
    /// Delay of ECHO after a threshold crossing of the envelope, microseconds, relative to that of
    /// the reference echo. `phase_rad` returns the carrier's phase at the crossing, in excess of
    /// the nominal carrier.
    fn delay_us(
        &self,
        receiver: &Receiver,
        crossing_us: f64,
        phase_rad: &mut dyn FnMut() -> f64,
    ) -> f64;

    /// Returns `true` if the delay is always 0.
    fn follows_envelope(&self) -> bool {
        false
    }
}

/// ECHO rises with the envelope.
pub(super) struct EnvelopeTiming;

impl EchoTiming for EnvelopeTiming {
    fn delay_us(&self, _: &Receiver, _: f64, _: &mut dyn FnMut() -> f64) -> f64 {
        0.0
    }

    fn follows_envelope(&self) -> bool {
        true
    }
}

/// ECHO rises at the next crest of the carrier.
pub(super) struct CarrierTiming;

impl EchoTiming for CarrierTiming {
    fn delay_us(
        &self,
        receiver: &Receiver,
        crossing_us: f64,
        phase_rad: &mut dyn FnMut() -> f64,
    ) -> f64 {
        receiver.until_crest_us(phase_rad(), crossing_us) - receiver.crest_us
    }
}
