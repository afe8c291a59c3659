//! What the board still has to do.

use super::{Action, Beam, Device, Phase};

/// Actions not yet polled, one bit each, in the order they are handed out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Pending(u8);

impl Pending {
    pub(super) const ABORT_FIRE: Self = Self(1);
    pub(super) const STOP_MOTION: Self = Self(1 << 1);
    pub(super) const RELEASE_COILS: Self = Self(1 << 2);
    /// What the present phase asks for: Home, Move or Fire.
    pub(super) const PHASE: Self = Self(1 << 3);
    pub(super) const RESET: Self = Self(1 << 4);

    pub(super) fn add(&mut self, action: Self) {
        self.0 |= action.0;
    }

    /// Clears `action`; tells whether it was pending.
    pub(super) fn take(&mut self, action: Self) -> bool {
        let pending = self.has(action);
        self.0 &= !action.0;
        pending
    }

    pub(super) const fn has(self, action: Self) -> bool {
        self.0 & action.0 != 0
    }
}

impl Device {
    #[inline(never)]
    pub(super) fn next_action(&mut self) -> Option<Action> {
        if self.pending.take(Pending::ABORT_FIRE) {
            return Some(Action::AbortFire);
        }
        if self.pending.take(Pending::STOP_MOTION) {
            return Some(Action::StopMotion);
        }
        if self.pending.take(Pending::RELEASE_COILS) {
            return Some(Action::ReleaseCoils);
        }
        if self.pending.take(Pending::PHASE) {
            return self.phase_action();
        }
        (self.outbox.is_empty() && self.pending.take(Pending::RESET)).then_some(Action::Reset)
    }

    fn phase_action(&mut self) -> Option<Action> {
        let settings = self.settings?;
        self.holds_coils |= !matches!(self.phase, Phase::Beam(Beam::Listening));
        let (speed, acceleration) = (settings.speed, settings.acceleration);
        match self.phase {
            Phase::Homing => Some(Action::Home { speed, acceleration }),
            Phase::Moving { target } | Phase::Beam(Beam::Moving { target }) => {
                Some(Action::Move { target, speed, acceleration })
            }
            Phase::Beam(Beam::Listening) => Some(Action::Fire {
                window_ticks: settings.window_ticks,
                max_echoes: settings.max_echoes,
                blanking: settings.blanking,
            }),
            Phase::Idle | Phase::Stopping | Phase::Beam(Beam::Waiting) => None,
        }
    }
}
