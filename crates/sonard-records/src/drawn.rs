//! Paths of readings as lines in the plan.

use sonard_model::geometry::DVec2;

use crate::{PathRecord, Ping, ScanView};

impl ScanView {
    /// Path of a reading as a line in the plan, from the transmitter over the interactions to the receiver, metres;
    /// `None` if the log lacks the transducer's position.
    #[must_use]
    pub fn polyline(&self, ping: &Ping, path: &PathRecord) -> Option<Vec<DVec2>> {
        Some(path.polyline(self.ends(ping, path)?))
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
}
