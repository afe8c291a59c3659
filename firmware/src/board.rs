//! Main loop: passes events to the device machine, carries out its actions, and sleeps.

use core::mem::MaybeUninit;

use board_config::{Config, OPTION_INDEX_HIGH};
use firmware_protocol::device::{Action, Board, Device, within_half_a_turn};
use firmware_protocol::messages::{Capabilities, FirmwareVersion};

use crate::clock::{self, Purpose};
use crate::hardware::{CriticalSection, critical_section, enable_interrupts, feed_watchdog};
use crate::home::Homing;
use crate::{OPTIONS, boot, motion, pins, ranger, serial, store};

/// Maximum number of bytes processed per iteration.
const BYTES_PER_ROUND: u8 = 16;
/// Ticks beyond which a deadline is left to the clock's overflow, which wakes the chip every 33 ms.
const MAX_ALARM_TICKS: u32 = 50_000;

/// Option bit, also read by the interrupt handler of the emergency stop.
const EMERGENCY_FITTED: u8 = 0x80;

/// At a fixed address, so that the compiler can access it directly: on the stack the code is half
/// as large again.
static mut DEVICE: MaybeUninit<Device> = MaybeUninit::uninit();

struct MainLoop {
    index: Option<bool>,
    has_emergency_stop: bool,
    revolution: u16,
    homing: Option<Homing>,
    /// `true` after a homing, so that the next one can measure the drift.
    was_homed: bool,
    pressed: bool,
    /// `true` from a stop by the device itself until homing: the light blinks.
    alarmed: bool,
}

pub fn run() -> ! {
    let mut main_loop = start();
    // SAFETY: written by `start`, and not referenced elsewhere.
    let device = unsafe { (*(&raw mut DEVICE)).assume_init_mut() };
    boot::start_watchdog();
    enable_interrupts();
    loop {
        feed_watchdog();
        main_loop.run_once(device);
        main_loop.update_light();
        if arm_alarm(device) {
            clock::sleep_until_event();
        }
    }
}

/// Reads the EEPROM and creates the machine. Not part of the loop, to limit its stack.
#[inline(never)]
fn start() -> MainLoop {
    let config = store::config();
    let board = Board {
        boot: store::next_boot(),
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: config.serial,
        steps_per_revolution: config.steps_per_revolution,
        capabilities: config.capabilities,
        reset_cause: boot::reset_cause(),
    };
    // SAFETY: called before the loop that uses it.
    unsafe { (*(&raw mut DEVICE)).write(Device::new(board)) };
    MainLoop::new(&config)
}

impl MainLoop {
    fn new(config: &Config) -> Self {
        let has_emergency_stop = config.capabilities.has(Capabilities::EMERGENCY_STOP);
        let fitted = if has_emergency_stop { EMERGENCY_FITTED } else { 0 };
        critical_section(|cs| *OPTIONS.get(cs) = config.options & !EMERGENCY_FITTED | fitted);
        let has_index = config.capabilities.has(Capabilities::INDEX_SENSOR);
        Self {
            index: has_index.then_some(config.options & OPTION_INDEX_HIGH != 0),
            has_emergency_stop,
            revolution: config.steps_per_revolution,
            homing: None,
            was_homed: false,
            pressed: false,
            alarmed: false,
        }
    }

    #[inline(never)]
    /// Processes all events once.
    fn run_once(&mut self, device: &mut Device) {
        // The lease comes first: after it has expired, no beam may follow.
        handle_timeout(device);
        self.watch_emergency(device);
        report_echoes(device);
        if let Some(end) = motion::take_move_end() {
            self.move_ended(device, &end);
        }
        self.perform_actions(device);
        for _ in 0..BYTES_PER_ROUND {
            if serial::take_line_error() {
                device.handle_line_error(clock::now());
            }
            let Some(byte) = serial::receive() else { break };
            handle_byte(device, byte);
            self.perform_actions(device);
        }
        transmit(device);
        // A restart waits until its acknowledgement has been sent.
        self.perform_actions(device);
    }

    fn watch_emergency(&mut self, device: &mut Device) {
        let pressed = self.has_emergency_stop && pins::emergency();
        if pressed && !self.pressed {
            pins::make_safe();
            handle_emergency(device);
        }
        self.pressed = pressed;
    }

