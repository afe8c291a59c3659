//! Wiring of the chip's pins, and the callbacks that simavr invokes for them.

use std::{collections::VecDeque, ffi::c_void, ptr::NonNull};

use crate::{Environment, HZ, Module, motor::Motor, sys};

/// Duration of a byte in simavr, cycles: eleven bits, with a start bit, eight data bits and two
/// stop bits.
const BYTE_CYCLES: u64 = 11 * 136;
/// Maximum interval at which a sleeping chip is woken, so that the caller keeps control, cycles.
pub(crate) const HEARTBEAT: u64 = HZ / 10_000;
/// Width of the index, steps.
const INDEX_WIDTH: i32 = 4;
const PINC: usize = 0x26;
const DDRD: usize = 0x2a;
const PORTD: usize = 0x2b;
const DIR_BIT: u8 = 1 << 5;
const ENABLE_BIT: u8 = 1 << 6;

/// State accessed by simavr's callbacks. Boxed, because they keep its address.
pub(crate) struct Rig {
    pub(crate) avr: NonNull<sys::avr_t>,
    pub(crate) echo_pin: *mut sys::avr_irq_t,
    pub(crate) index_pin: *mut sys::avr_irq_t,
    pub(crate) emergency_pin: *mut sys::avr_irq_t,
    pub(crate) uart_in: *mut sys::avr_irq_t,
    pub(crate) environment: Box<dyn Environment>,
    pub(crate) steps_per_revolution: i32,
    pub(crate) module: Module,
    pub(crate) init: bool,
    pub(crate) init_rises: Vec<u64>,
    pub(crate) pulses: Vec<u64>,
    pub(crate) steps: i64,
    pub(crate) motor: Motor,
    pub(crate) emergency: bool,
    pub(crate) stuck_echo: bool,
    pub(crate) to_chip: VecDeque<u8>,
    pub(crate) sending: bool,
    pub(crate) from_chip: Vec<u8>,
    /// Cycle of the last heartbeat.
    pub(crate) last_heartbeat: u64,
}

impl Rig {
    #[expect(unsafe_code, reason = "simavr is C")]
    pub(crate) fn chip(&self) -> &sys::avr_t {
        // SAFETY: created in `Emulator::new`, freed in its `drop`.
        unsafe { self.avr.as_ref() }
    }

    #[expect(unsafe_code, reason = "simavr is C")]
    pub(crate) fn data(&self) -> &[u8] {
        let chip = self.chip();
        // SAFETY: simavr allocates `ramend + 1` bytes of data space.
        unsafe { std::slice::from_raw_parts(chip.data, usize::from(chip.ramend) + 1) }
    }

    #[expect(unsafe_code, reason = "simavr is C")]
    pub(crate) fn data_mut(&mut self) -> &mut [u8] {
        let chip = self.chip();
        // SAFETY: as in `data`; the rig is borrowed for the same time.
        unsafe { std::slice::from_raw_parts_mut(chip.data, usize::from(chip.ramend) + 1) }
    }

    pub(crate) fn now(&self) -> u64 {
        self.chip().cycle
    }

    pub(crate) fn holds_coils(&self) -> bool {
        let data = self.data();
        data[DDRD] & ENABLE_BIT != 0 && data[PORTD] & ENABLE_BIT == 0
    }

    pub(crate) fn set_init(&mut self, high: bool) {
        if self.init == high {
            return;
        }
        self.init = high;
        let now = self.now();
        if high {
            self.follow();
            self.init_rises.push(now);
            let echoes = self.environment.fire();
            self.module.fire(now, &echoes);
        } else {
            self.module.reset();
        }
        self.update_echo_pin();
    }

    /// Restores the timers after a reset, which removes them from simavr. Bytes in transit are
    /// lost.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub(crate) fn restart_timers(&mut self) {
        self.to_chip.clear();
        self.sending = false;
        self.last_heartbeat = self.now();
        let user = (&raw mut *self).cast::<c_void>();
        // SAFETY: the rig is boxed and outlives the timer.
        unsafe {
            let avr = self.avr.as_ptr();
            sys::avr_cycle_timer_cancel(avr, Some(heartbeat), user);
            sys::avr_cycle_timer_cancel(avr, Some(send_byte), user);
            sys::avr_cycle_timer_register(avr, HEARTBEAT, Some(heartbeat), user);
        }
    }

    /// Sets the level of ECHO, and schedules its next possible change.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub(crate) fn update_echo_pin(&mut self) {
        let level = self.module.echo() || self.stuck_echo;
        let now = self.now();
        let user = (&raw mut *self).cast::<c_void>();
        // SAFETY: the rig is boxed and outlives the timer.
        unsafe {
            sys::avr_raise_irq(self.echo_pin, level.into());
            sys::avr_cycle_timer_cancel(self.avr.as_ptr(), Some(update_module), user);
            if let Some(at) = self.module.next_update(now) {
                sys::avr_cycle_timer_register(
                    self.avr.as_ptr(),
                    at - now,
                    Some(update_module),
                    user,
                );
            }
        }
    }

    /// Advances the rotor, if the coils carry current.
    pub(crate) fn follow(&mut self) {
        if self.holds_coils() {
            let slipped = self.motor.follow(self.now());
            self.turn(slipped);
        } else {
            self.motor.release();
        }
    }

    fn turn(&mut self, steps: i32) {
        if steps != 0 {
            self.environment.turn(steps);
            self.refresh_inputs();
        }
    }

    /// Sets the levels of index sensor and emergency stop where they differ: enabling the chip's
    /// pull-ups overwrites them.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub(crate) fn refresh_inputs(&mut self) {
        let from_index = self.environment.steps_from_index().rem_euclid(self.steps_per_revolution);
        let levels =
            [(self.index_pin, from_index >= INDEX_WIDTH), (self.emergency_pin, self.emergency)];
        for (bit, (pin, level)) in levels.into_iter().enumerate() {
            if (self.data()[PINC] >> bit & 1 != 0) != level {
                // Toggles twice, because after a reset simavr's pin and its register differ, and it
                // forwards only changes of the pin.
                // SAFETY: a pin of the chip.
                unsafe {
                    sys::avr_raise_irq(pin, (!level).into());
                    sys::avr_raise_irq(pin, level.into());
                }
            }
        }
    }
}

