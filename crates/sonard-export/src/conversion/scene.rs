//! The scene that readings are predicted in, as it is drawn.

use std::f64::consts::TAU;

use sonard_model::{geometry::DVec2, scene::Scene};
use sonard_records::Session;

use crate::ros::message::{Header, Marker, Shape};

const WIDTH_M: f64 = 0.01;
const COLOUR: [f32; 4] = [0.35, 0.35, 0.35, 1.0];
/// A round reflector is drawn by so many lines.
const SIDES: u32 = 24;
/// Beyond so many ends of lines a scene is not drawn: 24 bytes each.
const MOST_ENDS: usize = 1 << 15;

/// The ends of the lines that a session's scene is drawn by, walls and round reflectors apart; empty if it has none or
/// the log does not have its text.
pub(super) fn outlines(session: &Session) -> Vec<(&'static str, Vec<[f64; 3]>)> {
    let text = session.scene_text.as_deref();
    let Some(scene) = text.and_then(|text| Scene::from_json(text).ok()) else { return Vec::new() };
    let on_floor = |point: DVec2| [point.x, point.y, 0.0];
    let walls: Vec<_> =
        scene.walls.iter().flat_map(|wall| [wall.a, wall.b]).map(on_floor).collect();
    let cylinders: Vec<_> = scene
        .cylinders
        .iter()
        .flat_map(|cylinder| circle(cylinder.center, cylinder.radius_m))
        .map(on_floor)
        .collect();
    let drawn = vec![("walls", walls), ("cylinders", cylinders)];
    let ends: usize = drawn.iter().map(|(_, ends)| ends.len()).sum();
    if ends > MOST_ENDS { Vec::new() } else { drawn }
}

/// The ends of the sides of a circle, side by side.
fn circle(centre: DVec2, radius_m: f64) -> impl Iterator<Item = DVec2> {
    let corner = move |number: u32| {
        centre + radius_m * DVec2::from_angle(TAU * f64::from(number % SIDES) / f64::from(SIDES))
    };
    (0..SIDES).flat_map(move |side| [corner(side), corner(side + 1)])
}

pub(super) fn markers<'a>(
    outlines: Vec<(&'static str, Vec<[f64; 3]>)>,
    header: Header<'a>,
) -> Vec<Marker<'a>> {
    let marker = |(namespace, points)| Marker {
        header,
        namespace,
        shape: Shape::Lines,
        width_m: WIDTH_M,
        colour: COLOUR,
        points,
    };
    outlines.into_iter().map(marker).collect()
}
