//! Receiver model: selects the arrivals at the transducer's face that raise ECHO, and times them.
//!
//! # Timing
//!
//! A pulse rises over some tens of microseconds. ECHO therefore rises before or after the nominal
//! arrival time, depending on the ratio of echo amplitude to threshold. The part of this offset
//! that all echoes share belongs to calibration and is left out here: times are counted so that a
//! head-on, perfectly reflecting wall is timed by its path alone and its range is its distance. A
//! weaker echo is late relative to that reference (time walk). With the 6500's 16 cycles and 7 kHz
//! of bandwidth the error is 1.3 mm of range at half the amplitude and 7 mm at a tenth.
//!
//! # Detection
//!
//! Overlapping arrivals add up with their phases. The detector compares the envelope of the sum
//! with the effective threshold: the sensor's threshold divided by the current gain. The envelope
//! has to stay above the threshold for the sensor's integration time. That delay is the same for
//! all echoes and is left out as well.

mod characteristics;
mod detection;
mod detector;
mod detector_bank;
mod gain;
mod noise;
mod trace;

#[cfg(test)]
mod tests;

pub use self::{
    characteristics::{Combining, Incident, PulseArrival, Receiver},
    detection::{Detection, Latch, classify_tof},
    detector_bank::{DetectorBank, EchoRise},
    noise::ReceiverNoise,
    trace::{EchoTrace, EnvelopePeak, TracePoint},
};
