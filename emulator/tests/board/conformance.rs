//! Conformance tests on the firmware's machine code.

use crate::common::{commanded, config, elf};
use firmware_protocol::conformance_tests;
use sonard_emulator::Emulator;

conformance_tests!(Emulator::new(&elf(), &config(), Box::new(commanded(&[]))).expect("a firmware"));
