use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::geometry::Mirror;

/// Tolerance of lengths and positions, metres.
const SAME_M: f64 = 1e-9;

fn room(corners: &[DVec2], reflectances: &[f64], heights: Option<[f64; 2]>) -> Scene {
    let mut builder = Scene::builder("room");
    let next = corners.iter().cycle().skip(1);
    for (number, ((a, b), reflectance)) in corners.iter().zip(next).zip(reflectances).enumerate() {
        let material = format!("m{number}");
        let ends = [a.to_array(), b.to_array()];
        builder = builder.material(&material, *reflectance).walls(
            &format!("w{number}"),
            &ends,
            &material,
        );
    }
    if let (Some([floor, ceiling]), [.., below, above]) = (heights, reflectances) {
        builder = builder
            .heights(floor, ceiling)
            .material("floor", *below)
            .material("ceiling", *above)
            .floor_and_ceiling("floor", "ceiling");
    }
    Scene::from_json(&builder.text()).expect("a valid scene")
}

fn box_corners([x, y]: [f64; 2]) -> [DVec2; 4] {
    [DVec2::ZERO, DVec2::new(x, 0.0), DVec2::new(x, y), DVec2::new(0.0, y)]
}

/// Receiver, position, distance, reflectance and surfaces of an image.
type Row = (u32, [f64; 3], f64, f64, Vec<u32>);

fn rows(images: &ImageSources) -> Vec<Row> {
    let row = |at: usize| {
        let surfaces = images.surfaces(at).to_vec();
        let (position, distance) = (images.positions_m[at], images.distances_m[at]);
        (images.receivers[at], position, distance, images.reflectances[at], surfaces)
    };
    (0..images.len()).map(row).collect()
}

