//! Echo detectors: each scans the arrivals of one firing for the times at which ECHO rises.
//!
//! A further kind of detector is an implementation of [`EchoDetector`](firing::EchoDetector) in a file of its own, or of
//! [`Summation`](sum::Summation) if it compares an envelope with the threshold, and an arm of
//! [`start_detector`].

mod coherent;
mod envelope;
pub(super) mod firing;
mod ideal;
mod power;
mod pulse;
mod pulse_track;
mod rise;
mod sum;
mod threshold;
mod timing;

use self::{
    coherent::CoherentSum,
    envelope::EnvelopeDetector,
    firing::{EchoDetector, Firing},
    ideal::IdealDetector,
    power::PowerSum,
};
use super::characteristics::Combining;

/// Starts the detector of a firing's receiver.
pub(super) fn start_detector(firing: Firing<'_>) -> Box<dyn EchoDetector + '_> {
    match firing.receiver.combining {
        Combining::Coherent => Box::new(EnvelopeDetector::<CoherentSum>::new(firing)),
        Combining::Incoherent => Box::new(EnvelopeDetector::<PowerSum>::new(firing)),
        Combining::Ideal => Box::new(IdealDetector::new(firing)),
    }
}
