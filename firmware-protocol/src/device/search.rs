//! Finding the index, for boards that have a sensor for it. Position zero is the step at which
//! the sensor comes on in the forward direction, whatever side it was reached from.
//!
//! Half a turn forwards, then at most a whole one backwards: the cable is never wound further
//! than half a turn from where it was.

use super::HomeError;

/// A search under way.
#[derive(Debug, Clone, Copy)]
pub struct IndexSearch {
    leg: Leg,
    /// Steps a revolution.
    revolution: u16,
    seen: i32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Leg {
    /// Forwards to where the index comes on: position zero.
    Ahead,
    /// Backwards, to find the index at all.
    Back,
    /// Backwards out of the index.
    Out,
    /// Forwards again: the index must be near.
    Final,
    /// To where it was seen.
    Return,
}

impl IndexSearch {
    /// Begins with the sensor on or off. Turn first as [`Self::turn`] says.
    #[must_use]
    pub const fn begin(at_index: bool, revolution: u16) -> Self {
        Self { leg: if at_index { Leg::Out } else { Leg::Ahead }, revolution, seen: 0 }
    }

    /// What to turn to from step `here`, and what to watch the sensor for meanwhile: brake as
    /// soon as it is on (`true`) or off. Then comes [`Self::arrived`].
    #[must_use]
    pub fn turn(&self, here: i32) -> (i32, Option<bool>) {
        let revolution = i32::from(self.revolution);
        match self.leg {
            Leg::Ahead | Leg::Final => (here.wrapping_add(revolution / 2), Some(true)),
            Leg::Back => (here.wrapping_sub(revolution), Some(true)),
            Leg::Out => (here.wrapping_sub(revolution / 2), Some(false)),
            Leg::Return => (self.seen, None),
        }
    }

    /// The last turn ended; `seen`: where the sensor became what it was watched for. `None` while
    /// there is another turn, then where the index is, in the coordinates so far, which begin
    /// there from now on.
    pub fn arrived(&mut self, seen: Option<i32>) -> Option<Result<i32, HomeError>> {
        self.leg = match (self.leg, seen) {
            (Leg::Return, _) => return Some(Ok(self.seen)),
            (Leg::Ahead | Leg::Final, Some(seen)) => {
                self.seen = seen;
                Leg::Return
            }
            (Leg::Ahead, None) => Leg::Back,
            (Leg::Back, Some(_)) => Leg::Out,
            (Leg::Out, Some(_)) => Leg::Final,
            (Leg::Back | Leg::Out | Leg::Final, None) => {
                return Some(Err(HomeError::IndexNotFound));
            }
        };
        None
    }
}

/// The same angle within half a turn of zero: the index comes once a turn.
#[must_use]
pub fn within_half_a_turn(steps: i32, revolution: u16) -> i32 {
    let revolution = i32::from(revolution);
    let mut near = steps;
    // No division: a microcontroller has none, and there are few turns.
    while revolution > 0 && near > revolution / 2 {
        near = near.wrapping_sub(revolution);
    }
    while revolution > 0 && near < -(revolution / 2) {
        near = near.wrapping_add(revolution);
    }
    near
}
