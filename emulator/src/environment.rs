//! Environment of the board: motor position and echoes.

use firmware_protocol::messages::limits::{TICK_HZ, WINDOW_TICKS_MAX};
use sonard_mock::{Firing, World};

use crate::CYCLES_PER_TICK;

/// Environment of the board beyond its pins.
pub trait Environment {
    /// Turns the motor by `steps`, with sign.
    fn turn(&mut self, steps: i32);
    /// Actual position of the motor relative to the index, steps.
    fn steps_from_index(&self) -> i32;
    /// Fires the ranger; returns the arrival times of the echoes in cycles after INIT rose, in
    /// ascending order.
    fn fire(&mut self) -> Vec<u64>;
}

/// Environment simulated by the mock.
impl Environment for World {
    fn turn(&mut self, steps: i32) {
        World::turn(self, steps);
    }

    fn steps_from_index(&self) -> i32 {
        World::steps_from_index(self)
    }

    fn fire(&mut self) -> Vec<u64> {
        let Firing { echo_ticks, .. } = World::fire(self, WINDOW_TICKS_MAX, TICK_HZ);
        echo_ticks.iter().map(|&ticks| u64::from(ticks) * CYCLES_PER_TICK).collect()
    }
}

/// Environment with prescribed echoes, accurate to the cycle.
#[derive(Debug, Clone, Default)]
pub struct ScriptedEnvironment {
    /// Arrival times of the echoes, cycles after INIT rose.
    pub echoes: Vec<u64>,
    /// Position of the motor, steps from the index.
    pub step: i32,
}

impl Environment for ScriptedEnvironment {
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
