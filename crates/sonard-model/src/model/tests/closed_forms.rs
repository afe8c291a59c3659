//! Single reflectors, whose echoes are known exactly.

use super::*;
use crate::{acoustics::BeamPattern, model::Edge, reading::PingStatus};

const SPACINGS_DEG: [f64; 3] = [0.4, 0.2, 0.05];

fn at_spacing(ray_spacing_deg: f64) -> Options {
    FanOptions { ray_spacing_deg, ..BARE }.into()
}

#[test]
fn wall_head_on() {
    for spacing_deg in SPACINGS_DEG {
        let one_wall = scene(vec![wall("w", (1.3, -3.0), (1.3, 2.0), 0.8)]);
        let all = arrivals(one_wall, at_spacing(spacing_deg), DVec2::ZERO, 0.0);
        let specular: Vec<_> = of_kind(&all, PathKind::Specular).collect();
        assert_eq!(specular.len(), 1);
        close(specular[0].length_m, 2.6, 1e-9, "length");
        close(specular[0].amplitude, 0.8, 1e-6, "amplitude");
        close(specular[0].departure_rad, 0.0, 1e-9, "departure");
        close(specular[0].arrival_rad, 0.0, 1e-9, "arrival");
    }
}

#[test]
fn wall_aslant_has_two_way_beam() {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let beam = BeamPattern::new(&sensor, Air::default().sound_speed_m_s());
    let one_wall = scene(vec![wall("w", (1.3, -3.0), (1.3, 2.0), 1.0)]);
    let simulator = simulator(one_wall, BARE);
    let point = simulator.at(DVec2::ZERO);
    for turned_deg in [-9.0_f64, -3.0, 0.5, 6.0, 11.0] {
        let all = point.arrivals(turned_deg.to_radians()).expect("few paths");
        let specular = of_kind(&all, PathKind::Specular).next().expect("an echo");
        let expected = beam.one_way(turned_deg.to_radians()).powi(2);
        close(specular.amplitude, expected, 1e-6, "amplitude");
        close(specular.length_m, 2.6, 1e-9, "length");
    }
}

#[test]
fn right_angled_corner() {
    for spacing_deg in SPACINGS_DEG {
        let corner = vec![
            wall("east", (0.9, -0.7), (0.9, 2.0), 1.0),
            wall("south", (-2.0, -0.7), (0.9, -0.7), 1.0),
        ];
        let vertex = DVec2::new(0.9, -0.7);
        let bearing_deg = vertex.to_angle().to_degrees();
        let all = arrivals(scene(corner), at_spacing(spacing_deg), DVec2::ZERO, bearing_deg);
        let twice: Vec<_> =
            of_kind(&all, PathKind::Specular).filter(|a| reflectors(&a.path).len() == 2).collect();
        // Each half of the beam hits the walls in its own order.
        assert_eq!(twice.len(), 2, "{spacing_deg}");
        for arrival in twice {
            close(arrival.length_m, 2.0 * vertex.length(), 1e-9, "length");
            close(arrival.arrival_rad, vertex.to_angle(), 1e-9, "arrival");
            close(arrival.amplitude, 1.0, 1e-6, "amplitude");
        }
    }
}

#[test]
fn parallel_walls() {
    let pair = vec![
        wall("north", (-4.0, 0.5), (4.0, 0.5), 0.9),
        wall("south", (-4.0, -0.3), (4.0, -0.3), 0.9),
    ];
    for spacing_deg in SPACINGS_DEG {
        let options = Options { max_range_m: Some(2.0), ..at_spacing(spacing_deg) };
        let all = arrivals(scene(pair.clone()), options, DVec2::ZERO, 90.0);
        let found: Vec<_> = of_kind(&all, PathKind::Specular).collect();
        // Odd orders that begin at the north wall; even ones return from behind.
        assert_eq!(found.len(), 2, "{spacing_deg}: {found:?}");
        for (arrival, (order, length_m)) in found.iter().zip([(1, 1.0), (3, 2.6)]) {
            assert_eq!(reflectors(&arrival.path).len(), order);
            close(arrival.length_m, length_m, 1e-9, "length");
            close(arrival.amplitude, 0.9f64.powi(order as i32), 1e-6, "amplitude");
        }
    }
}

