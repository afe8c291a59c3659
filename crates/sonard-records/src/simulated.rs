//! Simulated scans, without a device.

use jiff::Timestamp;
use uuid::Uuid;

use super::{Ping, Provenance, ScanEnd, ScanPlan, ScanStart, ScanView, Session, SimRecord};
use sonard_model::{
    geometry::Pose,
    model::{Prediction, Simulator, TooCostly},
};

/// Motor steps per revolution, the unit of `step`.
const STEPS_PER_REVOLUTION: f64 = 400.0;

impl ScanView {
    /// Simulates a whole scan at a pose, with its session; `time` is the time stamp of all records.
    ///
    /// # Errors
    /// If there are more paths than the model can trace.
    pub fn simulated(
        simulator: &Simulator,
        scan: Uuid,
        pose: &Pose,
        plan: &ScanPlan,
        time: Timestamp,
    ) -> Result<Self, TooCostly> {
        let point = simulator.at(pose.position());
        let ping = |index| {
            let azimuth_deg = plan.azimuth_deg(index / plan.pings_per_stop.max(1));
            let prediction = point.ping(pose.direction_rad(azimuth_deg))?;
            Ok(Ping::simulated(simulator, scan, index, azimuth_deg, &prediction))
        };
        let pings = (0..plan.beams()).map(ping).collect::<Result<_, TooCostly>>()?;
        Ok(Self {
            scan,
            session: Some(std::sync::Arc::new(Session::simulated(simulator, time))),
            start: Some(ScanStart::new(scan, time, *pose, *plan)),
            pings,
            events: Vec::new(),
            end: Some(ScanEnd::simulated(simulator, scan, plan.beams(), time)),
        })
    }
}

impl Session {
    /// Session of a simulated log.
    #[must_use]
    pub fn simulated(simulator: &Simulator, started: Timestamp) -> Self {
        let (sensor, air) = (simulator.sensor().clone(), simulator.air());
        let mut session = Self::new(started, Provenance::Simulated, sensor, air);
        session.set_scene(simulator.scene());
        session.model = Some(simulator.options().into());
        session
    }
}

impl Ping {
    /// Simulated reading from a prediction.
    #[must_use]
    pub fn simulated(
        simulator: &Simulator,
        scan: Uuid,
        index: u32,
        azimuth_deg: f64,
        prediction: &Prediction,
    ) -> Self {
        let record = SimRecord::from_prediction(simulator, prediction);
        Self {
            step: (azimuth_deg / 360.0 * STEPS_PER_REVOLUTION).round() as i32,
            tof_us: prediction.echoes_us.first().copied(),
            range_m: record.range_m,
            amplitude: record.amplitude,
            margin_db: record.margin_db,
            path: record.path,
            ..Self::new(scan, index, azimuth_deg, record.status)
        }
    }
}

impl ScanEnd {
    /// End of a simulated scan. Without a motor, a scan takes the sum of its detection windows.
    #[must_use]
    pub fn simulated(simulator: &Simulator, scan: Uuid, beams: u32, time: Timestamp) -> Self {
        let window_s = 2.0 * simulator.receiver().max_range_m / simulator.sound_speed_m_s();
        let windows_s = f64::from(beams) * window_s;
        Self {
            scan,
            time,
            beams,
            missing: 0,
            repaired: 0,
            duration_s: windows_s,
            acoustic_limit_s: windows_s,
            home_drift_steps: None,
            provenance: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sonard_model::{
        acoustics::{Air, Sensor},
        model::Options,
        scene::{Scene, shipped},
    };

    use super::*;

    /// Each window lasts for the round trip to the maximum range.
    #[test]
    fn simulated_duration_is_all_windows() {
        let scene = Scene::from_json(shipped::text("simple-room").expect("shipped"));
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let options = Options { max_range_m: Some(3.4), ..Options::default() };
        let scene = Arc::new(scene.expect("a scene"));
        let simulator = Simulator::new(scene, sensor, Air::default(), options).expect("a model");
        let end = ScanEnd::simulated(&simulator, Uuid::nil(), 400, Timestamp::UNIX_EPOCH);
        let expected_s = 400.0 * 2.0 * 3.4 / simulator.sound_speed_m_s();
        assert!((end.duration_s - expected_s).abs() < 1e-9, "{end:?}");
        assert!((7.9..8.0).contains(&end.acoustic_limit_s), "{end:?}");
        assert_eq!((end.beams, end.missing, end.repaired), (400, 0, 0));
    }
}
