//! Random faults of the line and of the device.

use std::{borrow::Cow, fmt, str::FromStr};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use thiserror::Error;

use super::invalid_replies::InvalidReply;

/// Probabilities of injected faults. Text form: `flip=0.001,drop=0.001,reset=0.002,version=9`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FaultPlan {
    /// Probability that a byte has one bit flipped.
    pub flip: f64,
    /// Probability that a byte is lost.
    pub drop: f64,
    /// Probability that a byte is duplicated.
    pub double: f64,
    /// Probability that a chunk of bytes is delayed by `delay_ms`.
    pub delay: f64,
    /// Delay of a chunk, milliseconds.
    pub delay_ms: u32,
    /// Probability for each firing that the device hangs for `stall_ms`.
    pub stall: f64,
    /// Duration of a stall, milliseconds.
    pub stall_ms: u32,
    /// Probability for each firing that the device restarts.
    pub reset: f64,
    /// Probability for each firing that the line hangs up and comes back.
    pub hangup: f64,
    /// Probability for each move of the motor that the device restarts, as from a weak supply.
    pub motor_reset: f64,
    /// Probability for each move of the motor that the line hangs up and comes back.
    pub motor_hangup: f64,
    /// Probability for each firing that no echo is detected, as without a transducer.
    pub no_echo: f64,
    /// Probability for each firing that ECHO is high before it, as from a module without power.
    pub stuck_echo: f64,
    /// Protocol version to claim instead of the true one.
    pub version: Option<u8>,
    /// Fault of the replies.
    pub lie: Option<InvalidReply>,
}

/// Help text on the keys of a fault specification.
pub const FAULT_HELP: &str = "comma-separated KEY=VALUE: flip, drop, double (probability per \
byte), delay (probability per chunk; delay_ms, default 20), stall (probability per firing; \
stall_ms, default 500), reset, hangup, no_echo, stuck_echo (probability per firing), motor_reset, \
motor_hangup (probability per move of the motor), version (protocol version to report), lie \
(protocol faults; lie=? lists them)";

/// Error in a fault specification.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FaultSpecError {
    /// A part without `=`.
    #[error("{0:?} is not KEY=VALUE")]
    NotAPair(String),
    /// An unknown key.
    #[error("{0:?} is not a fault")]
    UnknownKey(String),
    /// An invalid value for a key.
    #[error("{key}={value} is invalid, expected {expected}")]
    BadValue {
        /// Key of the fault.
        key: String,
        /// Value as specified.
        value: String,
        /// Description of valid values.
        expected: Cow<'static, str>,
    },
}

impl FromStr for FaultPlan {
    type Err = FaultSpecError;

    fn from_str(spec: &str) -> Result<Self, Self::Err> {
        let mut plan = Self { delay_ms: 20, stall_ms: 500, ..Self::default() };
        for part in spec.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let (key, value) =
                part.split_once('=').ok_or_else(|| FaultSpecError::NotAPair(part.into()))?;
            plan.set(key.trim(), value.trim())?;
        }
        Ok(plan)
    }
}

impl FaultPlan {
    fn set(&mut self, key: &str, value: &str) -> Result<(), FaultSpecError> {
        match key {
            "flip" => self.flip = probability(key, value)?,
            "drop" => self.drop = probability(key, value)?,
            "double" => self.double = probability(key, value)?,
            "delay" => self.delay = probability(key, value)?,
            "stall" => self.stall = probability(key, value)?,
            "reset" => self.reset = probability(key, value)?,
            "hangup" => self.hangup = probability(key, value)?,
            "no_echo" => self.no_echo = probability(key, value)?,
            "stuck_echo" => self.stuck_echo = probability(key, value)?,
            "delay_ms" => self.delay_ms = whole(key, value, "milliseconds, 0 to 60000")?,
            "stall_ms" => self.stall_ms = whole(key, value, "milliseconds, 0 to 60000")?,
            "motor_reset" => self.motor_reset = probability(key, value)?,
            "motor_hangup" => self.motor_hangup = probability(key, value)?,
            "lie" => {
                let invalid =
                    InvalidReply::from_name(value).map_err(|names| bad(key, value, names))?;
                self.lie = Some(invalid);
            }
            "version" => self.version = Some(whole(key, value, "a protocol version, 0 to 255")?),
            _ => return Err(FaultSpecError::UnknownKey(key.into())),
        }
        if self.delay_ms > 60_000 || self.stall_ms > 60_000 {
            return Err(bad(key, value, "milliseconds, 0 to 60000"));
        }
        Ok(())
    }
}

fn probability(key: &str, value: &str) -> Result<f64, FaultSpecError> {
    value
        .parse()
        .ok()
        .filter(|p| (0.0..=1.0).contains(p))
        .ok_or_else(|| bad(key, value, "a probability, 0 to 1"))
}

fn whole<T: FromStr>(key: &str, value: &str, expected: &'static str) -> Result<T, FaultSpecError> {
    value.parse().map_err(|_| bad(key, value, expected))
}

