//! Detection of arrivals at given times.

mod carrier;
mod noise;
mod threshold;

use std::f64::consts::TAU;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

use super::*;
use crate::{
    acoustics::{Gain, Sensor},
    reading::PingStatus,
};

/// At 340 m/s a path of 0.34 m takes 1000 us.
const SPEED_M_S: f64 = 340.0;

/// Receiver with the 6500's timing and pulse and gain that compensates spreading. The reference
/// echo crosses 0.02 at 47 us before its nominal onset and lasts 417 us.
fn receiver() -> Receiver {
    rising(0.0)
}

/// Receiver whose threshold rises with range, dB/m.
fn rising(threshold_rise_db_per_m: f64) -> Receiver {
    let sensor = Sensor {
        threshold_rise_db_per_m,
        gain: Gain::default(),
        threshold: 0.02,
        max_range_m: 3.4,
        ..Sensor::preset("senscomp-6500").expect("a preset")
    };
    Receiver::new(&sensor, SPEED_M_S)
}

/// Times (microseconds), amplitudes and phases.
fn arrivals(sounds: &[(f64, f64, f64)]) -> Vec<PulseArrival> {
    sounds
        .iter()
        .zip(0..)
        .map(|(&(tof_us, amplitude, phase_rad), index)| PulseArrival {
            length_m: tof_us * SPEED_M_S * 1e-6,
            amplitude,
            // Compensates the phase of the path length, so that `phase_rad` is the phase at
            // arrival.
            phase_rad: phase_rad + TAU * 49.4e-3 * tof_us,
            index,
        })
        .collect()
}

/// Asserts the status and the rise times of ECHO.
fn check(sounds: &[(f64, f64)], status: PingStatus, echoes_us: &[f64]) -> Detection {
    let sounds: Vec<_> =
        sounds.iter().map(|&(tof_us, amplitude)| (tof_us, amplitude, 0.0)).collect();
    let detection = receiver().detect(&arrivals(&sounds));
    assert_eq!(detection.status, status, "{sounds:?}: {detection:?}");
    assert_eq!(detection.echoes_us.len(), echoes_us.len(), "{detection:?}");
    for (found, expected) in detection.echoes_us.iter().zip(echoes_us) {
        assert!((found - expected).abs() < 0.05, "{detection:?}");
    }
    detection
}

/// Delay of an echo of this strength relative to one of strength 1, microseconds: inverse error
/// function for the filter's 22.736 us.
fn walk_us(strength: f64) -> f64 {
    let (mut low, mut high) = (-6.0, 6.0);
    let solve = |level: f64, low: &mut f64, high: &mut f64| {
        for _ in 0..60 {
            let middle = (*low + *high) / 2.0;
            let value = 0.5 * (1.0 + libm::erf(middle / 2f64.sqrt()));
            if value < level { *low = middle } else { *high = middle }
        }
        *low
    };
    let weak = solve(0.02 / strength, &mut low, &mut high);
    (low, high) = (-6.0, 6.0);
    let strong = solve(0.02, &mut low, &mut high);
    (weak - strong) * 22.736
}

#[test]
fn weak_echoes_are_late() {
    let strong = check(&[(3000.0, 1.0)], PingStatus::Echo, &[3000.0]);
    assert!((strong.range_m.expect("a range") - 0.51).abs() < 1e-6);
    assert!((strong.margin_db.expect("a margin") - 34.0).abs() < 0.03);
    for strength in [0.5, 0.1, 0.03] {
        check(&[(3000.0, strength)], PingStatus::Echo, &[3000.0 + walk_us(strength)]);
    }
    assert!((walk_us(0.1) - 27.6).abs() < 0.1, "{}", walk_us(0.1));
}

#[test]
fn blanking_catches_active_sound() {
    check(&[(1900.0, 1.0)], PingStatus::NoEcho, &[]);
    let caught = check(&[(2100.0, 1.0)], PingStatus::MinRange, &[2380.0]);
    assert!((caught.range_m.expect("a range") - 0.4046).abs() < 1e-12);
    check(&[(2100.0, 0.01)], PingStatus::NoEcho, &[]);
    // Above the threshold at the end of blanking, but not for the required three cycles.
    check(&[(2000.0, 1.0)], PingStatus::NoEcho, &[]);
    check(&[(2380.5, 1.0)], PingStatus::Echo, &[2380.5]);
}

#[test]
fn first_detectable_arrival_wins() {
    let echo = check(
        &[(3000.0, 0.019), (4000.0, 0.1), (5000.0, 0.9)],
        PingStatus::Echo,
        &[4000.0 + walk_us(0.1), 5000.0 + walk_us(0.9)],
    );
    assert_eq!(echo.arrival.map(|arrival| arrival.index), Some(1));
}

