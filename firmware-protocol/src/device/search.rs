//! Index search, for boards with an index sensor. Position zero is the step at which the sensor
//! switches on in the forward direction, regardless of the direction of approach.
//!
//! The search moves half a turn forwards, then at most a whole turn backwards. The cable is never
//! wound further than half a turn from its initial state.

use super::HomeError;

/// Index search in progress.
#[derive(Debug, Clone, Copy)]
pub struct IndexSearch {
    leg: SearchLeg,
    /// Steps per revolution.
    revolution: u16,
    seen: i32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SearchLeg {
    /// Forwards until the sensor switches on: position zero.
    Ahead,
    /// Backwards, to find the index at all.
    Back,
    /// Backwards until the sensor switches off.
    Out,
    /// Forwards again: the index must be near.
    Final,
    /// Back to the detected position.
    Return,
}

impl IndexSearch {
    /// Starts a search with the sensor on or off. The first move is that of [`Self::turn`].
    #[must_use]
    pub const fn begin(at_index: bool, revolution: u16) -> Self {
        Self { leg: if at_index { SearchLeg::Out } else { SearchLeg::Ahead }, revolution, seen: 0 }
    }

    /// Target of the next move from step `here`, and the sensor level to brake at: on (`true`),
    /// off, or none. Call [`Self::arrived`] after the move.
    #[must_use]
    pub fn turn(&self, here: i32) -> (i32, Option<bool>) {
        let revolution = i32::from(self.revolution);
        match self.leg {
            SearchLeg::Ahead | SearchLeg::Final => (here.wrapping_add(revolution / 2), Some(true)),
            SearchLeg::Back => (here.wrapping_sub(revolution), Some(true)),
            SearchLeg::Out => (here.wrapping_sub(revolution / 2), Some(false)),
            SearchLeg::Return => (self.seen, None),
        }
    }

    /// Processes the end of a move; `seen` is the step at which the sensor reached the level of
    /// [`Self::turn`]. Returns `None` if another move follows, else the position of the index in
    /// the present coordinates. That position becomes zero.
    pub fn arrived(&mut self, seen: Option<i32>) -> Option<Result<i32, HomeError>> {
        self.leg = match (self.leg, seen) {
            (SearchLeg::Return, _) => return Some(Ok(self.seen)),
            (SearchLeg::Ahead | SearchLeg::Final, Some(seen)) => {
                self.seen = seen;
                SearchLeg::Return
            }
            (SearchLeg::Ahead, None) => SearchLeg::Back,
            (SearchLeg::Back, Some(_)) => SearchLeg::Out,
            (SearchLeg::Out, Some(_)) => SearchLeg::Final,
            (SearchLeg::Back | SearchLeg::Out | SearchLeg::Final, None) => {
                return Some(Err(HomeError::IndexNotFound));
            }
        };
        None
    }
}

/// Returns the equivalent angle within half a turn of zero, as the index occurs once per
/// revolution.
#[must_use]
pub fn within_half_a_turn(steps: i32, revolution: u16) -> i32 {
    let revolution = i32::from(revolution);
    let mut near = steps;
    // Subtracts, because the microcontroller has no division and there are few turns.
    while revolution > 0 && near > revolution / 2 {
        near = near.wrapping_sub(revolution);
    }
    while revolution > 0 && near < -(revolution / 2) {
        near = near.wrapping_add(revolution);
    }
    near
}
