//! Beam patterns compared with closed forms and tables.

use super::{face_response::PulsedFace, *};
use crate::acoustics::{BeamPoint, Pulse};

const SPEED_M_S: f64 = 343.99;
const RADIUS_M: f64 = 19.3e-3;

fn preset(name: &str) -> Sensor {
    Sensor::preset(name).expect("a preset")
}

fn ka(sound_speed_m_s: f64) -> f64 {
    TAU * 49.4e3 / sound_speed_m_s * RADIUS_M
}

#[test]
fn angle_at_inverts_the_pattern() {
    for name in Sensor::preset_names() {
        let beam = BeamPattern::new(&preset(name), SPEED_M_S);
        assert_eq!(beam.one_way(0.0), 1.0, "{name}");
        for level in [1e-12, 0.001, 0.0203, 0.1, 0.5, 0.9, 0.999_999] {
            let angle_rad = beam.angle_at(level);
            let off = beam.one_way(angle_rad) - level;
            assert!(off.abs() < 1e-9 || angle_rad == FRAC_PI_2, "{name} {level}: {off}");
            let before = (0..100).map(|i| beam.one_way(f64::from(i) / 100.0 * angle_rad));
            assert!(before.fold(1.0, f64::min) >= level - 1e-9, "{name} {level}");
        }
        assert_eq!([beam.angle_at(1.0), beam.angle_at(2.0)], [0.0; 2], "{name}");
    }
}

#[test]
fn piston_matches_tables() {
    let one_way = |degrees: f64| piston_directivity(ka(343.2), degrees.to_radians());
    assert!((20.0 * one_way(7.28).log10() + 6.0).abs() < 0.05, "{}", one_way(7.28));
    assert!(one_way(12.67) > 0.0 && one_way(12.69) < 0.0);
    let side = (1268..2500).map(|i| one_way(f64::from(i) / 100.0).abs()).fold(0.0, f64::max);
    assert!((20.0 * side.log10() + 17.6).abs() < 0.05, "{side}");
}

#[test]
fn kuc_siegel_integrates_to_cosine() {
    for degrees in [0.5_f64, 7.0, 30.0, 60.0, 89.0] {
        let theta_rad = degrees.to_radians();
        let half_span_s = RADIUS_M * theta_rad.sin() / SPEED_M_S;
        let count = 20_000;
        let step_s = 2.0 * half_span_s / f64::from(count);
        let integral: f64 = (0..count)
            .map(|i| (f64::from(i) + 0.5) * step_s - half_span_s)
            .map(|t| kuc_siegel_response(t, RADIUS_M, theta_rad, SPEED_M_S) * step_s)
            .sum();
        assert!((integral - theta_rad.cos()).abs() < 1e-6, "{degrees}: {integral}");
    }
}

#[test]
fn long_pulse_gives_the_piston() {
    let sensor = Sensor { pulse: Pulse::Gaussian { sigma_us: 5000.0 }, ..preset("senscomp-6500") };
    let beam = BeamPattern::new(&sensor, SPEED_M_S);
    for i in 0..89 {
        let theta_rad = f64::from(i).to_radians();
        let expected = (piston_directivity(ka(SPEED_M_S), theta_rad) * theta_rad.cos()).abs();
        let found = beam.one_way(theta_rad);
        assert!((found - expected).abs() < 2e-4, "{i}: {found} for {expected}");
    }
}

#[test]
fn matches_direct_convolution() {
    let sensor = preset("senscomp-6500");
    let Pulse::Burst { cycles, bandwidth_hz } = sensor.pulse else { panic!("a burst") };
    let length_s = cycles / sensor.frequency_hz;
    let sigma_s = 1.0 / (TAU * bandwidth_hz);
    let envelope = |t: f64| {
        0.5 * (libm::erf(t / sigma_s / 2f64.sqrt())
            - libm::erf((t - length_s) / sigma_s / 2f64.sqrt()))
    };
    let beam = BeamPattern::new(&sensor, SPEED_M_S);
    for degrees in [3.0_f64, 9.0, 12.68, 20.0, 50.0] {
        let theta_rad = degrees.to_radians();
        let half_span_s = RADIUS_M * theta_rad.sin() / SPEED_M_S;
        let count = 400;
        let step_s = 2.0 * half_span_s / f64::from(count);
        let magnitude = |time_s: f64| {
            let (mut re, mut im) = (0.0, 0.0);
            for i in 0..count {
                let u = (f64::from(i) + 0.5) * step_s - half_span_s;
                let h = kuc_siegel_response(u, RADIUS_M, theta_rad, SPEED_M_S) * step_s;
                let strength = h * envelope(time_s - u);
                let phase = TAU * sensor.frequency_hz * u;
                re += strength * phase.cos();
                im += strength * phase.sin();
            }
            f64::hypot(re, im)
        };
        let expected = (-200..500).map(|t| magnitude(f64::from(t) * 1e-6)).fold(0.0, f64::max);
        let found = beam.one_way(theta_rad);
        assert!((found - expected).abs() < 2e-4, "{degrees}: {found} for {expected}");
    }
}

