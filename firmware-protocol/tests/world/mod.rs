//! Motor, ranger and board in virtual time, around the real device machine.
//!
//! The echoes of every firing encode its position and number, so that a reading assigned to the
//! wrong firing is detected.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part")]

pub mod line;
pub mod ready;
pub mod sim;

use firmware_protocol::device::{Action, Board, Device, EchoReport, HomeError};
use firmware_protocol::messages::{
    Blanking, Capabilities, Echoes, FirmwareVersion, ReadingStatus, ResetCause, Settings,
};

/// Firing of the simulated ranger.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Firing {
    pub step: i32,
    pub fired_ticks: u32,
    pub echoes: Vec<u32>,
}

#[derive(Debug, Clone)]
enum Job {
    Home,
    Move { target: i32 },
    Fire { window_ticks: u32, max_echoes: u8 },
}

/// Simulated board: carries out the device's actions and calls it back.
#[derive(Debug, Clone)]
pub struct World {
    pub device: Device,
    /// Device time in ticks, not wrapped.
    pub clock: u64,
    /// Value of the device's 32-bit clock at `clock` 0.
    pub clock_offset: u32,
    pub boot: u16,
    /// Position of the motor, steps.
    pub step: i32,
    pub firings: Vec<Firing>,
    pub homings: u32,
    pub moves: Vec<i32>,
    pub coils_released: u32,
    pub aborted: u32,
    pub resets: u32,
    pub index_missing: bool,
    motion: Option<(u64, u64, Job)>,
    ranger: Option<(u64, u64, Job)>,
    speed: u64,
}

pub fn board(boot: u16) -> Board {
    Board {
        boot,
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: *b"MOCK000001",
        steps_per_revolution: 400,
        capabilities: Capabilities::INDEX_SENSOR
            .with(Capabilities::SHORT_BLANKING)
            .with(Capabilities::MULTIPLE_ECHOES)
            .with(Capabilities::EMERGENCY_STOP)
            .with(Capabilities::COIL_RELEASE),
        reset_cause: ResetCause::PowerOn,
    }
}

pub fn settings() -> Settings {
    Settings {
        window_ticks: 48_000,
        min_interval_ticks: 0,
        settle_ticks: 4_000,
        max_echoes: 3,
        blanking: Blanking::Internal,
        speed: 2_000,
        acceleration: 40_000,
        hold_s: 0,
    }
}

/// Returns echoes within the window that are unique to a firing: they encode its number and
/// position.
pub fn encode_echoes(number: usize, step: i32, window_ticks: u32, max_echoes: u8) -> Vec<u32> {
    let count = usize::from(max_echoes).min(number % 4).min(3);
    let number = number as u32;
    let third = window_ticks / 3;
    let place = |part: u32, what: u32| part * third + 1 + what % (third - 1);
    let all = [
        place(0, number),
        place(1, step.rem_euclid(40_000).unsigned_abs()),
        place(2, number / third),
    ];
    all[..count].to_vec()
}

impl World {
    pub fn new(boot: u16, clock_offset: u32) -> Self {
        // The device replaces 0 by 1, which `reboot` would repeat.
        let boot = boot.max(1);
        Self {
            device: Device::new(board(boot)),
            clock: 0,
            clock_offset,
            boot,
            step: 137,
            firings: Vec::new(),
            homings: 0,
            moves: Vec::new(),
            coils_released: 0,
            aborted: 0,
            resets: 0,
            index_missing: false,
            motion: None,
            ranger: None,
            speed: 1,
        }
    }

    /// Value of the device's clock, ticks.
    pub fn ticks(&self) -> u32 {
        (self.clock as u32).wrapping_add(self.clock_offset)
    }

    /// Restarts the board: the motor keeps its position, all other state is new.
    pub fn reboot(&mut self) {
        self.boot = self.boot.wrapping_add(1).max(1);
        self.device = Device::new(board(self.boot));
        self.motion = None;
        self.ranger = None;
    }

    /// Advances the clock; nothing may be due in between.
    pub fn advance(&mut self, clock: u64) {
        assert!(clock >= self.clock);
        self.clock = clock;
    }

