//! The chip, and what its pins are wired to.

use std::{
    collections::VecDeque,
    ffi::{CString, c_char, c_void},
    fmt,
    path::Path,
    ptr::NonNull,
};

use board_config::Config;

use crate::{CYCLES_PER_US, HZ, Module, Surroundings, sys};

const fn ioctl(name: [u8; 4]) -> u32 {
    u32::from_be_bytes(name)
}
const UART: u32 = ioctl(*b"uar0");
const UART_SET_FLAGS: u32 = ioctl(*b"uas0");
const EEPROM_SET: u32 = ioctl(*b"eesp");
const PORT_B: u32 = ioctl(*b"iogB");
const PORT_C: u32 = ioctl(*b"iogC");
const PORT_D: u32 = ioctl(*b"iogD");

/// simavr takes eleven bits for a byte: start, eight, and what it believes are two stop bits.
const BYTE_CYCLES: u64 = 11 * 136;
/// A sleeping chip is woken so often at least, so that the caller keeps control.
const HEARTBEAT: u64 = HZ / 10_000;
/// Steps for which the index sensor is on.
const INDEX_WIDTH: i32 = 4;

const RAM_START: usize = 0x100;
/// What memory holds before anything is written to it.
const PAINT: u8 = 0xa5;
const PINC: usize = 0x26;
const DDRB: usize = 0x24;
const DDRD: usize = 0x2a;
const PORTD: usize = 0x2b;
const MCUSR: usize = 0x54;
const INIT_BIT: u8 = 1 << 1;
const DIR_BIT: u8 = 1 << 5;
const ENABLE_BIT: u8 = 1 << 6;
const STATE_DONE: i32 = 6;
const STATE_CRASHED: i32 = 7;

/// Why a chip restarts, as MCUSR tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reset {
    /// Power came on.
    PowerOn = 1,
    /// The reset pin.
    External = 2,
    /// The supply sagged.
    BrownOut = 4,
}

/// The firmware panicked or ran into nowhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crash {
    /// Program counter, bytes.
    pub pc: u32,
    /// Cycle.
    pub at: u64,
}

impl fmt::Display for Crash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the firmware crashed at {:#06x}, cycle {}", self.pc, self.at)
    }
}

impl std::error::Error for Crash {}

/// An ATmega328P that runs the firmware, with everything wired to it.
pub struct Emulator {
    rig: Box<Rig>,
}

/// What simavr's callbacks touch; in a box, because they keep its address.
struct Rig {
    avr: NonNull<sys::avr_t>,
    echo_pin: *mut sys::avr_irq_t,
    index_pin: *mut sys::avr_irq_t,
    emergency_pin: *mut sys::avr_irq_t,
    uart_in: *mut sys::avr_irq_t,
    surroundings: Box<dyn Surroundings>,
    steps_per_revolution: i32,
    module: Module,
    init: bool,
    init_rises: Vec<u64>,
    pulses: Vec<u64>,
    steps: i64,
    emergency: bool,
    stuck_echo: bool,
    to_chip: VecDeque<u8>,
    sending: bool,
    from_chip: Vec<u8>,
    /// When the heartbeat came last.
    beat: u64,
}

impl fmt::Debug for Emulator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Emulator")
            .field("cycle", &self.cycle())
            .field("steps", &self.rig.steps)
            .field("firings", &self.rig.init_rises.len())
            .finish_non_exhaustive()
    }
}

