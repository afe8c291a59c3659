//! Poses of a course without a scene.

use serde::{Deserialize, Serialize};
use sonard_inverse::{FitSweep, World};

use crate::{
    error::SurveyError, feature::VirtualFeature, normal::pose_column, options::SurveyOptions,
    progress::NoObserver, result::SurveyedPose, scores::PlanScores, slam::virtual_map,
    survey::workspace,
};

/// Poses and virtual features of a course.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CourseMap {
    /// Poses of the sweeps, in their order, in the frame of the first.
    pub poses: Vec<SurveyedPose>,
    /// Features that two or more places support, each with the number of arcs.
    pub features: Vec<(VirtualFeature, usize)>,
}

/// Estimates the poses of sweeps of an unknown room, with their poses as odometry.
///
/// Echoes of any order are landmarks: a mirror image of a wall is a line, a mirror image of a
/// corner or an edge is a point. Standard deviations are those of the joint estimate.
///
/// # Errors
/// As [`survey`](crate::survey).
pub fn map_course(
    world: &World,
    sweeps: &[FitSweep],
    options: &SurveyOptions,
) -> Result<CourseMap, SurveyError> {
    let scores = PlanScores::default();
    let workspace = workspace(world, (sweeps.into(), sweeps), options, (&NoObserver, &scores))?;
    let map = virtual_map(&workspace.arcs, workspace.readings[0].odometry, &workspace.moves);
    let sigma = |at: usize| match (pose_column(at), &map.covariance) {
        (None, _) => Some([0.0; 3]),
        (Some(column), Some(covariance)) => {
            Some([0, 1, 2].map(|of| covariance[(column + of, column + of)].max(0.0).sqrt()))
        }
        (Some(_), None) => None,
    };
    let poses = sweeps.iter().zip(&map.poses).enumerate().map(|(at, (sweep, pose))| {
        let sigma = sigma(at);
        SurveyedPose {
            scan: sweep.scan,
            pose: *pose,
            sigma_m: sigma.map(|[x, y, _]| [x, y]),
            sigma_heading_deg: sigma.map(|[.., heading_rad]| heading_rad.to_degrees()),
            equivalent: Vec::new(),
        }
    });
    let features = map.features.iter().map(|of| (of.feature, of.arcs.len()));
    Ok(CourseMap { poses: poses.collect(), features: features.collect() })
}
