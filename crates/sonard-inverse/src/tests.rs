//! Parameters and poses recovered from simulated readings.

mod candidates;
mod changes;
mod checkpoint;
mod coarse;
mod course;
mod derivatives;
mod diagnosis;
mod margins;
mod near;
mod recovery;
mod thresholds;

pub(crate) use checkpoint::{PLACE, short};

use std::sync::Arc;

use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::Options,
    scene::{Scene, shipped},
};

use crate::{ErrorModel, World};

fn shipped(name: &str) -> Arc<Scene> {
    Arc::new(Scene::from_json(shipped::text(name).expect("a shipped scene")).expect("a scene"))
}

fn world(scene: &str, sensor: &str) -> World {
    let sensor = Sensor::preset(sensor).expect("a preset");
    World::new(shipped(scene), sensor, Air::default(), Options::default())
}

/// Standard deviation of the threshold from firing to firing, decibels.
const SIGMA_DB: f64 = 0.5;

/// Error model of readings with such thresholds, up to a maximum range.
fn as_read(reach_m: f64) -> ErrorModel {
    ErrorModel {
        outlier_share: 1e-3,
        outlier_arc_share: 0.0,
        ..ErrorModel::rough(1e-3, SIGMA_DB, reach_m)
    }
}

/// World with a single wall at a distance in metres.
fn before_a_wall(at_m: f64, reach_m: f64) -> World {
    let text = format!(
        r#"{{"name": "wall", "materials": {{"wood": {{"reflectance": 0.8}}}},
            "walls": [{{"id": "w", "from": [{at_m}, -9], "to": [{at_m}, 9], "material": "wood"}}]}}"#
    );
    let mut here = world("simple-room", "senscomp-6500");
    here.scene = Scene::from_json(&text).expect("a scene").into();
    here.options.max_range_m = Some(reach_m);
    here
}

fn first_pose(scene: &Scene) -> Pose {
    *scene.poses.values().next().expect("a pose")
}