#[test]
fn interpolation_error_is_bounded() {
    let sensor = preset("senscomp-6500");
    let beam = BeamPattern::new(&sensor, SPEED_M_S);
    let disc = PulsedFace::for_sensor(&sensor);
    for i in 0..1800 {
        let theta_rad = (f64::from(i) * 0.05 + 0.025).to_radians();
        let expected =
            theta_rad.cos() * disc.peak(ka(SPEED_M_S) * theta_rad.sin()) / disc.peak(0.0);
        let error = (beam.one_way(theta_rad) - expected).abs();
        let bound = if theta_rad < 0.19 { 2e-5 } else { 4e-4 };
        assert!(error < bound, "{theta_rad}: {error}");
    }
}

/// Faces of one shape share a table, whatever their size and the air: a pattern does not depend on
/// earlier requests. Wide faces have a coarser table of the same maximum size.
#[test]
fn shared_table_fits_each_face() {
    let sensor_with = |radius_m: f64| Sensor {
        aperture: Aperture::Piston { radius_m, skirts_db: None },
        ..preset("senscomp-6500")
    };
    let disc = PulsedFace::for_sensor(&sensor_with(RADIUS_M));
    let level = |beam: &BeamPattern, degrees: f64| beam.one_way(degrees.to_radians());
    let in_new_thread = |radius_m: f64, speed_m_s: f64| {
        std::thread::spawn(move || BeamPattern::new(&sensor_with(radius_m), speed_m_s))
            .join()
            .expect("a pattern")
    };
    for (radius_m, speed_m_s) in [
        (RADIUS_M, 343.99),
        (0.5 * RADIUS_M, 331.0),
        (2.0 * RADIUS_M, 360.0),
        (RADIUS_M, 300.0),
        (10.0 * RADIUS_M, 343.99),
    ] {
        let sensor = sensor_with(radius_m);
        let (beam, fresh) =
            (BeamPattern::new(&sensor, speed_m_s), in_new_thread(radius_m, speed_m_s));
        let ka = TAU * sensor.frequency_hz / speed_m_s * radius_m;
        for i in 0..180 {
            let degrees = 0.5 * f64::from(i);
            assert_eq!(level(&beam, degrees), level(&fresh, degrees), "{radius_m} {degrees}");
            let theta_rad = degrees.to_radians();
            let expected = theta_rad.cos() * disc.peak(ka * theta_rad.sin()) / disc.peak(0.0);
            let error = (level(&beam, degrees) - expected).abs();
            // Kinks of side lobes are limited by the resolution of the pattern's table.
            assert!(
                error < if ka < 40.0 { 1e-4 } else { 2e-3 },
                "{radius_m} {speed_m_s} {degrees}: {error}"
            );
        }
    }
}

/// A file can hold a face of thousands of wavelengths: the table must not take minutes.
#[test]
fn table_size_is_bounded() {
    let face =
        |ka: f64| face_response::FaceResponse::for_sensor(&preset("senscomp-6500"), ka).entries();
    for ka in [0.0, 1.0, 17.3, 39.9, 40.1, 81.0, 300.0] {
        assert!(face(ka) <= 4003, "{ka}: {}", face(ka));
    }
}

#[test]
fn gaussian_matches_bozma_kuc() {
    let beam = BeamPattern::new(&preset("bozma-kuc-60khz"), 343.0);
    assert!((beam.one_way(11.8_f64.to_radians()) - (-2.0_f64).exp()).abs() < 1e-12);
    // Two-way extent of a plane at tau = 0.02 on both sides: 23.3 degrees.
    let extent_deg = 2.0 * beam.angle_at(0.02_f64.sqrt()).to_degrees();
    assert!((extent_deg - 23.3).abs() < 0.05, "{extent_deg}");
}

fn with_skirts(level_db: Option<f64>) -> Sensor {
    let aperture = Aperture::Piston { radius_m: 6.5e-3, skirts_db: level_db };
    Sensor { aperture, ..preset("hc-sr04") }
}

