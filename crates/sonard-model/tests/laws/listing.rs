//! Completeness of listings: each echo once, none missing, backwards as forwards.

use rand::{Rng, RngExt};
use sonard_model::{
    geometry::DVec2,
    model::paths::{EchoPath, PathSettings},
};

use crate::{
    compare::{AS_IS, assert_same, floor_of},
    worlds::*,
};

/// Swaps transmitter and receiver.
fn swapped(world: &World) -> World {
    let [transmitter, receiver] = world.ends;
    World { ends: [receiver, transmitter], ..world.clone() }
}

/// Lists echoes from the other end.
fn from_the_other_end(mut echoes: Vec<EchoPath>) -> Vec<EchoPath> {
    for echo in &mut echoes {
        std::mem::swap(&mut echo.departure_rad, &mut echo.arrival_rad);
        echo.rise_rad.reverse();
    }
    echoes
}

#[test]
fn ends_are_interchangeable() {
    for (kind, name) in [
        (FURNISHED_PAIR, "swap"),
        (WITH_LEGS_PAIR, "swap legs"),
        (WITH_HEIGHTS_AND_LEGS_PAIR, "swap heights"),
    ] {
        on_random_worlds(name, kind, |world, _| {
            let there = world.echoes(&settings());
            let back = from_the_other_end(swapped(world).echoes(&settings()));
            assert_same(&there, &back, &settings(), AS_IS);
        });
    }
}

#[test]
fn reverse_paths_are_listed() {
    for (kind, name) in [
        (FURNISHED, "backwards"),
        (WITH_LEGS, "backwards legs"),
        (WITH_HEIGHTS, "backwards heights"),
    ] {
        on_random_worlds(name, kind, |world, _| {
            let there = world.echoes(&settings());
            assert_same(&there, &from_the_other_end(there.clone()), &settings(), AS_IS);
        });
    }
}

/// A room of four right angles: every image of the transmitter in the lattice is received, and
/// nothing else.
#[test]
fn pair_in_a_rectangle() {
    let listed = PathSettings {
        max_path_m: 6.0,
        floor: 1e-4,
        edge_law: None,
        absorption_np_per_m: 0.0,
        ..settings()
    };
    for case in 0..cases() {
        let mut random = generator("rectangle", case);
        let (world, size, ends) = rectangle(&mut random);
        let mut found: Vec<f64> = world.echoes(&listed).iter().map(|e| e.length_m).collect();
        let mut expected = lattice(size, ends, listed.max_path_m);
        found.sort_by(f64::total_cmp);
        expected.sort_by(f64::total_cmp);
        assert_eq!(found.len(), expected.len(), "scene {case}: {}", world.text());
        let off_m = found.iter().zip(&expected).map(|(one, other)| (one - other).abs());
        let off_m = off_m.fold(0.0, f64::max);
        assert!(off_m < 1e-9, "scene {case}: off by {off_m} m: {}", world.text());
    }
}

/// A rigid rectangle anywhere, with an `hc-sr04` 3 to 12 cm in front of one of its walls; also its
/// size and the places of both ends in its own frame.
fn rectangle(random: &mut impl Rng) -> (World, DVec2, [DVec2; 2]) {
    let size = DVec2::new(random.random_range(0.5..4.0), random.random_range(0.5..4.0));
    let from_wall_m = random.random_range(0.03..0.12);
    let along_m = random.random_range(0.05..0.95) * size.x;
    let half = 0.013 * DVec2::from_angle(any_direction(random));
    let middle = DVec2::new(along_m, from_wall_m);
    let ends = [middle - half, middle + half];
    let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), size, DVec2::new(0.0, size.y)];
    let wall = |i: usize| Wall {
        ends: [corners[i], corners[(i + 1) % 4]],
        reflectance: 1.0,
        roughness: 0.0,
        z_m: None,
    };
    let world =
        World { walls: (0..4).map(wall).collect(), rounds: Vec::new(), ends, heights: None };
    let turn = DVec2::from_angle(any_direction(random));
    let shift = DVec2::new(random.random_range(-5.0..5.0), random.random_range(-5.0..5.0));
    (world.moved(|p| p.rotate(turn) + shift), size, ends)
}

