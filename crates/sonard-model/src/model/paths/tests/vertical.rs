//! Floor and ceiling.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use super::*;
use crate::{
    acoustics::{BeamPattern, Sensor},
    model::{Engine, Reflector},
};

fn at_height(z_m: f64) -> PathSettings {
    PathSettings { sensor_z_m: Some(z_m), max_path_m: 8.0, ..LOSSLESS }
}

#[test]
fn wall_and_floor_corner() {
    let (d, h) = (0.8, 0.35);
    let mut room = scene(&[[-9.0, d, 9.0, d]]);
    room.floor_z_m = Some(0.0);
    let echoes = Paths::new(&room, at_height(h)).enumerate(DVec2::ZERO).expect("few paths");
    let lengths: Vec<f64> = echoes.iter().map(|echo| echo.length_m).collect();
    for (length_m, expected) in lengths.iter().zip([2.0 * h, 2.0 * d, 2.0 * d.hypot(h)]) {
        assert!((length_m - expected).abs() < 1e-12, "{lengths:?}");
    }
    assert_eq!(lengths.len(), 3);
    let corner = &echoes[2];
    assert_eq!(reflectors(&corner.path)[..], [Reflector::Wall(0), Reflector::Floor]);
    let below = -(h / d).atan();
    assert!((corner.rise_rad[0] - below).abs() < 1e-12);
    assert!((corner.rise_rad[1] - below).abs() < 1e-12, "as steep back as there");
    assert!((corner.amplitude - 1.0).abs() < 1e-12);
}

/// A box: the images are the lattice in three dimensions.
#[test]
fn box_is_the_image_lattice() {
    let size = [1.3, 0.9, 1.1];
    let at = [0.4, 0.25, 0.3];
    let corners =
        [[0.0, 0.0], [size[0], 0.0], [size[0], size[1]], [0.0, size[1]]].map(DVec2::from_array);
    let mut room = polygon(&corners);
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(size[2]));
    let settings = PathSettings { max_path_m: 6.0, ..at_height(at[2]) };
    let echoes =
        Paths::new(&room, settings).enumerate(DVec2::new(at[0], at[1])).expect("few paths");
    let along = |axis: usize| {
        (-4..=4).flat_map(move |m| {
            let shift = 2.0 * f64::from(m) * size[axis];
            [shift, shift - 2.0 * at[axis]]
        })
    };
    let mut expected = Vec::new();
    for x in along(0) {
        for y in along(1) {
            for z in along(2) {
                expected.push((x * x + y * y + z * z).sqrt());
            }
        }
    }
    expected.retain(|length| (1e-9..=6.0).contains(length));
    expected.sort_by(f64::total_cmp);
    assert_eq!(echoes.len(), expected.len());
    for (echo, length_m) in echoes.iter().zip(expected) {
        assert!((echo.length_m - length_m).abs() < 1e-9);
    }
}

/// Each reflection leaves its material's share, in the wall-floor corner and on any path.
#[test]
fn materials_of_floor_and_ceiling() {
    let corners = [[0.0, 0.0], [1.3, 0.0], [1.3, 0.9], [0.0, 0.9]].map(DVec2::from_array);
    let mut room = polygon(&corners);
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(1.1));
    let material = |reflectance, roughness| Material { reflectance, roughness };
    room.floor_material = material(0.5, 0.0);
    room.ceiling_material = material(0.9, 0.19);
    for wall in &mut room.walls {
        wall.material = material(0.8, 0.0);
    }
    let settings = PathSettings { max_path_m: 6.0, floor: 0.02, ..at_height(0.3) };
    let echoes =
        Paths::new(&room, settings.clone()).enumerate(DVec2::new(0.4, 0.25)).expect("few paths");
    for echo in &echoes {
        let gains = echo.path.reflectors().map(|reflector| match reflector {
            Reflector::Floor => 0.5,
            Reflector::Ceiling => 0.81,
            _ => 0.8,
        });
        let all: f64 = gains.product();
        assert!((echo.amplitude / all - 1.0).abs() < 1e-12, "{echo:?}");
    }
    let corner =
        echoes.iter().find(|e| reflectors(&e.path)[..] == [Reflector::Wall(3), Reflector::Floor]);
    assert!((corner.expect("the corner").amplitude - 0.4).abs() < 1e-12);
    // Only weak echoes are omitted.
    let rigid = Scene {
        floor_material: Material::RIGID,
        ceiling_material: Material::RIGID,
        ..room.clone()
    };
    let all = Paths::new(&rigid, PathSettings { floor: 1e-4, ..settings })
        .enumerate(DVec2::new(0.4, 0.25))
        .expect("few paths");
    let strong = all.iter().filter(|echo| {
        let hits = |level| {
            reflectors(&echo.path).iter().filter(|reflector| **reflector == level).count() as i32
        };
        let left = 0.5_f64.powi(hits(Reflector::Floor)) * 0.81_f64.powi(hits(Reflector::Ceiling));
        echo.amplitude * left >= 0.02
    });
    assert_eq!(strong.count(), echoes.len());
}

