//! Round bodies near walls, with repeated reflections between the two.

use std::f64::consts::PI;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::{model::Reflector, scene::Cylinder};

fn body(center: DVec2, radius_m: f64) -> Cylinder {
    let material = Material::RIGID;
    Cylinder { id: Arc::from("body"), center, radius_m, material, z_m: None }
}

/// A room of 0.928 m by 0.742 m with a body a hand's width from one wall and nearly touching
/// another.
fn narrow_room() -> Scene {
    let mut room =
        polygon(&[[0.0, 0.0], [0.928, 0.0], [0.928, 0.742], [0.0, 0.742]].map(DVec2::from_array));
    room.cylinders = vec![body(DVec2::new(0.774, 0.245), 0.15)];
    room
}

/// Along the normal between wall and body, with `n` contacts with the body, width and growth
/// undergo the same flight and reflection each time. The matrix of a round has a closed-form power.
#[test]
fn rounds_spread_as_matrix_power() {
    let (gap, height, r) = (0.095, 0.085, 0.15);
    let mut plan = scene(&[[-30.0, 0.0, 30.0, 0.0]]);
    plan.cylinders = vec![body(DVec2::new(0.0, gap + r), r)];
    let settings = PathSettings { max_path_m: 4.0, floor: 1e-5, ..LOSSLESS };
    let echoes = Paths::new(&plan, settings).enumerate(DVec2::new(0.0, height)).expect("few paths");

    // From the body to the wall and back: `w += D g`, then `g += 2 w / r`.
    let flight = 2.0 * gap;
    let round = [[1.0, flight], [2.0 / r, 1.0 + 2.0 * flight / r]];
    let mu = (1.0 + flight / r).acosh();
    let after = |n: i32, [w, g]: [f64; 2]| {
        let (a, b) =
            ((f64::from(n) * mu).sinh() / mu.sinh(), (f64::from(n - 1) * mu).sinh() / mu.sinh());
        [0, 1].map(|i| a * (round[i][0] * w + round[i][1] * g) - b * [w, g][i])
    };
    let mut seen = 0;
    // Away from the body or straight to it, and back from either side.
    for (out, home) in
        [(gap - height, gap - height), (gap - height, gap + height), (gap + height, gap + height)]
    {
        for n in 1..=9 {
            let [w, g] = after(n - 1, [out, 1.0 + 2.0 * out / r]);
            let length_m = out + f64::from(n - 1) * flight + home;
            let amplitude = (length_m / (w + home * g)).sqrt();
            let expected = if out == home { 1 } else { 2 };
            let found: Vec<_> = echoes
                .iter()
                .filter(|echo| (echo.length_m - length_m).abs() < 1e-9)
                .filter(|echo| (echo.amplitude / amplitude - 1.0).abs() < 1e-9)
                .collect();
            if amplitude > 1e-4 && length_m <= 4.0 {
                assert_eq!(found.len(), expected, "{n} contacts, {length_m} m, {amplitude}");
                seen += 1;
            }
        }
    }
    assert_eq!(seen, 27);
}

/// Traces a ray through the room independently of the engine.
fn crossings(room: &Scene, from: DVec2, angle: f64, reach_m: f64, at: DVec2, radius_m: f64) -> u32 {
    let round = &room.cylinders[0];
    let size = DVec2::new(0.928, 0.742);
    let (mut p, mut d, mut left_m) = (from, DVec2::from_angle(angle), reach_m);
    let mut count = 0;
    let mut is_first = true;
    while left_m > 0.0 {
        let to_wall = |p: f64, d: f64, size: f64| if d > 0.0 { (size - p) / d } else { -p / d };
        let (by_x, by_y) = (to_wall(p.x, d.x, size.x), to_wall(p.y, d.y, size.y));
        let foot = (round.center - p).dot(d);
        let half = round.radius_m.powi(2) - (round.center - p).perp_dot(d).powi(2);
        let by_round = if half > 0.0 && foot - half.sqrt() > 1e-9 {
            foot - half.sqrt()
        } else {
            f64::INFINITY
        };
        let step = by_x.min(by_y).min(by_round);
        let ahead = (at - p).dot(d);
        if !is_first
            && ahead > 0.0
            && ahead < step.min(left_m)
            && (at - p).perp_dot(d).abs() < radius_m
        {
            count += 1;
        }
        (p, left_m, is_first) = (p + step * d, left_m - step, false);
        if step == by_round {
            let normal = (p - round.center).normalize();
            d -= 2.0 * d.dot(normal) * normal;
        } else if step == by_x {
            d.x = -d.x;
        } else {
            d.y = -d.y;
        }
    }
    count
}

/// Energy: of rays sent out at random, as many pass by as the strengths of all echoes together
/// predict. A path whose rays have spread to `w` per radian sends `2 rho / w` of a radian to a
/// target of radius `rho`.
#[test]
fn energy_equals_random_rays() {
    const RAYS: u32 = 600_000;
    let (from, at, reach_m, radius_m) = (DVec2::new(0.3, 0.2), DVec2::new(0.25, 0.5), 1.9, 0.005);
    let room = narrow_room();
    let settings = PathSettings { max_path_m: reach_m, floor: 1e-5, ..LOSSLESS };
    let echoes = Paths::new(&room, settings).enumerate_between(from, at).expect("few paths");
    assert!(echoes.len() > 40, "{}", echoes.len());
    let share: f64 = echoes.iter().map(|echo| echo.amplitude.powi(2) / echo.length_m).sum();
    let expected = share * radius_m / PI * f64::from(RAYS);
    let mut random = Pcg64::seed_from_u64(5);
    let counted: u32 = (0..RAYS)
        .map(|_| crossings(&room, from, random.random_range(0.0..TAU), reach_m, at, radius_m))
        .sum();
    let off = f64::from(counted) / expected - 1.0;
    assert!(off.abs() < 0.03, "{counted} rays instead of {expected}");
}

