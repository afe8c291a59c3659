//! Board of the mock: executes the device state machine's actions in the world, on its own clock.
//!
//! Discrete-event simulation without I/O. Events happen at their exact device times, however late
//! they are processed, so that timing does not depend on the computer.

use firmware_protocol::{
    device::{Action, Device, DeviceTimer, EchoReport},
    messages::{Echoes, ReadingStatus, ResetCause, limits},
};
use sonard_model::motion::Trapezoid;

use super::{
    faults::{DeviceFault, Faults},
    identity::{BoardSettings, Pace, identity},
    invalid_replies::ReplyCorruptor,
    note::Note,
    world::{Firing, World},
};

const TICK_HZ: u32 = limits::TICK_HZ;
/// Time from the action to the rise of INIT, ticks: the lead of the compare unit.
const FIRE_LEAD_TICKS: u64 = 32;

/// Kind of the next event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WakeKind {
    /// A move, a settling time or a listening window ends: virtual time may jump there.
    Work,
    /// The host's lease runs, or the device hangs: only real time may pass.
    RealTimeOnly,
}

/// Next event of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wake {
    /// Device time, ticks since power-up.
    pub at: u64,
    /// Kind of event, which decides on jumps in time.
    pub kind: WakeKind,
}

/// Device state machine with its board and environment.
#[derive(Debug)]
pub struct MockBoard {
    settings: BoardSettings,
    device: Device,
    world: World,
    faults: Faults,
    corruptor: ReplyCorruptor,
    now: u64,
    boot: u16,
    /// Value of the step counter.
    step: i32,
    known: bool,
    coils: bool,
    activity: Activity,
    stalled_until: u64,
    /// Half of the remaining lease at the last message from the host, ticks.
    lease_reserve: u64,
    hung_up: bool,
    fired: u64,
    notes: Vec<Note>,
}

#[derive(Debug)]
enum Activity {
    Nothing,
    Moving { motion: Trapezoid, from: i32, target: i32, since: u64, until: u64 },
    Homing { drift_steps: i32, until: u64 },
    Braking { step: i32, until: u64 },
    Listening { report: Box<EchoReport>, until: u64 },
}

impl Activity {
    const fn until(&self) -> Option<u64> {
        match self {
            Self::Nothing => None,
            Self::Moving { until, .. }
            | Self::Homing { until, .. }
            | Self::Braking { until, .. }
            | Self::Listening { until, .. } => Some(*until),
        }
    }
}

impl MockBoard {
    /// Creates a board at power-up.
    #[must_use]
    pub fn new(settings: BoardSettings, world: World) -> Self {
        let mut board = Self {
            settings,
            device: Device::new(identity(&settings, settings.boot, ResetCause::PowerOn)),
            world,
            faults: Faults::new(settings.faults, settings.seed ^ 0x00b0_a4d0),
            corruptor: ReplyCorruptor::new(settings.faults.lie, settings.faults.version),
            now: u64::from(settings.clock),
            boot: settings.boot,
            step: 0,
            known: false,
            coils: false,
            activity: Activity::Nothing,
            stalled_until: 0,
            lease_reserve: 0,
            hung_up: false,
            fired: 0,
            notes: vec![Note::Booted(settings.boot)],
        };
        board.act();
        board
    }

    /// Device time, ticks since power-up.
    #[must_use]
    pub const fn now(&self) -> u64 {
        self.now
    }

    /// Next event, at which to call [`Self::advance`]; `None` if only received bytes cause events.
    #[must_use]
    pub fn next_wake(&self) -> Option<Wake> {
        if self.stalled() {
            return Some(Wake { at: self.stalled_until, kind: WakeKind::RealTimeOnly });
        }
        let work = self.activity.until().map(|at| Wake { at, kind: WakeKind::Work });
        let timer = self.device.poll_timeout().map(|(timer, at)| {
            let ahead = at.wrapping_sub(self.now as u32).cast_signed().max(0);
            let kind = match timer {
                DeviceTimer::Settle | DeviceTimer::MinInterval => WakeKind::Work,
                DeviceTimer::Lease | DeviceTimer::Hold => WakeKind::RealTimeOnly,
            };
            Wake { at: self.now + u64::from(ahead.unsigned_abs()), kind }
        });
        let wake = match (work, timer) {
            (Some(work), Some(timer)) => Some(if timer.at < work.at { timer } else { work }),
            (work, timer) => work.or(timer),
        }?;
        let may_jump = wake.kind == WakeKind::Work && self.leaves_lease(wake.at);
        Some(Wake { kind: if may_jump { WakeKind::Work } else { WakeKind::RealTimeOnly }, ..wake })
    }

