//! Conformance tests on the firmware's machine code.

use crate::common::{config, elf, scripted};
use firmware_protocol::conformance_tests;
use sonard_emulator::Emulator;

conformance_tests!(Emulator::new(&elf(), &config(), Box::new(scripted(&[]))).expect("a firmware"));