fn bad(key: &str, value: &str, expected: impl Into<Cow<'static, str>>) -> FaultSpecError {
    FaultSpecError::BadValue { key: key.into(), value: value.into(), expected: expected.into() }
}

/// Fault of the device at a firing or a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceFault {
    /// The device hangs for a number of milliseconds.
    Stall(u32),
    /// The device restarts.
    Reset,
    /// The line hangs up.
    Hangup,
}

impl fmt::Display for DeviceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stall(ms) => write!(f, "device stalls for {ms} ms"),
            Self::Reset => f.write_str("device resets"),
            Self::Hangup => f.write_str("line hangs up"),
        }
    }
}

/// Random generator of faults, reproducible for a given seed and sequence of calls.
#[derive(Debug)]
pub struct Faults {
    plan: FaultPlan,
    rng: Pcg64,
}

impl Faults {
    /// Creates a generator for a plan from a seed.
    #[must_use]
    pub fn new(plan: FaultPlan, seed: u64) -> Self {
        Self { plan, rng: Pcg64::seed_from_u64(seed) }
    }

    /// Appends `bytes` to `out` with the faults of the line applied.
    pub fn garble(&mut self, bytes: &[u8], out: &mut Vec<u8>) {
        for &byte in bytes {
            if self.happens(self.plan.drop) {
                continue;
            }
            let flipped = if self.happens(self.plan.flip) {
                byte ^ (1 << self.rng.random_range(0..8))
            } else {
                byte
            };
            out.push(flipped);
            if self.happens(self.plan.double) {
                out.push(flipped);
            }
        }
    }

    /// Draws the delay of the next chunk of bytes, milliseconds.
    pub fn delay_ms(&mut self) -> u32 {
        if self.happens(self.plan.delay) { self.plan.delay_ms } else { 0 }
    }

    /// Draws the fault of the device at a firing, if any.
    pub fn draw_firing_fault(&mut self) -> Option<DeviceFault> {
        let FaultPlan { stall, stall_ms, reset, hangup, .. } = self.plan;
        // All three are drawn each time, so that no probability affects the sequence of another.
        let draws = [self.happens(reset), self.happens(hangup), self.happens(stall)];
        [DeviceFault::Reset, DeviceFault::Hangup, DeviceFault::Stall(stall_ms)]
            .into_iter()
            .zip(draws)
            .find_map(|(fault, happens)| happens.then_some(fault))
    }

    /// Draws the fault of the device at the start of a move, if any.
    pub fn draw_motion_fault(&mut self) -> Option<DeviceFault> {
        let FaultPlan { motor_reset, motor_hangup, .. } = self.plan;
        let draws = [self.happens(motor_reset), self.happens(motor_hangup)];
        [DeviceFault::Reset, DeviceFault::Hangup]
            .into_iter()
            .zip(draws)
            .find_map(|(fault, happens)| happens.then_some(fault))
    }

    /// Draws the faults of the module at a firing: ECHO stuck high, no echo.
    pub fn draw_module_faults(&mut self) -> (bool, bool) {
        let FaultPlan { stuck_echo, no_echo, .. } = self.plan;
        (self.happens(stuck_echo), self.happens(no_echo))
    }

    fn happens(&mut self, probability: f64) -> bool {
        probability > 0.0 && self.rng.random_bool(probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specification_is_parsed() {
        let plan: FaultPlan = "flip=0.25, reset=1,version=9".parse().expect("reads");
        assert_eq!((plan.flip, plan.reset, plan.version), (0.25, 1.0, Some(9)));
        for (spec, part) in [
            ("flip", "KEY=VALUE"),
            ("flop=1", "not a fault"),
            ("flip=2", "0 to 1"),
            ("flip=NaN", "0 to 1"),
            ("stall_ms=70000", "60000"),
            ("version=300", "0 to 255"),
            ("lie=so", "late-echo"),
        ] {
            let error = spec.parse::<FaultPlan>().expect_err(spec);
            assert!(error.to_string().contains(part), "{spec}: {error}");
        }
    }

    #[test]
    fn probabilities_are_reproduced() {
        let plan: FaultPlan = "drop=0.1,double=0.1,flip=0.1".parse().expect("reads");
        let sent = vec![0x55; 100_000];
        let run = |seed| {
            let mut got = Vec::new();
            Faults::new(plan, seed).garble(&sent, &mut got);
            got
        };
        let got = run(1);
        assert_eq!(got, run(1));
        assert_ne!(got, run(2));
        // 0.9 survive, a tenth of those twice: 99,000 with a deviation of about 130.
        assert!((98_300..99_700).contains(&got.len()), "{}", got.len());
        let flipped = got.iter().filter(|&&byte| byte != 0x55).count();
        assert!((9_200..10_600).contains(&flipped), "{flipped}");
    }

    #[test]
    fn no_plan_changes_nothing() {
        let mut faults = Faults::new(FaultPlan::default(), 7);
        let mut got = Vec::new();
        faults.garble(&[1, 2, 3], &mut got);
        assert_eq!(got, [1, 2, 3]);
        assert_eq!((faults.delay_ms(), faults.draw_firing_fault()), (0, None));
    }
}