    /// Returns `true` if a jump to `at` leaves the host at least half of its lease in real time.
    ///
    /// Otherwise jumps would use up the lease of a host that is delayed by some milliseconds.
    fn leaves_lease(&self, at: u64) -> bool {
        self.lease_left().is_none_or(|left| at + self.lease_reserve <= self.now + left)
    }

    /// Time to the end of the sweep's lease, ticks.
    fn lease_left(&self) -> Option<u64> {
        let ends = self.device.lease_deadline()?;
        Some(u64::from(ends.wrapping_sub(self.now as u32).cast_signed().max(0).unsigned_abs()))
    }

    /// Advances device time to `to`; everything due happens at its exact time.
    pub fn advance(&mut self, to: u64) {
        while let Some(wake) = self.next_wake().filter(|wake| wake.at <= to) {
            self.now = self.now.max(wake.at);
            if self.activity.until().is_some_and(|until| until <= self.now) {
                self.complete();
            }
            self.device.handle_timeout(self.now as u32);
            self.act();
        }
        self.now = self.now.max(to);
    }

    /// Processes bytes from the host at the present device time.
    pub fn handle_bytes(&mut self, bytes: &[u8]) {
        let mut garbled = Vec::with_capacity(bytes.len());
        self.faults.garble(bytes, &mut garbled);
        for byte in garbled {
            self.device.handle_byte(self.now as u32, byte);
            // A real board's main loop runs many times between two bytes.
            self.act();
        }
        self.lease_reserve = self.lease_left().unwrap_or(0) / 2;
    }

    /// Appends the bytes for the host, with the faults of the line applied.
    pub fn poll_transmit(&mut self, out: &mut Vec<u8>) {
        if self.stalled() {
            return;
        }
        let mut buffer = [0; 128];
        let mut sent = Vec::new();
        loop {
            let count = self.device.poll_transmit(&mut buffer);
            if count == 0 {
                break;
            }
            sent.extend_from_slice(buffer.get(..count).unwrap_or_default());
        }
        let corrupted = self.corruptor.corrupt(sent);
        self.faults.garble(&corrupted, out);
        // A restart waits until its acknowledgement is sent.
        self.act();
    }

    /// Passage of device time: real or virtual.
    #[must_use]
    pub const fn pace(&self) -> Pace {
        self.settings.pace
    }

    /// Draws the delay of the next chunk of bytes on the line, milliseconds.
    pub fn line_delay_ms(&mut self) -> u32 {
        self.faults.delay_ms()
    }

    /// Returns `true` while the device hangs and ignores the line.
    #[must_use]
    pub const fn stalled(&self) -> bool {
        self.now < self.stalled_until
    }

    /// Takes a pending hangup of the line.
    pub const fn take_hangup(&mut self) -> bool {
        std::mem::replace(&mut self.hung_up, false)
    }

    /// Mutable access to the environment.
    pub const fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// True distance of the motor from the index, steps.
    #[must_use]
    pub const fn steps_from_index(&self) -> i32 {
        self.world.steps_from_index()
    }

    /// Returns `true` while the motor's coils have current.
    #[must_use]
    pub const fn holds_coils(&self) -> bool {
        self.coils
    }