/// Exceeds the piston by the floor's power, and falls with the angle where the piston does.
#[test]
fn side_lobe_floor_adds_power() {
    let [without, with] =
        [None, Some(-8.0)].map(|db| BeamPattern::new(&with_skirts(db), SPEED_M_S));
    let level = 10f64.powf(-8.0 / 20.0);
    let mut last = 1.0;
    for i in 0..=900 {
        let theta_rad = f64::from(i).to_radians() / 10.0;
        let [piston, held] = [&without, &with].map(|beam| beam.one_way(theta_rad));
        let skirts = level * theta_rad.cos();
        let expected = (piston.powi(2) + (1.0 - piston.powi(2)) * skirts.powi(2)).sqrt();
        assert!((held - expected).abs() < 1e-5, "{i}: {held} for {expected}");
        assert!(held <= last + 1e-12 && last - held < 0.01, "{i}: {held} after {last}");
        last = held;
    }
    assert!((with.one_way(0.0) - 1.0).abs() < 1e-6 && with.one_way(FRAC_PI_2) == 0.0);
    // A floor at -120 dB has no effect.
    let faint = BeamPattern::new(&with_skirts(Some(-120.0)), SPEED_M_S);
    for i in 0..900 {
        let theta_rad = f64::from(i).to_radians() / 10.0;
        assert!((faint.one_way(theta_rad) - without.one_way(theta_rad)).abs() < 2e-6);
    }
}

#[test]
fn table_interpolates_linearly() {
    let points = [(0.0, Some(0.0)), (20.0, Some(-4.0)), (45.0, Some(-9.0)), (100.0, None)];
    let points = points.map(|(angle_deg, level_db)| BeamPoint { angle_deg, level_db }).to_vec();
    let aperture = Aperture::Table { points, radius_m: 6.5e-3 };
    let beam = BeamPattern::new(&Sensor { aperture, ..preset("hc-sr04") }, SPEED_M_S);
    let level_db = |degrees: f64| 20.0 * beam.one_way(degrees.to_radians()).log10();
    for (degrees, expected_db) in
        [(0.0, 0.0), (10.0, -2.0), (20.0, -4.0), (32.5, -6.5), (45.0, -9.0)]
    {
        assert!((level_db(degrees) - expected_db).abs() < 1e-4, "{degrees}");
    }
    // Linear to zero amplitude.
    assert!((level_db(72.5) - (-9.0 + 20.0 * 0.5_f64.log10())).abs() < 1e-4);
    assert_eq!([100.1_f64, 179.0].map(|degrees| beam.one_way(degrees.to_radians())), [0.0; 2]);
    for i in 0..2000 {
        let [here, next] = [i, i + 1].map(|i| beam.one_way(f64::from(i).to_radians() / 20.0));
        assert!(next <= here && here - next < 0.002, "{i}: {here} {next}");
    }
    for level in [0.9, 0.5, 0.36] {
        assert!((beam.one_way(beam.angle_at(level)) - level).abs() < 1e-9, "{level}");
    }
}

#[test]
fn pattern_is_bounded_by_the_axis() {
    let line = Sensor {
        aperture: Aperture::Line {
            half_length_m: 0.0192,
            full_within_deg: 90.0,
            none_beyond_deg: 90.0,
        },
        ..preset("senscomp-6500")
    };
    for sensor in [preset("senscomp-6500"), preset("bozma-kuc-60khz"), line] {
        let beam = BeamPattern::new(&sensor, SPEED_M_S);
        assert!((beam.one_way(0.0) - 1.0).abs() < 1e-9, "{}", sensor.name);
        for i in 0..=1800 {
            let theta_rad = f64::from(i).to_radians() / 10.0;
            let amplitude = beam.one_way(theta_rad);
            assert!((0.0..=1.0 + 1e-9).contains(&amplitude), "{theta_rad}: {amplitude}");
            assert!(i <= 900 || amplitude == 0.0, "{theta_rad}");
            assert_eq!(amplitude, beam.one_way(-theta_rad));
        }
    }
}

/// Integral of the fourth power of `exp(-2 t^2 / h^2)`: `h sqrt(pi / 8)`.
#[test]
fn gaussian_power_matches_integral() {
    for half_angle_deg in [5.0, 12.0] {
        let aperture = Aperture::Gaussian { half_angle_deg, radius_m: 0.019 };
        let sensor = Sensor { aperture, ..Sensor::preset("senscomp-6500").expect("a preset") };
        let power_rad = BeamPattern::new(&sensor, 343.0).two_way_power_rad();
        let expected_rad = half_angle_deg.to_radians() * (PI / 8.0).sqrt();
        assert!((power_rad / expected_rad - 1.0).abs() < 1e-6, "{power_rad} {expected_rad}");
    }
}