    #[inline(never)]
    fn move_ended(&mut self, device: &mut Device, end: &motion::MoveEnd) {
        let Some(homing) = &mut self.homing else {
            return handle_moved(device, end.position);
        };
        if let Some(outcome) = homing.move_ended(end) {
            self.homing = None;
            let was_homed = core::mem::replace(&mut self.was_homed, outcome.is_ok());
            self.alarmed = outcome.is_err();
            let drift =
                |seen| if was_homed { within_half_a_turn(seen, self.revolution) } else { 0 };
            handle_homed(device, outcome.map(drift));
        }
    }

    #[inline(never)]
    fn perform_actions(&mut self, device: &mut Device) {
        while let Some(action) = device.poll_action() {
            if self.pressed && is_dangerous(&action) {
                handle_emergency(device);
                continue;
            }
            match action {
                Action::Home { speed, acceleration } => self.home(device, speed, acceleration),
                Action::Move { target, speed, acceleration } => {
                    motion::move_to(target, speed, acceleration, None);
                }
                Action::StopMotion => {
                    self.homing = None;
                    motion::brake();
                }
                Action::ReleaseCoils => {
                    self.homing = None;
                    self.was_homed = false;
                    self.alarmed = true;
                    motion::release();
                }
                Action::Fire { window_ticks, max_echoes, blanking } => {
                    ranger::fire(window_ticks, max_echoes, blanking);
                }
                Action::AbortFire => ranger::abort(),
                Action::Reset => boot::restart(),
            }
        }
    }

    fn home(&mut self, device: &mut Device, speed: u16, acceleration: u32) {
        if let Some(on) = self.index {
            self.homing = Some(Homing::start(speed, acceleration, self.revolution, on));
        } else {
            // Energises the motor at its present position, which becomes zero.
            pins::enable::low();
            motion::set_zero();
            self.alarmed = false;
            handle_homed(device, Ok(0));
        }
    }

    /// Updates the light: on while active, blinking while the position is lost after a fault, else
    /// off.
    fn update_light(&self) {
        let on =
            if self.alarmed { clock::blink() } else { motion::is_moving() || ranger::is_ranging() };
        if on { pins::light::high() } else { pins::light::low() }
    }
}

/// Returns `true` for actions that move the motor or fire.
const fn is_dangerous(action: &Action) -> bool {
    matches!(action, Action::Home { .. } | Action::Move { .. } | Action::Fire { .. })
}

#[inline(never)]
/// Returns `false` if the machine's next deadline has passed; otherwise ensures that the chip wakes
/// in time.
fn arm_alarm(device: &Device) -> bool {
    let Some((_, at)) = device.poll_timeout() else { return true };
    let now = clock::now();
    if clock::is_past(now, at) {
        return false;
    }
    // A step pulse or the end of a window uses the alarm, and wakes the chip early enough.
    if at.wrapping_sub(now) < MAX_ALARM_TICKS && !motion::is_moving() && !ranger::is_ranging() {
        critical_section(|cs| clock::set_alarm(cs, Purpose::Wake, at));
    }
    true
}

#[inline(never)]
fn transmit(device: &mut Device) {
    while serial::has_room() {
        let Some(byte) = device.poll_byte() else { return };
        serial::send(byte);
    }
}

// Each method of the machine is called from one place, out of line: inlined into the loop they
// would take twice the space.

#[inline(never)]
fn handle_timeout(device: &mut Device) {
    device.handle_timeout(clock::now());
}

#[inline(never)]
fn handle_byte(device: &mut Device, byte: u8) {
    device.handle_byte(clock::now(), byte);
}

#[inline(never)]
fn handle_moved(device: &mut Device, position: i32) {
    device.handle_moved(clock::now(), position);
}

#[inline(never)]
fn handle_homed(device: &mut Device, outcome: Result<i32, firmware_protocol::device::HomeError>) {
    device.handle_homed(clock::now(), outcome);
}

#[inline(never)]
fn report_echoes(device: &mut Device) {
    if let Some(report) = ranger::take_report() {
        device.handle_echoes(clock::now(), report);
    }
}

#[inline(never)]
fn handle_emergency(device: &mut Device) {
    device.handle_emergency_stop(clock::now());
}

/// Handles PCINT1, a change of the emergency stop: the pins immediately, the machine in the next
/// iteration.
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_4() {
    // SAFETY: an interrupt handler.
    let cs = &unsafe { CriticalSection::in_interrupt() };
    if *OPTIONS.get(cs) & EMERGENCY_FITTED != 0 && pins::emergency() {
        pins::make_safe();
    }
    clock::wake(cs);
}