#[test]
fn body_paths_are_reciprocal() {
    let paths =
        Paths::new(&narrow_room(), PathSettings { max_path_m: 2.5, floor: 1e-3, ..LOSSLESS });
    let (t, r) = (DVec2::new(0.3, 0.2), DVec2::new(0.774, 0.05));
    let (there, back) = (
        paths.enumerate_between(t, r).expect("few paths"),
        paths.enumerate_between(r, t).expect("few paths"),
    );
    let strong = |echoes: &[EchoPath]| echoes.iter().filter(|echo| echo.amplitude > 0.0101).count();
    assert!(strong(&there) > 300, "{}", strong(&there));
    assert_eq!(strong(&there), strong(&back));
    for echo in there.iter().filter(|echo| echo.amplitude > 0.0101) {
        let found = back.iter().any(|other| {
            reflectors(&other.path).iter().eq(reflectors(&echo.path).iter().rev())
                && (other.length_m - echo.length_m).abs() < 1e-9
                && (other.amplitude / echo.amplitude - 1.0).abs() < 1e-6
        });
        assert!(found, "no reverse of {echo:?}");
    }
}

/// Every echo of an exhaustive search, down to much weaker and longer echoes, that is short and
/// strong enough is also found by a search that ends there.
#[test]
fn pruned_search_is_complete() {
    let mut random = Pcg64::seed_from_u64(11);
    let mut count = 0;
    for case in 0..24 {
        let mut within = |range: std::ops::Range<f64>| random.random_range(range);
        let mut corner =
            |x: f64, y: f64| DVec2::new(x + within(-0.15..0.15), y + within(-0.15..0.15));
        let corners = [corner(0.0, 0.0), corner(1.1, 0.0), corner(1.1, 0.9), corner(0.0, 0.9)];
        let mut room = polygon(&corners);
        let center = DVec2::new(within(0.35..0.75), within(0.35..0.55));
        let radius_m = within(0.08..0.19);
        room.cylinders = vec![body(center, radius_m)];
        if case % 3 == 0 {
            room.cylinders.push(body(center + DVec2::new(0.26, 0.0), 0.05));
        }
        let out = DVec2::from_angle(within(0.0..TAU));
        let at = center + (radius_m + within(0.01..0.12)) * out;
        let is_hidden =
            room.cylinders.iter().any(|body| body.center.distance(at) < body.radius_m + 1e-3);
        if is_hidden {
            continue;
        }
        let settings = PathSettings {
            max_path_m: within(1.5..3.0),
            floor: within(2e-3..6e-3),
            unrestricted_m: within(0.3..1.0),
            absorption_np_per_m: 0.19,
            ..LOSSLESS
        };
        let all = PathSettings {
            max_path_m: settings.max_path_m + 1.0,
            floor: 0.2 * settings.floor,
            repeated_contact_ratio: 3.0,
            ..settings.clone()
        };
        let is_listed = |echo: &EchoPath| {
            let contacts = |surface: &&Reflector| matches!(surface, Reflector::Cylinder(_));
            let is_repeated = reflectors(&echo.path).iter().filter(contacts).count() > 1;
            echo.length_m <= settings.max_path_m
                && echo.amplitude >= settings.contact_floor(is_repeated, echo.length_m)
        };
        let found = Paths::new(&room, settings.clone()).enumerate(at).expect("few paths");
        let all = Paths::new(&room, all).enumerate(at).expect("few paths");
        let lengths_m = |echoes: &[EchoPath]| -> Vec<f64> {
            echoes.iter().filter(|echo| is_listed(echo)).map(|echo| echo.length_m).collect()
        };
        let [found_m, all_m] = [lengths_m(&found), lengths_m(&all)];
        assert_eq!(
            found_m.len(),
            all_m.len(),
            "case {case}: {corners:?}, {center} {radius_m}, {at}"
        );
        let are_same = found_m.iter().zip(&all_m).all(|(one, other)| (one - other).abs() < 1e-9);
        assert!(are_same, "case {case}");
        count += found_m.len();
    }
    assert!(count > 3000, "{count}");
}

/// The number of contacts is limited by detectability, not by a constant.
#[test]
fn contacts_end_with_detectability() {
    let most = |floor: f64| {
        let paths = Paths::new(&narrow_room(), PathSettings { max_path_m: 3.0, floor, ..LOSSLESS });
        let at_body = |echo: &EchoPath| {
            reflectors(&echo.path).iter().filter(|wall| **wall == Reflector::Cylinder(0)).count()
        };
        paths
            .enumerate(DVec2::new(0.774, 0.085))
            .expect("few paths")
            .iter()
            .map(at_body)
            .max()
            .unwrap_or(0)
    };
    let (few, more) = (most(1e-2), most(1e-3));
    assert!(few >= 3 && more >= few + 3, "{few} {more}");
}