fn any_direction(random: &mut impl Rng) -> f64 {
    random.random_range(0.0..std::f64::consts::TAU)
}

/// Lengths from each image of the transmitter to the receiver (Allen and Berkley).
fn lattice(size: DVec2, [transmitter, receiver]: [DVec2; 2], max_path_m: f64) -> Vec<f64> {
    let images = |side: f64, at: f64| {
        let bound = (max_path_m / (2.0 * side)).ceil() as i32 + 1;
        let all = (-bound..=bound).flat_map(move |m| {
            let shift = 2.0 * f64::from(m) * side;
            [shift + at, shift - at]
        });
        all.collect::<Vec<f64>>()
    };
    let (xs, ys) = (images(size.x, transmitter.x), images(size.y, transmitter.y));
    xs.iter()
        .flat_map(|&x| ys.iter().map(move |&y| DVec2::new(x, y)))
        .filter(|image| image.distance(transmitter) > 1e-9)
        .map(|image| image.distance(receiver))
        .filter(|length_m| *length_m <= max_path_m)
        .collect()
}

#[test]
fn longer_range_only_adds() {
    for (kind, name) in [
        (FURNISHED_PAIR, "range"),
        (WITH_LEGS, "range legs"),
        (WITH_HEIGHTS_AND_LEGS_PAIR, "range heights"),
    ] {
        on_random_worlds(name, kind, |world, random| {
            let near = PathSettings { max_path_m: random.random_range(1.0..4.5), ..settings() };
            let within: Vec<_> = world
                .echoes(&settings())
                .into_iter()
                .filter(|echo| echo.length_m <= near.max_path_m)
                .collect();
            assert_same(&world.echoes(&near), &within, &near, AS_IS);
        });
    }
}

#[test]
fn lower_floor_only_adds() {
    for (kind, name) in [
        (FURNISHED_PAIR, "floor"),
        (WITH_LEGS, "floor legs"),
        (WITH_HEIGHTS_AND_LEGS_PAIR, "floor heights"),
    ] {
        on_random_worlds(name, kind, |world, random| {
            let loud = PathSettings { floor: random.random_range(0.01..0.05), ..settings() };
            let above = |echoes: Vec<EchoPath>| -> Vec<EchoPath> {
                echoes.into_iter().filter(|e| e.amplitude >= floor_of(e, &loud)).collect()
            };
            let (some, all) = (world.echoes(&loud), world.echoes(&settings()));
            let below = some.iter().find(|echo| echo.amplitude < floor_of(echo, &loud));
            assert!(below.is_none(), "{below:?} is below its floor, {}", loud.floor);
            assert_same(&some, &above(all), &loud, AS_IS);
        });
    }
}

/// With one floor for all paths, a listing is the stronger part of a longer one.
#[test]
fn amplitude_filters_the_listing() {
    let crowd = Kind { partitions: 1, strips: 0, rounds: 4, ..FURNISHED };
    for (kind, name) in
        [(WITH_LEGS, "filter"), (WITH_LEGS_PAIR, "filter pair"), (crowd, "filter crowd")]
    {
        on_random_worlds(name, kind, |world, random| {
            let of = |min_amplitude: f64| {
                let max_path_m = 3.0;
                PathSettings { max_path_m, ..settings() }.listing(Some(min_amplitude))
            };
            let low = of(0.02);
            let high = of(low.floor * 10_f64.powf(random.random_range(0.0..1.5)));
            let mut all = world.echoes(&low);
            all.retain(|echo| echo.amplitude >= high.floor);
            assert_same(&world.echoes(&high), &all, &high, AS_IS);
        });
    }
}

#[test]
fn higher_order_only_adds() {
    for (kind, name) in [
        (FURNISHED_PAIR, "order"),
        (WITH_LEGS, "order legs"),
        (WITH_HEIGHTS_AND_LEGS_PAIR, "order heights"),
    ] {
        on_random_worlds(name, kind, |world, random| {
            let bound = random.random_range(0..5);
            let low = PathSettings { max_order: Some(bound), ..settings() };
            let up_to: Vec<_> = world
                .echoes(&settings())
                .into_iter()
                .filter(|echo| echo.path.order() <= usize::from(bound))
                .collect();
            assert_same(&world.echoes(&low), &up_to, &low, AS_IS);
        });
    }
}
