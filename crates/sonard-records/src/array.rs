//! Records of array scans: one or more rounds of an array's rangers.

use jiff::Timestamp;
use uuid::Uuid;

use super::{CrosstalkRecord, Ping, Provenance, ScanEnd, ScanStart, Session, SimRecord};
use sonard_model::{
    array::{InterferingFiring, RangerArray},
    geometry::Pose,
    model::{ArrayAtPose, ArrayModel, Prediction},
};

impl Session {
    /// Session of a simulated array.
    #[must_use]
    pub fn for_array(model: &ArrayModel, started: Timestamp) -> Self {
        let array = Some(model.array().as_ref().clone());
        Self { array, ..Self::simulated(model.simulator(), started) }
    }
}

impl ScanStart {
    /// Start of a simulated scan of `rounds` rounds of an array.
    #[must_use]
    pub fn for_array(
        model: &ArrayModel,
        scan: Uuid,
        pose: Pose,
        rounds: u32,
        time: Timestamp,
    ) -> Self {
        let plan = model.array().plan(rounds);
        Self { provenance: Some(Provenance::Simulated), ..Self::new(scan, time, pose, plan) }
    }
}

impl Ping {
    /// Predicted reading of an array's ranger, in a scan that began at `scan_pose`.
    #[must_use]
    pub fn for_array(
        at_pose: &ArrayAtPose<'_>,
        scan: Uuid,
        scan_pose: &Pose,
        index: u32,
        ranger: usize,
        prediction: &Prediction,
    ) -> Self {
        let mounted = &at_pose.array().rangers[ranger];
        let azimuth_deg = mounted.azimuth_deg();
        let ping = Self::simulated(at_pose.simulator(ranger), scan, index, azimuth_deg, prediction);
        Self {
            step: 0,
            ranger: Some(mounted.id.clone()),
            crosstalk: crosstalk(at_pose.array(), prediction),
            pose: Some(*at_pose.pose()).filter(|pose| pose != scan_pose),
            provenance: Some(Provenance::Simulated),
            ..ping
        }
    }
}

impl SimRecord {
    /// Record of a prediction for an array's ranger.
    #[must_use]
    pub fn for_array(at_pose: &ArrayAtPose<'_>, ranger: usize, prediction: &Prediction) -> Self {
        let crosstalk = crosstalk(at_pose.array(), prediction);
        Self { crosstalk, ..Self::from_prediction(at_pose.simulator(ranger), prediction) }
    }
}

fn crosstalk(array: &RangerArray, prediction: &Prediction) -> Option<CrosstalkRecord> {
    let InterferingFiring { ranger, before_us } = prediction.crosstalk?;
    Some(CrosstalkRecord { ranger: array.rangers[ranger].id.clone(), before_us })
}

impl ScanEnd {
    /// End of an array scan, with the numbers of measured and missing beams.
    #[must_use]
    pub fn for_array(
        model: &ArrayModel,
        scan: Uuid,
        [beams, missing]: [u32; 2],
        time: Timestamp,
    ) -> Self {
        let end = Self::simulated(model.simulator(), scan, beams, time);
        let duration_s = model.array().duration_s(beams);
        Self { missing, duration_s, provenance: Some(Provenance::Simulated), ..end }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sonard_model::{
        acoustics::{Air, Sensor},
        array::RangerArray,
        geometry::wrap_360,
        model::Options,
        scene::Scene,
    };

    use super::*;
    use crate::{Record, ScanView, decode_line, encode_line};

    const ROOM: &str = r#"{"name": "square", "materials": {"hard": {"reflectance": 1.0}},
        "walls": [{"id": "wall", "polyline": [[0, 0], [3, 0], [3, 3], [0, 3]], "closed": true,
                   "material": "hard"}]}"#;

    #[test]
    fn array_scan_has_viewpoints() {
        let array = RangerArray::preset("pioneer-8").expect("a preset");
        let sensor = Sensor::preset(&array.sensor).expect("a preset");
        let room = Scene::from_json(ROOM).expect("a scene");
        let (air, options) = (Air::default(), Options::default());
        let model =
            ArrayModel::new(Arc::new(array), &room, &sensor, air, options).expect("right options");
        let (time, scan) = (jiff::Timestamp::UNIX_EPOCH, uuid::Uuid::from_u128(1));
        let [from, to] = [0.0, 10.0].map(|heading_deg| Pose { x_m: 1.0, y_m: 1.0, heading_deg });
        let pings = [from, to].into_iter().zip(0..).map(|(pose, index)| {
            let at_pose = model.at(pose).expect("a valid pose");
            Record::Ping(Box::new(Ping::for_array(
                &at_pose,
                scan,
                &from,
                index,
                1,
                &at_pose.ping(1).expect("few paths"),
            )))
        });
        let records = [
            Record::Session(Box::new(Session::for_array(&model, time))),
            Record::ScanStart(ScanStart::for_array(&model, scan, from, 1, time)),
        ];
        let records = records.into_iter().chain(pings.collect::<Vec<_>>());
        let through_text = records.map(|record| {
            let mut line = Vec::new();
            encode_line(&record, &mut line).expect("encodable");
            let read = decode_line(line.trim_ascii_end()).expect("decodable");
            assert_eq!(read, record);
            read
        });
        let view = ScanView::from_records(through_text).remove(0);
        assert_eq!((view.pings[0].pose, view.pings[1].pose), (None, Some(to)));
        for (ping, robot) in view.pings.iter().zip([from, to]) {
            let mounted = model.array().rangers[1].world_pose(&robot);
            let viewpoint = view.viewpoint(ping).expect("a viewpoint");
            assert!(viewpoint.position().distance(mounted.position()) < 1e-12);
            assert_eq!(viewpoint.direction_deg, wrap_360(mounted.heading_deg));
        }
        let mut unknown = view.pings[0].clone();
        unknown.ranger = Some("s99".into());
        assert_eq!(view.viewpoint(&unknown), None);
    }
}
