//! Markers of the scene in which readings are predicted.

use std::f64::consts::TAU;

use sonard_model::{geometry::DVec2, scene::Scene};
use sonard_records::Session;

use crate::ros::message::{Header, Marker, MarkerShape};

const WIDTH_M: f64 = 0.01;
const COLOUR: [f32; 4] = [0.35, 0.35, 0.35, 1.0];
/// Number of lines that approximate a cylinder.
const SIDES: u32 = 24;
/// Maximum number of line ends; larger scenes are not drawn. Each end has 24 bytes.
const MAX_ENDS: usize = 1 << 15;

/// Returns the line ends of a session's scene, walls and cylinders separately; empty without a
/// scene text in the log.
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
    if ends > MAX_ENDS { Vec::new() } else { drawn }
}

/// Returns the line ends of a polygon that approximates a circle.
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
        shape: MarkerShape::Lines,
        width_m: WIDTH_M,
        colour: COLOUR,
        points,
    };
    outlines.into_iter().map(marker).collect()
}
