//! Both machines joined on a line that loses, alters, duplicates and delays bytes, with a device
//! that restarts and a line that is cut, in thousands of runs.
//!
//! A failing run prints its seed.
//! `JOINED_SEED=<seed> cargo test -p firmware-protocol --test joined` repeats that run alone,
//! `JOINED_RUNS=<n>` sets the number of runs.

mod world;

use std::collections::{BTreeMap, BTreeSet};

use firmware_protocol::host::{ATTEMPTS, Command, HostError, HostEvent, OVERRUNS, Outcome};
use firmware_protocol::messages::{NakReason, Reading, Reply, Settings, Sweep, SweepState};
use world::line::{Faults, Random};
use world::settings;
use world::sim::Sim;

const RUNS: u64 = 10_000;
const TEST: &str = "cargo test -p firmware-protocol --test joined";

/// Totals of all runs, which show that the test covered enough.
#[derive(Debug, Default)]
struct Tally {
    sweeps_complete: u64,
    sweeps_failed: u64,
    pings: u64,
    failures: BTreeMap<String, u64>,
    repaired: u64,
    duplicates: u64,
    retries: u64,
    iterations: u64,
}

#[test]
fn every_sweep_completes_or_fails() {
    let mut tally = Tally::default();
    if let Some(seed) = number_from_env("JOINED_SEED") {
        run(seed, &mut tally);
        println!("{tally:#?}");
        return;
    }
    let runs = number_from_env("JOINED_RUNS").unwrap_or(RUNS);
    for seed in 0..runs {
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            run(seed, &mut tally);
        }));
        assert!(outcome.is_ok(), "seed {seed} failed: repeat with JOINED_SEED={seed} {TEST}");
    }
    println!("{tally:#?}");
    let repeat = format!("repeat with JOINED_RUNS={runs} {TEST}: {tally:?}");
    assert!(tally.sweeps_complete > runs / 3, "too few sweeps got through; {repeat}");
    assert!(tally.repaired > runs / 3, "nothing was repaired; {repeat}");
    for cause in ["Rebooted", "Hangup", "NoAnswer", "EmergencyStop"] {
        assert!(tally.failures.contains_key(cause), "never failed by {cause}; {repeat}");
    }
}

