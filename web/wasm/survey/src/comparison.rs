//! Comparison of a survey with the true room, for the page.

use serde::Serialize;
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_survey::{Survey, trial::Comparison};

/// Figures of a survey in a room that is revealed.
#[derive(Debug, Serialize)]
pub(crate) struct RevealedFigures {
    /// Share of the true walls that is found within 2 cm and 2 degrees.
    recall: f64,
    /// Share of the walls found that is true.
    precision: f64,
    /// Median distance of the true corners to the nearest end of a wall found, metres; `None`
    /// without walls.
    corner_m: Option<f64>,
    /// Mean error of the positions of stops, metres.
    position_m: f64,
    /// Mean error of the headings of stops, degrees.
    heading_deg: f64,
    /// Number of true posts, of those that an observed one is near, and of other observed ones.
    posts: [usize; 3],
}

impl RevealedFigures {
    pub(crate) fn new(survey: &Survey, scene: &Scene, course: &[Pose]) -> Self {
        let compared = Comparison::new(survey, scene, course);
        let mut corners_m = compared.corners_m;
        corners_m.sort_by(f64::total_cmp);
        let middle = corners_m.get(corners_m.len() / 2).copied();
        Self {
            recall: compared.recall,
            precision: compared.precision,
            corner_m: middle.filter(|corner_m| corner_m.is_finite()),
            position_m: compared.position_m,
            heading_deg: compared.heading_deg,
            posts: compared.posts,
        }
    }
}
