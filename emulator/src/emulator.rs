//! Emulated chip with its connected devices.

use std::{collections::VecDeque, ffi::c_void, fmt, path::Path, ptr::NonNull};

use board_config::Config;
use firmware_protocol::conformance::DeviceUnderTest;

use crate::rig::{
    HEARTBEAT, Rig, heartbeat, on_binh, on_blnk, on_init, on_sent, on_sleep, on_step, send_byte,
};
use crate::{
    CYCLES_PER_US, Environment, HZ, Module, MotorLimits, ScriptedEnvironment, firmware,
    motor::Motor, sys,
};

const fn ioctl(name: [u8; 4]) -> u32 {
    u32::from_be_bytes(name)
}
const UART: u32 = ioctl(*b"uar0");
const UART_SET_FLAGS: u32 = ioctl(*b"uas0");
const EEPROM_SET: u32 = ioctl(*b"eesp");
const PORT_B: u32 = ioctl(*b"iogB");
const PORT_C: u32 = ioctl(*b"iogC");
const PORT_D: u32 = ioctl(*b"iogD");

const RAM_START: usize = 0x100;
/// Initial content of the memory, to measure the depth of the stack.
const PAINT: u8 = 0xa5;
const DDRB: usize = 0x24;
const MCUSR: usize = 0x54;
const INIT_BIT: u8 = 1 << 1;
const STATE_DONE: i32 = 6;
const STATE_CRASHED: i32 = 7;

/// Cause of a reset, as reported in MCUSR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reset {
    /// Power was switched on.
    PowerOn = 1,
    /// The reset pin was pulled low.
    External = 2,
    /// The supply voltage dropped.
    BrownOut = 4,
}

/// Crash of the firmware: a panic, or execution outside the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crash {
    /// Program counter, bytes.
    pub pc: u32,
    /// Time of the crash, cycles.
    pub at: u64,
}

impl fmt::Display for Crash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the firmware crashed at {:#06x}, cycle {}", self.pc, self.at)
    }
}

impl std::error::Error for Crash {}

/// ATmega328P that runs the firmware, with all connected devices.
pub struct Emulator {
    rig: Box<Rig>,
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

/// Sets the UART flags and the EEPROM of a new chip.
///
/// # Safety
///
/// `avr` must be a created and initialised chip.
unsafe fn configure(avr: NonNull<sys::avr_t>, config: &Config) {
    let mut flags = 0_u32;
    let mut image = config.encode();
    let mut eeprom =
        sys::avr_eeprom_desc_t { ee: image.as_mut_ptr(), offset: 0, size: image.len() as u32 };
    // SAFETY: both calls copy their arguments.
    unsafe {
        sys::avr_ioctl(avr.as_ptr(), UART_SET_FLAGS, (&raw mut flags).cast());
        sys::avr_ioctl(avr.as_ptr(), EEPROM_SET, (&raw mut eeprom).cast());
    }
}

impl Emulator {
    /// Creates a chip with the firmware `elf` and the EEPROM content `config`, before its first
    /// instruction.
    ///
    /// # Errors
    ///
    /// Returns an error if the file is not a firmware.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn new(
        elf: &Path,
        config: &Config,
        environment: Box<dyn Environment>,
    ) -> Result<Self, String> {
        let mut firmware = firmware::read(elf)?;
        // SAFETY: calls in the order required by simavr; every pointer is checked or owned, and the
        // rig outlives the chip, whose timers and notifications end with it.
        unsafe {
            let avr = sys::avr_make_mcu_by_name(firmware.mmcu.as_ptr());
            let mut avr = NonNull::new(avr)
                .ok_or("this version of simavr does not support the ATmega328P")?;
            sys::avr_init(avr.as_ptr());
            sys::avr_load_firmware(avr.as_ptr(), &raw mut firmware);
            avr.as_mut().frequency = HZ as u32;
            avr.as_mut().sleep = Some(on_sleep);
            avr.as_mut().set_log(0);
            configure(avr, config);
            let pin = |port, bit| sys::avr_io_getirq(avr.as_ptr(), port, bit);
            let mut rig = Box::new(Rig {
                avr,
                echo_pin: pin(PORT_B, 0),
                index_pin: pin(PORT_C, 0),
                emergency_pin: pin(PORT_C, 1),
                uart_in: pin(UART, 0),
                environment,
                steps_per_revolution: config.steps_per_revolution.into(),
                module: Module::default(),
                init: false,
                init_rises: Vec::new(),
                pulses: Vec::new(),
                steps: 0,
                motor: Motor::default(),
                emergency: false,
                stuck_echo: false,
                to_chip: VecDeque::new(),
                sending: false,
                from_chip: Vec::new(),
                last_heartbeat: 0,
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

    /// Cycles since power-on.
    #[must_use]
    pub fn cycle(&self) -> u64 {
        self.rig.now()
    }

    /// Microseconds since power-on.
    #[must_use]
    pub fn now_us(&self) -> u64 {
        self.cycle() / CYCLES_PER_US
    }

    /// Sends bytes to the chip; they are transmitted over the line in sequence.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn send(&mut self, bytes: &[u8]) {
        self.rig.to_chip.extend(bytes);
        if !self.rig.sending && !bytes.is_empty() {
            self.rig.sending = true;
            let user = (&raw mut *self.rig).cast::<c_void>();
            // SAFETY: the rig lives as long as the chip.
            unsafe {
                sys::avr_cycle_timer_register(self.rig.avr.as_ptr(), 1, Some(send_byte), user);
            }
        }
    }

    /// Returns the bytes sent by the chip since the last call.
    pub fn received(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.rig.from_chip)
    }

    /// Returns `true` if [`Self::received`] would return bytes.
    #[must_use]
    pub fn has_received(&self) -> bool {
        !self.rig.from_chip.is_empty()
    }

    /// Number of bytes still in transit to the chip.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.rig.to_chip.len()
    }

    /// Runs until `done` returns `true`, for at most `cycles`; returns whether it did.
    ///
    /// # Errors
    ///
    /// Returns a [`Crash`] of the firmware.
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

    /// Runs the chip for `cycles`.
    ///
    /// # Errors
    ///
    /// Returns a [`Crash`] of the firmware.
    pub fn run(&mut self, cycles: u64) -> Result<(), Crash> {
        self.run_until(cycles, |_| false).map(drop)
    }

    #[expect(unsafe_code, reason = "simavr is C")]
    fn instruction(&mut self) -> Result<(), Crash> {
        // SAFETY: the chip was initialised.
        let state = unsafe { sys::avr_run(self.rig.avr.as_ptr()) };
        if self.cycle() > self.rig.last_heartbeat + 4 * HEARTBEAT {
            self.rig.restart_timers();
        }
        let data = self.rig.data();
        if self.rig.init && data[DDRB] & INIT_BIT == 0 {
            // A reset releases the pins without notification; the resistor pulls INIT low.
            self.rig.set_init(false);
        }
        if state == STATE_DONE || state == STATE_CRASHED {
            return Err(Crash { pc: self.rig.chip().pc, at: self.cycle() });
        }
        Ok(())
    }

    /// Resets the chip, with the given cause in MCUSR.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn reset(&mut self, cause: Reset) {
        // SAFETY: the chip was initialised.
        unsafe { sys::avr_reset(self.rig.avr.as_ptr()) };
        self.rig.data_mut()[MCUSR] = cause as u8;
        self.rig.set_init(false);
        self.rig.restart_timers();
    }

