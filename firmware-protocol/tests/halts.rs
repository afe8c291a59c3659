//! Ends and pauses of motion and firing: Stop, Reset, leases, the emergency stop, a full ring.

mod world;

use firmware_protocol::frame::{Frame, Header};
use firmware_protocol::host::{Command, HostError, HostEvent, Outcome};
use firmware_protocol::messages::{FaultKind, NakReason, Request, Settings, Sweep, SweepState};
use world::line::Faults;
use world::ready::{BAUD, delivered, plan, ready};
use world::settings;
use world::sim::Sim;

#[test]
fn hold_expires_without_index() {
    let mut sim = Sim::new(7, BAUD, Faults::default());
    sim.world.index_missing = true;
    sim.run(Command::Identify).expect("ends");
    sim.run(Command::Configure(Settings { hold_s: 3, ..settings() })).expect("ends");
    sim.idle(4_000_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 0, "the coils carry no current yet");
    let events = sim.run(Command::Home).expect("ends");
    let rejected = HostError::Rejected(NakReason::IndexNotFound);
    assert_eq!(events.last(), Some(&HostEvent::Failed(rejected)));
    sim.idle(10_000_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 1);
    let faults = sim
        .events
        .iter()
        .filter(|(_, event)| matches!(event, HostEvent::Fault(FaultKind::HoldExpired)));
    assert_eq!(faults.count(), 1, "once");
}

#[test]
fn lease_ends_sweep() {
    let mut sim = ready(settings());
    sim.start(Command::Sweep(plan(400, 1)));
    sim.idle(300_000).expect("no hang");
    let cut_at = sim.now_ns;
    // From here on the device receives nothing from the host.
    sim.up = world::line::Line::new(
        u64::from(BAUD),
        Faults { frame_lost_one_in: 1, ..Faults::default() },
        world::line::Random::new(1),
    );
    while sim.world.coils_released == 0 {
        sim.idle(1_000).expect("no hang");
        assert!(sim.now_ns < cut_at + 3_000_000_000, "the lease never ended");
    }
    assert!(sim.now_ns >= cut_at + 600_000_000, "ended long before the lease");
    assert!(sim.now_ns <= cut_at + 1_010_000_000, "ended long after the lease");
    let fired = sim.world.firings.len();
    sim.idle(2_000_000).expect("no hang");
    assert_eq!(sim.world.firings.len(), fired, "fired after the lease");
    assert_eq!(sim.world.device.step(), None, "the position is unknown now");
    let faults = sim
        .events
        .iter()
        .filter(|(_, event)| matches!(event, HostEvent::Fault(FaultKind::LeaseExpired)));
    assert_eq!(faults.count(), 1);
    let failed = sim
        .events
        .iter()
        .any(|(_, event)| matches!(event, HostEvent::Failed(HostError::LeaseExpired)));
    assert!(failed, "the host must report the cause");
}

#[test]
fn hold_expires_without_requests() {
    let mut sim = ready(Settings { hold_s: 3, ..settings() });
    sim.idle(2_900_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 0);
    sim.run(Command::Status).expect("ends");
    sim.idle(2_900_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 0);
    sim.idle(200_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 1);
    let events = sim.run(Command::MoveTo { step: 3 }).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Failed(HostError::Rejected(NakReason::NotHomed))));
}

#[test]
fn stop_during_sweep() {
    let mut sim = ready(settings());
    sim.start(Command::Sweep(plan(400, 1)));
    sim.idle(500_000).expect("no hang");
    let first = sim.events.len();
    let firing = sim.world.firings.len();
    sim.start(Command::Stop);
    sim.run_while(|sim| sim.host.is_busy()).expect("ends");
    let ends: Vec<_> = sim.events[first..].iter().map(|(_, event)| *event).collect();
    assert!(
        ends.iter()
            .any(|event| matches!(event, HostEvent::SweepDone { end: SweepState::Stopped, .. }))
    );
    assert_eq!(ends.last(), Some(&HostEvent::Done(Outcome::Stopped)));
    sim.idle(1_000_000).expect("no hang");
    assert!(sim.world.firings.len() <= firing + 1, "fired after Stop");
    assert_eq!(sim.world.device.step(), Some(sim.world.step));
    let events = sim.run(Command::MoveTo { step: 20 }).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Done(Outcome::Moved { step: 20 })));
}

