//! The main loop: tells the device machine what happened, does what it asks for, and sleeps.

use core::mem::MaybeUninit;

use board_config::{Config, OPTION_INDEX_HIGH};
use firmware_protocol::device::{Action, Board, Device, within_half_a_turn};
use firmware_protocol::messages::{Capabilities, FirmwareVersion};

use crate::clock::{self, Purpose};
use crate::hardware::{Alone, alone, enable_interrupts, feed_watchdog};
use crate::home::Homing;
use crate::{OPTIONS, boot, motion, pins, ranger, serial, store};

/// Bytes given to the machine before the rest of the world gets its turn.
const BYTES_A_ROUND: u8 = 16;
/// A deadline further away than this is left to the clock's overflow, which wakes every 33 ms.
const FAR: u32 = 50_000;

/// Among the options, which the handler of the emergency stop sees too.
const EMERGENCY_FITTED: u8 = 0x80;

/// In a place of its own, so that the compiler can address it directly: on the stack the same
/// code takes half as much again.
static mut DEVICE: MaybeUninit<Device> = MaybeUninit::uninit();

struct Rig {
    index: Option<bool>,
    can_stop: bool,
    revolution: u16,
    homing: Option<Homing>,
    /// Whether a homing has been done, so that the next can tell the drift.
    known: bool,
    pressed: bool,
    /// Something stopped the device by itself: the light blinks until it is homed.
    alarmed: bool,
}

pub fn run() -> ! {
    let mut rig = start();
    // SAFETY: `start` has written it, and nobody else holds it.
    let device = unsafe { (*(&raw mut DEVICE)).assume_init_mut() };
    boot::start_watchdog();
    enable_interrupts();
    loop {
        feed_watchdog();
        rig.round(device);
        rig.show();
        if clock_is_set(device) {
            clock::rest();
        }
    }
}

/// Reads the EEPROM and makes the machine. Apart from the loop, whose stack this would burden.
#[inline(never)]
fn start() -> Rig {
    let config = store::config();
    let board = Board {
        boot: store::next_boot(),
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: config.serial,
        steps_per_revolution: config.steps_per_revolution,
        capabilities: config.capabilities,
        reset_cause: boot::reset_cause(),
    };
    // SAFETY: before the loop that uses it.
    unsafe { (*(&raw mut DEVICE)).write(Device::new(board)) };
    Rig::new(&config)
}

impl Rig {
    fn new(config: &Config) -> Self {
        let can_stop = config.capabilities.has(Capabilities::EMERGENCY_STOP);
        let fitted = if can_stop { EMERGENCY_FITTED } else { 0 };
        alone(|alone| *OPTIONS.get(alone) = config.options & !EMERGENCY_FITTED | fitted);
        let has_index = config.capabilities.has(Capabilities::INDEX_SENSOR);
        Self {
            index: has_index.then_some(config.options & OPTION_INDEX_HIGH != 0),
            can_stop,
            revolution: config.steps_per_revolution,
            homing: None,
            known: false,
            pressed: false,
            alarmed: false,
        }
    }

    #[inline(never)]
    /// Everything that may have happened, once.
    fn round(&mut self, device: &mut Device) {
        // The lease first: a beam that ends after it must not be followed by another.
        on_time(device);
        self.watch_emergency(device);
        listen(device);
        if let Some(arrival) = motion::take_arrival() {
            self.arrived(device, &arrival);
        }
        self.act(device);
        for _ in 0..BYTES_A_ROUND {
            if serial::take_damage() {
                device.handle_line_error(clock::now());
            }
            let Some(byte) = serial::receive() else { break };
            on_byte(device, byte);
            self.act(device);
        }
        speak(device);
        // A restart waits until its acknowledgement is out.
        self.act(device);
    }

    fn watch_emergency(&mut self, device: &mut Device) {
        let pressed = self.can_stop && pins::emergency();
        if pressed && !self.pressed {
            pins::make_safe();
            emergency(device);
        }
        self.pressed = pressed;
    }