/// The weight is the beam pattern's at the angle in space.
#[test]
fn tilted_beam_finds_the_floor() {
    let (d, h) = (2.0, 0.3);
    let mut room = scene(&[[-9.0, d, 9.0, d]]);
    room.floor_z_m = Some(0.0);
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let beam = BeamPattern::new(&sensor, 343.99);
    let amplitude_at = |tilt_rad: f64, walls: &[Reflector]| {
        let settings = PathSettings { tilt_rad, floor: 1e-6, ..at_height(h) };
        let engine = PathEngine::new(&room, beam.clone(), None, settings);
        let place = engine.arrivals_at(DVec2::ZERO).expect("few paths");
        let arrivals = place.arrivals(FRAC_PI_2);
        arrivals.iter().find(|a| reflectors(&a.path)[..] == *walls).map_or(0.0, |a| a.amplitude)
    };
    let (wall, corner) = ([Reflector::Wall(0)], [Reflector::Wall(0), Reflector::Floor]);
    let below = (h / d).atan();
    assert!((amplitude_at(0.0, &wall) - 1.0).abs() < 1e-9);
    assert!((amplitude_at(0.0, &corner) - beam.one_way(below).powi(2)).abs() < 1e-9);
    assert!((amplitude_at(-0.05, &corner) - beam.one_way(below - 0.05).powi(2)).abs() < 1e-9);
    assert!((amplitude_at(-0.05, &wall) - beam.one_way(0.05).powi(2)).abs() < 1e-9);
    assert_eq!(amplitude_at(0.0, &[Reflector::Floor]), 0.0);
    assert!((amplitude_at(-FRAC_PI_2, &[Reflector::Floor]) - 1.0).abs() < 1e-9);
    assert!(amplitude_at(-FRAC_PI_4, &[Reflector::Floor]) < 0.01);
}

/// Without heights nothing changes, at any height of the ranger.
#[test]
fn planar_scene_ignores_height() {
    let plan = scene(&[[-1.0, 0.5, 4.0, 0.5], [0.3, -1.0, 4.0, 0.2]]);
    let settings = PathSettings { edge_law: Some(EdgeLaw::Utd), ..LOSSLESS };
    let flat = Paths::new(&plan, settings.clone()).enumerate(DVec2::ZERO).expect("few paths");
    let high = PathSettings { sensor_z_m: Some(3.0), ..settings };
    assert_eq!(Paths::new(&plan, high).enumerate(DVec2::ZERO).expect("few paths"), flat);
    assert!(flat.len() > 3);
}

