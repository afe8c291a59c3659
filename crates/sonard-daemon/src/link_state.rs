//! State machine of the link to the device: next step, retry delay, reportable transitions.
//!
//! The machine is pure: the caller supplies the outcome of each step and the time of a monotonic
//! clock, and does the waiting. Two invariants hold: the motor moves only after homing on the
//! current connection, and consecutive attempts are separated by a bounded wait.

use std::time::Duration;

use sonard_api::{LinkState, Trouble};

/// Outcome of a step, or an external event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkInput {
    /// The port is open and locked.
    Opened,
    /// The expected device reported its identity.
    Identified,
    /// The motor is at its home position.
    Homed,
    /// The first beam of a scan is about to be measured.
    ScanBegun,
    /// A scan ended normally, or was stopped.
    ScanEnded,
    /// The device restarted while idle: the position of its motor is unknown.
    Restarted,
    /// The step or the link failed.
    Failed(Trouble),
    /// The emergency stop was pressed (`true`) or released.
    EmergencyStop(bool),
    /// The device's own emergency stop was pressed.
    DeviceStopped,
    /// A start was requested.
    Start,
    /// The configured port changed.
    PortChanged,
    /// The daemon is stopping.
    Shutdown,
}

/// Next step of the device task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkStep {
    /// Open and lock the port.
    Open,
    /// Query the identity of the device.
    Identify,
    /// Set up the device and home the motor.
    Home,
    /// Serve scans: the device is ready.
    Serve,
    /// Close the port if it is open, and wait until this time or the next event.
    Wait(Duration),
    /// Close the port and wait for the next event.
    Rest,
    /// Close all resources and end.
    End,
}

/// Transition between settled states, to be reported once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// Settled state before, if there was one.
    pub from: Option<LinkState>,
    /// Settled state from now on.
    pub to: LinkState,
}

/// Bounds of the wait between attempts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RetryBounds {
    /// Wait after the first failure.
    pub min: Duration,
    /// Upper bound of the wait.
    pub max: Duration,
}

/// State machine of the link. [`Self::poll`] returns the next step, [`Self::handle`] takes its
/// outcome, and [`Self::poll_transition`] returns a transition to report.
#[derive(Debug, Clone)]
pub struct LinkMachine {
    retry_bounds: RetryBounds,
    state: LinkState,
    since: Duration,
    retry_at: Duration,
    /// Consecutive attempts that failed to bring the device up.
    failures: u32,
    /// Consecutive losses of a device that was up, before it completed a scan.
    relapses: u32,
    /// Time since which the device is up without interruption.
    up_since: Option<Duration>,
    pressed: bool,
    /// The machine resumes by itself after an emergency stop.
    resumes: bool,
    /// Last reported settled state.
    reported: Option<LinkState>,
    transition: Option<Transition>,
}

impl LinkMachine {
    /// Creates a machine whose first step opens the port.
    #[must_use]
    pub const fn new(retry_bounds: RetryBounds, now: Duration) -> Self {
        Self {
            retry_bounds,
            state: LinkState::Opening,
            since: now,
            retry_at: now,
            failures: 0,
            relapses: 0,
            up_since: None,
            pressed: false,
            resumes: false,
            reported: None,
            transition: None,
        }
    }

    /// Changes the bounds of the wait, from the next failure on.
    pub const fn set_retry_bounds(&mut self, retry_bounds: RetryBounds) {
        self.retry_bounds = retry_bounds;
    }

    /// Sets whether the machine resumes by itself after the next emergency stop.
    pub const fn set_resumes(&mut self, resumes: bool) {
        self.resumes = resumes;
    }

    /// Returns the current step. It changes only with an input, or when a wait ends.
    pub fn poll(&mut self, now: Duration) -> LinkStep {
        use LinkState as State;
        match self.state {
            State::Opening => LinkStep::Open,
            State::Identifying => LinkStep::Identify,
            State::Homing => LinkStep::Home,
            State::Ready | State::Scanning => LinkStep::Serve,
            State::EmergencyStop | State::AwaitingStart => LinkStep::Rest,
            State::Stopped => LinkStep::End,
            _ if now < self.retry_at => LinkStep::Wait(self.retry_at),
            _ => {
                self.enter(now, State::Opening);
                LinkStep::Open
            }
        }
    }