/// Asserts that two lists have the same images, wherever those at equal distances are.
#[track_caller]
fn assert_same(one: &ImageSources, other: &ImageSources) {
    assert_eq!(one.len(), other.len());
    let mut rest = rows(other);
    for image in rows(one) {
        let is_same = |row: &Row| {
            let apart = row.1.iter().zip(image.1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            row.0 == image.0
                && apart < SAME_M
                && (row.2 - image.2).abs() < SAME_M
                && (row.3 - image.3).abs() < 1e-12
                && row.4.len() == image.4.len()
        };
        let found = rest.iter().position(is_same);
        rest.swap_remove(found.unwrap_or_else(|| panic!("{image:?} is missing")));
    }
}

/// Random boxes in space and in the plan, with a reflectance for each surface.
#[test]
fn boxes_have_a_closed_form() {
    let mut random = Pcg64::seed_from_u64(1);
    for case in 0..60 {
        let dimensions = if case % 2 == 0 { 3 } else { 2 };
        let size: Vec<f64> = (0..dimensions).map(|_| random.random_range(1.0..6.0)).collect();
        let walls: Vec<f64> = (0..2 * dimensions).map(|_| random.random_range(0.3..1.0)).collect();
        let mut place = || {
            let mut at = [0.0; 3];
            at.iter_mut()
                .zip(&size)
                .for_each(|(at, side)| *at = side * random.random_range(0.05..0.95));
            at
        };
        let (source, receivers) = (place(), [place(), place(), place()]);
        let corners = box_corners([size[0], size[1]]);
        let scene = room(&corners, &walls, size.get(2).map(|height| [0.0, *height]));
        let traced = image_sources(&scene, source, &receivers, 5).expect("a room");
        let closed = BoxRoom::new(&size, &walls).expect("a box");
        let closed = closed.image_sources(source, &receivers, 5).expect("inside");
        assert_same(&traced, &closed);
        assert!(closed.len() > 150, "{}", closed.len());
        // Sequences of surfaces are those of the closed form, where no two are reached at once.
        let (mut traced, mut closed) = (rows(&traced), rows(&closed));
        for rows in [&mut traced, &mut closed] {
            rows.sort_by(|a, b| a.0.cmp(&b.0).then(a.4.cmp(&b.4)));
        }
        let equal = traced.iter().zip(&closed).filter(|(a, b)| a.4 == b.4).count();
        assert!(equal == closed.len(), "{equal} of {}", closed.len());
    }
}

/// A path backwards is a path.
#[test]
fn source_and_receiver_are_interchangeable() {
    let mut random = Pcg64::seed_from_u64(2);
    for _ in 0..50 {
        let (scene, places) = random_room(&mut random);
        let [a, b] = places;
        let there = image_sources(&scene, a, &[b], 5).expect("a room");
        let back = image_sources(&scene, b, &[a], 5).expect("a room");
        let key = |images: &ImageSources, is_reversed: bool| {
            let mut keys: Vec<(Vec<u32>, i64)> = (0..images.len())
                .map(|at| {
                    let mut surfaces = images.surfaces(at).to_vec();
                    if is_reversed {
                        surfaces.reverse();
                    }
                    (surfaces, (1e6 * images.distances_m[at]).round() as i64)
                })
                .collect();
            keys.sort();
            keys
        };
        assert_eq!(key(&there, false), key(&back, true));
    }
}

/// Images of a moved and turned room are the moved and turned images.
#[test]
fn moving_the_room_moves_the_images() {
    let mut random = Pcg64::seed_from_u64(3);
    for _ in 0..50 {
        let (scene, [a, b]) = random_room(&mut random);
        let turn = DVec2::from_angle(random.random_range(0.0..TAU));
        let shift = DVec2::new(random.random_range(-9.0..9.0), random.random_range(-9.0..9.0));
        let to = |p: DVec2| turn.rotate(p) + shift;
        let to_space = |[x, y, z]: [f64; 3]| {
            let at = to(DVec2::new(x, y));
            [at.x, at.y, z]
        };
        let mut moved = scene.clone();
        moved.walls.iter_mut().for_each(|wall| (wall.a, wall.b) = (to(wall.a), to(wall.b)));
        let mut here = image_sources(&scene, a, &[b], 4).expect("a room");
        let there = image_sources(&moved, to_space(a), &[to_space(b)], 4).expect("a room");
        here.positions_m.iter_mut().for_each(|at| *at = to_space(*at));
        assert_same(&here, &there);
    }
}

/// A quadrilateral room with a partition in it, and two places.
fn random_room(random: &mut Pcg64) -> (Scene, [[f64; 3]; 2]) {
    let mut near = |x: f64, y: f64| {
        DVec2::new(x + random.random_range(-0.4..0.4), y + random.random_range(-0.4..0.4))
    };
    let corners = [near(0.0, 0.0), near(4.0, 0.0), near(4.0, 3.0), near(0.0, 3.0)];
    let partition = [near(2.0, 0.9), near(2.0, 2.1)];
    let places = [near(1.0, 1.5), near(3.0, 1.5)].map(|at| [at.x, at.y, 1.1]);
    let heights = random.random::<bool>().then_some([0.0, 2.5]);
    let mut scene = room(&corners, &[0.9, 0.8, 0.7, 0.6, 0.5, 0.4], heights);
    let mut wall = scene.walls[0].clone();
    (wall.id, wall.a, wall.b) = ("partition".into(), partition[0], partition[1]);
    scene.walls.push(wall);
    (scene, places)
}

/// Sequences of walls whose image is visible, tried one by one. `margin_m` is the distance by which
/// a path must miss all ends of walls; `None` if it does not.
fn is_visible(scene: &Scene, sequence: &[usize], ends: [DVec2; 2], margin_m: f64) -> Option<bool> {
    let [source, receiver] = ends;
    let walls = |at: usize| (scene.walls[at].a, scene.walls[at].b);
    let mirror = |at: usize| Mirror::through(walls(at).0, walls(at).1);
    let mut images = vec![source];
    for &wall in sequence {
        images.push(mirror(wall).image(images[images.len() - 1]));
    }
    let (mut is_sure, mut to, mut behind) = (true, receiver, None);
    for at in (0..=sequence.len()).rev() {
        // From the receiver's side back to the source: the leg before the last point.
        let from = match at.checked_sub(1).map(|before| sequence[before]) {
            None => source,
            Some(wall) => {
                let (a, b) = walls(wall);
                let run = images[at] - to;
                let across = run.perp_dot(b - a);
                if across.abs() < 1e-12 {
                    return Some(false);
                }
                let share = (a - to).perp_dot(b - a) / across;
                let place_m = (a - to).perp_dot(run) / across * a.distance(b);
                is_sure &= place_m.abs() > margin_m && (place_m - a.distance(b)).abs() > margin_m;
                let off = share * run.length();
                if !(0.0..=a.distance(b)).contains(&place_m) || off <= 0.0 || share >= 1.0 {
                    return Some(false);
                }
                to + share * run
            }
        };
        let own = [behind, at.checked_sub(1).map(|before| sequence[before])];
        for other in (0..scene.walls.len()).filter(|other| !own.contains(&Some(*other))) {
            let (a, b) = walls(other);
            let (run, along) = (from - to, b - a);
            let across = run.perp_dot(along);
            let (share, place) =
                ((a - to).perp_dot(along) / across, (a - to).perp_dot(run) / across);
            let slack = margin_m / along.length();
            if (0.0..1.0).contains(&share) && (-slack..1.0 + slack).contains(&place) {
                is_sure &= (slack..1.0 - slack).contains(&place);
                return is_sure.then_some(false);
            }
        }
        behind = own[1];
        to = from;
    }
    is_sure.then_some(true)
}

/// Rooms with a partition against all sequences of walls, tried one by one.
#[test]
fn rooms_against_all_sequences() {
    let mut random = Pcg64::seed_from_u64(4);
    let mut compared = [0, 0];
    for _ in 0..40 {
        let (mut scene, places) = random_room(&mut random);
        (scene.floor_z_m, scene.ceiling_z_m) = (None, None);
        let ends = places.map(plan);
        let found = image_sources(&scene, places[0], &[places[1]], 4).expect("a room");
        let listed: Vec<&[u32]> = (0..found.len()).map(|at| found.surfaces(at)).collect();
        let count = scene.walls.len();
        for order in 0..=4 {
            for number in 0..count.pow(order) {
                let digit = |place: u32| number / count.pow(place) % count;
                let sequence: Vec<usize> = (0..order).map(digit).collect();
                if sequence.windows(2).any(|pair| pair[0] == pair[1]) {
                    continue;
                }
                let Some(expected) = is_visible(&scene, &sequence, ends, 1e-6) else { continue };
                let surfaces: Vec<u32> = sequence.iter().map(|wall| *wall as u32).collect();
                let is_listed = listed.contains(&&surfaces[..]);
                assert_eq!(is_listed, expected, "{surfaces:?} {ends:?} {:?}", scene.walls);
                compared[usize::from(expected)] += 1;
            }
        }
    }
    assert!(compared[0] > 10_000 && compared[1] > 500, "{compared:?}");
}

/// Two parallel walls in the open, and a source behind one of them.
#[test]
fn open_rooms_and_hidden_sources() {
    let text = Scene::builder("street")
        .material("m", 0.8)
        .walls("left", &[[0.0, 0.0], [50.0, 0.0]], "m")
        .walls("right", &[[0.0, 3.0], [50.0, 3.0]], "m")
        .text();
    let scene = Scene::from_json(&text).expect("a scene");
    let (source, receivers) = ([25.0, 1.0, 0.0], [[25.5, 2.0, 0.0], [25.0, -1.0, 0.0]]);
    let found = image_sources(&scene, source, &receivers, 9).expect("a scene");
    // Between the walls each order has two images, and behind one there is nothing.
    assert_eq!(
        found.orders(),
        (0..10).flat_map(|n| vec![n; if n == 0 { 1 } else { 2 }]).collect::<Vec<u16>>()
    );
    assert!(found.receivers.iter().all(|receiver| *receiver == 0));
    let first = [found.distances_m[0], found.delays_s(343.0)[0], found.amplitudes()[0]];
    let length_m = 1.25_f64.sqrt();
    let expected = [length_m, length_m / 343.0, 1.0 / (4.0 * PI * length_m)];
    assert!(first.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{first:?}");
    assert!(
        found
            .reflectances
            .iter()
            .zip(found.orders())
            .all(|(of, n)| { (of - 0.8_f64.powi(n.into())).abs() < 1e-12 })
    );
}

#[test]
fn invalid_rooms_are_rejected() {
    let box_room = |size: &[f64], walls: &[f64]| BoxRoom::new(size, walls).expect_err("invalid");
    for (size, walls, named) in [
        (&[1.0][..], &[1.0; 2][..], "number of dimensions"),
        (&[1.0, 2.0], &[1.0; 6], "number of reflectances"),
        (&[1.0, 0.0], &[1.0; 4], "size"),
        (&[1.0, f64::NAN], &[1.0; 4], "size"),
        (&[1.0, 2.0], &[1.0, 1.0, 1.1, 1.0], "reflectance"),
    ] {
        assert!(box_room(size, walls).to_string().starts_with(named), "{named}");
    }
    let room = BoxRoom::new(&[1.0, 2.0], &[1.0; 4]).expect("a box");
    assert!(room.image_sources([0.5, 2.1, 0.0], &[], 3).is_err());
    assert!(room.image_sources([0.5, 1.1, 0.0], &[[f64::NAN, 0.0, 0.0]], 3).is_err());
    let mut random = Pcg64::seed_from_u64(5);
    let (mut scene, [a, _]) = random_room(&mut random);
    assert!(image_sources(&scene, [f64::INFINITY, 0.0, 0.0], &[a], 3).is_err());
    scene.walls[0].z_m = Some([0.0, 1.0]);
    let error = image_sources(&scene, a, &[a], 3).expect_err("a low wall");
    assert!(matches!(error, ImageSourceError::LowWall { .. }), "{error}");
}
