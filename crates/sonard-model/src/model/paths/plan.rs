//! The floor plan as sound is traced through it, and the settings of the search. All of it is made once
//! for a scene; nothing here knows where the ranger is.

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
pub(crate) use corners::{ALONG_RAD, Corner, Corners, Facing, Flank};
pub(crate) use cylinders::{Circle, Cylinders, Span, SurfaceArc};
pub(crate) use mesh::{Mesh, Side};
pub(crate) use posts::take_posts;
pub(crate) use raised::Raised;
pub(crate) use strips::take_strips;
pub(crate) use walls::{WallMirror, mirror_gain, scattered};

use super::{
    effort::{Bound, Effort},
    settings::Settings,
};

/// A scene's floor plan.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) settings: Settings,
    /// Of the search at hand.
    pub(crate) effort: Arc<Effort>,
    /// By wall of the scene.
    pub(crate) walls: Arc<[WallMirror]>,
    pub(crate) climbs: Arc<Climbs>,
    pub(crate) raised: Arc<Raised>,
    pub(crate) corners: Arc<Corners>,
    pub(crate) cylinders: Arc<Cylinders>,
    /// `None` for a scene with nothing in it.
    pub(crate) mesh: Option<Arc<Mesh>>,
}

impl Plan {
    /// The same for a search of its own.
    pub(crate) fn for_search(&self, most: Bound) -> Self {
        Self { effort: Arc::new(Effort::new(most)), ..self.clone() }
    }

    /// The same for paths up to a length, metres, which is at most the one it was prepared for.
    pub(crate) fn within(&self, max_path_m: f64) -> Self {
        let settings = Settings { max_path_m, ..self.settings.clone() };
        Self { settings, ..self.clone() }
    }

    /// Whether sound can pass a wall below or above.
    pub(crate) fn lets_pass(&self, wall: u32) -> bool {
        self.climbs.of_wall(wall).is_some()
    }
}
