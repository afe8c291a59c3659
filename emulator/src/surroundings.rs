//! What the motor turns in and the ranger listens to.

use firmware_protocol::messages::limits::{TICK_HZ, WINDOW_TICKS_MAX};
use sonard_mock::World;

use crate::CYCLES_PER_TICK;

/// The world outside the board's pins.
pub trait Surroundings {
    /// One pulse of the motor: 1 or -1.
    fn turn(&mut self, steps: i32);
    /// How far the motor really is from the index, steps.
    fn steps_from_index(&self) -> i32;
    /// The ranger fires: when echoes come, cycles after INIT rose, in order.
    fn fire(&mut self) -> Vec<u64>;
}

/// The mock's world.
impl Surroundings for World {
    fn turn(&mut self, steps: i32) {
        World::turn(self, steps);
    }

    fn steps_from_index(&self) -> i32 {
        World::steps_from_index(self)
    }

    fn fire(&mut self) -> Vec<u64> {
        let heard = World::fire(self, WINDOW_TICKS_MAX, TICK_HZ);
        heard.iter().map(|&ticks| u64::from(ticks) * CYCLES_PER_TICK).collect()
    }
}

/// Echoes on order, to the cycle.
#[derive(Debug, Clone, Default)]
pub struct Commanded {
    /// When echoes come, cycles after INIT rose.
    pub echoes: Vec<u64>,
    /// Where the motor is, steps from the index.
    pub step: i32,
}

impl Surroundings for Commanded {
    fn turn(&mut self, steps: i32) {
        self.step += steps;
    }

    fn steps_from_index(&self) -> i32 {
        self.step
    }

    fn fire(&mut self) -> Vec<u64> {
        self.echoes.clone()
    }
}
