//! Flash and memory of the firmware compared with their limits, at the maximum depth of the stack.

use std::process::Command as Process;

use crate::common::{SETTINGS, elf, ready, scripted};
use firmware_protocol::host::Command;
use firmware_protocol::messages::{Blanking, Settings, Sweep};
use rand::{Rng as _, SeedableRng as _};
use sonard_emulator::HZ;

/// Half of the chip's flash, to leave room for extensions.
const FLASH_MAX: u32 = 16 * 1024;
const MEMORY_MAX: usize = 1_200;

/// Sizes of text, data and bss, bytes.
fn sizes() -> (u32, u32, u32) {
    let output = Process::new("avr-size").arg(elf()).output().expect("avr-size (binutils-avr)");
    let text = String::from_utf8(output.stdout).expect("text");
    let fields: Vec<u32> = text
        .lines()
        .nth(1)
        .expect("a line of numbers")
        .split_whitespace()
        .take(3)
        .map(|field| field.parse().expect("a number"))
        .collect();
    (fields[0], fields[1], fields[2])
}

/// Combines everything that uses the stack: a sweep with eight echoes, resends, noise on the line.
fn deepest_stack() -> usize {
    let many = Settings {
        max_echoes: 8,
        blanking: Blanking::Short { ticks: 1_000 },
        speed: 10_000,
        acceleration: 200_000,
        ..SETTINGS
    };
    let echoes: Vec<u64> = (2..10).map(|ms| ms * HZ / 1000).collect();
    let mut bench = ready(scripted(&echoes), many);
    let plan =
        Sweep { sweep: 1, first_step: 0, stride: 9, stops: 60, pings_per_stop: 2, lease_ms: 2_000 };
    let mut random = rand_pcg::Pcg64::seed_from_u64(3);
    bench.start(Command::Sweep(plan)).expect("begins");
    while bench.host.is_busy() {
        let mut noise = [0; 40];
        random.fill_bytes(&mut noise);
        bench.device.send(&noise);
        bench.run(0.05).expect("runs");
    }
    for command in [Command::Status, Command::Home, Command::Ping, Command::Identify] {
        bench.perform(command, 20.0).expect("works");
    }
    bench.perform(Command::Reset, 5.0).expect("restarts");
    bench.device.stack_bytes()
}

#[test]
fn flash_and_memory_within_limits() {
    let (text, data, bss) = sizes();
    let flash = text + data;
    let fixed = (data + bss) as usize;
    let stack = deepest_stack();
    println!("flash {flash} of {FLASH_MAX}, memory {fixed} + stack {stack} of {MEMORY_MAX}");
    assert!(flash <= FLASH_MAX, "{flash} bytes of flash");
    assert!(fixed + stack <= MEMORY_MAX, "{fixed} bytes of memory and {stack} of stack");
}
