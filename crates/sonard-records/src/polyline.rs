//! Propagation paths of readings as polylines in the floor plan.

use sonard_model::geometry::DVec2;

use crate::{PathRecord, Ping, ScanView};

impl ScanView {
    /// Path of a reading as a polyline in the plan, metres: transmitter, interactions, receiver.
    /// `None` if the log lacks the transducer's position.
    #[must_use]
    pub fn polyline(&self, ping: &Ping, path: &PathRecord) -> Option<Vec<DVec2>> {
        Some(path.polyline(self.transducer_positions(ping, path)?))
    }

    /// Positions of transmitter and receiver for a reading's own path or the predicted one. With
    /// crosstalk the transmitter is that of another ranger. `None` if the log lacks their
    /// positions.
    #[must_use]
    pub fn transducer_positions(&self, ping: &Ping, path: &PathRecord) -> Option<[DVec2; 2]> {
        let own = self.viewpoint(ping)?.transducer_positions();
        let predicted = ping.sim.as_ref().filter(|sim| sim.path.as_ref() == Some(path));
        let simulated = ping.crosstalk.as_ref().filter(|_| ping.path.as_ref() == Some(path));
        let Some(other) = predicted.and_then(|sim| sim.crosstalk.as_ref()).or(simulated) else {
            return Some(own);
        };
        let sender = Ping { ranger: Some(other.ranger.clone()), ..ping.clone() };
        Some([self.viewpoint(&sender)?.transducer_positions()[0], own[1]])
    }
}