#[test]
fn stop_during_move() {
    let mut sim = ready(settings());
    sim.start(Command::MoveTo { step: 4_000 });
    sim.idle(700_000).expect("no hang");
    let events = sim.run(Command::Stop).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Done(Outcome::Stopped)));
    assert!((1_000..2_000).contains(&sim.world.step), "stopped at {}", sim.world.step);
    assert_eq!(sim.world.device.step(), Some(sim.world.step));
}

#[test]
fn home_clears_emergency_stop() {
    let mut sim = ready(settings());
    sim.emergency_at_ns = Some(sim.now_ns + 400_000_000);
    let events = sim.run(Command::Sweep(plan(400, 1))).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Failed(HostError::EmergencyStop)));
    assert_eq!(sim.world.coils_released, 1);
    let events = sim.run(Command::Sweep(plan(2, 1))).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Failed(HostError::Rejected(NakReason::NotHomed))));
    let events = sim.run(Command::Home).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Done(Outcome::Homed { drift_steps: 2 })));
    assert_eq!(delivered(&sim.run(Command::Sweep(plan(2, 1))).expect("ends")), 2);
}

#[test]
fn reset_restarts_once() {
    let mut sim = ready(settings());
    let boot = sim.world.boot;
    let events = sim.run(Command::Reset).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Done(Outcome::Reset)));
    sim.idle(100_000).expect("no hang");
    assert_eq!((sim.world.resets, sim.world.boot), (1, boot.wrapping_add(1)));
    let events = sim.run(Command::Identify).expect("ends");
    assert!(matches!(events.last(), Some(HostEvent::Identified(_))));
}

#[test]
fn holds_until_acknowledged() {
    let mut sim = ready(Settings { max_echoes: 8, ..settings() });
    let seq = 30_000_u16
        .wrapping_add(sim.host.identity().and_then(|identity| identity.last_seq).unwrap_or(0));
    let plan = Sweep {
        sweep: 5,
        first_step: 0,
        stride: 0,
        stops: 1,
        pings_per_stop: 100,
        lease_ms: 60_000,
    };
    let header = |seq| Header { boot: sim.world.boot, seq };
    let start = Frame::encode(header(seq), &Request::Sweep(plan)).expect("fits");
    let next = Request::KeepAlive { sweep: 5, next: 100 };
    let acknowledge = Frame::encode(header(seq.wrapping_add(1)), &next).expect("fits");
    let before = sim.world.firings.len();
    let ticks = sim.world.ticks();
    sim.world.device.handle_bytes(ticks, &start);
    sim.idle(20_000_000).expect("no hang");
    let held = sim.world.firings.len() - before;
    assert!((8..60).contains(&held), "held after {held} beams");
    let ticks = sim.world.ticks();
    sim.world.device.handle_bytes(ticks, &acknowledge);
    sim.idle(1_000_000).expect("no hang");
    assert!(sim.world.firings.len() - before > held, "did not continue");
}

#[test]
fn premature_ack_drops_nothing() {
    let mut sim = ready(settings());
    let seq = 30_000_u16
        .wrapping_add(sim.host.identity().and_then(|identity| identity.last_seq).unwrap_or(0));
    let header = |seq| Header { boot: sim.world.boot, seq };
    let start = Frame::encode(header(seq), &Request::Sweep(Sweep { sweep: 5, ..plan(6, 1) }));
    let all = Request::KeepAlive { sweep: 5, next: 6 };
    let acknowledged = Frame::encode(header(seq.wrapping_add(1)), &all).expect("fits");
    let ticks = sim.world.ticks();
    sim.world.device.handle_bytes(ticks, &start.expect("fits"));
    for _ in 0..100 {
        let ticks = sim.world.ticks();
        sim.world.device.handle_bytes(ticks, &acknowledged);
        sim.idle(5_000).expect("no hang");
    }
    // The host does not know this sweep, and counts each of its readings as a duplicate.
    assert_eq!(sim.host.stats().duplicates, 6);
}
