//! What was drawn as a scene file, so that a scene of a set is one that every verb reads.

use std::collections::BTreeMap;

use rand::{Rng, RngExt as _};
use serde::Serialize;
use sonard_model::{geometry::DVec2, scene::Scene};

use super::{Unfit, furnish::Piece, room::Outline};
use crate::spec::{SceneKeys, Spec};

/// A scene file. Not a map of JSON: the order of its members must not hang on how the program was built.
#[derive(Serialize)]
struct File<'a> {
    name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    floor_z_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    floor_material: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ceiling_z_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ceiling_material: Option<&'a str>,
    materials: BTreeMap<&'a str, Material>,
    walls: Vec<Wall<'a>>,
    cylinders: Vec<Cylinder<'a>>,
}

#[derive(Serialize)]
struct Material {
    reflectance: f64,
    roughness: f64,
}

#[derive(Serialize)]
struct Wall<'a> {
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
struct Cylinder<'a> {
    id: String,
    center: DVec2,
    radius_m: f64,
    material: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    z_m: Option<[f64; 2]>,
}

/// The scene of an outline and its furniture, in materials that are drawn for it.
///
/// # Errors
/// When it is none: a wall of no length, an angle that closes.
pub(super) fn scene(
    spec: &Spec,
    keys: &SceneKeys,
    outline: &Outline,
    pieces: &[Piece],
    rng: &mut impl Rng,
) -> Result<Scene, Unfit> {
    let mut file = empty(spec, rng);
    for (number, ends) in outline.walls().enumerate() {
        let material = one_of(&keys.walls, spec, rng);
        file.walls.push(Wall::single(format!("room.{number}"), ends, material));
    }
    let mut numbers = [0; 3];
    let mut id = |kind: usize, name: &str| {
        numbers[kind] += 1;
        format!("{name}-{}", numbers[kind])
    };
    for piece in pieces {
        let is_partition = matches!(piece, Piece::Partition(_));
        let named = if is_partition { &keys.walls } else { &spec.furniture.materials };
        let material = one_of(named, spec, rng);
        let top_m = spec.furniture.height_m.as_ref().map(|height| height.draw(rng));
        // Furniture up to the ceiling has no top.
        let top_m = top_m.filter(|top_m| file.ceiling_z_m.is_some_and(|ceiling| *top_m < ceiling));
        let z_m = top_m.map(|top_m| [0.0, top_m]);
        match piece {
            Piece::Partition(ends) => {
                file.walls.push(Wall::single(id(0, "partition"), *ends, material));
            }
            Piece::Box(corners) => file.walls.push(Wall {
                id: id(1, "box"),
                from: None,
                to: None,
                polyline: Some(*corners),
                closed: Some(true),
                material,
                z_m,
            }),
            Piece::Cylinder { center, radius_m } => file.cylinders.push(Cylinder {
                id: id(2, "cylinder"),
                center: *center,
                radius_m: *radius_m,
                material,
                z_m,
            }),
        }
    }
    let text = serde_json::to_string(&file).map_err(|_| Unfit::Scene)?;
    Scene::from_json(&text).map_err(|_| Unfit::Scene)
}

/// The room without walls: its materials, its floor and its ceiling.
fn empty<'a>(spec: &'a Spec, rng: &mut impl Rng) -> File<'a> {
    let materials = spec.materials.iter().map(|(name, material)| {
        let reflectance = material.reflectance.draw(rng);
        (name.as_str(), Material { reflectance, roughness: material.roughness.draw(rng) })
    });
    let mut file = File {
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
        file.floor_material = Some(one_of(&heights.floor, spec, rng));
        file.ceiling_z_m = Some(heights.ceiling_m.draw(rng));
        file.ceiling_material = Some(one_of(&heights.ceiling, spec, rng));
    }
    file
}

impl<'a> Wall<'a> {
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

/// One of the named materials, or of all.
fn one_of<'a>(named: &'a [String], spec: &'a Spec, rng: &mut impl Rng) -> &'a str {
    match named.len() {
        0 => {
            let index = rng.random_range(0..spec.materials.len());
            spec.materials.keys().nth(index).map_or("", String::as_str)
        }
        count => &named[rng.random_range(0..count)],
    }
}