    #[inline(never)]
    fn arrived(&mut self, device: &mut Device, arrival: &motion::Arrival) {
        let Some(homing) = &mut self.homing else {
            return moved(device, arrival.position);
        };
        if let Some(outcome) = homing.arrived(arrival) {
            self.homing = None;
            let known = core::mem::replace(&mut self.known, outcome.is_ok());
            self.alarmed = outcome.is_err();
            let drift = |seen| if known { within_half_a_turn(seen, self.revolution) } else { 0 };
            homed(device, outcome.map(drift));
        }
    }

    #[inline(never)]
    fn act(&mut self, device: &mut Device) {
        while let Some(action) = device.poll_action() {
            if self.pressed && is_dangerous(&action) {
                emergency(device);
                continue;
            }
            match action {
                Action::Home { speed, acceleration } => self.home(device, speed, acceleration),
                Action::Move { target, speed, acceleration } => {
                    motion::turn(target, speed, acceleration, None);
                }
                Action::StopMotion => {
                    self.homing = None;
                    motion::brake();
                }
                Action::ReleaseCoils => {
                    self.homing = None;
                    self.known = false;
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
            self.homing = Some(Homing::begin(speed, acceleration, self.revolution, on));
        } else {
            // Holds the motor where it is: that is zero now.
            pins::enable::low();
            motion::set_zero();
            self.alarmed = false;
            homed(device, Ok(0));
        }
    }

    /// Steady while at work, blinking while the position is lost to a fault, else off.
    fn show(&self) {
        let on = if self.alarmed {
            clock::blink()
        } else {
            motion::is_turning() || ranger::is_listening()
        };
        if on { pins::light::high() } else { pins::light::low() }
    }
}

/// Turns the motor or fires.
const fn is_dangerous(action: &Action) -> bool {
    matches!(action, Action::Home { .. } | Action::Move { .. } | Action::Fire { .. })
}

#[inline(never)]
/// Whether the machine's next deadline will wake the chip; if not, it has come already.
fn clock_is_set(device: &Device) -> bool {
    let Some((_, at)) = device.poll_timeout() else { return true };
    let now = clock::now();
    if clock::is_past(now, at) {
        return false;
    }
    // A pulse or the end of a window uses the alarm, and wakes soon enough.
    if at.wrapping_sub(now) < FAR && !motion::is_turning() && !ranger::is_listening() {
        alone(|alone| clock::set_alarm(alone, Purpose::Wake, at));
    }
    true
}

#[inline(never)]
fn speak(device: &mut Device) {
    while serial::has_room() {
        let Some(byte) = device.poll_byte() else { return };
        serial::send(byte);
    }
}

// Each verb of the machine once, and apart: inlined into the loop they take twice the room.

#[inline(never)]
fn on_time(device: &mut Device) {
    device.handle_timeout(clock::now());
}

#[inline(never)]
fn on_byte(device: &mut Device, byte: u8) {
    device.handle_byte(clock::now(), byte);
}

#[inline(never)]
fn moved(device: &mut Device, position: i32) {
    device.handle_moved(clock::now(), position);
}

#[inline(never)]
fn homed(device: &mut Device, outcome: Result<i32, firmware_protocol::device::HomeError>) {
    device.handle_homed(clock::now(), outcome);
}

#[inline(never)]
fn listen(device: &mut Device) {
    if let Some(report) = ranger::take_report() {
        device.handle_echoes(clock::now(), report);
    }
}

#[inline(never)]
fn emergency(device: &mut Device) {
    device.handle_emergency_stop(clock::now());
}

/// PCINT1: the emergency stop changed. The pins at once, the machine when the loop comes round.
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_4() {
    // SAFETY: an interrupt handler.
    let alone = &unsafe { Alone::in_interrupt() };
    if *OPTIONS.get(alone) & EMERGENCY_FITTED != 0 && pins::emergency() {
        pins::make_safe();
    }
    clock::wake(alone);
}