    /// Time of the next event of the board, not wrapped, ticks.
    pub fn next_event(&self) -> Option<u64> {
        let timer = self.device.poll_timeout().map(|(_, at)| {
            let ahead = at.wrapping_sub(self.ticks()) as i32;
            self.clock + u64::try_from(ahead).unwrap_or(0)
        });
        let motion = self.motion.as_ref().map(|(_, at, _)| *at);
        let ranger = self.ranger.as_ref().map(|(_, at, _)| *at);
        [timer, motion, ranger].into_iter().flatten().min()
    }

    /// Carries out everything that is due and the actions of the device.
    pub fn settle(&mut self) {
        if self.motion.as_ref().is_some_and(|(_, at, _)| *at <= self.clock) {
            self.motion_ends();
        }
        if self.ranger.as_ref().is_some_and(|(_, at, _)| *at <= self.clock) {
            self.window_ends();
        }
        if self.device.poll_timeout().is_some() {
            self.device.handle_timeout(self.ticks());
        }
        while let Some(action) = self.device.poll_action() {
            self.perform(action);
        }
    }

    fn perform(&mut self, action: Action) {
        match action {
            Action::Home { speed, .. } => {
                assert!(self.motion.is_none(), "the motor turns already");
                self.homings += 1;
                self.speed = u64::from(speed);
                let time = self.turning(self.step.unsigned_abs());
                self.motion = Some((self.clock, self.clock + time, Job::Home));
            }
            Action::Move { target, speed, .. } => {
                assert!(self.motion.is_none(), "the motor turns already");
                assert!(self.ranger.is_none(), "turns while listening");
                self.moves.push(target);
                self.speed = u64::from(speed);
                let time = self.turning(target.abs_diff(self.step));
                self.motion = Some((self.clock, self.clock + time, Job::Move { target }));
            }
            Action::StopMotion => self.stop_motion(),
            Action::ReleaseCoils => {
                self.coils_released += 1;
                self.motion = None;
            }
            Action::Fire { window_ticks, max_echoes, .. } => {
                assert!(self.ranger.is_none(), "fires while listening");
                assert!(self.motion.is_none(), "fires while turning");
                let end = self.clock + u64::from(window_ticks);
                let number = self.firings.len();
                self.firings.push(Firing {
                    step: self.step,
                    fired_ticks: self.ticks(),
                    echoes: encode_echoes(number, self.step, window_ticks, max_echoes),
                });
                self.ranger = Some((self.clock, end, Job::Fire { window_ticks, max_echoes }));
            }
            Action::AbortFire => {
                self.aborted += 1;
                self.ranger = None;
            }
            Action::Reset => {
                self.resets += 1;
                self.reboot();
            }
        }
    }

    /// Duration at constant speed, ticks: the device does not depend on the speed profile.
    pub fn turning(&self, steps: u32) -> u64 {
        u64::from(steps) * 2_000_000 / self.speed
    }

    fn stop_motion(&mut self) {
        if let Some((began, ends, Job::Move { target })) = self.motion.take() {
            let whole = i64::from(target) - i64::from(self.step);
            let done = whole * (self.clock - began) as i64 / ((ends - began) as i64).max(1);
            self.step += done as i32;
        }
        // Braking takes 1 ms here.
        self.motion = Some((self.clock, self.clock + 2_000, Job::Move { target: self.step }));
    }

    fn motion_ends(&mut self) {
        let Some((_, _, job)) = self.motion.take() else {
            return;
        };
        let now = self.ticks();
        match job {
            Job::Move { target } => {
                self.step = target;
                self.device.handle_moved(now, target);
            }
            Job::Home if self.index_missing => {
                self.device.handle_homed(now, Err(HomeError::IndexNotFound));
            }
            Job::Home => {
                self.step = 0;
                self.device.handle_homed(now, Ok(if self.homings > 1 { 2 } else { 0 }));
            }
            Job::Fire { .. } => unreachable!("the motor does not fire"),
        }
    }

    fn window_ends(&mut self) {
        let Some((_, _, Job::Fire { .. })) = self.ranger.take() else {
            return;
        };
        let Some(firing) = self.firings.last() else {
            return;
        };
        let report = EchoReport {
            fired_ticks: firing.fired_ticks,
            status: ReadingStatus::Echo,
            echoes: Echoes::from_ticks(&firing.echoes),
        };
        self.device.handle_echoes(self.ticks(), &report);
    }
}
