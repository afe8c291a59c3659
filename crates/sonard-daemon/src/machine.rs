//! The link to the device as a state machine: what to do next, how long to wait, what to say.
//!
//! Pure: it is told what came of each step and what time it is (any clock that does not jump),
//! and never waits itself. It holds two rules: the motor moves only after homing on this
//! connection, and between two tries there is a bounded wait.

use std::time::Duration;

use sonard_api::{LinkState, Trouble};

/// The outcome of a step, or an external event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// The port is open and locked.
    Opened,
    /// The right device told its identity.
    Identified,
    /// The motor is at home.
    Homed,
    /// A scan began.
    ScanBegun,
    /// A scan ended as it should, or was stopped.
    ScanEnded,
    /// The device restarted while it had no work: its position is unknown.
    Restarted,
    /// The step, or the link by itself, failed.
    Failed(Trouble),
    /// The emergency stop was pressed (`true`) or released.
    EmergencyStop(bool),
    /// The device's own emergency stop was pressed.
    DeviceStopped,
    /// Somebody wants it to work.
    Start,
    /// Another port is to be used.
    PortChanged,
    /// The end.
    Shutdown,
}

/// The next step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Open the port.
    Open,
    /// Ask who is there.
    Identify,
    /// Set up the device and home the motor.
    Home,
    /// The device can be used; scans may begin.
    Serve,
    /// Close the port if it is open, and wait until this time or until something happens.
    Wait(Duration),
    /// Close the port and wait until something happens.
    Rest,
    /// Close everything.
    End,
}

/// From one settled state to another, to be told once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// Settled state before, if there was one.
    pub from: Option<LinkState>,
    /// Settled state now.
    pub to: LinkState,
}

/// Bounds of the wait from try to try.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackOff {
    /// After the first failure.
    pub min: Duration,
    /// Never longer.
    pub max: Duration,
}

/// Decides what to do about the link: [`Self::poll`] says what, [`Self::handle`] is told what came
/// of it, [`Self::poll_transition`] what to tell others.
#[derive(Debug, Clone)]
pub struct LinkMachine {
    back_off: BackOff,
    state: LinkState,
    since: Duration,
    retry_at: Duration,
    /// Tries in a row that did not bring the device up.
    failures: u32,
    /// Times in a row that the device was up, and lost before it had been of use.
    relapses: u32,
    /// Since when the device can be used without a break.
    up_since: Option<Duration>,
    pressed: bool,
    /// Whether it works on by itself after an emergency stop.
    resumes: bool,
    /// The settled state that was told last.
    told: Option<LinkState>,
    transition: Option<Transition>,
}

impl LinkMachine {
    /// A machine that begins by opening the port.
    #[must_use]
    pub const fn new(back_off: BackOff, now: Duration) -> Self {
        Self {
            back_off,
            state: LinkState::Opening,
            since: now,
            retry_at: now,
            failures: 0,
            relapses: 0,
            up_since: None,
            pressed: false,
            resumes: false,
            told: None,
            transition: None,
        }
    }

    /// Other bounds from the next failure on.
    pub const fn set_back_off(&mut self, back_off: BackOff) {
        self.back_off = back_off;
    }

    /// Whether it works on by itself after the next emergency stop.
    pub const fn set_resumes(&mut self, resumes: bool) {
        self.resumes = resumes;
    }

    /// What to do now. The same until something is handled, except that a wait ends.
    pub fn poll(&mut self, now: Duration) -> Step {
        use LinkState as State;
        match self.state {
            State::Opening => Step::Open,
            State::Identifying => Step::Identify,
            State::Homing => Step::Home,
            State::Ready | State::Scanning => Step::Serve,
            State::EmergencyStop | State::AwaitingStart => Step::Rest,
            State::Stopped => Step::End,
            _ if now < self.retry_at => Step::Wait(self.retry_at),
            _ => {
                self.enter(now, State::Opening);
                Step::Open
            }
        }
    }

    /// Takes in what happened. What does not fit the state is ignored.
    pub fn handle(&mut self, now: Duration, input: Input) {
        use LinkState as State;
        match (input, self.state) {
            (_, State::Stopped) => {}
            (Input::Shutdown, _) => self.enter(now, State::Stopped),
            (Input::EmergencyStop(pressed), state) => {
                self.pressed = pressed;
                if pressed {
                    self.enter(now, State::EmergencyStop);
                } else if state == State::EmergencyStop {
                    self.after_stop(now);
                }
            }
            (_, State::EmergencyStop) => {}
            (Input::Start, State::AwaitingStart) => self.enter(now, State::Opening),
            (_, State::AwaitingStart) => {}
            (Input::DeviceStopped, _) if self.resumes => self.fail(now, Trouble::Fault),
            (Input::DeviceStopped, _) => self.enter(now, State::AwaitingStart),
            (Input::PortChanged, _) => self.enter(now, State::Opening),
            (Input::Failed(trouble), _) => self.fail(now, trouble),
            (Input::Opened, State::Opening) => self.enter(now, State::Identifying),
            (Input::Identified, State::Identifying) => self.enter(now, State::Homing),
            (Input::Homed, State::Homing) => {
                self.up_since = Some(now);
                self.enter(now, State::Ready);
            }
            (Input::ScanBegun, State::Ready) => self.enter(now, State::Scanning),
            (Input::ScanEnded, State::Scanning) => {
                self.relapses = 0;
                self.enter(now, State::Ready);
            }
            (Input::Restarted, State::Ready | State::Scanning) => {
                self.enter(now, State::Identifying);
            }
            _ => {}
        }
    }

    /// The next change of settled state that nobody was told of.
    pub const fn poll_transition(&mut self) -> Option<Transition> {
        self.transition.take()
    }

    /// What the link is doing.
    #[must_use]
    pub const fn state(&self) -> LinkState {
        self.state
    }

    /// Since when.
    #[must_use]
    pub const fn since(&self) -> Duration {
        self.since
    }

    /// Failures since the device was last in proper use.
    #[must_use]
    pub const fn failures(&self) -> u32 {
        self.failures
    }

    /// When the next try is due, if the link waits for one.
    #[must_use]
    pub fn retry_at(&self) -> Option<Duration> {
        let waits = self.state.is_settled() && !self.state.is_up();
        let for_ever = matches!(
            self.state,
            LinkState::EmergencyStop | LinkState::AwaitingStart | LinkState::Stopped
        );
        (waits && !for_ever).then_some(self.retry_at)
    }

    /// Whoever released it may still have a hand there, or have turned the motor: nothing moves by
    /// itself, and what begins then begins anew, homing and all.
    fn after_stop(&mut self, now: Duration) {
        let next = if self.resumes { LinkState::Opening } else { LinkState::AwaitingStart };
        self.enter(now, next);
    }

    fn fail(&mut self, now: Duration, trouble: Trouble) {
        // A device that came up is there again, however long it was away: what counts from here on is
        // how often it was lost again, until it was of use or up for longer than the longest wait.
        if let Some(since) = self.up_since {
            if now.saturating_sub(since) > self.back_off.max {
                self.relapses = 0;
            }
            self.failures = self.relapses;
            self.relapses = self.relapses.saturating_add(1);
        }
        let doublings = self.failures.min(16);
        let wait = self.back_off.min.saturating_mul(1 << doublings).min(self.back_off.max);
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
        if settled.is_settled() && self.told != Some(settled) {
            let from = self.told.replace(settled);
            self.transition = Some(Transition { from, to: settled });
        }
    }
}

#[cfg(test)]
mod tests;
