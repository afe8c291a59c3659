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
        let ends = self.ends(ping, path)?;
        path.polyline(ends).or_else(|| self.path_again(ping, path, scene)?.polyline(ends))
    }

    /// Transmitter and receiver of a reading's own path or of the predicted one; the transmitter is another ranger's
    /// where that is whose sound was received. `None` if the log does not say where they were.
    #[must_use]
    pub fn ends(&self, ping: &Ping, path: &PathRecord) -> Option<[DVec2; 2]> {
        let own = self.viewpoint(ping)?.ends();
        let of_sim = ping.sim.as_ref().filter(|sim| sim.path.as_ref() == Some(path));
        let of_ping = ping.crosstalk.as_ref().filter(|_| ping.path.as_ref() == Some(path));
        let Some(other) = of_sim.and_then(|sim| sim.crosstalk.as_ref()).or(of_ping) else {
            return Some(own);
        };
        let sender = Ping { ranger: Some(other.ranger.clone()), ..ping.clone() };
        Some([self.viewpoint(&sender)?.ends()[0], own[1]])
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