impl Emulator {
    /// A chip with the firmware `elf` and an EEPROM that holds `config`, before its first
    /// instruction.
    ///
    /// # Errors
    /// When the file is no firmware.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn new(
        elf: &Path,
        config: &Config,
        surroundings: Box<dyn Surroundings>,
    ) -> Result<Self, String> {
        let path = CString::new(elf.as_os_str().as_encoded_bytes()).map_err(|e| e.to_string())?;
        // SAFETY: simavr's own order of calls; every pointer is checked or its own, and the rig
        // outlives the chip, whose timers and notifications end with it.
        unsafe {
            let mut firmware: sys::elf_firmware_t = std::mem::zeroed();
            if sys::elf_read_firmware(path.as_ptr(), &raw mut firmware) != 0 {
                return Err(format!("{} is no firmware", elf.display()));
            }
            for (slot, byte) in firmware.mmcu.iter_mut().zip(b"atmega328p\0") {
                *slot = *byte as c_char;
            }
            firmware.frequency = HZ as u32;
            let avr = sys::avr_make_mcu_by_name(firmware.mmcu.as_ptr());
            let mut avr = NonNull::new(avr).ok_or("this simavr knows no ATmega328P")?;
            sys::avr_init(avr.as_ptr());
            sys::avr_load_firmware(avr.as_ptr(), &raw mut firmware);
            avr.as_mut().frequency = HZ as u32;
            avr.as_mut().sleep = Some(keep_on);
            avr.as_mut().set_log(0);
            let mut flags = 0_u32;
            sys::avr_ioctl(avr.as_ptr(), UART_SET_FLAGS, (&raw mut flags).cast());
            let mut image = config.encode();
            let mut eeprom = sys::avr_eeprom_desc_t {
                ee: image.as_mut_ptr(),
                offset: 0,
                size: image.len() as u32,
            };
            sys::avr_ioctl(avr.as_ptr(), EEPROM_SET, (&raw mut eeprom).cast());
            let pin = |port, bit| sys::avr_io_getirq(avr.as_ptr(), port, bit);
            let mut rig = Box::new(Rig {
                avr,
                echo_pin: pin(PORT_B, 0),
                index_pin: pin(PORT_C, 0),
                emergency_pin: pin(PORT_C, 1),
                uart_in: pin(UART, 0),
                surroundings,
                steps_per_revolution: config.steps_per_revolution.into(),
                module: Module::default(),
                init: false,
                init_rises: Vec::new(),
                pulses: Vec::new(),
                steps: 0,
                emergency: false,
                stuck_echo: false,
                to_chip: VecDeque::new(),
                sending: false,
                from_chip: Vec::new(),
                beat: 0,
            });
            let user = (&raw mut *rig).cast::<c_void>();
            let hook = |pin, handler| sys::avr_irq_register_notify(pin, Some(handler), user);
            hook(pin(PORT_B, 1), on_init as unsafe extern "C" fn(_, _, _));
            hook(pin(PORT_B, 2), on_binh);
            hook(pin(PORT_B, 3), on_blnk);
            hook(pin(PORT_D, 4), on_step);
            hook(pin(UART, 1), on_sent);
            sys::avr_raise_irq(rig.echo_pin, 0);
            sys::avr_cycle_timer_register(avr.as_ptr(), HEARTBEAT, Some(heartbeat), user);
            for byte in &mut rig.data_mut()[RAM_START..] {
                *byte = PAINT;
            }
            Ok(Self { rig })
        }
    }

    /// Cycles since power came on.
    #[must_use]
    pub fn cycle(&self) -> u64 {
        self.rig.now()
    }

    /// Microseconds since power came on.
    #[must_use]
    pub fn now_us(&self) -> u64 {
        self.cycle() / CYCLES_PER_US
    }

    /// Bytes for the chip; they go over the line one after the other.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn send(&mut self, bytes: &[u8]) {
        self.rig.to_chip.extend(bytes);
        if !self.rig.sending && !bytes.is_empty() {
            self.rig.sending = true;
            let user = (&raw mut *self.rig).cast::<c_void>();
            // SAFETY: the rig lives as long as the chip.
            unsafe {
                sys::avr_cycle_timer_register(self.rig.avr.as_ptr(), 1, Some(feed), user);
            }
        }
    }

    /// What the chip has sent since the last call.
    pub fn received(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.rig.from_chip)
    }

    /// Whether [`Self::received`] would give anything.
    #[must_use]
    pub fn has_received(&self) -> bool {
        !self.rig.from_chip.is_empty()
    }

    /// Bytes that are still on their way to the chip.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.rig.to_chip.len()
    }

    /// Runs until `done`, at most `cycles`; tells whether it was done.
    ///
    /// # Errors
    /// [`Crash`].
    pub fn run_until(
        &mut self,
        cycles: u64,
        mut done: impl FnMut(&Self) -> bool,
    ) -> Result<bool, Crash> {
        let end = self.cycle() + cycles;
        while self.cycle() < end {
            self.instruction()?;
            if done(self) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Runs so many cycles.
    ///
    /// # Errors
    /// [`Crash`].
    pub fn run(&mut self, cycles: u64) -> Result<(), Crash> {
        self.run_until(cycles, |_| false).map(drop)
    }

    #[expect(unsafe_code, reason = "simavr is C")]
    fn instruction(&mut self) -> Result<(), Crash> {
        // SAFETY: the chip was initialised.
        let state = unsafe { sys::avr_run(self.rig.avr.as_ptr()) };
        if self.cycle() > self.rig.beat + 4 * HEARTBEAT {
            self.rig.start_again();
        }
        let data = self.rig.data();
        if self.rig.init && data[DDRB] & INIT_BIT == 0 {
            // A reset lets go of the pins without a word; the resistor pulls INIT low.
            self.rig.set_init(false);
        }
        if state == STATE_DONE || state == STATE_CRASHED {
            return Err(Crash { pc: self.rig.chip().pc, at: self.cycle() });
        }
        Ok(())
    }

    /// Restarts the chip.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn reset(&mut self, cause: Reset) {
        // SAFETY: the chip was initialised.
        unsafe { sys::avr_reset(self.rig.avr.as_ptr()) };
        self.rig.data_mut()[MCUSR] = cause as u8;
        self.rig.set_init(false);
        self.rig.start_again();
    }

    /// Makes the firmware hang with interrupts on: an instruction that jumps to itself.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn hang(&mut self) {
        const JUMP_TO_ITSELF: [u8; 2] = [0xff, 0xcf];
        let unused = 0x7000;
        // SAFETY: the flash has 32 KB; the firmware keeps to less than half of it.
        unsafe {
            let chip = self.rig.avr.as_mut();
            std::ptr::copy_nonoverlapping(JUMP_TO_ITSELF.as_ptr(), chip.flash.add(unused), 2);
            chip.pc = unused as u32;
        }
    }

    /// Presses or releases the emergency stop.
    pub fn press_emergency(&mut self, pressed: bool) {
        self.rig.emergency = pressed;
        self.rig.refresh_inputs();
    }

    /// ECHO hangs high, as when the module has no power.
    pub fn stick_echo(&mut self, stuck: bool) {
        self.rig.stuck_echo = stuck;
        self.rig.show_echo();
    }

    /// When INIT rose, cycles, since the last call.
    pub fn take_init_rises(&mut self) -> Vec<u64> {
        std::mem::take(&mut self.rig.init_rises)
    }

    /// When STEP rose, cycles, since the last call.
    pub fn take_pulses(&mut self) -> Vec<u64> {
        std::mem::take(&mut self.rig.pulses)
    }

    /// Pulses forward less pulses back, with the coils held, since power came on.
    #[must_use]
    pub fn steps(&self) -> i64 {
        self.rig.steps
    }

    /// Whether INIT is high.
    #[must_use]
    pub fn is_firing(&self) -> bool {
        self.rig.init
    }

    /// Whether the motor's coils have current.
    #[must_use]
    pub fn holds_coils(&self) -> bool {
        self.rig.holds_coils()
    }

    /// The deepest the stack has been since power came on, bytes: what is no longer painted above
    /// the longest stretch of memory that still is. (The pointer itself can't be watched: a
    /// function changes it one byte after the other.)
    #[must_use]
    pub fn stack_bytes(&self) -> usize {
        let memory = &self.rig.data()[RAM_START..];
        let (mut longest, mut end, mut run) = (0, 0, 0);
        for (at, byte) in memory.iter().enumerate() {
            run = if *byte == PAINT { run + 1 } else { 0 };
            if run > longest {
                (longest, end) = (run, at + 1);
            }
        }
        memory.len() - end
    }

    /// What is outside, if it is a `T`: for tests that change it on the way.
    pub fn set_surroundings(&mut self, surroundings: Box<dyn Surroundings>) {
        self.rig.surroundings = surroundings;
    }
}

