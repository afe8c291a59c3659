//! Paths of readings as lines in the plan.

use std::sync::Arc;

use sonard_model::{acoustics::Air, geometry::DVec2, model::Simulator, scene::Scene};

use crate::{PathRecord, Ping, ScanView};

impl ScanView {
    /// A path of a reading as a line in the plan, from the transmitter over its points to the receiver. For
    /// a log of format 1, which has no points, the session's model finds it again in the scene; `None` if
    /// that has no such path.
    #[must_use]
    pub fn polyline(&self, ping: &Ping, path: &PathRecord, scene: &Scene) -> Option<Vec<DVec2>> {
        let ends = self.viewpoint(ping)?.ends();
        path.polyline(ends).or_else(|| self.path_again(ping, path, scene)?.polyline(ends))
    }

    fn path_again(&self, ping: &Ping, path: &PathRecord, scene: &Scene) -> Option<PathRecord> {
        let session = self.session.as_deref()?;
        let robot = ping.pose.or_else(|| self.pose())?;
        let axis = ping.axis(Some(session), &robot)?;
        let scene = Arc::new(session.scene_around(scene, &robot));
        let (sensor, air) = (session.sensor_of(ping), Air::try_from(&session.air).ok()?);
        let options = session.model.as_ref()?.options()?;
        let simulator = Simulator::new(Arc::clone(&scene), sensor, air, options).ok()?;
        let point = simulator.at(axis.position());
        let arrival = path.arrival(&point, axis.direction_rad(0.0))?;
        Some(PathRecord::of(&scene, &arrival.path, arrival.length_m))
    }
}
