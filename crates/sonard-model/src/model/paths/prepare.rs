//! Preparation: the part of the work that depends on the scene alone.

use std::sync::Arc;

use super::{
    diffraction::EdgeToEdge,
    effort::{BOUND, Bound, Effort},
    floor::{
        Corners, Cylinders, Mesh, PlanCircle, Raised, TracingPlan, WallMirror, extract_posts,
        extract_strips,
    },
    height::Heights,
    settings::{PathSettings, default_sensor_z_m},
};
use crate::{
    acoustics::edge::EdgeLaw,
    geometry::{Arrangement, DVec2, Mirror},
    scene::{Cylinder, FloorPlan, Scene},
};

/// A scene prepared for enumerating echo paths.
#[derive(Debug, Clone)]
pub struct Paths {
    pub(super) plan: TracingPlan,
    pub(super) heights: Arc<Heights>,
    /// Empty without double diffraction.
    pub(super) edge_to_edge: Arc<EdgeToEdge>,
    /// Effort limit of a search.
    pub(super) bound: Bound,
}

impl Paths {
    /// Prepares a scene with the settings of the search.
    #[must_use]
    pub fn new(scene: &Scene, settings: PathSettings) -> Self {
        let drawn = scene.floor_plan();
        let usual = || default_sensor_z_m(scene.floor_z_m, scene.ceiling_z_m);
        let z_m = settings.sensor_z_m.unwrap_or_else(usual);
        let heights = Heights::new(scene, &drawn.walls, z_m, &settings);
        let plan = plan(scene, &drawn, &heights, settings);
        let has_double = plan.settings.double_diffraction;
        let mesh = plan.mesh.as_ref().filter(|_| has_double);
        let edge_to_edge = mesh.map(|mesh| EdgeToEdge::new(mesh, &plan.settings));
        Self {
            edge_to_edge: edge_to_edge.unwrap_or_default().into(),
            heights: heights.into(),
            plan,
            bound: BOUND,
        }
    }

    /// Returns a copy for paths up to a length, metres, which is at most the one it was prepared
    /// for.
    pub(super) fn within(&self, max_path_m: f64) -> Self {
        Self { plan: self.plan.within(max_path_m), ..self.clone() }
    }

    /// Height of the transducer, metres; `None` in a scene without floor and ceiling.
    #[must_use]
    pub fn sensor_z_m(&self) -> Option<f64> {
        self.heights.z_at(0.0)
    }
}

/// Prepares the floor plan of the objects at relevant heights.
fn plan(
    scene: &Scene,
    drawn: &FloorPlan,
    heights: &Heights,
    settings: PathSettings,
) -> TracingPlan {
    let is_there = |wall: u32| heights.is_relevant(scene.walls[wall as usize].z_m);
    let mut arrangement: Arrangement = drawn.restricted_to(is_there);
    let segments: &[(DVec2, DVec2)] = &drawn.walls;
    let gains: Vec<_> = scene.walls.iter().map(|wall| wall.material.mirror_amplitude()).collect();
    let climbs = heights.climbs(&settings);
    let circle = |c: &Cylinder| PlanCircle {
        center: c.center,
        radius_m: if heights.is_relevant(c.z_m) { c.radius_m } else { 0.0 },
        gain: c.material.mirror_amplitude(),
        is_opaque: heights.is_opaque(c.z_m),
    };
    let mut circles: Vec<PlanCircle> = scene.cylinders.iter().map(circle).collect();
    // Other laws have no aspect, and mirrors alone no edges.
    let (mut strips, mut posts) = (Vec::new(), Vec::new());
    if settings.edge_law == Some(EdgeLaw::Utd) {
        let (lets_pass, k) = (|wall| climbs.of_wall(wall).is_some(), settings.wave_number_per_m);
        strips = extract_strips(&mut arrangement, &gains, lets_pass, k);
        posts = extract_posts(&mut arrangement, &mut circles, k);
    }
    let round = circles.iter().filter(|circle| circle.radius_m > 0.0);
    let extra: Vec<_> =
        round.flat_map(|c| [c.center - c.radius_m, c.center + c.radius_m]).collect();
    // From outside the box no path to a wall and on to any receiver is short enough.
    let margin_m = settings.max_path_m + 1.0;
    let mesh = Mesh::new(&arrangement, heights.stacked(&arrangement), &extra, margin_m);
    let wall = |number: usize| {
        let ((a, b), gain) = (segments[number], gains[number]);
        let mirror = Mirror::through(a, b);
        WallMirror {
            mirror,
            rotor: mirror.rotor(),
            gain,
            loss_m: settings.same_loss_m(gain),
            scatter: scene.walls[number].material.scattered_energy(),
            z_m: scene.walls[number].z_m,
        }
    };
    let corners = settings
        .edge_law
        .map(|law| Corners::new(&arrangement, segments, &gains, law, strips, posts));
    let images: Vec<_> = heights.images.iter().map(|image| [image.gain, image.rise_m]).collect();
    TracingPlan {
        walls: (0..segments.len()).map(wall).collect(),
        climbs: climbs.into(),
        raised: Raised::new(&images, &settings).into(),
        corners: corners.unwrap_or_default().into(),
        cylinders: Cylinders::new(circles, mesh.as_ref()).into(),
        mesh: mesh.map(Arc::new),
        effort: Arc::new(Effort::new(BOUND)),
        settings,
    }
}