#[test]
fn free_end_matches_kuc_siegel() {
    for range_m in [0.3, 1.0, 2.5] {
        // A wall at 60 degrees: its mirror echo leaves the beam, its near end stays.
        let end = (range_m, 0.0);
        let tilted = wall("w", end, (range_m + 0.5, 0.9), 1.0);
        let all = arrivals(scene(vec![tilted]), BARE, DVec2::ZERO, 0.0);
        let found = of_kind(&all, PathKind::Diffracted)
            .find(|arrival| {
                diffractors(&arrival.path)[..]
                    == [Diffractor::Upright(Edge { wall: 0, at_b: false })]
            })
            .expect("an echo of the end");
        let wavelength_m = Air::default().sound_speed_m_s() / 49.4e3;
        let expected = 1.0 / (std::f64::consts::TAU * (range_m / wavelength_m).sqrt());
        close(found.length_m, 2.0 * range_m, 1e-9, "length");
        close(found.amplitude, expected, 1e-4 * expected, "amplitude");
    }
}

#[test]
fn hidden_end_has_no_echo() {
    let walls = vec![
        wall("hidden", (1.0, 0.0), (1.5, 0.4), 1.0),
        wall("screen", (0.5, -0.4), (0.5, 0.4), 1.0),
    ];
    let all = arrivals(scene(walls), BARE, DVec2::ZERO, 0.0);
    let of_second =
        |a: &Arrival| matches!(diffractors(&a.path)[..], [Diffractor::Upright(e)] if e.wall == 1);
    assert!(of_kind(&all, PathKind::Diffracted).all(of_second));
}

/// A cylinder of radius r at distance d spreads a head-on echo to `sqrt(r / (r + d))` of a plane's
/// at the same distance (wave front of radius d on a mirror of radius r).
#[test]
fn cylinder_spreads_its_echo() {
    for (radius_m, distance_m) in [(0.05, 0.6), (0.3, 1.0), (0.02, 2.0)] {
        let mut post = scene(Vec::new());
        post.cylinders = vec![cylinder((radius_m + distance_m, 0.0), radius_m)];
        let all = arrivals(post, at_spacing(0.02), DVec2::ZERO, 0.0);
        assert_eq!(all.len(), 1);
        let expected = (radius_m / (radius_m + distance_m)).sqrt();
        close(all[0].length_m, 2.0 * distance_m, 1e-5, "length");
        close(all[0].amplitude, expected, 2e-3 * expected, "amplitude");
        close(all[0].arrival_rad, 0.0, 1e-3, "arrival");
    }
}

