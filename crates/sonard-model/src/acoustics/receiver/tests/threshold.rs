//! Thresholds that vary with gain steps and with range.

use super::{
    detector::{firing::Firing, start_detector},
    *,
};

/// The effective threshold rises with range within a step and falls at its end.
#[test]
fn gain_steps_lower_the_threshold() {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let receiver = Receiver::new(&sensor, 343.99);
    let [before, after] = [5119.0, 5121.0].map(|t_us| receiver.threshold_at(t_us));
    assert!((20.0 * (before / after).log10() - 5.2).abs() < 0.01, "{before} {after}");
    // The sensor's own threshold applies within each step and at the rated range.
    assert!((receiver.threshold_at(3491.0) / sensor.threshold - 1.0).abs() < 0.01);
    assert!((receiver.threshold_at(62_210.0) / sensor.threshold - 1.0).abs() < 0.01);
    // An echo too weak at the end of step 1 is detected once the gain has risen.
    let tof_us = 5000.0;
    let weak = PulseArrival {
        length_m: tof_us * 343.99e-6,
        amplitude: 0.8 * before,
        phase_rad: 0.0,
        index: 0,
    };
    let detection = receiver.detect(&[weak]);
    assert_eq!(detection.status, PingStatus::Echo);
    assert!((detection.echoes_us[0] - 5120.0).abs() < 0.1, "{detection:?}");
}

#[test]
fn rising_threshold_delays_echoes() {
    let flat = receiver();
    let mut rng = Pcg64::seed_from_u64(1);
    for _ in 0..300 {
        let sounds = arrivals(&random_sounds(&mut rng));
        let mut last_us = 0.0;
        for rise_db in [0.0, 0.5, 2.0, 6.0, 15.0] {
            let found = rising(rise_db).detect(&sounds);
            let first_us = found.echoes_us.first().copied().unwrap_or(f64::INFINITY);
            assert!(first_us >= last_us - 0.02, "{rise_db}: {first_us} after {last_us}");
            last_us = first_us;
            if rise_db == 0.0 {
                assert_eq!(found, flat.detect(&sounds));
            }
        }
    }
    let rising = rising(4.0);
    // 6000 us correspond to 1.02 m.
    assert!((rising.threshold_at(6000.0) / 0.02 - 10f64.powf(4.08 / 20.0)).abs() < 1e-9);
    let steps = (0..20_000).map(|t_us| rising.threshold_at(f64::from(t_us)));
    let steps: Vec<f64> = steps.collect();
    for pair in steps.windows(2) {
        assert!((1.0..1.0001).contains(&(pair[1] / pair[0])), "{pair:?}");
    }
}

/// A rising threshold is equivalent to weaker arrivals.
#[test]
fn rising_threshold_attenuates() {
    let mut rng = Pcg64::seed_from_u64(2);
    let (mut same, mut detected) = (0, 0);
    for _ in 0..400 {
        let sounds = random_sounds(&mut rng);
        // Evaluated at the middle of the pulse, which lasts 324 us.
        let weaker = |&(tof_us, amplitude, phase): &(f64, f64, f64)| {
            let range_m = 0.5e-6 * SPEED_M_S * (tof_us + 100.0);
            (tof_us, amplitude * 10f64.powf(-5.0 * range_m / 20.0), phase)
        };
        let weaker: Vec<_> = sounds.iter().map(weaker).collect();
        let [risen, attenuated] =
            [rising(5.0).detect(&arrivals(&sounds)), receiver().detect(&arrivals(&weaker))];
        let firsts = [&risen, &attenuated].map(|found| found.echoes_us.first().copied());
        match firsts {
            [Some(a_us), Some(b_us)] if (a_us - b_us).abs() < 4.0 => {
                detected += 1;
                same += 1;
            }
            [None, None] => same += 1,
            _ => {}
        }
    }
    // Some arrivals are within a few tenths of a decibel of the threshold.
    assert!(same >= 385 && detected > 150, "{same} of 400, {detected} detected");
}

/// ECHO rises where the envelope equals the threshold, however many arrivals overlap.
#[test]
fn crossings_are_converged() {
    let mut rng = Pcg64::seed_from_u64(3);
    let (receiver, mut crossed) = (receiver(), 0);
    for _ in 0..400 {
        let sounds = arrivals(&random_sounds(&mut rng));
        let mut detector = start_detector(Firing::new(&receiver, &sounds, &|_| None));
        let ready_us = receiver.scan_start_us(0.0);
        let Some(rise_us) = detector.next_rise(ready_us, f64::INFINITY) else { continue };
        detector.rewind_to(ready_us);
        let mut relative =
            |t_us: f64| detector.level(rise_us + t_us) / detector.threshold_at(rise_us + t_us);
        let at_rise = relative(0.0);
        // A dip below the threshold within the integration time postpones the rise.
        let lasts = (1..=60).all(|t_us| relative(f64::from(t_us)) > 1.0);
        if lasts && receiver.status_at(rise_us) == PingStatus::Echo {
            crossed += 1;
            assert!((at_rise - 1.0).abs() < 1e-9, "{at_rise} at {rise_us}");
        }
    }
    assert!(crossed > 200, "{crossed}");
}

/// A search that continues from the rise at a lower threshold finds the same rise as one from the
/// end of blanking.
#[test]
fn higher_thresholds_continue_searches() {
    let mut rng = Pcg64::seed_from_u64(4);
    let (receiver, mut compared) = (receiver(), 0);
    for _ in 0..400 {
        let sounds = arrivals(&random_sounds(&mut rng));
        let mut bank = receiver.detector_bank(f64::INFINITY, &sounds, &|_| None);
        let mut ready_us = 0.0;
        for step in 0..12 {
            let factor = 10f64.powf(0.05 * f64::from(step));
            let continued = bank.first_rise(factor, ready_us);
            let mut fresh = receiver.detector_bank(f64::INFINITY, &sounds, &|_| None);
            let [a_us, b_us] = [&continued, &fresh.first_rise(factor, 0.0)]
                .map(|rise| rise.map(|of| of.passed_us));
            let (Some(a_us), Some(b_us)) = (a_us, b_us) else {
                assert_eq!(a_us, b_us, "factor {factor}");
                break;
            };
            assert!((a_us - b_us).abs() < 1e-6, "factor {factor}: {a_us}, {b_us}");
            compared += 1;
            ready_us = a_us;
        }
    }
    assert!(compared > 1000, "{compared}");
}