impl Drop for Emulator {
    #[expect(unsafe_code, reason = "simavr is C")]
    fn drop(&mut self) {
        // SAFETY: nobody uses the chip afterwards. simavr frees what it made.
        unsafe { sys::avr_terminate(self.rig.avr.as_ptr()) };
    }
}

impl Rig {
    #[expect(unsafe_code, reason = "simavr is C")]
    fn chip(&self) -> &sys::avr_t {
        // SAFETY: made in `Emulator::new`, freed in its `drop`.
        unsafe { self.avr.as_ref() }
    }

    #[expect(unsafe_code, reason = "simavr is C")]
    fn data(&self) -> &[u8] {
        let chip = self.chip();
        // SAFETY: simavr allocates `ramend + 1` bytes of data space.
        unsafe { std::slice::from_raw_parts(chip.data, usize::from(chip.ramend) + 1) }
    }

    #[expect(unsafe_code, reason = "simavr is C")]
    fn data_mut(&mut self) -> &mut [u8] {
        let chip = self.chip();
        // SAFETY: as in `data`; the rig is borrowed for as long.
        unsafe { std::slice::from_raw_parts_mut(chip.data, usize::from(chip.ramend) + 1) }
    }

    fn now(&self) -> u64 {
        self.chip().cycle
    }

    fn holds_coils(&self) -> bool {
        let data = self.data();
        data[DDRD] & ENABLE_BIT != 0 && data[PORTD] & ENABLE_BIT == 0
    }

    fn set_init(&mut self, high: bool) {
        if self.init == high {
            return;
        }
        self.init = high;
        let now = self.now();
        if high {
            self.init_rises.push(now);
            let echoes = self.surroundings.fire();
            self.module.fire(now, &echoes);
        } else {
            self.module.rest();
        }
        self.show_echo();
    }