fn number_from_env(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// Session of a host and a device: a few commands, some of which fail.
fn run(seed: u64, tally: &mut Tally) {
    let mut random = Random::new(seed);
    let baud = random.pick(&[38_400, 115_200, 500_000]);
    let mut sim = Sim::new(random.next(), baud, faults(&mut random));
    let mut trouble = random.once_in(2);
    for _ in 0..3 + random.below(4) {
        if !prepare(&mut sim, &mut random, tally) {
            continue;
        }
        if std::mem::take(&mut trouble) {
            cause_trouble(&mut sim, &mut random);
        }
        match random.below(5) {
            0 => check_ping(&mut sim, tally),
            1 => check_move(&mut sim, &mut random, tally),
            2 => drop(check_home(&mut sim, tally)),
            _ => check_sweep(&mut sim, &mut random, tally),
        }
    }
    let stats = sim.host.stats();
    assert_eq!(stats.rejected, 0, "a valid reply was rejected");
    tally.repaired += stats.repaired;
    tally.duplicates += stats.duplicates;
    tally.retries += stats.retries;
    tally.iterations += sim.iterations;
}

fn faults(random: &mut Random) -> Faults {
    let rare = [0, 0, 3_000, 600, 200];
    let frames = [0, 0, 50, 10];
    Faults {
        byte_lost_one_in: random.pick(&rare),
        byte_changed_one_in: random.pick(&rare),
        byte_doubled_one_in: random.pick(&rare),
        frame_doubled_one_in: random.pick(&frames),
        frame_lost_one_in: random.pick(&[0, 0, 50, 10, 4]),
        delay_max_us: random.pick(&[1_000, 30_000, 400_000]),
        stall_one_in: random.pick(&[0, 0, 2_000]),
    }
}

fn cause_trouble(sim: &mut Sim, random: &mut Random) {
    let at = Some(sim.now_ns + random.below(1_500_000_000));
    match random.below(4) {
        0 | 1 => sim.reboot_at_ns = at,
        2 => sim.hangup_at_ns = at,
        _ => sim.emergency_at_ns = at,
    }
}

/// Identifies, configures and homes, as far as needed; returns `false` if the line prevented it.
fn prepare(sim: &mut Sim, random: &mut Random, tally: &mut Tally) -> bool {
    if sim.host.identity().is_none() && !succeeds(sim, Command::Identify, tally) {
        return false;
    }
    let settings = Settings {
        max_echoes: 1 + random.below(8) as u8,
        min_interval_ticks: random.pick(&[0, 0, 70_000]),
        window_ticks: random.pick(&[10_000, 48_000]),
        ..settings()
    };
    succeeds(sim, Command::Configure(settings), tally) && check_home(sim, tally)
}

/// Runs a command that must not fire.
fn succeeds(sim: &mut Sim, command: Command, tally: &mut Tally) -> bool {
    let fired = sim.world.firings.len();
    let events = sim.run(command).expect("ends");
    assert_eq!(sim.world.firings.len(), fired, "{command:?} fired");
    let end = only_end(&events);
    count_failure(sim, end, tally);
    !matches!(end, HostEvent::Failed(_))
}

fn check_home(sim: &mut Sim, tally: &mut Tally) -> bool {
    if sim.host.identity().is_none() {
        return false;
    }
    let before = sim.world.homings;
    if sim.host.start(sim.now_us(), Command::Home).is_err() {
        return false;
    }
    let events = finish(sim);
    let end = only_end(&events);
    count_failure(sim, end, tally);
    let homed = matches!(end, HostEvent::Done(Outcome::Homed { .. }));
    quiet(sim, homed);
    assert!(sim.world.homings - before <= 1, "homed twice for one request");
    assert!(!homed || sim.world.homings - before == 1);
    homed
}

fn check_move(sim: &mut Sim, random: &mut Random, tally: &mut Tally) {
    let step = random.below(2_000) as i32 - 1_000;
    let before = sim.world.moves.len();
    let events = sim.run(Command::MoveTo { step }).expect("ends");
    let end = only_end(&events);
    count_failure(sim, end, tally);
    let moved = matches!(end, HostEvent::Done(Outcome::Moved { .. }));
    if moved {
        assert_eq!(sim.world.step, step);
    }
    quiet(sim, moved);
    assert!(sim.world.moves.len() - before <= 1, "moved twice for one request");
}

fn check_ping(sim: &mut Sim, tally: &mut Tally) {
    let before = sim.world.firings.len();
    let events = sim.run(Command::Ping).expect("ends");
    let end = only_end(&events);
    count_failure(sim, end, tally);
    let readings = readings(&events);
    let pinged = matches!(end, HostEvent::Done(Outcome::Pinged));
    assert_eq!(readings.len(), usize::from(pinged));
    for (reading, _) in &readings {
        check_reading(sim, before, reading);
    }
    tally.pings += u64::from(pinged);
    quiet(sim, pinged);
    let fired = sim.world.firings.len() - before;
    assert!(fired <= 1, "fired {fired} times for one Ping");
}

fn check_sweep(sim: &mut Sim, random: &mut Random, tally: &mut Tally) {
    let plan = Sweep {
        sweep: 0,
        first_step: random.below(800) as i32 - 400,
        stride: random.pick(&[-7, 0, 1, 4]),
        stops: 1 + random.below(24) as u16,
        pings_per_stop: 1 + random.below(3) as u8,
        lease_ms: random.pick(&[1_000, 2_000, 4_000]),
    };
    let beams = plan.beams().expect("has beams");
    let before = sim.world.firings.len();
    let events = sim.run(Command::Sweep(plan)).expect("ends");
    let end = only_end(&events);
    count_failure(sim, end, tally);
    let complete = check_beams(sim, &plan, before, &events, end);
    tally.sweeps_complete += u64::from(complete);
    tally.sweeps_failed += u64::from(!complete);
    if complete {
        assert_eq!(sim.world.firings.len() - before, usize::from(beams), "one firing per beam");
    }
    quiet(sim, complete);
    assert!(sim.world.firings.len() - before <= usize::from(beams), "a beam was fired twice");
}

fn check_beams(
    sim: &Sim,
    plan: &Sweep,
    before: usize,
    events: &[HostEvent],
    end: &HostEvent,
) -> bool {
    let beams = plan.beams().expect("has beams");
    let mut seen = BTreeSet::new();
    for (reading, _) in readings(events) {
        assert!(reading.index < beams);
        assert_eq!(Some(reading.step), plan.step_of(reading.index));
        assert!(seen.insert(reading.index), "beam {} was delivered twice", reading.index);
        check_reading(sim, before, &reading);
        let number = before + usize::from(reading.index);
        assert_eq!(sim.world.firings[number].fired_ticks, reading.fired_ticks, "beams mixed up");
    }
    match end {
        HostEvent::SweepDone { delivered, end: SweepState::Complete, .. } => {
            assert_eq!(seen.len(), usize::from(beams), "a beam is missing");
            assert_eq!(*delivered, beams);
            true
        }
        HostEvent::Failed(_) => false,
        other => panic!("a sweep ended with {other:?}"),
    }
}

/// Checks that the reading was physically measured since firing number `first`.
fn check_reading(sim: &Sim, first: usize, reading: &Reading) {
    let firing = sim.world.firings[first..]
        .iter()
        .find(|firing| firing.fired_ticks == reading.fired_ticks)
        .expect("a reading without a firing");
    assert_eq!(firing.step, reading.step, "taken elsewhere");
    assert_eq!(firing.echoes, reading.echoes.to_vec(), "echoes of another firing");
}

fn readings(events: &[HostEvent]) -> Vec<(Reading, bool)> {
    events
        .iter()
        .filter_map(|event| match event {
            HostEvent::Reading { reading, repaired } => Some((*reading, *repaired)),
            _ => None,
        })
        .collect()
}

/// After a failure: stops, and waits until leases and late copies have expired.
fn quiet(sim: &mut Sim, succeeded: bool) {
    if !succeeded {
        sim.run(Command::Stop).expect("ends");
        sim.idle(5_000_000).expect("no hang");
    }
}

fn finish(sim: &mut Sim) -> Vec<HostEvent> {
    let first = sim.events.len();
    sim.run_while(|sim| sim.host.is_busy()).expect("ends");
    sim.events[first..].iter().map(|(_, event)| *event).collect()
}

/// Returns the single event that ends a command.
fn only_end(events: &[HostEvent]) -> &HostEvent {
    let ends: Vec<_> = events
        .iter()
        .filter(|event| {
            matches!(
                event,
                HostEvent::Identified(_)
                    | HostEvent::Done(_)
                    | HostEvent::SweepDone { .. }
                    | HostEvent::Failed(_)
            )
        })
        .collect();
    assert_eq!(ends.len(), 1, "{events:?}");
    ends[0]
}

fn count_failure(sim: &mut Sim, end: &HostEvent, tally: &mut Tally) {
    if let HostEvent::Failed(error) = end {
        check_cause(sim, error);
        let name = match error {
            HostError::Rejected(reason) => format!("Refused({reason:?})"),
            other => {
                let text = format!("{other:?}");
                text.split([' ', '(', '{']).next().unwrap_or_default().to_string()
            }
        };
        *tally.failures.entry(name).or_default() += 1;
    }
    sim.sent.replies.clear();
    sim.received.replies.clear();
}

/// Checks that the faults of the line explain the failure of a command.
fn check_cause(sim: &Sim, error: &HostError) {
    match error {
        HostError::Stalled { .. } => {
            // The first of more than ATTEMPTS fruitless Alives may reveal that a beam was lost, and
            // each of the others follows a Resend of this beam.
            let losses = max_losses_of_beam(sim);
            assert!(losses > usize::from(ATTEMPTS), "stalled after {losses} losses of a beam");
        }
        HostError::Overrun { .. } => {
            let started = max_started(sim);
            assert!(started >= usize::from(OVERRUNS), "overrun after {started} Started");
        }
        HostError::SweepLost
        | HostError::WrongReading { .. }
        | HostError::WrongVersion { .. }
        | HostError::Rejected(NakReason::Busy | NakReason::NotConfigured) => {
            panic!("no fault of the line causes {error:?}")
        }
        _ => {}
    }
}

/// Largest number of times that the device sent the same beam, of those that never arrived.
fn max_losses_of_beam(sim: &Sim) -> usize {
    let beams = |replies: &[(u16, Reply)]| {
        let mut counts = BTreeMap::<_, usize>::new();
        for (_, reply) in replies {
            if let Reply::Reading(reading) = reply {
                *counts.entry((reading.sweep, reading.index)).or_default() += 1;
            }
        }
        counts
    };
    let received = beams(&sim.received.replies);
    let sent = beams(&sim.sent.replies);
    let lost = sent.iter().filter(|(beam, _)| !received.contains_key(beam));
    lost.map(|(_, count)| *count).max().unwrap_or(0)
}

/// Largest number of Started received for the same request.
fn max_started(sim: &Sim) -> usize {
    let mut counts = BTreeMap::<_, usize>::new();
    for (seq, reply) in &sim.received.replies {
        *counts.entry(seq).or_default() += usize::from(matches!(reply, Reply::Started));
    }
    counts.into_values().max().unwrap_or(0)
}
