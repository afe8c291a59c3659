//! Detectors that watch the carrier, and modules that average.

use super::*;
use crate::acoustics::Detector;

/// A cycle of the 6500's carrier, microseconds.
const CYCLE_US: f64 = 1e3 / 49.4;

fn watching(detector: Detector) -> Receiver {
    Receiver { detector, ..receiver() }
}

/// When a lone echo from 3000 us away is told that left with a phase.
fn told_us(receiver: &Receiver, amplitude: f64, phase_rad: f64) -> f64 {
    let arrival = PulseArrival { length_m: 3000e-6 * SPEED_M_S, amplitude, phase_rad, index: 0 };
    receiver.detect(&[arrival]).echoes_us[0]
}

#[test]
fn weak_echoes_are_told_whole_cycles_late() {
    let (envelope, carrier) = (watching(Detector::Envelope), watching(Detector::Carrier));
    assert!((told_us(&carrier, 1.0, 0.0) - 3000.0).abs() < 0.01, "the reference is not late");
    let mut most = 0.0_f64;
    for step in 0..60 {
        let amplitude = 0.0201 * 50f64.powf(f64::from(step) / 60.0);
        let [by_envelope_us, told_us] =
            [&envelope, &carrier].map(|receiver| told_us(receiver, amplitude, 0.0));
        let cycles = (told_us - 3000.0) / CYCLE_US;
        assert!((cycles - cycles.round()).abs() < 1e-3, "{amplitude}: {cycles} cycles late");
        assert!((told_us - by_envelope_us).abs() < CYCLE_US, "{amplitude}: {told_us}");
        most = most.max(cycles.round());
    }
    assert!((3.0..12.0).contains(&most), "{most} cycles at the threshold itself");
}

/// An echo whose carrier is turned by half a cycle has its crests in between.
#[test]
fn a_turned_carrier_moves_what_is_told() {
    let carrier = watching(Detector::Carrier);
    let late = (told_us(&carrier, 1.0, std::f64::consts::PI) - 3000.0) / CYCLE_US;
    assert!((late.abs() - 0.5).abs() < 1e-3, "{late} cycles");
    let envelope = watching(Detector::Envelope);
    assert!((told_us(&envelope, 1.0, std::f64::consts::PI) - 3000.0).abs() < 0.01);
}

#[test]
fn an_average_spreads_less_and_tells_what_most_firings_hear() {
    let noise = ReceiverNoise { jitter_us: 10.0, ..ReceiverNoise::NONE };
    let spread_us = |averaged_firings: u32| {
        let receiver = Receiver { averaged_firings, ..receiver() };
        let mut rng = Pcg64::seed_from_u64(4);
        let arrivals = arrivals(&[(3000.0, 1.0, 0.0)]);
        let told: Vec<f64> = (0..400)
            .map(|_| receiver.detect_in_noise(&arrivals, &|_| None, &noise, &mut rng))
            .map(|detection| detection.echoes_us[0] - 3000.0)
            .collect();
        (told.iter().map(|off| off * off).sum::<f64>() / told.len() as f64).sqrt()
    };
    let [one_us, nine_us] = [1, 9].map(spread_us);
    assert!((one_us - 10.0).abs() < 1.0 && (nine_us - 10.0 / 3.0).abs() < 0.4, "{nine_us}");
    let receiver = Receiver { averaged_firings: 3, ..receiver() };
    let detection = |is_heard: bool| {
        let of = if is_heard { arrivals(&[(3000.0, 1.0, 0.0)]) } else { Vec::new() };
        receiver.detect(&of)
    };
    for (heard, status) in [(1, PingStatus::NoEcho), (2, PingStatus::Echo)] {
        let firings = (0..3).map(|at| detection(at < heard)).collect();
        let told = receiver.averaged(firings);
        assert_eq!((told.status, told.range_m.is_some()), (status, heard == 2));
    }
}