/// # Safety
///
/// `user` must be the rig, and not referenced elsewhere: simavr calls one handler at a time, from
/// within `avr_run` or from a method of the emulator that has ended its borrow.
#[expect(unsafe_code, reason = "simavr is C")]
unsafe fn rig<'a>(user: *mut c_void) -> &'a mut Rig {
    // SAFETY: guaranteed by the caller.
    unsafe { &mut *user.cast::<Rig>() }
}

macro_rules! on_pin {
    ($name:ident, |$rig:ident, $high:ident| $body:expr) => {
        #[expect(unsafe_code, reason = "simavr is C")]
        pub(crate) unsafe extern "C" fn $name(
            _: *mut sys::avr_irq_t,
            value: u32,
            user: *mut c_void,
        ) {
            // SAFETY: registered with the rig.
            let $rig = unsafe { rig(user) };
            let $high = value & 1 != 0;
            $body
        }
    };
}

on_pin!(on_init, |rig, high| rig.set_init(high));
on_pin!(on_binh, |rig, high| {
    if high {
        let now = rig.now();
        rig.module.end_blanking(now);
        rig.update_echo_pin();
    }
});
on_pin!(on_blnk, |rig, high| {
    let now = rig.now();
    rig.module.blank(now, high);
    rig.update_echo_pin();
});
on_pin!(on_step, |rig, high| {
    if high {
        let now = rig.now();
        rig.pulses.push(now);
        if rig.holds_coils() {
            let steps = if rig.data()[PORTD] & DIR_BIT != 0 { 1 } else { -1 };
            rig.steps += i64::from(steps);
            let turned = rig.motor.pulse(now, steps);
            rig.turn(turned);
        }
    }
});

#[expect(unsafe_code, reason = "simavr is C")]
pub(crate) unsafe extern "C" fn on_sent(_: *mut sys::avr_irq_t, value: u32, user: *mut c_void) {
    // SAFETY: registered with the rig.
    unsafe { rig(user) }.from_chip.push((value & 0xff) as u8);
}

#[expect(unsafe_code, reason = "simavr is C")]
pub(crate) unsafe extern "C" fn update_module(
    _: *mut sys::avr_t,
    when: u64,
    user: *mut c_void,
) -> u64 {
    // SAFETY: registered with the rig.
    let rig = unsafe { rig(user) };
    rig.module.update(when);
    // SAFETY: a pin of the chip.
    unsafe { sys::avr_raise_irq(rig.echo_pin, (rig.module.echo() || rig.stuck_echo).into()) };
    rig.module.next_update(when).unwrap_or(0)
}

#[expect(unsafe_code, reason = "simavr is C")]
pub(crate) unsafe extern "C" fn send_byte(_: *mut sys::avr_t, when: u64, user: *mut c_void) -> u64 {
    // SAFETY: registered with the rig.
    let rig = unsafe { rig(user) };
    let Some(byte) = rig.to_chip.pop_front() else {
        rig.sending = false;
        return 0;
    };
    // SAFETY: the chip's UART.
    unsafe { sys::avr_raise_irq(rig.uart_in, byte.into()) };
    when + BYTE_CYCLES
}

#[expect(unsafe_code, reason = "simavr is C")]
pub(crate) unsafe extern "C" fn heartbeat(_: *mut sys::avr_t, when: u64, user: *mut c_void) -> u64 {
    // SAFETY: registered with the rig.
    let rig = unsafe { rig(user) };
    rig.follow();
    rig.refresh_inputs();
    rig.last_heartbeat = when;
    when + HEARTBEAT
}

/// Does nothing on sleep: the caller does the pacing.
#[expect(unsafe_code, reason = "simavr is C")]
pub(crate) unsafe extern "C" fn on_sleep(_: *mut sys::avr_t, _: u64) {}