#[test]
fn no_echo_names_best_candidate() {
    let no_echo = check(
        &[(1000.0, 1.0), (3000.0, 0.01), (4000.0, 0.015), (25_000.0, 1.0)],
        PingStatus::NoEcho,
        &[],
    );
    assert_eq!(no_echo.arrival.map(|arrival| arrival.index), Some(2));
    let lacked_db = 20.0 * (0.015_f64 / 0.02).log10();
    assert!((no_echo.margin_db.expect("a margin") - lacked_db).abs() < 1e-6);
    assert_eq!(check(&[], PingStatus::NoEcho, &[]).arrival, None);
}

#[test]
fn hold_off_skips_ended_sounds() {
    check(&[(3000.0, 1.0), (3010.0, 0.005)], PingStatus::Echo, &[3000.0]);
    check(&[(3000.0, 1.0), (3200.0, 1.0)], PingStatus::Echo, &[3000.0, 3440.0]);
    let many: Vec<(f64, f64)> = (0..20).map(|i| (3000.0 + 700.0 * f64::from(i), 1.0)).collect();
    let first_eight: Vec<f64> = many.iter().take(8).map(|&(tof_us, _)| tof_us).collect();
    check(&many, PingStatus::Echo, &first_eight);
}

#[test]
fn phase_decides_on_weak_pairs() {
    let pair = |phase_rad| arrivals(&[(3000.0, 0.015, 0.0), (3001.0, 0.015, phase_rad)]);
    let together = receiver().detect(&pair(0.0));
    assert_eq!(together.status, PingStatus::Echo);
    assert!((together.amplitude.expect("an amplitude") - 0.03).abs() < 1e-3);
    let against = receiver().detect(&pair(TAU / 2.0));
    assert_eq!(against.status, PingStatus::NoEcho);
    assert!(against.margin_db.expect("a margin") < -6.0);
    let ideal = Receiver { combining: Combining::Ideal, ..receiver() };
    assert_eq!(ideal.detect(&pair(0.0)).status, PingStatus::NoEcho);
}

/// Over all phases the mean power of a coherent pair is the power of an incoherent one.
#[test]
fn incoherent_pairs_add_powers() {
    let incoherent = Receiver { combining: Combining::Incoherent, ..receiver() };
    let pair = |phase_rad: f64| arrivals(&[(3000.0, 0.4, 0.0), (3001.0, 0.3, phase_rad)]);
    let amplitude = |receiver: &Receiver, phase_rad: f64| {
        receiver.detect(&pair(phase_rad)).amplitude.expect("an amplitude")
    };
    let phases = (0..64).map(|at| TAU * f64::from(at) / 64.0);
    let mean =
        phases.map(|phase_rad| amplitude(&receiver(), phase_rad).powi(2)).sum::<f64>() / 64.0;
    for phase_rad in [0.0, 1.0, TAU / 2.0] {
        let together = amplitude(&incoherent, phase_rad);
        assert!((together - 0.5).abs() < 1e-3, "{phase_rad}: {together}");
        assert!((together.powi(2) - mean).abs() < 2e-3, "{together} {mean}");
    }
    // Weak arrivals that cancel are detected on average; an isolated one is unaffected.
    let weak = arrivals(&[(3000.0, 0.015, 0.0), (3001.0, 0.015, TAU / 2.0)]);
    assert_eq!(incoherent.detect(&weak).status, PingStatus::Echo);
    let isolated = arrivals(&[(2600.0, 0.4, 1.0), (3500.0, 0.05, 2.0)]);
    assert_eq!(incoherent.detect(&isolated), receiver().detect(&isolated));
}

/// From the rise of a more sensitive receiver on, a less sensitive one detects the same as from the
/// end of blanking on.
#[test]
fn higher_threshold_rises_no_earlier() {
    let mut rng = Pcg64::seed_from_u64(5);
    for trial in 0..300 {
        let mut sounds: Vec<(f64, f64, f64)> = (0..12)
            .map(|_| {
                let amplitude = 10f64.powf(rng.random_range(-2.2..0.0));
                (rng.random_range(2400.0..6000.0), amplitude, rng.random_range(0.0..TAU))
            })
            .collect();
        sounds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let all = arrivals(&sounds);
        let (mut ready_us, mut threshold) = (0.0, 0.005);
        while threshold < 1.5 {
            let receiver = Receiver { threshold, ..receiver() };
            let detect_from = |ready_us: f64| {
                receiver.detect_within(f64::INFINITY, &all, &|_| None, Latch::First, ready_us).0
            };
            let (whole, late) = (detect_from(0.0), detect_from(ready_us));
            assert_eq!((whole.status, whole.arrival), (late.status, late.arrival), "{trial}");
            let [whole_us, late_us] =
                [&whole, &late].map(|detection| detection.echoes_us.first().copied());
            let apart_us = whole_us.zip(late_us).map_or(0.0, |(a, b)| (a - b).abs());
            assert!(
                apart_us < 1.0 && whole_us.is_some() == late_us.is_some(),
                "{whole:?} {late:?}"
            );
            ready_us = whole_us.unwrap_or(ready_us);
            threshold *= 1.12;
        }
    }
}