    /// Drops the supply for the given time: the chip stops, its pins are released, and then it
    /// restarts.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn dip(&mut self, milliseconds: u64) {
        self.reset(Reset::BrownOut);
        // SAFETY: the chip was initialised. Its clock is stopped while time passes.
        unsafe { self.rig.avr.as_mut() }.cycle += milliseconds * 1_000 * CYCLES_PER_US;
        self.rig.restart_timers();
    }

    /// Sets the limits of the motor; without limits it follows every pulse.
    pub fn set_motor(&mut self, limits: Option<MotorLimits>) {
        self.rig.motor.set_limits(limits);
    }

    /// Makes the firmware hang with interrupts enabled: an instruction that jumps to itself.
    #[expect(unsafe_code, reason = "simavr is C")]
    pub fn hang(&mut self) {
        const JUMP_TO_ITSELF: [u8; 2] = [0xff, 0xcf];
        let unused = 0x7000;
        // SAFETY: the flash has 32 KB, of which the firmware uses far less.
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

    /// Holds ECHO high, as when the module has no power.
    pub fn stick_echo(&mut self, stuck: bool) {
        self.rig.stuck_echo = stuck;
        self.rig.update_echo_pin();
    }

    /// Returns the times at which INIT rose since the last call, cycles.
    pub fn take_init_rises(&mut self) -> Vec<u64> {
        std::mem::take(&mut self.rig.init_rises)
    }

    /// Returns the times at which STEP rose since the last call, cycles.
    pub fn take_pulses(&mut self) -> Vec<u64> {
        std::mem::take(&mut self.rig.pulses)
    }

    /// Net pulses since power-on while the coils were energised.
    #[must_use]
    pub fn steps(&self) -> i64 {
        self.rig.steps
    }

    /// Returns `true` while INIT is high.
    #[must_use]
    pub fn is_firing(&self) -> bool {
        self.rig.init
    }

    /// Returns `true` while the motor's coils carry current.
    #[must_use]
    pub fn holds_coils(&self) -> bool {
        self.rig.holds_coils()
    }

    /// Maximum depth of the stack since power-on, bytes: the memory above the longest run of
    /// unchanged bytes. (The stack pointer cannot be watched: a function changes it one byte at a
    /// time.)
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

    /// Replaces the environment of the board.
    pub fn set_environment(&mut self, environment: Box<dyn Environment>) {
        self.rig.environment = environment;
    }
}

impl Drop for Emulator {
    #[expect(unsafe_code, reason = "simavr is C")]
    fn drop(&mut self) {
        // SAFETY: the chip is not used afterwards. simavr frees its own allocations.
        unsafe { sys::avr_terminate(self.rig.avr.as_ptr()) };
    }
}

impl DeviceUnderTest for Emulator {
    type Error = Crash;

    fn now_us(&self) -> u64 {
        self.now_us()
    }

    fn run(&mut self, us: u64) -> Result<(), Crash> {
        self.run(us * CYCLES_PER_US)
    }

    fn send(&mut self, bytes: &[u8]) {
        self.send(bytes);
    }

    fn receive(&mut self) -> Vec<u8> {
        self.received()
    }

    fn set_echoes(&mut self, after_us: &[f64]) {
        let cycles = |us: &f64| (us * CYCLES_PER_US as f64).round() as u64;
        let echoes = after_us.iter().map(cycles).collect();
        let step = self.rig.environment.steps_from_index();
        self.set_environment(Box::new(ScriptedEnvironment { echoes, step }));
    }

    fn take_firings(&mut self) -> usize {
        self.take_init_rises().len()
    }

    fn motor_steps(&self) -> i64 {
        self.steps()
    }

    fn holds_coils(&self) -> bool {
        self.holds_coils()
    }
}