/// A low wall in front of a high one: visible below its upper edge, passed above it.
#[test]
fn low_wall_blocks_below_its_edge() {
    let mut room = scene(&[[-9.0, 0.6, 9.0, 0.6], [-9.0, 1.5, 9.0, 1.5]]);
    room.walls[0].z_m = Some([0.0, 0.3]);
    let (low, high, floor) = (Reflector::Wall(0), Reflector::Wall(1), Reflector::Floor);
    let paths_from = |room: &Scene, z_m: f64| {
        let settings = PathSettings { max_order: Some(2), ..at_height(z_m) };
        let mut paths_from: Vec<_> = Paths::new(room, settings)
            .enumerate(DVec2::ZERO)
            .expect("few paths")
            .into_iter()
            .map(|echo| reflectors(&echo.path).to_vec())
            .collect();
        paths_from.sort();
        paths_from
    };
    // All sound at the ranger's height.
    assert_eq!(paths_from(&room, 0.2), [[low]]);
    assert_eq!(paths_from(&room, 0.4), [[high]]);
    // With a floor, the path by floor and wall hits the wall at its foot.
    room.floor_z_m = Some(0.0);
    let low_again = vec![low, floor];
    assert_eq!(paths_from(&room, 0.2), [vec![low], low_again.clone(), vec![floor]]);
    // From 0.4 the corner of low wall and floor is visible, and the high one's is hidden.
    assert_eq!(paths_from(&room, 0.4), [low_again, vec![high], vec![floor]]);
    // From 0.7 the path to the far corner and back is at 0.42 over the low wall.
    let all = paths_from(&room, 0.7);
    assert!(all.contains(&vec![high, floor]), "{all:?}");
}

/// A low post hides objects behind it from a ranger at its height, not from one above.
#[test]
fn low_cylinder_hides_only_behind() {
    let mut plan = scene(&[[-2.0, 2.0, 2.0, 2.0]]);
    (plan.floor_z_m, plan.ceiling_z_m) = (Some(0.0), Some(2.5));
    plan.cylinders = vec![crate::scene::Cylinder {
        id: Arc::from("post"),
        center: DVec2::new(0.0, 1.0),
        radius_m: 0.1,
        material: plan.walls[0].material,
        z_m: Some([0.0, 0.5]),
    }];
    let level = |z_m: f64| {
        let echoes = Paths::new(&plan, at_height(z_m)).enumerate(DVec2::ZERO).expect("few paths");
        let level = echoes.iter().filter(|echo| echo.rise_rad == [0.0; 2]);
        level.map(|echo| reflectors(&echo.path)[0]).collect::<Vec<_>>()
    };
    assert_eq!(level(0.4), [Reflector::Cylinder(0)]);
    assert_eq!(level(0.6), [Reflector::Wall(0)]);
}

/// A path to a corner touches the far wall there, which does not block it.
#[test]
fn corners_of_low_walls() {
    for turn in 0..12 {
        let frame = DVec2::from_angle(0.5 * f64::from(turn));
        let [corner, a, b] =
            [DVec2::ZERO, DVec2::new(-1.0, 0.0), DVec2::new(0.0, 1.0)].map(|p| frame.rotate(p));
        let mut plan = scene(&[[a.x, a.y, corner.x, corner.y], [corner.x, corner.y, b.x, b.y]]);
        plan.floor_z_m = Some(0.0);
        let settings = PathSettings { edge_law: Some(EdgeLaw::Utd), ..at_height(0.3) };
        let level = |plan: &Scene, at: DVec2| -> Vec<f64> {
            let mut echoes =
                Paths::new(plan, settings.clone()).enumerate(frame.rotate(at)).expect("few paths");
            let is_by_level_edge =
                |diffractor: &Diffractor| matches!(diffractor, Diffractor::Level { .. });
            echoes.retain(|e| {
                e.rise_rad == [0.0; 2] && !diffractors(&e.path).iter().any(is_by_level_edge)
            });
            echoes.iter().map(|echo| echo.length_m).collect()
        };
        for at in [DVec2::new(-0.4, 0.3), DVec2::new(0.4, -0.3)] {
            plan.walls.iter_mut().for_each(|wall| wall.z_m = None);
            let high = level(&plan, at);
            plan.walls.iter_mut().for_each(|wall| wall.z_m = Some([0.0, 0.5]));
            let low = level(&plan, at);
            // No path around or over a wall that sound does not pass at this height.
            assert!(high.iter().any(|length_m| (length_m - 1.0).abs() < 1e-9), "{high:?}");
            assert_eq!(low.len(), high.len(), "{low:?} {high:?}");
        }
    }
}