#[test]
fn pair_out_of_phase_cancels_overlap() {
    let pair = arrivals(&[(3000.0, 0.5, 0.0), (3150.0, 0.5, TAU / 2.0)]);
    let detection = receiver().detect(&pair);
    assert!((detection.echoes_us[0] - 3000.0 - walk_us(0.5)).abs() < 0.05, "{detection:?}");
    // Both cancel in the envelope until the first one ends.
    let trace = receiver().trace(&pair, &|_| None, 4000.0, 1.0);
    let at = |t_us: f64| trace.points[t_us as usize].envelope;
    assert!(at(3130.0) > 0.45 && at(3285.0) < 0.02 && at(3450.0) > 0.45);
    assert_eq!(trace.peaks.len(), 2);
    assert!((trace.peaks[1].peak.0 - 0.5).abs() < 1e-3);
}

/// The ideal detector selects the same arrivals and times each by its path.
#[test]
fn ideal_receiver_is_the_limit() {
    let sounds = [(2600.0, 0.4, 1.0), (3500.0, 0.05, 2.0), (4400.0, 0.9, 0.3), (9000.0, 0.03, 0.0)];
    let coherent = receiver().detect(&arrivals(&sounds));
    let ideal = Receiver { combining: Combining::Ideal, ..receiver() }.detect(&arrivals(&sounds));
    assert_eq!(coherent.arrival, ideal.arrival);
    assert_eq!(coherent.echoes_us.len(), 4);
    for ((coherent_us, ideal_us), (tof_us, strength, _)) in
        coherent.echoes_us.iter().zip(&ideal.echoes_us).zip(sounds)
    {
        assert!((ideal_us - tof_us).abs() < 1e-9);
        assert!(
            (coherent_us - ideal_us - walk_us(strength)).abs() < 0.05,
            "{coherent_us} {ideal_us}"
        );
    }
}

/// Random arrivals, some of them detectable: times in microseconds, amplitudes, phases.
fn random_sounds(rng: &mut Pcg64) -> Vec<(f64, f64, f64)> {
    let count = rng.random_range(1..6);
    let mut sounds: Vec<(f64, f64, f64)> = (0..count)
        .map(|_| {
            let level_db: f64 = rng.random_range(-40.0..-10.0);
            let tof_us = rng.random_range(2500.0..18_000.0);
            (tof_us, 10f64.powf(level_db / 20.0), rng.random_range(0.0..TAU))
        })
        .collect();
    sounds.sort_by(|a, b| a.0.total_cmp(&b.0));
    sounds
}

#[test]
fn ranges_are_quantized() {
    let mut coarse = receiver();
    coarse.range_step_m = 0.01;
    let mut rng = Pcg64::seed_from_u64(3);
    let mut echoes = 0;
    for _ in 0..300 {
        let sounds = arrivals(&random_sounds(&mut rng));
        let [fine, coarse] = [receiver().detect(&sounds), coarse.detect(&sounds)];
        assert_eq!(fine.status, coarse.status);
        assert_eq!(fine.echoes_us.len(), coarse.echoes_us.len());
        if fine.status == PingStatus::MinRange {
            assert_eq!(fine.range_m, coarse.range_m, "the end of blanking is not quantized");
        }
        let (Some(fine_m), Some(coarse_m), PingStatus::Echo) =
            (fine.range_m, coarse.range_m, fine.status)
        else {
            continue;
        };
        echoes += 1;
        assert!((fine_m - coarse_m).abs() <= 0.005 + 1e-12, "{fine_m} {coarse_m}");
        assert!((coarse_m * 100.0 - (coarse_m * 100.0).round()).abs() < 1e-9, "{coarse_m}");
        let of_time_m = 0.5e-6 * SPEED_M_S * coarse.echoes_us[0];
        assert!((of_time_m - coarse_m).abs() < 1e-9, "{of_time_m} {coarse_m}");
    }
    assert!(echoes > 150, "{echoes}");
}

#[test]
fn early_tof_is_minimum_range() {
    for (tof_us, status) in [
        (None, PingStatus::NoEcho),
        (Some(2380.0), PingStatus::MinRange),
        (Some(2395.0), PingStatus::MinRange),
        (Some(2401.0), PingStatus::Echo),
    ] {
        assert_eq!(classify_tof(tof_us, 2380.0), status, "{tof_us:?}");
    }
}
