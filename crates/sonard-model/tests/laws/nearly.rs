//! Continuity at corners that are nearly regular, where mirror images coincide and the edge between
//! them vanishes.

use std::f64::consts::PI;

use num_complex::Complex64;
use rand::RngExt;
use rand_pcg::Pcg64;
use sonard_model::{
    geometry::{DVec2, wrap_pi},
    model::paths::{EchoPath, PathSettings, Paths},
    scene::Scene,
};

use crate::worlds::*;

/// Corner of two long walls, with a transmitter and a receiver on one line to it.
struct Corner {
    opening_rad: f64,
    reflectance: [f64; 2],
    /// Direction to the transducers from the first wall, radians.
    from_rad: f64,
    /// Direction of the first wall, radians.
    turn_rad: f64,
    at: DVec2,
    distances_m: [f64; 2],
}

impl Corner {
    /// A corner of `pi / count` with an echo that returns by way of the corner itself.
    fn random(count: u32, random: &mut Pcg64) -> Self {
        let opening_rad = PI / f64::from(count);
        let first = random.random_range(0.5..1.0);
        let is_even = count.is_multiple_of(2);
        // An odd number of mirrors returns sound along the middle only.
        let share = if is_even { random.random_range(0.1..0.9) } else { 0.5 };
        let second = if is_even { random.random_range(0.5..1.0) } else { first };
        let distance_m = random.random_range(0.05..5.0);
        let other_m = if random.random() { distance_m } else { random.random_range(0.05..5.0) };
        Self {
            opening_rad,
            reflectance: [first, second],
            from_rad: share * opening_rad,
            turn_rad: any_angle(random),
            at: DVec2::new(random.random_range(-9.0..9.0), random.random_range(-9.0..9.0)),
            distances_m: [distance_m, other_m],
        }
    }

    /// Field of all echoes along the line to the corner, with the second wall turned by
    /// `deviation_rad` out of its regular direction.
    fn field(&self, deviation_rad: f64) -> Complex64 {
        let along = |from_rad: f64| DVec2::from_angle(self.turn_rad + from_rad);
        let turned_rad = [0.0, self.opening_rad + deviation_rad];
        let mut builder = Scene::builder("corner");
        for (number, (turned_rad, reflectance)) in
            turned_rad.into_iter().zip(self.reflectance).enumerate()
        {
            let ends = [self.at, self.at + 20.0 * along(turned_rad)].map(|end| end.to_array());
            let material = format!("m{number}");
            builder = builder.material(&material, reflectance).walls(
                &format!("w{number}"),
                &ends,
                &material,
            );
        }
        let mut scene = Scene::from_json(&builder.text()).expect("a valid scene");
        // As drawn, without corrections of right angles.
        scene.snap_m = 0.0;
        let middle_m = self.distances_m[0] + self.distances_m[1];
        let listed = PathSettings {
            max_path_m: middle_m + 0.1,
            floor: 1e-4,
            absorption_np_per_m: 0.0,
            ..settings()
        };
        let direction = along(self.from_rad);
        let [start, end] = self.distances_m.map(|distance_m| self.at + distance_m * direction);
        let echoes = Paths::new(&scene, listed).enumerate_between(start, end).expect("few paths");
        let back_rad = (-direction).to_angle();
        let is_along = |direction_rad: f64| wrap_pi(direction_rad - back_rad).abs() < 0.05;
        echoes
            .iter()
            .filter(|echo| is_along(echo.departure_rad) && is_along(echo.arrival_rad))
            .map(|echo| field_over(echo, middle_m))
            .sum()
    }
}

/// Field of an echo with the phase of its path beyond a length, metres.
fn field_over(echo: &EchoPath, length_m: f64) -> Complex64 {
    let phase_rad = echo.phase_rad - settings().wave_number_per_m * (echo.length_m - length_m);
    Complex64::from_polar(echo.amplitude, phase_rad)
}

/// The field changes by the share of a Fresnel zone by which the images move past the corner.
#[test]
fn corners_are_continuous_in_their_angle() {
    for case in 0..cases() {
        let mut random = generator("angle", case);
        let corner = Corner::random(random.random_range(1..5), &mut random);
        let regular = corner.field(0.0);
        let [here_m, there_m] = corner.distances_m;
        let kl = settings().wave_number_per_m * here_m * there_m / (here_m + there_m);
        for step in 0..41 {
            for sign in [-1.0, 1.0] {
                let deviation_rad = sign * 10_f64.powf(-12.0 + 0.25 * f64::from(step));
                let moved = (corner.field(deviation_rad) - regular).norm();
                let limit = 1e-6 + 12.0 * kl.sqrt() * deviation_rad.abs();
                assert!(
                    moved < limit,
                    "scene {case}: {moved} by {deviation_rad}, limit {limit}, {:?} {:?} {:?}",
                    corner.opening_rad,
                    corner.distances_m,
                    corner.reflectance
                );
            }
        }
    }
}

/// Sum of the fields of the echoes of a listing that are like one of them: in length to a
/// micrometre, in direction to 0.1 mrad.
fn field_like(echoes: &[EchoPath], one: &EchoPath) -> Complex64 {
    let is_like = |echo: &&EchoPath| {
        (echo.length_m - one.length_m).abs() < 1e-6
            && wrap_pi(echo.departure_rad - one.departure_rad).abs() < 1e-4
            && wrap_pi(echo.arrival_rad - one.arrival_rad).abs() < 1e-4
    };
    echoes.iter().filter(is_like).map(|echo| field_over(echo, one.length_m)).sum()
}

/// Splits walls with joints up to a nanometre off their lines, in rooms of four right angles and in
/// others.
#[test]
fn joints_within_a_nanometre_change_nothing() {
    for (name, is_rectangle) in [("joints", false), ("joints of rectangles", true)] {
        for case in 0..cases() {
            let mut random = generator(name, case);
            let kind = if random.random() { FURNISHED } else { FURNISHED_PAIR };
            let mut world = World::random(kind, &mut random);
            if is_rectangle {
                world = world.with_right_angles();
            }
            let split = world.split_off_line(&mut random);
            let lists = [&world, &split].map(|world| world.echoes(&settings()));
            for (one, other) in [(&lists[0], &lists[1]), (&lists[1], &lists[0])] {
                for echo in one.iter().filter(|echo| echo.amplitude > 0.012) {
                    let fields = [one, other].map(|list| field_like(list, echo));
                    let off = (fields[0] - fields[1]).norm();
                    assert!(off < 1e-4, "{name} {case}: {fields:?} of {echo:?}: {}", split.text());
                }
            }
        }
    }
}
