//! Finding the index. Position zero is the step at which the sensor comes on in the forward
//! direction, whatever side it was reached from.
//!
//! Half a turn forwards, then at most a whole one backwards: the cable is never wound further
//! than half a turn from where it was.

use firmware_protocol::device::HomeError;

use crate::motion::{self, Arrival};

/// How far homing is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Leg {
    /// Forwards to where the index comes on: position zero.
    Ahead,
    /// Backwards, to find the index at all.
    Back,
    /// Backwards out of the index.
    Out,
    /// Forwards again, slowly found before: the index must be near.
    Final,
    /// To where it was seen.
    Return,
}

/// A search under way.
pub struct Homing {
    leg: Leg,
    speed: u16,
    acceleration: u32,
    revolution: u16,
    on: bool,
    seen: i32,
}

impl Homing {
    /// Begins. `on`: what the sensor reads at the index.
    pub fn begin(speed: u16, acceleration: u32, revolution: u16, on: bool) -> Self {
        let mut homing = Self { leg: Leg::Ahead, speed, acceleration, revolution, on, seen: 0 };
        if crate::pins::index() == on {
            homing.go(Leg::Out);
        } else {
            homing.go(Leg::Ahead);
        }
        homing
    }

    /// A leg has ended. `None` while there is another, then where the index was, in the
    /// coordinates so far, which begin there from now on.
    pub fn arrived(&mut self, arrival: &Arrival) -> Option<Result<i32, HomeError>> {
        match (self.leg, arrival.seen) {
            (Leg::Return, _) => {
                motion::shift_zero(self.seen);
                return Some(Ok(self.seen));
            }
            (Leg::Ahead | Leg::Final, Some(seen)) => {
                self.seen = seen;
                self.go(Leg::Return);
            }
            (Leg::Ahead, None) => self.go(Leg::Back),
            (Leg::Back, Some(_)) => self.go(Leg::Out),
            (Leg::Out, Some(_)) => self.go(Leg::Final),
            (Leg::Back | Leg::Out | Leg::Final, None) => {
                return Some(Err(HomeError::IndexNotFound));
            }
        }
        None
    }

    fn go(&mut self, leg: Leg) {
        self.leg = leg;
        let revolution = i32::from(self.revolution);
        let here = motion::position();
        let (target, watch) = match leg {
            Leg::Ahead | Leg::Final => (here.wrapping_add(revolution / 2), Some(self.on)),
            Leg::Back => (here.wrapping_sub(revolution), Some(self.on)),
            Leg::Out => (here.wrapping_sub(revolution / 2), Some(!self.on)),
            Leg::Return => (self.seen, None),
        };
        motion::turn(target, self.speed, self.acceleration, watch);
    }
}