    /// A reset has taken every timer out of simavr. Bytes on their way are lost.
    #[expect(unsafe_code, reason = "simavr is C")]
    fn start_again(&mut self) {
        self.to_chip.clear();
        self.sending = false;
        self.beat = self.now();
        let user = (&raw mut *self).cast::<c_void>();
        // SAFETY: the rig is in its box and outlives the timer.
        unsafe {
            let avr = self.avr.as_ptr();
            sys::avr_cycle_timer_cancel(avr, Some(heartbeat), user);
            sys::avr_cycle_timer_cancel(avr, Some(feed), user);
            sys::avr_cycle_timer_register(avr, HEARTBEAT, Some(heartbeat), user);
        }
    }

    /// Puts ECHO on its pin, and looks again when something may change.
    #[expect(unsafe_code, reason = "simavr is C")]
    fn show_echo(&mut self) {
        let level = self.module.echo() || self.stuck_echo;
        let now = self.now();
        let user = (&raw mut *self).cast::<c_void>();
        // SAFETY: the rig is in its box and outlives the timer.
        unsafe {
            sys::avr_raise_irq(self.echo_pin, level.into());
            sys::avr_cycle_timer_cancel(self.avr.as_ptr(), Some(look), user);
            if let Some(at) = self.module.next_look(now) {
                sys::avr_cycle_timer_register(self.avr.as_ptr(), at - now, Some(look), user);
            }
        }
    }

    /// Index sensor and emergency stop, where they are not what they should be: the chip's own
    /// pull-ups write over them when they are switched on.
    #[expect(unsafe_code, reason = "simavr is C")]
    fn refresh_inputs(&mut self) {
        let from_index = self.surroundings.steps_from_index().rem_euclid(self.steps_per_revolution);
        let levels =
            [(self.index_pin, from_index >= INDEX_WIDTH), (self.emergency_pin, self.emergency)];
        for (bit, (pin, level)) in levels.into_iter().enumerate() {
            if (self.data()[PINC] >> bit & 1 != 0) != level {
                // There and back, because after a reset simavr's pin and its register differ, and
                // it passes on only what changes the pin.
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
/// `user` is the rig, and nobody else holds it: simavr calls one handler at a time, from within
/// `avr_run` or from a method of the emulator that is done with its borrow.
#[expect(unsafe_code, reason = "simavr is C")]
unsafe fn rig<'a>(user: *mut c_void) -> &'a mut Rig {
    // SAFETY: as the caller promises.
    unsafe { &mut *user.cast::<Rig>() }
}

macro_rules! on_pin {
    ($name:ident, |$rig:ident, $high:ident| $body:expr) => {
        #[expect(unsafe_code, reason = "simavr is C")]
        unsafe extern "C" fn $name(_: *mut sys::avr_irq_t, value: u32, user: *mut c_void) {
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
        rig.show_echo();
    }
});
on_pin!(on_blnk, |rig, high| {
    let now = rig.now();
    rig.module.blank(now, high);
    rig.show_echo();
});
on_pin!(on_step, |rig, high| {
    if high {
        let now = rig.now();
        rig.pulses.push(now);
        if rig.holds_coils() {
            let steps = if rig.data()[PORTD] & DIR_BIT != 0 { 1 } else { -1 };
            rig.surroundings.turn(steps);
            rig.steps += i64::from(steps);
            rig.refresh_inputs();
        }
    }
});

#[expect(unsafe_code, reason = "simavr is C")]
unsafe extern "C" fn on_sent(_: *mut sys::avr_irq_t, value: u32, user: *mut c_void) {
    // SAFETY: registered with the rig.
    unsafe { rig(user) }.from_chip.push((value & 0xff) as u8);
}

#[expect(unsafe_code, reason = "simavr is C")]
unsafe extern "C" fn look(_: *mut sys::avr_t, when: u64, user: *mut c_void) -> u64 {
    // SAFETY: registered with the rig.
    let rig = unsafe { rig(user) };
    rig.module.look(when);
    // SAFETY: a pin of the chip.
    unsafe { sys::avr_raise_irq(rig.echo_pin, (rig.module.echo() || rig.stuck_echo).into()) };
    rig.module.next_look(when).unwrap_or(0)
}

#[expect(unsafe_code, reason = "simavr is C")]
unsafe extern "C" fn feed(_: *mut sys::avr_t, when: u64, user: *mut c_void) -> u64 {
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
unsafe extern "C" fn heartbeat(_: *mut sys::avr_t, when: u64, user: *mut c_void) -> u64 {
    // SAFETY: registered with the rig.
    let rig = unsafe { rig(user) };
    rig.refresh_inputs();
    rig.beat = when;
    when + HEARTBEAT
}

/// The caller does the pacing: a sleeping chip costs nothing.
#[expect(unsafe_code, reason = "simavr is C")]
unsafe extern "C" fn keep_on(_: *mut sys::avr_t, _: u64) {}
