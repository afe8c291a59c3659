//! Rough walls, whose patches scatter with individual phases.

use rand::RngExt;
use sonard_model::{geometry::DVec2, model::paths::PathSettings};

use crate::{
    compare::{AS_IS, Turned, assert_same},
    worlds::*,
};

const ROUGH: Kind = Kind {
    partitions: 2,
    strips: 0,
    rounds: 1,
    roughness: 0.5,
    is_pair: false,
    has_heights: false,
};

fn listed() -> PathSettings {
    PathSettings { edge_law: None, floor: 0.005, max_path_m: 4.0, ..settings() }
}

/// Settings of the comparison: the last patches before the maximum range may be cut there, by a
/// hand's breadth.
fn compared() -> PathSettings {
    PathSettings { max_path_m: 3.9, ..listed() }
}

#[test]
fn speckle_ignores_splits() {
    on_random_worlds("rough split", ROUGH, |world, random| {
        let pieces = world.split(random);
        let lists = [world, &pieces].map(|world| world.echoes(&listed()));
        assert_same(&lists[0], &lists[1], &compared(), AS_IS);
    });
}

#[test]
fn speckle_ignores_order_and_ends() {
    on_random_worlds("rough reorder", ROUGH, |world, random| {
        let other = world.reordered(random);
        let lists = [world, &other].map(|world| world.echoes(&listed()));
        assert_same(&lists[0], &lists[1], &compared(), AS_IS);
    });
}

#[test]
fn speckle_moves_but_not_mirrors() {
    on_random_worlds("rough move", ROUGH, |world, random| {
        let by_rad = any_angle(random);
        let shift = DVec2::new(random.random_range(-5.0..5.0), 1.0);
        let there = world.clone().moved(|p| p.rotate(DVec2::from_angle(by_rad)) + shift);
        let lists = [world, &there].map(|world| world.echoes(&listed()));
        let turned = Turned { direction: Some(|direction, by| direction + by), by_rad, ..AS_IS };
        assert_same(&lists[0], &lists[1], &compared(), turned);
    });
}

#[test]
fn hidden_behind_rough_walls() {
    on_random_worlds("rough hide", ROUGH, |world, random| {
        let more = world.with_hidden(random);
        let lists = [world, &more].map(|world| world.echoes(&listed()));
        assert_same(&lists[0], &lists[1], &compared(), AS_IS);
    });
}
