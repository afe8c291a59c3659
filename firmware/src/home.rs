//! Homing: moves the motor through the index search.

use firmware_protocol::device::{HomeError, IndexSearch};

use crate::motion::{self, MoveEnd};

/// Index search in progress.
pub struct Homing {
    search: IndexSearch,
    speed: u16,
    acceleration: u32,
    /// Level of the sensor at the index.
    on: bool,
}

impl Homing {
    pub fn start(speed: u16, acceleration: u32, revolution: u16, on: bool) -> Self {
        let search = IndexSearch::begin(crate::pins::index() == on, revolution);
        let homing = Self { search, speed, acceleration, on };
        homing.start_move();
        homing
    }

    /// Processes the end of a move. Returns `None` if another move follows, else the position of
    /// the index in the present coordinates, which becomes zero.
    pub fn move_ended(&mut self, end: &MoveEnd) -> Option<Result<i32, HomeError>> {
        let outcome = self.search.arrived(end.seen);
        match outcome {
            None => self.start_move(),
            Some(Ok(seen)) => motion::shift_zero(seen),
            Some(Err(_)) => {}
        }
        outcome
    }

    fn start_move(&self) {
        let (target, until) = self.search.turn(motion::position());
        let watch = until.map(|on| on == self.on);
        motion::move_to(target, self.speed, self.acceleration, watch);
    }
}
