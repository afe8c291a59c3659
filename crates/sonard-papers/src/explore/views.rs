//! Exploration by the next views of surveys.

use rand::Rng;
use sonard_model::geometry::Pose;
use sonard_survey::{
    NoObserver, Survey, SurveyError, SurveyOptions, survey,
    trial::{Comparison, Explorer},
};

/// Explores by next views and returns the last survey.
///
/// The robot sweeps along a course of at least two stops. Then its sweeps are surveyed and it
/// drives to the next view, repeatedly, until there is none or the number of stops is reached.
///
/// # Errors
/// As [`survey`].
pub fn explore_views(
    explorer: &mut Explorer<'_>,
    course: &[Pose],
    options: &SurveyOptions,
    max_stops: usize,
    random: &mut impl Rng,
) -> Result<Survey, SurveyError> {
    explorer.sweep_along(course, random)?;
    loop {
        let found = survey(explorer.world(), explorer.readings(), options, &NoObserver)?;
        let motion = Comparison::new(&found, &explorer.world().scene, explorer.stops()).motion;
        let is_last = explorer.stops().len() >= max_stops;
        let view = found.next_view.as_ref().filter(|_| !is_last);
        let way = view.and_then(|view| {
            explorer.way_to_view(motion.of(view.pose.position()), options.view_reach_m)
        });
        let Some(way) = way else { return Ok(found) };
        explorer.drive(way, random)?;
    }
}
