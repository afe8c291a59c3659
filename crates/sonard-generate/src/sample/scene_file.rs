//! Conversion of sampled rooms to scene files, which every command reads.

use std::collections::BTreeMap;

use rand::{Rng, RngExt as _};
use serde::Serialize;
use sonard_model::{geometry::DVec2, scene::Scene};

use super::{Rejection, furnish::Furniture, room::RoomOutline};
use crate::spec::{Spec, SpecSceneKeys};

/// Scene file. A struct keeps the order of members independent of the build, unlike a JSON map.
#[derive(Serialize)]
struct SceneFile<'a> {
    name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    floor_z_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    floor_material: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ceiling_z_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ceiling_material: Option<&'a str>,
    materials: BTreeMap<&'a str, MaterialEntry>,
    walls: Vec<WallEntry<'a>>,
    cylinders: Vec<CylinderEntry<'a>>,
}

#[derive(Serialize)]
struct MaterialEntry {
    reflectance: f64,
    roughness: f64,
}

#[derive(Serialize)]
struct WallEntry<'a> {
    id: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    from: Option<DVec2>,
    #[serde(skip_serializing_if = "Option::is_none")]
    to: Option<DVec2>,
    #[serde(skip_serializing_if = "Option::is_none")]
    polyline: Option<[DVec2; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    closed: Option<bool>,
    material: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    z_m: Option<[f64; 2]>,
}

#[derive(Serialize)]
struct CylinderEntry<'a> {
    id: String,
    center: DVec2,
    radius_m: f64,
    material: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    z_m: Option<[f64; 2]>,
}

/// Builds the scene of an outline and its furniture, with sampled materials.
///
/// # Errors
/// Returns an error for an invalid scene, such as walls of zero length or zero angle.
pub(super) fn scene(
    spec: &Spec,
    keys: &SpecSceneKeys,
    outline: &RoomOutline,
    pieces: &[Furniture],
    rng: &mut impl Rng,
) -> Result<Scene, Rejection> {
    let mut file = empty(spec, rng);
    for (number, ends) in outline.walls().enumerate() {
        let material = draw_material(&keys.walls, spec, rng);
        file.walls.push(WallEntry::single(format!("room.{number}"), ends, material));
    }
    let mut numbers = [0; 3];
    let mut id = |kind: usize, name: &str| {
        numbers[kind] += 1;
        format!("{name}-{}", numbers[kind])
    };
    for piece in pieces {
        let is_partition = matches!(piece, Furniture::Partition(_));
        let named = if is_partition { &keys.walls } else { &spec.furniture.materials };
        let material = draw_material(named, spec, rng);
        let top_m = spec.furniture.height_m.as_ref().map(|height| height.draw(rng));
        // Furniture that reaches the ceiling has no top.
        let top_m = top_m.filter(|top_m| file.ceiling_z_m.is_some_and(|ceiling| *top_m < ceiling));
        let z_m = top_m.map(|top_m| [0.0, top_m]);
        match piece {
            Furniture::Partition(ends) => {
                file.walls.push(WallEntry::single(id(0, "partition"), *ends, material));
            }
            Furniture::Box(corners) => file.walls.push(WallEntry {
                id: id(1, "box"),
                from: None,
                to: None,
                polyline: Some(*corners),
                closed: Some(true),
                material,
                z_m,
            }),
            Furniture::Cylinder { center, radius_m } => file.cylinders.push(CylinderEntry {
                id: id(2, "cylinder"),
                center: *center,
                radius_m: *radius_m,
                material,
                z_m,
            }),
        }
    }
    let text = serde_json::to_string(&file).map_err(|_| Rejection::Scene)?;
    Scene::from_json(&text).map_err(|_| Rejection::Scene)
}

/// Builds a scene without walls, with materials, floor and ceiling.
fn empty<'a>(spec: &'a Spec, rng: &mut impl Rng) -> SceneFile<'a> {
    let materials = spec.materials.iter().map(|(name, material)| {
        let reflectance = material.reflectance.draw(rng);
        (name.as_str(), MaterialEntry { reflectance, roughness: material.roughness.draw(rng) })
    });
    let mut file = SceneFile {
        name: &spec.set.name,
        floor_z_m: None,
        floor_material: None,
        ceiling_z_m: None,
        ceiling_material: None,
        materials: materials.collect(),
        walls: Vec::new(),
        cylinders: Vec::new(),
    };
    if let Some(heights) = &spec.heights {
        file.floor_z_m = Some(0.0);
        file.floor_material = Some(draw_material(&heights.floor, spec, rng));
        file.ceiling_z_m = Some(heights.ceiling_m.draw(rng));
        file.ceiling_material = Some(draw_material(&heights.ceiling, spec, rng));
    }
    file
}

impl<'a> WallEntry<'a> {
    const fn single(id: String, [from, to]: [DVec2; 2], material: &'a str) -> Self {
        Self {
            id,
            from: Some(from),
            to: Some(to),
            polyline: None,
            closed: None,
            material,
            z_m: None,
        }
    }
}

/// Draws one of the named materials, or of all if none is named.
fn draw_material<'a>(named: &'a [String], spec: &'a Spec, rng: &mut impl Rng) -> &'a str {
    match named.len() {
        0 => {
            let index = rng.random_range(0..spec.materials.len());
            spec.materials.keys().nth(index).map_or("", String::as_str)
        }
        count => &named[rng.random_range(0..count)],
    }
}
