//! Options for scene, pose and azimuths, shared by several verbs.

use std::path::PathBuf;

use super::{Failure, scene_file};
use crate::{geometry::Pose, scan::ScanPlan, scene::Scene};

/// Options of the ranger's scene and pose.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct PlaceArgs {
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions
    #[arg(long, value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(super) pose: String,
}

impl PlaceArgs {
    /// Loads the scene, and checks that the pose is free.
    pub(super) fn load(&self) -> Result<(Scene, Pose), Failure> {
        let scene = scene_file::load(&self.scene)?;
        let pose = scene_file::pose(&scene, &self.pose)?;
        Ok((scene, pose))
    }
}

/// Options of the scan's azimuths.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct AzimuthArgs {
    /// First azimuth, degrees counter-clockwise from the heading
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    from_deg: f64,
    /// End of the azimuths, degrees, exclusive
    #[arg(long, value_name = "DEG", default_value_t = 360.0, allow_negative_numbers = true)]
    to_deg: f64,
    /// Step, degrees; on a device, a multiple of the motor's step
    #[arg(long, value_name = "DEG", default_value_t = 0.9)]
    step_deg: f64,
}

impl AzimuthArgs {
    /// Returns a checked plan with the given number of pings per step.
    pub(super) fn plan(&self, pings_per_stop: u32) -> Result<ScanPlan, Failure> {
        let Self { from_deg, to_deg, step_deg } = *self;
        let plan = ScanPlan { from_deg, to_deg, step_deg, pings_per_stop };
        plan.check().map_err(|error| {
            Failure::input(error, "see --from-deg, --to-deg and --step-deg in `--help`")
        })?;
        Ok(plan)
    }
}
