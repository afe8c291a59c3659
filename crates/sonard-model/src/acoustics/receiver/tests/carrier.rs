//! Carrier detectors, and modules that average.

use super::*;
use crate::acoustics::Detector;

/// A cycle of the 6500's carrier, microseconds.
const CYCLE_US: f64 = 1e3 / 49.4;

fn with_detector(detector: Detector) -> Receiver {
    Receiver { detector, ..receiver() }
}

/// Reported time of an isolated echo at 3000 us with a phase offset.
fn reported_us(receiver: &Receiver, amplitude: f64, phase_rad: f64) -> f64 {
    let arrival = PulseArrival { length_m: 3000e-6 * SPEED_M_S, amplitude, phase_rad, index: 0 };
    receiver.detect(&[arrival]).echoes_us[0]
}

#[test]
fn weak_echoes_are_cycles_late() {
    let (envelope, carrier) = (with_detector(Detector::Envelope), with_detector(Detector::Carrier));
    assert!((reported_us(&carrier, 1.0, 0.0) - 3000.0).abs() < 0.01, "the reference is not late");
    let mut max_cycles = 0.0_f64;
    for step in 0..60 {
        let amplitude = 0.0201 * 50f64.powf(f64::from(step) / 60.0);
        let [by_envelope_us, reported_us] =
            [&envelope, &carrier].map(|receiver| reported_us(receiver, amplitude, 0.0));
        let cycles = (reported_us - 3000.0) / CYCLE_US;
        assert!((cycles - cycles.round()).abs() < 1e-3, "{amplitude}: {cycles} cycles late");
        assert!((reported_us - by_envelope_us).abs() < CYCLE_US, "{amplitude}: {reported_us}");
        max_cycles = max_cycles.max(cycles.round());
    }
    assert!((3.0..12.0).contains(&max_cycles), "{max_cycles} cycles at the threshold itself");
}

/// Half a cycle of phase offset moves the crests by half a cycle.
#[test]
fn carrier_phase_shifts_time() {
    let carrier = with_detector(Detector::Carrier);
    let late = (reported_us(&carrier, 1.0, std::f64::consts::PI) - 3000.0) / CYCLE_US;
    assert!((late.abs() - 0.5).abs() < 1e-3, "{late} cycles");
    let envelope = with_detector(Detector::Envelope);
    assert!((reported_us(&envelope, 1.0, std::f64::consts::PI) - 3000.0).abs() < 0.01);
}

#[test]
fn averaging_reduces_jitter() {
    let noise = ReceiverNoise { jitter_us: 10.0, ..ReceiverNoise::NONE };
    let spread_us = |averaged_firings: u32| {
        let receiver = Receiver { averaged_firings, ..receiver() };
        let mut rng = Pcg64::seed_from_u64(4);
        let arrivals = arrivals(&[(3000.0, 1.0, 0.0)]);
        let offsets_us: Vec<f64> = (0..400)
            .map(|_| receiver.detect_in_noise(&arrivals, &|_| None, &noise, &mut rng))
            .map(|detection| detection.echoes_us[0] - 3000.0)
            .collect();
        (offsets_us.iter().map(|off| off * off).sum::<f64>() / offsets_us.len() as f64).sqrt()
    };
    let [one_us, nine_us] = [1, 9].map(spread_us);
    assert!((one_us - 10.0).abs() < 1.0 && (nine_us - 10.0 / 3.0).abs() < 0.4, "{nine_us}");
    let receiver = Receiver { averaged_firings: 3, ..receiver() };
    let detection = |is_detected: bool| {
        let sounds = if is_detected { arrivals(&[(3000.0, 1.0, 0.0)]) } else { Vec::new() };
        receiver.detect(&sounds)
    };
    for (detected, status) in [(1, PingStatus::NoEcho), (2, PingStatus::Echo)] {
        let firings = (0..3).map(|at| detection(at < detected)).collect();
        let averaged = receiver.average(firings);
        assert_eq!((averaged.status, averaged.range_m.is_some()), (status, detected == 2));
    }
}
