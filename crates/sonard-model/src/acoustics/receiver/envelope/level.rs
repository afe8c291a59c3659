//! Envelope of the summed arrivals at a time.

use num_complex::Complex64;

use super::{ActivePulse, Combining, EnvelopeSum, Receiver, modulus};
use crate::acoustics::Detector;

impl EnvelopeSum<'_> {
    /// Envelope at a time. Times must not decrease between calls.
    pub(in super::super) fn level(&mut self, t_us: f64) -> f64 {
        self.advance(t_us);
        if self.summed < self.begun {
            for pulse in &mut self.pulses[self.summed.max(self.over)..self.begun] {
                pulse.find_field();
            }
            self.summed = self.begun;
        }
        self.level_of(self.over, t_us)
    }

    /// Delay of the carrier's threshold crossing after the envelope's at `t_us`: time to the next
    /// crest, relative to that of the reference echo. Within a cycle the phase of the sum is that
    /// of its carrier.
    pub(in super::super) fn crest_after_us(&mut self, t_us: f64) -> f64 {
        let receiver = self.receiver;
        if receiver.detector == Detector::Envelope || receiver.combining != Combining::Coherent {
            return 0.0;
        }
        // Computes the fields of all active pulses.
        self.level(t_us);
        let live = self.pulses[self.over..self.begun].iter();
        let sum: Complex64 = live.map(|pulse| pulse.field * self.shape_at(pulse, t_us)).sum();
        let noise = self.noise.map_or(Complex64::ZERO, |noise| noise.at(t_us));
        let phase_rad = (sum * self.gain_increase(t_us) + noise).arg();
        receiver.until_crest_us(phase_rad, t_us) - receiver.crest_us
    }

    /// Envelope of the pulses from an index on.
    #[inline]
    pub(super) fn level_of(&self, from: usize, t_us: f64) -> f64 {
        let live = &self.pulses[from..self.begun];
        if !self.is_plain {
            return self.any_level(live, t_us);
        }
        // Fast path for most sensors.
        let Receiver { shape, lead_us, .. } = self.receiver;
        let fields =
            live.iter().map(|pulse| pulse.field * shape.real_at(t_us - pulse.tof_us + lead_us));
        match self.receiver.combining {
            Combining::Incoherent => fields.map(|field| field.norm_sqr()).sum::<f64>().sqrt(),
            _ => modulus(fields.fold(Complex64::ZERO, |sum, field| sum + field)),
        }
    }

    /// Envelope for any sensor, with noise.
    fn any_level(&self, live: &[ActivePulse], t_us: f64) -> f64 {
        let noise = self.noise.map_or(Complex64::ZERO, |noise| noise.at(t_us));
        let gain = self.gain_increase(t_us);
        match self.receiver.combining {
            Combining::Coherent => {
                let sum: Complex64 =
                    live.iter().map(|pulse| pulse.field * self.shape_at(pulse, t_us)).sum();
                modulus(sum * gain + noise)
            }
            Combining::Incoherent => {
                let power =
                    |pulse: &ActivePulse| (pulse.field * self.shape_at(pulse, t_us)).norm_sqr();
                let power: f64 = live.iter().map(power).sum();
                modulus(noise).hypot(power.sqrt() * gain)
            }
            Combining::Ideal => live
                .iter()
                .map(|pulse| pulse.size * self.modulus_at(pulse, t_us) * gain)
                .fold(modulus(noise), f64::max),
        }
    }
}
