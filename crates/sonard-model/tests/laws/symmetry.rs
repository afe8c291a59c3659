//! Invariance under motions of the world, and under different descriptions.

use rand::RngExt;
use sonard_model::geometry::DVec2;

use crate::{
    compare::{AS_IS, Turned, assert_same},
    worlds::*,
};

#[test]
fn moving_changes_nothing() {
    for (kind, name) in
        [(FURNISHED, "move"), (WITH_LEGS_PAIR, "move legs"), (WITH_HEIGHTS, "move heights")]
    {
        on_random_worlds(name, kind, |world, random| {
            let shift =
                DVec2::new(random.random_range(-50.0..50.0), random.random_range(-9.0..9.0));
            let there = world.clone().moved(|p| p + shift);
            let lists = [world, &there].map(|world| world.echoes(&settings()));
            assert_same(&lists[0], &lists[1], &settings(), AS_IS);
        });
    }
}

#[test]
fn turning_turns_directions() {
    for (kind, name) in
        [(FURNISHED_PAIR, "turn"), (WITH_LEGS, "turn legs"), (WITH_HEIGHTS, "turn heights")]
    {
        on_random_worlds(name, kind, |world, random| {
            let by_rad = any_angle(random);
            let there = world.clone().moved(|p| p.rotate(DVec2::from_angle(by_rad)));
            let lists = [world, &there].map(|world| world.echoes(&settings()));
            let turned =
                Turned { direction: Some(|direction, by| direction + by), by_rad, ..AS_IS };
            assert_same(&lists[0], &lists[1], &settings(), turned);
        });
    }
}

#[test]
fn mirroring_mirrors_directions() {
    for (kind, name) in
        [(FURNISHED_PAIR, "mirror"), (WITH_LEGS, "mirror legs"), (WITH_HEIGHTS, "mirror heights")]
    {
        on_random_worlds(name, kind, |world, _| {
            let there = world.clone().moved(|p| DVec2::new(p.x, -p.y));
            let lists = [world, &there].map(|world| world.echoes(&settings()));
            let turned = Turned { direction: Some(|direction, _| -direction), ..AS_IS };
            assert_same(&lists[0], &lists[1], &settings(), turned);
        });
    }
}

/// Scales everything, including the wavelength.
#[test]
fn scaling_with_the_wavelength() {
    on_random_worlds("scale", WITH_LEGS_PAIR, |world, random| {
        let by = random.random_range(0.5..2.0);
        let mut there = world.clone().moved(|p| by * p);
        there.rounds.iter_mut().for_each(|round| round.radius_m *= by);
        let mut larger = settings();
        larger.max_path_m *= by;
        larger.absorption_np_per_m /= by;
        larger.wave_number_per_m /= by;
        let here = world.echoes(&settings());
        let mut there = there.echoes(&larger);
        there.iter_mut().for_each(|echo| echo.length_m /= by);
        assert_same(&here, &there, &settings(), AS_IS);
    });
}

#[test]
fn splitting_changes_nothing() {
    for (kind, name) in
        [(FURNISHED, "split"), (WITH_LEGS_PAIR, "split legs"), (WITH_HEIGHTS, "split heights")]
    {
        on_random_worlds(name, kind, |world, random| {
            let pieces = world.split(random);
            let lists = [world, &pieces].map(|world| world.echoes(&settings()));
            assert_same(&lists[0], &lists[1], &settings(), AS_IS);
        });
    }
}

#[test]
fn wall_order_and_ends_are_ignored() {
    for (kind, name) in [
        (FURNISHED_PAIR, "reorder"),
        (WITH_LEGS, "reorder legs"),
        (WITH_HEIGHTS, "reorder heights"),
    ] {
        on_random_worlds(name, kind, |world, random| {
            let other = world.reordered(random);
            let lists = [world, &other].map(|world| world.echoes(&settings()));
            assert_same(&lists[0], &lists[1], &settings(), AS_IS);
        });
    }
}

#[test]
fn hidden_behind_closed_walls() {
    for (kind, name) in
        [(FURNISHED, "hide"), (WITH_LEGS_PAIR, "hide legs"), (WITH_HEIGHTS, "hide heights")]
    {
        on_random_worlds(name, kind, |world, random| {
            let more = world.with_hidden(random);
            let lists = [world, &more].map(|world| world.echoes(&settings()));
            assert_same(&lists[0], &lists[1], &settings(), AS_IS);
        });
    }
}
