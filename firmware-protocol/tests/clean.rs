//! Both machines on a line without faults: nothing waits for the link, and single faults put
//! in by hand have exactly the effect that the protocol says.

mod world;

use firmware_protocol::device::Device;
use firmware_protocol::frame::{Frame, Header};
use firmware_protocol::host::{Command, HostError, HostEvent, LinkStats, Outcome, StartError};
use firmware_protocol::messages::{FaultKind, NakReason, Request, Settings, Sweep, SweepState};
use world::line::Faults;
use world::settings;
use world::sim::Sim;

const BAUD: u32 = 115_200;

fn ready(settings: Settings) -> Sim {
    let mut sim = Sim::new(7, BAUD, Faults::default());
    for command in [Command::Identify, Command::Configure(settings), Command::Home] {
        let events = sim.run(command).expect("ends");
        assert!(!matches!(events.last(), Some(HostEvent::Failed(_))), "{events:?}");
    }
    sim
}

fn plan(stops: u16, pings_per_stop: u8) -> Sweep {
    Sweep { sweep: 0, first_step: 0, stride: 1, stops, pings_per_stop, lease_ms: 1_000 }
}

fn delivered(events: &[HostEvent]) -> usize {
    events.iter().filter(|event| matches!(event, HostEvent::Reading { .. })).count()
}

#[test]
fn the_link_is_never_on_the_critical_path() {
    let settings = settings();
    let mut sim = ready(settings);
    sim.idle(100_000).expect("no hang");
    let before = *sim.host.stats();
    let events = sim.run(Command::Sweep(plan(400, 1))).expect("ends");
    assert_eq!(delivered(&events), 400);
    let firings = &sim.world.firings;
    let first = firings[0].fired_ticks;
    let last = firings[firings.len() - 1].fired_ticks;
    let step_ticks = 2_000_000 / u32::from(settings.speed);
    let each = settings.window_ticks + settings.settle_ticks + step_ticks;
    let taken = last.wrapping_sub(first);
    assert!(taken.abs_diff(399 * each) <= 4, "{taken} ticks instead of {}", 399 * each);
    check_costs(&before, sim.host.stats());
}

/// 400 readings of up to three echoes, and few words from the host.
fn check_costs(before: &LinkStats, after: &LinkStats) {
    let received = after.bytes_received - before.bytes_received;
    let sent = after.bytes_sent - before.bytes_sent;
    println!("400 beams: {received} bytes to the host, {sent} bytes to the device");
    assert!(received < 400 * 36, "{received} bytes received");
    assert!(sent < 400 * 4, "{sent} bytes sent");
    assert_eq!(after.retries, before.retries, "nothing needs repeating on a clean line");
    assert_eq!(after.duplicates, 0);
    assert_eq!(after.repaired, 0);
}

#[test]
fn eight_echoes_and_short_windows_do_not_fill_the_ring() {
    let settings = Settings { max_echoes: 8, window_ticks: 20_000, settle_ticks: 0, ..settings() };
    let mut sim = ready(settings);
    let events = sim.run(Command::Sweep(Sweep { stride: 0, ..plan(1, 200) })).expect("ends");
    assert_eq!(delivered(&events), 200);
    let fired: Vec<_> = sim.world.firings.iter().map(|firing| firing.fired_ticks).collect();
    for pair in fired.windows(2) {
        let apart = pair[1].wrapping_sub(pair[0]);
        assert!(apart <= settings.window_ticks + 2, "held for {apart} ticks");
    }
}

#[test]
fn the_interval_between_firings_is_kept() {
    let settings = Settings { min_interval_ticks: 100_000, ..settings() };
    let mut sim = ready(settings);
    sim.run(Command::Sweep(plan(5, 3))).expect("ends");
    sim.run(Command::Ping).expect("ends");
    let fired: Vec<_> = sim.world.firings.iter().map(|firing| firing.fired_ticks).collect();
    assert_eq!(fired.len(), 16);
    for pair in fired.windows(2) {
        assert!(pair[1].wrapping_sub(pair[0]) >= 100_000);
    }
}

#[test]
fn a_silent_host_ends_the_sweep() {
    let mut sim = ready(settings());
    sim.start(Command::Sweep(plan(400, 1)));
    sim.idle(300_000).expect("no hang");
    let cut_at = sim.now_ns;
    // From here on nothing from the host arrives.
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
    assert!(failed, "the host must learn why");
}

#[test]
fn idle_coils_are_released_when_the_host_is_gone() {
    let mut sim = ready(Settings { hold_s: 3, ..settings() });
    sim.idle(2_900_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 0);
    sim.run(Command::Status).expect("ends");
    sim.idle(2_900_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 0);
    sim.idle(200_000).expect("no hang");
    assert_eq!(sim.world.coils_released, 1);
    let events = sim.run(Command::MoveTo { step: 3 }).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Failed(HostError::Refused(NakReason::NotHomed))));
}

#[test]
fn stop_ends_a_sweep_and_keeps_the_position() {
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
fn stop_in_mid_move_keeps_the_position() {
    let mut sim = ready(settings());
    sim.start(Command::MoveTo { step: 4_000 });
    sim.idle(700_000).expect("no hang");
    let events = sim.run(Command::Stop).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Done(Outcome::Stopped)));
    assert!((1_000..2_000).contains(&sim.world.step), "stopped at {}", sim.world.step);
    assert_eq!(sim.world.device.step(), Some(sim.world.step));
}

