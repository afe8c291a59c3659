//! The envelope of the sum at a time.

use num_complex::Complex64;

use super::{Combining, Hearing, Receiver, Summand, modulus};
use crate::acoustics::Detector;

impl Hearing<'_> {
    /// Envelope at a time; no earlier time can be asked for afterwards.
    pub(in super::super) fn level(&mut self, t_us: f64) -> f64 {
        self.advance(t_us);
        if self.summed < self.begun {
            for summand in &mut self.summands[self.summed.max(self.over)..self.begun] {
                summand.find_field();
            }
            self.summed = self.begun;
        }
        self.level_of(self.over, t_us)
    }

    /// By how much later the carrier passes the threshold than the envelope, which does at `t_us`: at its next crest,
    /// counted so that the reference echo's is not late. Within a cycle the sum's phase is that of its carrier.
    pub(in super::super) fn crest_after_us(&mut self, t_us: f64) -> f64 {
        let receiver = self.receiver;
        if receiver.detector == Detector::Envelope || receiver.combining != Combining::Coherent {
            return 0.0;
        }
        // All that lasts then has its field.
        self.level(t_us);
        let live = self.summands[self.over..self.begun].iter();
        let sum: Complex64 = live.map(|summand| summand.field * self.shape_at(summand, t_us)).sum();
        let noise = self.noise.map_or(Complex64::ZERO, |noise| noise.at(t_us));
        let phase_rad = (sum * self.rise_of_gain(t_us) + noise).arg();
        receiver.until_crest_us(phase_rad, t_us) - receiver.crest_us
    }

    /// Envelope of the summands from a place on.
    #[inline]
    pub(super) fn level_of(&self, from: usize, t_us: f64) -> f64 {
        let live = &self.summands[from..self.begun];
        if !self.is_plain {
            return self.any_level(live, t_us);
        }
        // What most sensors have, at a part of the cost.
        let Receiver { shape, lead_us, .. } = self.receiver;
        let fields = live
            .iter()
            .map(|summand| summand.field * shape.real_at(t_us - summand.tof_us + lead_us));
        match self.receiver.combining {
            Combining::Incoherent => fields.map(|field| field.norm_sqr()).sum::<f64>().sqrt(),
            _ => modulus(fields.fold(Complex64::ZERO, |sum, field| sum + field)),
        }
    }

    /// The same of any sensor, in noise too.
    fn any_level(&self, live: &[Summand], t_us: f64) -> f64 {
        let noise = self.noise.map_or(Complex64::ZERO, |noise| noise.at(t_us));
        let gain = self.rise_of_gain(t_us);
        match self.receiver.combining {
            Combining::Coherent => {
                let sum: Complex64 =
                    live.iter().map(|summand| summand.field * self.shape_at(summand, t_us)).sum();
                modulus(sum * gain + noise)
            }
            Combining::Incoherent => {
                let power =
                    |summand: &Summand| (summand.field * self.shape_at(summand, t_us)).norm_sqr();
                let power: f64 = live.iter().map(power).sum();
                modulus(noise).hypot(power.sqrt() * gain)
            }
            Combining::Ideal => live
                .iter()
                .map(|summand| summand.size * self.modulus_at(summand, t_us) * gain)
                .fold(modulus(noise), f64::max),
        }
    }
}
