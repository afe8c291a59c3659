//! Effects of heights.

use rand::RngExt;

use crate::{
    compare::{AS_IS, Turned, assert_same},
    worlds::*,
};

/// Runs a law on scenes with floor and ceiling, without and with cylinders.
fn on_worlds_with_heights(law: &str, check: impl Fn(&World, &mut rand_pcg::Pcg64)) {
    on_random_worlds(law, WITH_HEIGHTS, &check);
    on_random_worlds(&format!("{law} legs"), WITH_HEIGHTS_AND_LEGS_PAIR, &check);
}

#[test]
fn raising_changes_nothing() {
    on_worlds_with_heights("raise", |world, random| {
        let by_m = random.random_range(-5.0..5.0);
        let lists = [world, &world.with_heights(|z_m| z_m + by_m)].map(|w| w.echoes(&settings()));
        assert_same(&lists[0], &lists[1], &settings(), AS_IS);
    });
}

#[test]
fn upside_down() {
    on_worlds_with_heights("upside down", |world, _| {
        let lists = [world, &world.with_heights(|z_m| -z_m)].map(|w| w.echoes(&settings()));
        let turned = Turned { is_upside_down: true, ..AS_IS };
        assert_same(&lists[0], &lists[1], &settings(), turned);
    });
}

#[test]
fn full_height_equals_no_limits() {
    on_worlds_with_heights("all the way", |world, random| {
        let limits = world.heights.map(|heights| heights.limits_z_m);
        let mut explicit = world.clone();
        for z_m in explicit.walls.iter_mut().map(|wall| &mut wall.z_m) {
            *z_m = z_m.or(limits.filter(|_| random.random()));
        }
        for z_m in explicit.rounds.iter_mut().map(|round| &mut round.z_m) {
            *z_m = z_m.or(limits.filter(|_| random.random()));
        }
        let lists = [world, &explicit].map(|world| world.echoes(&settings()));
        assert_same(&lists[0], &lists[1], &settings(), AS_IS);
    });
}

#[test]
fn absorbing_levels_equal_the_plane() {
    on_worlds_with_heights("swallow", |world, _| {
        let mut tall = world.clone();
        tall.walls.iter_mut().for_each(|wall| wall.z_m = None);
        tall.rounds.iter_mut().for_each(|round| round.z_m = None);
        let plane = World { heights: None, ..tall.clone() };
        if let Some(heights) = &mut tall.heights {
            heights.reflectance = [0.0; 2];
        }
        let lists = [&plane, &tall].map(|world| world.echoes(&settings()));
        assert_same(&lists[0], &lists[1], &settings(), AS_IS);
    });
}