#[test]
fn the_emergency_stop_names_itself_and_home_clears_it() {
    let mut sim = ready(settings());
    sim.emergency_at_ns = Some(sim.now_ns + 400_000_000);
    let events = sim.run(Command::Sweep(plan(400, 1))).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Failed(HostError::EmergencyStop)));
    assert_eq!(sim.world.coils_released, 1);
    let events = sim.run(Command::Sweep(plan(2, 1))).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Failed(HostError::Refused(NakReason::NotHomed))));
    let events = sim.run(Command::Home).expect("ends");
    assert_eq!(events.last(), Some(&HostEvent::Done(Outcome::Homed { drift_steps: 2 })));
    assert_eq!(delivered(&sim.run(Command::Sweep(plan(2, 1))).expect("ends")), 2);
}

#[test]
fn clock_samples_tell_the_device_clock() {
    let mut sim = ready(settings());
    let events = sim.run(Command::Sweep(plan(100, 1))).expect("ends");
    let mut samples = 0;
    for event in &events {
        let HostEvent::ClockSample { sent_us, received_us, device_ticks, retried } = event else {
            continue;
        };
        samples += 1;
        assert!(!retried);
        let at = u64::from(device_ticks.wrapping_sub(sim.world.clock_offset)) / 2;
        assert!((*sent_us..=*received_us).contains(&at), "{sent_us} {at} {received_us}");
    }
    assert!(samples > 5, "{samples} samples");
}

#[test]
fn a_closed_line_fails_at_once_and_the_device_is_met_again() {
    let mut sim = ready(settings());
    sim.start(Command::MoveTo { step: 300 });
    let now = sim.now_us();
    sim.host.handle_hangup(now);
    assert_eq!(sim.host.poll_event(), Some(HostEvent::Failed(HostError::Hangup)));
    assert_eq!(sim.host.poll_timeout(), None);
    assert_eq!(sim.host.start(now, Command::Ping), Err(StartError::NotIdentified));
    let events = sim.run(Command::Identify).expect("ends");
    assert!(matches!(events.last(), Some(HostEvent::Identified(_))));
    assert!(!events.iter().any(|event| matches!(event, HostEvent::Rebooted { .. })));
}

#[test]
fn reset_restarts_the_device_once() {
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
fn a_dead_line_fails_without_an_answer() {
    let mut sim = Sim::new(3, BAUD, Faults { frame_lost_one_in: 1, ..Faults::default() });
    let events = sim.run(Command::Identify).expect("ends");
    assert_eq!(events, [HostEvent::Failed(HostError::NoAnswer { attempts: 10 })]);
}

#[test]
fn a_device_that_speaks_something_else_is_told_apart() {
    let mut sim = Sim::new(3, BAUD, Faults { frame_lost_one_in: 1, ..Faults::default() });
    sim.start(Command::Identify);
    let now = sim.now_us();
    sim.host.handle_bytes(now, b"$GPGGA,123519,4807.038,N,01131.000,E*47\r\n");
    sim.run_while(|sim| sim.host.is_busy()).expect("ends");
    let (_, last) = sim.events.last().expect("an event");
    assert!(matches!(last, HostEvent::Failed(HostError::NotADevice { bytes: 41 })), "{last:?}");
}

/// Retries are idempotent: the same bytes, three times, execute once.
#[test]
fn repeated_requests_execute_once() {
    let mut sim = ready(settings());
    sim.run(Command::Sweep(plan(1, 1))).expect("ends");
    let header = |seq| Header { boot: sim.world.boot, seq };
    let last = sim.host.identity().and_then(|identity| identity.last_seq).unwrap_or(0);
    let seq = last.wrapping_add(20_000);
    let frames = [
        Frame::encode(header(seq), &Request::Home),
        Frame::encode(header(seq.wrapping_add(1)), &Request::MoveTo { step: 40 }),
        Frame::encode(header(seq.wrapping_add(2)), &Request::Ping),
        Frame::encode(
            header(seq.wrapping_add(3)),
            &Request::Sweep(Sweep { sweep: 9, ..plan(3, 1) }),
        ),
    ];
    let before = (sim.world.homings, sim.world.moves.len(), sim.world.firings.len());
    for frame in frames {
        let frame = frame.expect("fits");
        for pause_us in [0, 3_000, 500_000] {
            let ticks = sim.world.ticks();
            sim.world.device.handle_bytes(ticks, &frame);
            sim.idle(pause_us).expect("no hang");
        }
    }
    let after = (sim.world.homings, sim.world.moves.len(), sim.world.firings.len());
    // The sweep turns back from step 40, then to steps 1 and 2.
    assert_eq!(after, (before.0 + 1, before.1 + 1 + 3, before.2 + 1 + 3));
}

#[test]
fn the_device_holds_when_nobody_acknowledges_and_goes_on_when_somebody_does() {
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
    let go_on = Frame::encode(header(seq.wrapping_add(1)), &next).expect("fits");
    let before = sim.world.firings.len();
    let ticks = sim.world.ticks();
    sim.world.device.handle_bytes(ticks, &start);
    sim.idle(20_000_000).expect("no hang");
    let held = sim.world.firings.len() - before;
    assert!((8..60).contains(&held), "held after {held} beams");
    let ticks = sim.world.ticks();
    sim.world.device.handle_bytes(ticks, &go_on);
    sim.idle(1_000_000).expect("no hang");
    assert!(sim.world.firings.len() - before > held, "did not go on");
}

/// An ATmega328P has 2 KB of RAM, and the firmware 1.2 KB of it for everything.
#[test]
fn the_device_machine_is_small() {
    let size = size_of::<Device>();
    println!("Device: {size} bytes");
    assert!(size <= 600, "{size} bytes");
}
