//! Both machines on a line without faults: no beam waits for the link. Single injected faults have
//! exactly the specified effect.

mod world;

use firmware_protocol::device::Device;
use firmware_protocol::frame::{Frame, Header};
use firmware_protocol::host::{ATTEMPTS, Command, HostError, HostEvent, LinkStats, StartError};
use firmware_protocol::messages::{Request, Settings, Sweep};
use world::line::Faults;
use world::ready::{BAUD, delivered, plan, ready};
use world::settings;
use world::sim::Sim;

#[test]
fn no_beam_waits_for_the_link() {
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

/// Traffic of 400 readings with up to three echoes, and few requests from the host.
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
fn ring_suffices_for_eight_echoes() {
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
fn keeps_min_interval() {
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
fn clock_samples_are_accurate() {
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
fn hangup_fails_then_identifies() {
    let mut sim = ready(settings());
    sim.start(Command::MoveTo { step: 300 });
    let now = sim.now_us();
    sim.host.handle_hangup(now);
    assert_eq!(sim.host.poll_event(), Some(HostEvent::Failed(HostError::Hangup)));
    assert_eq!(sim.host.poll_timeout(), None);
    assert_eq!(sim.host.start(now, Command::Ping), Err(StartError::Restarted));
    let events = sim.run(Command::Identify).expect("ends");
    assert!(matches!(events.last(), Some(HostEvent::Identified(_))));
    assert!(!events.iter().any(|event| matches!(event, HostEvent::Rebooted { .. })));
}

#[test]
fn dead_line_reports_no_answer() {
    let mut sim = Sim::new(3, BAUD, Faults { frame_lost_one_in: 1, ..Faults::default() });
    let events = sim.run(Command::Identify).expect("ends");
    assert_eq!(events, [HostEvent::Failed(HostError::NoAnswer { attempts: ATTEMPTS })]);
}

#[test]
fn detects_foreign_device() {
    let mut sim = Sim::new(3, BAUD, Faults { frame_lost_one_in: 1, ..Faults::default() });
    sim.start(Command::Identify);
    let now = sim.now_us();
    sim.host.handle_bytes(now, b"$GPGGA,123519,4807.038,N,01131.000,E*47\r\n");
    sim.run_while(|sim| sim.host.is_busy()).expect("ends");
    let (_, last) = sim.events.last().expect("an event");
    assert!(matches!(last, HostEvent::Failed(HostError::NotADevice { bytes: 41 })), "{last:?}");
}

/// Repetitions are idempotent: the same bytes, sent three times, are executed once.
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
    // The sweep moves back from step 40, then to steps 1 and 2.
    assert_eq!(after, (before.0 + 1, before.1 + 1 + 3, before.2 + 1 + 3));
}

/// An ATmega328P has 2 KB of RAM, of which the firmware uses 1.2 KB in total.
#[test]
fn device_fits_in_ram() {
    let size = size_of::<Device>();
    println!("Device: {size} bytes");
    assert!(size <= 600, "{size} bytes");
}
