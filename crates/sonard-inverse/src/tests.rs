//! Held to the model itself: what it predicts is what has to be found again.

mod candidates;
mod coarse;
mod course;
mod derivatives;
mod found;
mod margins;
mod near;
mod stopped;
mod thresholds;

use std::sync::Arc;

use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::Options,
    scene::{Scene, shipped},
};

use crate::World;

fn shipped(name: &str) -> Arc<Scene> {
    Arc::new(Scene::from_json(shipped::text(name).expect("a shipped scene")).expect("a scene"))
}

fn world(scene: &str, sensor: &str) -> World {
    let sensor = Sensor::preset(sensor).expect("a preset");
    World::new(shipped(scene), sensor, Air::default(), Options::default())
}

fn first_pose(scene: &Scene) -> Pose {
    *scene.poses.values().next().expect("a pose")
}
