//! Echo detectors: each scans the arrivals of one firing for the times at which ECHO rises.
//!
//! A further detector is a variant of [`Detector`], a file with its
//! [`EchoDetector`](firing::EchoDetector) (or its [`EchoTiming`](timing::EchoTiming), if it only
//! delays what the envelope raises), and its arm in [`start_detector`], the one place that
//! distinguishes detectors.

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
    timing::{CarrierTiming, EnvelopeTiming},
};
use super::characteristics::Combining;
use crate::acoustics::Detector;

/// Starts the detector of a firing's receiver.
pub(super) fn start_detector(firing: Firing<'_>) -> Box<dyn EchoDetector + '_> {
    match (firing.receiver.combining, firing.receiver.detector) {
        (Combining::Ideal, _) => Box::new(IdealDetector::new(firing)),
        (Combining::Coherent, Detector::Envelope) => {
            Box::new(EnvelopeDetector::<CoherentSum>::new(firing, &EnvelopeTiming))
        }
        (Combining::Coherent, Detector::Carrier) => {
            Box::new(EnvelopeDetector::<CoherentSum>::new(firing, &CarrierTiming))
        }
        // A sum of powers has no carrier phase.
        (Combining::Incoherent, Detector::Envelope | Detector::Carrier) => {
            Box::new(EnvelopeDetector::<PowerSum>::new(firing, &EnvelopeTiming))
        }
    }
}