/// In a rectangle every echo is an image source of the lattice.
#[test]
fn rectangle_is_the_image_lattice() {
    let (width_m, depth_m, x_m, y_m) = (1.1, 0.83, 0.37, 0.29);
    let room = vec![
        wall("south", (0.0, 0.0), (width_m, 0.0), 1.0),
        wall("east", (width_m, 0.0), (width_m, depth_m), 1.0),
        wall("north", (width_m, depth_m), (0.0, depth_m), 1.0),
        wall("west", (0.0, depth_m), (0.0, 0.0), 1.0),
    ];
    let options = Options { max_range_m: Some(2.0), ..BARE.into() };
    let simulator = simulator(scene(room), options);
    let point = simulator.at(DVec2::new(x_m, y_m));
    let axis = |size_m: f64, at_m: f64| {
        (-5..=5).flat_map(move |n| {
            let shift_m = 2.0 * f64::from(n) * size_m;
            [shift_m, shift_m - 2.0 * at_m]
        })
    };
    let mut compared = 0;
    for azimuth_deg in (0..360).step_by(7) {
        let direction_rad = f64::from(azimuth_deg).to_radians();
        let mut expected: Vec<f64> = Vec::new();
        for (n, dx) in axis(width_m, x_m).zip(0..).map(|(dx, n)| (n, dx)) {
            for (m, dy) in axis(depth_m, y_m).zip(0..).map(|(dy, m)| (m, dy)) {
                let to_image = DVec2::new(dx, dy);
                // The sound leaves towards the image mirrored back into the room: for an even
                // number of mirrors along an axis it leaves opposite to its arrival.
                let mirrored = |even: bool, d: f64| if even { -d } else { d };
                let leaving = DVec2::new(mirrored(n % 2 == 0, dx), mirrored(m % 2 == 0, dy));
                let ahead = |end: DVec2| end.angle_to(DVec2::from_angle(direction_rad)).abs() < 0.2;
                let far = to_image.length();
                if far > 1e-9 && far < 3.99 && ahead(to_image) && ahead(leaving) {
                    expected.push(far);
                }
            }
        }
        expected.sort_by(f64::total_cmp);
        let arrivals = point.arrivals(direction_rad).expect("few paths");
        for length_m in expected {
            let found = of_kind(&arrivals, PathKind::Specular)
                .any(|arrival| (arrival.length_m - length_m).abs() < 1e-7);
            assert!(found, "{azimuth_deg}: no echo of {length_m} m");
            compared += 1;
        }
    }
    assert!(compared > 40, "{compared}");
}

#[test]
fn cone_reads_the_nearest_hit() {
    let options = ConeOptions { aperture_deg: Some(15.0) };
    let one_wall = scene(vec![wall("w", (1.0, -3.0), (1.0, 3.0), 1.0)]);
    let simulator = simulator(one_wall, options);
    let point = simulator.at(DVec2::ZERO);
    for (turned_deg, nearest_deg) in [(0.0_f64, 0.5_f64), (30.0, 22.5), (-40.0, -32.5)] {
        let prediction = point.ping(turned_deg.to_radians()).expect("few paths");
        assert_eq!(prediction.status, PingStatus::Echo);
        let expected = 1.0 / nearest_deg.to_radians().cos();
        close(prediction.range_m.expect("a range"), expected, 1e-9, "range");
    }
    assert_eq!(point.ping(std::f64::consts::PI).expect("few paths").status, PingStatus::NoEcho);
}

/// Ranges are measured from the face, and from the middle of a pair.
#[test]
fn face_off_the_axis() {
    let room = || scene(vec![wall("north", (-9.0, 1.0), (9.0, 1.0), 1.0)]);
    let range_m = |mounting: crate::acoustics::Mounting, direction_deg: f64| {
        let mut sensor = Sensor::preset("senscomp-6500").expect("a preset");
        sensor.mounting = mounting;
        sensor.blanking_us = 0.0;
        let options =
            PathOptions { ideal_receiver: true, lossless: true, ..PathOptions::default() };
        let simulator = Simulator::new(Arc::new(room()), sensor, Air::default(), options.into())
            .expect("good options");
        let ping =
            simulator.at(DVec2::ZERO).ping(f64::to_radians(direction_deg)).expect("few paths");
        ping.range_m.expect("a range")
    };
    let mounting = crate::acoustics::Mounting::default();
    close(range_m(mounting, 90.0), 1.0, 1e-12, "on the axis");
    let ahead = crate::acoustics::Mounting { ahead_m: 0.05, left_m: 0.02, ..mounting };
    close(range_m(ahead, 90.0), 0.95, 1e-12, "ahead");
    let turn = DVec2::from_angle(84_f64.to_radians());
    let face = turn.rotate(DVec2::new(0.05, 0.02));
    close(range_m(ahead, 84.0), 1.0 - face.y, 1e-12, "turned");
    let pair = crate::acoustics::Mounting { separation_m: 0.026, ..mounting };
    close(range_m(pair, 90.0), 1.0_f64.hypot(0.013), 1e-12, "a pair");
}
