//! Homed ranger on a line without faults, and helpers of the tests.

use firmware_protocol::host::{Command, HostEvent};
use firmware_protocol::messages::{Settings, Sweep};

use super::line::Faults;
use super::sim::Sim;

pub const BAUD: u32 = 115_200;

pub fn ready(settings: Settings) -> Sim {
    let mut sim = Sim::new(7, BAUD, Faults::default());
    for command in [Command::Identify, Command::Configure(settings), Command::Home] {
        let events = sim.run(command).expect("ends");
        assert!(!matches!(events.last(), Some(HostEvent::Failed(_))), "{events:?}");
    }
    sim
}

pub fn plan(stops: u16, pings_per_stop: u8) -> Sweep {
    Sweep { sweep: 0, first_step: 0, stride: 1, stops, pings_per_stop, lease_ms: 1_000 }
}

pub fn delivered(events: &[HostEvent]) -> usize {
    events.iter().filter(|event| matches!(event, HostEvent::Reading { .. })).count()
}
