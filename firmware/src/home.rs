//! Finding the index: turns the motor as the search says.

use firmware_protocol::device::{HomeError, IndexSearch};

use crate::motion::{self, Arrival};

/// A search under way.
pub struct Homing {
    search: IndexSearch,
    speed: u16,
    acceleration: u32,
    /// What the sensor reads at the index.
    on: bool,
}

impl Homing {
    pub fn begin(speed: u16, acceleration: u32, revolution: u16, on: bool) -> Self {
        let search = IndexSearch::begin(crate::pins::index() == on, revolution);
        let homing = Self { search, speed, acceleration, on };
        homing.go();
        homing
    }

    /// A turn has ended. `None` while there is another, then where the index was, in the
    /// coordinates so far, which begin there from now on.
    pub fn arrived(&mut self, arrival: &Arrival) -> Option<Result<i32, HomeError>> {
        let outcome = self.search.arrived(arrival.seen);
        match outcome {
            None => self.go(),
            Some(Ok(seen)) => motion::shift_zero(seen),
            Some(Err(_)) => {}
        }
        outcome
    }

    fn go(&self) {
        let (target, until) = self.search.turn(motion::position());
        let watch = until.map(|on| on == self.on);
        motion::turn(target, self.speed, self.acceleration, watch);
    }
}
