//! Setup of `sonard scan` from its options.

use std::sync::Arc;

use super::{super::mock_world::AssumedModel, Args};
use crate::{
    cli::{Failure, options::engine_options},
    ranger::{PrepareError, PreparedScan, ScanInputs},
};

/// Prepares everything that is needed before a port is opened.
pub(super) fn prepare(args: &Args) -> Result<PreparedScan, Failure> {
    let (scene, pose) = args.place.load()?;
    let inputs = ScanInputs {
        scene: Arc::new(scene),
        pose,
        pose_text: args.place.pose.clone(),
        plan: args.azimuths.plan(args.pings_per_stop)?,
        motion: args.motion.motion(),
        sensor: args.sensor.sensor()?,
        air: args.air.air()?,
        options: engine_options(&args.engine)?,
    };
    PreparedScan::new(inputs).map_err(|error| failure_from(&error))
}

fn failure_from(error: &PrepareError) -> Failure {
    match error {
        PrepareError::WindowTooShort(error) => Failure::input(error, error.help()),
        PrepareError::Model(error) => Failure::input(error, "see `sonard scan --help`"),
    }
}

/// Model that the host assumes of a mock's world.
pub(in crate::cli) const fn assumed(scan: &PreparedScan) -> AssumedModel<'_> {
    AssumedModel {
        scene: &scan.scene,
        pose: &scan.pose,
        sensor: &scan.sensor,
        air: &scan.air,
        options: &scan.options,
    }
}
