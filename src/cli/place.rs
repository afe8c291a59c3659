//! Options that say where and in which directions to look: shared by several verbs.

use std::path::PathBuf;

use super::{Failure, scene_file};
use crate::{geometry::Pose, scan::ScanPlan, scene::Scene};

/// Where the ranger stands.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct PlaceArgs {
    /// Scene file, or the name of a shipped scene (`sonard scene list`); predicts in it
    #[arg(long, value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(super) pose: String,
}

impl PlaceArgs {
    /// The scene, and a pose at which a ranger can stand in it.
    pub(super) fn load(&self) -> Result<(Scene, Pose), Failure> {
        let scene = scene_file::load(&self.scene)?;
        let pose = scene_file::pose(&scene, &self.pose)?;
        Ok((scene, pose))
    }
}

/// Which azimuths.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct AzimuthArgs {
    /// First azimuth, degrees counter-clockwise from the heading
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    from_deg: f64,
    /// End of the azimuths, degrees; not itself fired at
    #[arg(long, value_name = "DEG", default_value_t = 360.0, allow_negative_numbers = true)]
    to_deg: f64,
    /// From stop to stop, degrees; on a device, a multiple of the motor's step
    #[arg(long, value_name = "DEG", default_value_t = 0.9)]
    step_deg: f64,
}

impl AzimuthArgs {
    /// A checked plan with so many firings at each stop.
    pub(super) fn plan(&self, pings_per_stop: u32) -> Result<ScanPlan, Failure> {
        let Self { from_deg, to_deg, step_deg } = *self;
        let plan = ScanPlan { from_deg, to_deg, step_deg, pings_per_stop };
        plan.check().map_err(|error| {
            Failure::input(error, "give --from-deg, --to-deg and --step-deg as `--help` says")
        })?;
        Ok(plan)
    }
}
