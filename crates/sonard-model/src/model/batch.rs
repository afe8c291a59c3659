//! Predictions for many poses at once.

use rayon::prelude::*;

use super::{Prediction, Simulator, TooCostly};
use crate::{geometry::Pose, scan_plan::ScanPlan};

impl Simulator {
    /// [`predict`](Self::predict) for each pose, on all cores; the results equal those of one core,
    /// in the order of the poses.
    ///
    /// The scene is the same for all poses and has to contain a robot's body already, so poses of a
    /// robot need a simulator each.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory, at any pose.
    pub fn predict_many(
        &self,
        poses: &[Pose],
        plan: &ScanPlan,
    ) -> Result<Vec<Vec<Prediction>>, TooCostly> {
        poses.par_iter().map(|pose| self.predict(pose, plan)).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        acoustics::{Air, BeamPattern, EchoTrace, Receiver, ReceiverNoise, Sensor},
        model::{ObservationPoint, Options, Path, paths::Paths},
        scene::{Scene, shipped},
    };

    #[test]
    fn batch_equals_single_poses() {
        let text = shipped::text("two-surface-room").expect("shipped");
        let scene = Arc::new(Scene::from_json(text).expect("a scene"));
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let options = Options { max_range_m: Some(3.0), ..Options::default() };
        let simulator = Simulator::new(scene, sensor, Air::default(), options).expect("options");
        let pose = |i: i32| Pose {
            x_m: 0.3 + 0.25 * f64::from(i % 5),
            y_m: 0.3 + 0.3 * f64::from(i / 5),
            heading_deg: 7.0 * f64::from(i),
        };
        let poses: Vec<Pose> = (0..20).map(pose).collect();
        let plan = ScanPlan { step_deg: 9.0, ..ScanPlan::default() };
        let together = simulator.predict_many(&poses, &plan).expect("few paths");
        let alone: Result<Vec<_>, _> =
            poses.iter().map(|pose| simulator.predict(pose, &plan)).collect();
        assert_eq!(Ok(together), alone);
    }

    #[test]
    fn simulator_is_send_and_sync() {
        const fn shared<T: Send + Sync>() {}
        shared::<Scene>();
        shared::<Sensor>();
        shared::<Air>();
        shared::<BeamPattern>();
        shared::<Receiver>();
        shared::<ReceiverNoise>();
        shared::<EchoTrace>();
        shared::<Simulator>();
        shared::<ObservationPoint<'_>>();
        shared::<Prediction>();
        shared::<Path>();
        shared::<Paths>();
    }
}