    /// Handles an input. Inputs that do not apply to the current state are ignored.
    pub fn handle(&mut self, now: Duration, input: LinkInput) {
        use LinkState as State;
        match (input, self.state) {
            (_, State::Stopped) => {}
            (LinkInput::Shutdown, _) => self.enter(now, State::Stopped),
            (LinkInput::EmergencyStop(pressed), state) => {
                self.pressed = pressed;
                if pressed {
                    self.enter(now, State::EmergencyStop);
                } else if state == State::EmergencyStop {
                    self.leave_emergency_stop(now);
                }
            }
            (_, State::EmergencyStop) => {}
            (LinkInput::Start, State::AwaitingStart) => self.enter(now, State::Opening),
            (_, State::AwaitingStart) => {}
            (LinkInput::DeviceStopped, _) if self.resumes => self.fail(now, Trouble::Fault),
            (LinkInput::DeviceStopped, _) => self.enter(now, State::AwaitingStart),
            (LinkInput::PortChanged, _) => self.enter(now, State::Opening),
            (LinkInput::Failed(trouble), _) => self.fail(now, trouble),
            (LinkInput::Opened, State::Opening) => self.enter(now, State::Identifying),
            (LinkInput::Identified, State::Identifying) => self.enter(now, State::Homing),
            (LinkInput::Homed, State::Homing) => {
                self.up_since = Some(now);
                self.enter(now, State::Ready);
            }
            (LinkInput::ScanBegun, State::Ready) => self.enter(now, State::Scanning),
            (LinkInput::ScanEnded, State::Scanning) => {
                self.relapses = 0;
                self.enter(now, State::Ready);
            }
            (LinkInput::Restarted, State::Ready | State::Scanning) => {
                self.enter(now, State::Identifying);
            }
            _ => {}
        }
    }

    /// Takes the transition that has not been reported yet.
    pub const fn poll_transition(&mut self) -> Option<Transition> {
        self.transition.take()
    }

    /// Current state of the link.
    #[must_use]
    pub const fn state(&self) -> LinkState {
        self.state
    }

    /// Time since which the current state lasts.
    #[must_use]
    pub const fn since(&self) -> Duration {
        self.since
    }

    /// Consecutive failures; a completed scan resets them.
    #[must_use]
    pub const fn failures(&self) -> u32 {
        self.failures
    }

    /// Time of the next attempt, if the link is waiting for one.
    #[must_use]
    pub fn retry_at(&self) -> Option<Duration> {
        let waits = self.state.is_settled() && !self.state.is_up();
        let has_no_retry = matches!(
            self.state,
            LinkState::EmergencyStop | LinkState::AwaitingStart | LinkState::Stopped
        );
        (waits && !has_no_retry).then_some(self.retry_at)
    }

    /// Leaves the emergency stop. A hand may still be near the motor, or have turned it: motion
    /// needs a start unless `resumes` is set, and the device is homed again in any case.
    fn leave_emergency_stop(&mut self, now: Duration) {
        let next = if self.resumes { LinkState::Opening } else { LinkState::AwaitingStart };
        self.enter(now, next);
    }

    fn fail(&mut self, now: Duration, trouble: Trouble) {
        // A device that came up ends the sequence of failures, however long it was absent. From
        // then on losses count, until it completes a scan or is up for longer than the maximum
        // wait.
        if let Some(since) = self.up_since {
            if now.saturating_sub(since) > self.retry_bounds.max {
                self.relapses = 0;
            }
            self.failures = self.relapses;
            self.relapses = self.relapses.saturating_add(1);
        }
        let doublings = self.failures.min(16);
        let wait = self.retry_bounds.min.saturating_mul(1 << doublings).min(self.retry_bounds.max);
        self.failures = self.failures.saturating_add(1);
        self.retry_at = now.saturating_add(wait);
        self.enter(now, LinkState::Down(trouble));
    }

    fn enter(&mut self, now: Duration, state: LinkState) {
        if state == self.state {
            return;
        }
        self.state = state;
        self.since = now;
        if !state.is_up() {
            self.up_since = None;
        }
        let settled = if state == LinkState::Scanning { LinkState::Ready } else { state };
        if settled.is_settled() && self.reported != Some(settled) {
            let from = self.reported.replace(settled);
            self.transition = Some(Transition { from, to: settled });
        }
    }
}

#[cfg(test)]
mod tests;
