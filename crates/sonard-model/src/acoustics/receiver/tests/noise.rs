//! Noise of the receiver: magnitude and effect on readings.

use super::*;

#[test]
fn noise_affects_weak_echoes_most() {
    let one = |strength, noise: &ReceiverNoise, seed| {
        let mut rng = Pcg64::seed_from_u64(seed);
        receiver().detect_in_noise(
            &arrivals(&[(4000.0, strength, 0.0)]),
            &|_| None,
            noise,
            &mut rng,
        )
    };
    let quiet = one(0.1, &ReceiverNoise::NONE, 1);
    let plain = receiver().detect(&arrivals(&[(4000.0, 0.1, 0.0)]));
    assert!((quiet.echoes_us[0] - plain.echoes_us[0]).abs() < 0.01);
    let noise = ReceiverNoise { floor: 0.002, jitter_us: 0.0 };
    assert_eq!(one(0.1, &noise, 7), one(0.1, &noise, 7));
    assert_ne!(one(0.1, &noise, 7), one(0.1, &noise, 8));
    let spread_us = |strength| {
        let times: Vec<f64> = (0..60)
            .filter_map(|seed| one(strength, &noise, seed).echoes_us.first().copied())
            .collect();
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        (times.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / times.len() as f64).sqrt()
    };
    let (weak, strong) = (spread_us(0.05), spread_us(1.0));
    assert!(weak > 1.0 && weak > 1.5 * strong, "{weak} {strong}");
    // Noise alone raises ECHO when its envelope is comparable to the threshold.
    let strong_noise = ReceiverNoise { floor: 0.05, jitter_us: 0.0 };
    let mut rng = Pcg64::seed_from_u64(3);
    let alarm = receiver().detect_in_noise(&[], &|_| None, &strong_noise, &mut rng);
    assert_eq!((alarm.status, alarm.arrival), (PingStatus::Echo, None));
}

#[test]
fn noise_rms_equals_floor() {
    let noise = ReceiverNoise { floor: 0.01, jitter_us: 0.0 };
    let receiver = receiver();
    let track = noise.track(&receiver, &mut Pcg64::seed_from_u64(5));
    let squares = (1..2000).map(|i| {
        let t_us = 10.0 * f64::from(i);
        (track.at(t_us).norm() / receiver.range_m(t_us)).powi(2)
    });
    let rms = (squares.sum::<f64>() / 1999.0).sqrt();
    assert!((rms / 0.01 - 1.0).abs() < 0.1, "{rms}");
}
