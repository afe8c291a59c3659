//! Actions that the board has not polled yet.

use super::{Action, BeamPhase, Device, Phase};

/// Actions not yet polled, one bit each, in the order in which they are returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct PendingActions(u8);

impl PendingActions {
    pub(super) const ABORT_FIRE: Self = Self(1);
    pub(super) const STOP_MOTION: Self = Self(1 << 1);
    pub(super) const RELEASE_COILS: Self = Self(1 << 2);
    /// Action of the current phase: Home, Move or Fire.
    pub(super) const PHASE: Self = Self(1 << 3);
    pub(super) const RESET: Self = Self(1 << 4);

    pub(super) fn add(&mut self, action: Self) {
        self.0 |= action.0;
    }

    /// Clears `action` and returns `true` if it was pending.
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
        if self.pending.take(PendingActions::ABORT_FIRE) {
            return Some(Action::AbortFire);
        }
        if self.pending.take(PendingActions::STOP_MOTION) {
            return Some(Action::StopMotion);
        }
        if self.pending.take(PendingActions::RELEASE_COILS) {
            return Some(Action::ReleaseCoils);
        }
        if self.pending.take(PendingActions::PHASE) {
            return self.phase_action();
        }
        (self.outbox.is_empty() && self.pending.take(PendingActions::RESET))
            .then_some(Action::Reset)
    }

    fn phase_action(&mut self) -> Option<Action> {
        let settings = self.settings?;
        self.holds_coils |= !matches!(self.phase, Phase::Beam(BeamPhase::Listening));
        let (speed, acceleration) = (settings.speed, settings.acceleration);
        match self.phase {
            Phase::Homing => Some(Action::Home { speed, acceleration }),
            Phase::Moving { target } | Phase::Beam(BeamPhase::Moving { target }) => {
                Some(Action::Move { target, speed, acceleration })
            }
            Phase::Beam(BeamPhase::Listening) => Some(Action::Fire {
                window_ticks: settings.window_ticks,
                max_echoes: settings.max_echoes,
                blanking: settings.blanking,
            }),
            Phase::Idle | Phase::Stopping | Phase::Beam(BeamPhase::Waiting) => None,
        }
    }
}
