//! Tests of the engines: closed forms, laws, and the phenomena of Dudek, Jenkin, Milios and Wilkes.

mod array;
mod beside;
mod closed_forms;
mod crosstalk;
mod extents;
mod floor_plans;
mod full_wave;
mod interactions;
mod laws;
mod listening;
mod multiples;
mod options;
mod phenomena;
mod reach;
pub(in crate::model) mod reference;

use std::sync::Arc;

use super::{
    Arrival, ConeOptions, Diffractor, EngineKind, EngineOptions, FanOptions, Options, Path,
    PathOptions, Reflector, Simulator,
};
use crate::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    reading::PathKind,
    scene::{Cylinder, Material, Scene, Wall, shipped},
};

/// Free space without absorption: geometry alone.
const BARE: FanOptions = FanOptions { lossless: true, max_order: None, ray_spacing_deg: 0.1 };

fn shipped_scene(name: &str) -> Scene {
    Scene::from_json(shipped::text(name).expect(name)).expect(name)
}

fn wall(id: &str, a: (f64, f64), b: (f64, f64), reflectance: f64) -> Wall {
    let material = Material::smooth(reflectance);
    Wall { id: id.into(), a: a.into(), b: b.into(), material, z_m: None }
}

fn cylinder(center: (f64, f64), radius_m: f64) -> Cylinder {
    let material = Material::RIGID;
    Cylinder { id: "post".into(), center: center.into(), radius_m, material, z_m: None }
}

fn scene(walls: Vec<Wall>) -> Scene {
    let mut scene = shipped_scene("simple-room");
    scene.walls = walls;
    scene.robot = None;
    scene
}

fn simulator(scene: Scene, options: impl Into<Options>) -> Simulator {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    Simulator::new(Arc::new(scene), sensor, Air::default(), options.into()).expect("good options")
}

fn arrivals(
    scene: Scene,
    options: impl Into<Options>,
    from: DVec2,
    direction_deg: f64,
) -> Vec<Arrival> {
    simulator(scene, options).at(from).arrivals(direction_deg.to_radians()).expect("few paths")
}

fn of_kind(arrivals: &[Arrival], kind: PathKind) -> impl Iterator<Item = &Arrival> {
    arrivals.iter().filter(move |arrival| arrival.path.kind() == kind)
}

/// Mirror reflections of a path, in order.
pub(in crate::model) fn reflectors(path: &Path) -> Vec<Reflector> {
    path.reflectors().collect()
}

/// Edges that diffract a path, in order.
pub(in crate::model) fn diffractors(path: &Path) -> Vec<Diffractor> {
    path.diffractors().collect()
}

fn pose(scene: &Scene, name: &str) -> Pose {
    scene.poses[name]
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found} instead of {expected}");
}