    /// Takes the messages since the last call.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    fn complete(&mut self) {
        let now = self.now as u32;
        match std::mem::replace(&mut self.activity, Activity::Nothing) {
            Activity::Nothing => {}
            Activity::Moving { from, target, .. } => {
                self.world.turn(target - from);
                self.step = target;
                self.device.handle_moved(now, target);
            }
            Activity::Homing { drift_steps, .. } => {
                self.world.seek_index();
                self.step = 0;
                self.known = true;
                self.notes.push(Note::Homed(drift_steps));
                self.device.handle_homed(now, Ok(drift_steps));
            }
            Activity::Braking { step, .. } => {
                self.step = step;
                self.notes.push(Note::Stopped(step));
                self.device.handle_moved(now, step);
            }
            Activity::Listening { report, .. } => self.device.handle_echoes(now, &report),
        }
    }

    fn act(&mut self) {
        while let Some(action) = self.device.poll_action() {
            self.coils |= matches!(action, Action::Home { .. } | Action::Move { .. });
            match action {
                Action::Home { speed, acceleration } => self.home(speed, acceleration),
                Action::Move { target, speed, acceleration } => {
                    let motion = Trapezoid::new(target - self.step, speed, acceleration);
                    let until = self.now + ticks(motion.duration_s());
                    self.activity = Activity::Moving {
                        motion,
                        from: self.step,
                        target,
                        since: self.now,
                        until,
                    };
                }
                Action::StopMotion => self.brake(),
                Action::ReleaseCoils => {
                    self.release_coils();
                    self.notes.push(Note::CoilsReleased);
                }
                Action::Fire { window_ticks, max_echoes, .. } => {
                    self.fire(window_ticks, max_echoes);
                }
                Action::AbortFire => self.activity = Activity::Nothing,
                Action::Reset => self.restart(ResetCause::Requested),
            }
            if matches!(action, Action::Home { .. } | Action::Move { .. })
                && let Some(fault) = self.faults.draw_motion_fault()
            {
                self.inject(fault);
            }
        }
    }

    fn home(&mut self, speed: u16, acceleration: u32) {
        let away = self.world.steps_from_index();
        let drift_steps = if self.known { self.step - away } else { 0 };
        let motion = Trapezoid::new(away, speed, acceleration);
        let until = self.now + ticks(motion.duration_s());
        self.activity = Activity::Homing { drift_steps, until };
    }

    fn brake(&mut self) {
        let (step, until) = match self.activity {
            Activity::Moving { motion, from, since, .. } => {
                let (gone, stopped_s) =
                    motion.braking_stop((self.now - since) as f64 / f64::from(TICK_HZ));
                self.world.turn(gone);
                (from + gone, since + ticks(stopped_s))
            }
            // During a search for the index the position is unknown.
            _ => (self.step, self.now),
        };
        self.activity = Activity::Braking { step, until: until.max(self.now) };
    }

    /// Switches the coil current off; the motor stays about where it was.
    fn release_coils(&mut self) {
        if let Activity::Moving { motion, from, since, .. } = self.activity {
            let (gone, _) = motion.braking_stop((self.now - since) as f64 / f64::from(TICK_HZ));
            self.world.turn(gone);
            self.step = from + gone;
        }
        self.known = false;
        self.coils = false;
        self.activity = Activity::Nothing;
    }

    fn fire(&mut self, window_ticks: u32, max_echoes: u8) {
        let (stuck, no_echo) = self.faults.draw_module_faults();
        if stuck {
            // Without a firing the result is available at once.
            let report = Box::new(EchoReport {
                fired_ticks: self.now as u32,
                status: ReadingStatus::ModuleFault,
                echoes: Echoes::new(),
            });
            self.activity = Activity::Listening { report, until: self.now };
            return;
        }
        let fired = self.now + FIRE_LEAD_TICKS;
        let Firing { status, mut echo_ticks } = self.world.fire(window_ticks, TICK_HZ);
        self.notes.extend(self.world.take_begun_scan());
        if no_echo {
            echo_ticks.clear();
        }
        let mut echoes = Echoes::from_ticks(&echo_ticks);
        echoes.truncate(max_echoes);
        let status = match status {
            ReadingStatus::Echo if echoes.is_empty() => ReadingStatus::NoEcho,
            status => status,
        };
        let report = Box::new(EchoReport { fired_ticks: fired as u32, status, echoes });
        self.activity = Activity::Listening { report, until: fired + u64::from(window_ticks) };
        self.fired += 1;
        self.notes.push(Note::Fired(self.fired));
        if let Some(fault) = self.faults.draw_firing_fault() {
            self.inject(fault);
        }
    }

    fn inject(&mut self, fault: DeviceFault) {
        self.notes.push(Note::Fault(fault));
        match fault {
            DeviceFault::Stall(ms) => self.stalled_until = self.now + ticks(f64::from(ms) / 1e3),
            DeviceFault::Reset => self.restart(ResetCause::BrownOut),
            DeviceFault::Hangup => self.hung_up = true,
        }
    }

    fn restart(&mut self, cause: ResetCause) {
        self.release_coils();
        self.boot = self.boot.checked_add(1).unwrap_or(1);
        self.step = 0;
        self.device = Device::new(identity(&self.settings, self.boot, cause));
        self.notes.push(Note::Booted(self.boot));
    }
}

fn ticks(seconds: f64) -> u64 {
    (seconds * f64::from(TICK_HZ)).ceil() as u64
}
