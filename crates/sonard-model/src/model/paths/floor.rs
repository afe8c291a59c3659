//! Floor plan as the tracer needs it, and the settings of the search. Prepared once per scene and
//! independent of the ranger's position.

mod climbs;
mod corners;
mod cylinders;
mod mesh;
mod posts;
mod raised;
mod strips;
mod walls;

use std::sync::Arc;

pub(crate) use climbs::{ALL_SLOPES, Climbs, Spans, WallClimbs, united};
pub(crate) use corners::{ALONG_RAD, Corners, Facing, Flank, PlanCorner};
pub(crate) use cylinders::{AngleSpan, Cylinders, PlanCircle, SurfaceArc};
pub(crate) use mesh::{Mesh, TriangleSide};
pub(crate) use posts::extract_posts;
pub(crate) use raised::Raised;
pub(crate) use strips::extract_strips;
pub(crate) use walls::WallMirror;

use super::{
    effort::{Bound, Effort},
    settings::PathSettings,
};

/// Floor plan of a scene, prepared for tracing.
#[derive(Debug, Clone)]
pub(crate) struct TracingPlan {
    pub(crate) settings: PathSettings,
    /// Effort of the current search.
    pub(crate) effort: Arc<Effort>,
    /// Mirrors by wall of the scene.
    pub(crate) walls: Arc<[WallMirror]>,
    pub(crate) climbs: Arc<Climbs>,
    pub(crate) raised: Arc<Raised>,
    pub(crate) corners: Arc<Corners>,
    pub(crate) cylinders: Arc<Cylinders>,
    /// `None` for an empty scene.
    pub(crate) mesh: Option<Arc<Mesh>>,
}

impl TracingPlan {
    /// Returns a copy with a new effort counter, for one search.
    pub(crate) fn for_search(&self, bound: Bound) -> Self {
        Self { effort: Arc::new(Effort::new(bound)), ..self.clone() }
    }

    /// Returns a copy for paths up to a length, metres, which is at most the one it was prepared
    /// for.
    pub(crate) fn within(&self, max_path_m: f64) -> Self {
        let settings = PathSettings { max_path_m, ..self.settings.clone() };
        Self { settings, ..self.clone() }
    }

    /// Returns `true` if sound can pass below or above a wall.
    pub(crate) fn lets_pass(&self, wall: u32) -> bool {
        self.climbs.of_wall(wall).is_some()
    }
}
