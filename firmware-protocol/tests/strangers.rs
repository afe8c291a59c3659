//! What a host must refuse, and how it parts from a device that it gives up on: a table of lies,
//! and arbitrary well-formed replies.

mod stranger;

use std::collections::BTreeMap;

use firmware_protocol::frame::Header;
use firmware_protocol::host::{
    ATTEMPTS, Command, HostError, HostEvent, IdentityFault, OVERRUNS, ReadingFault, ReplyFault,
    STOP_ATTEMPTS, StartError,
};
use firmware_protocol::messages::{
    Alive, Capabilities, DeviceState, Echoes, FaultKind, Identity, NakReason, Reading,
    ReadingStatus, Reply, Request, ResetCause, Status, SweepDone, SweepState, Wire as _,
};
use proptest::prelude::*;
use stranger::{BEAM, BEGAN, BOOT, IDENTITY, SETTINGS, Stranger};

#[test]
fn an_identity_without_sense_is_refused_by_its_name() {
    let lies = [
        (Identity { boot: 0, ..IDENTITY }, IdentityFault::BootZero),
        (
            Identity { boot: 7, ..IDENTITY },
            IdentityFault::BootNotOfFrame { frame: BOOT, identity: 7 },
        ),
        (Identity { tick_hz: 0, ..IDENTITY }, IdentityFault::TickRate { tick_hz: 0 }),
        (
            Identity { tick_hz: 1_000_000, ..IDENTITY },
            IdentityFault::TickRate { tick_hz: 1_000_000 },
        ),
        (Identity { steps_per_revolution: 0, ..IDENTITY }, IdentityFault::NoSteps),
        (
            Identity { ring_bytes: 28, ..IDENTITY },
            IdentityFault::RingTooSmall { ring_bytes: 28, needed: 29 },
        ),
        (
            Identity { ring_bytes: 7, capabilities: Capabilities(0), ..IDENTITY },
            IdentityFault::RingTooSmall { ring_bytes: 7, needed: 8 },
        ),
    ];
    for (lie, fault) in lies {
        let mut stranger = Stranger::new();
        stranger.run(Command::Identify, Reply::Identity(lie));
        let refused = HostEvent::Failed(HostError::WrongIdentity(fault));
        assert_eq!(stranger.events, [refused], "{lie:?}");
        assert!(stranger.host.identity().is_none());
        assert_eq!(stranger.host.stats().refused, 1);
    }
}

/// Each lie about beam 5 of twelve; the others are told truly.
#[test]
fn a_reading_without_sense_is_refused_by_its_name_and_its_sweep_goes_on() {
    type Lie = fn(Reading) -> Reading;
    let lies: [(&str, Lie, ReadingFault); 10] = [
        (
            "an echo after the window",
            |true_one| Reading { echoes: Echoes::from_ticks(&[40_001]), ..true_one },
            ReadingFault::EchoAfterWindow { ticks: 40_001, window: 40_000 },
        ),
        (
            "no echo, with echoes",
            |true_one| Reading { status: ReadingStatus::NoEcho, ..true_one },
            ReadingFault::EchoUnexpected { echoes: 2 },
        ),
        (
            "not fired, with echoes",
            |true_one| Reading { status: ReadingStatus::ModuleFault, ..true_one },
            ReadingFault::EchoUnexpected { echoes: 2 },
        ),
        (
            "an echo, without one",
            |true_one| Reading { echoes: Echoes::new(), ..true_one },
            ReadingFault::EchoMissing,
        ),
        (
            "falling echoes",
            |true_one| Reading { echoes: Echoes::from_ticks(&[20_000, 9_000]), ..true_one },
            ReadingFault::EchoesOutOfOrder,
        ),
        (
            "more echoes than asked for",
            |true_one| Reading { echoes: Echoes::from_ticks(&[1, 2, 3]), ..true_one },
            ReadingFault::TooManyEchoes { echoes: 3, asked: 2 },
        ),
        (
            "fired before the sweep",
            |true_one| Reading { fired_ticks: BEGAN.wrapping_sub(1), ..true_one },
            ReadingFault::FiredTooEarly { ticks: 4 * BEAM + 1_001 + 50_000 },
        ),
        (
            "fired with the one before",
            |true_one| Reading { fired_ticks: true_one.fired_ticks.wrapping_sub(BEAM), ..true_one },
            ReadingFault::FiredTooEarly { ticks: 50_000 },
        ),
        (
            "fired in the window of the one before",
            |true_one| Reading {
                fired_ticks: true_one.fired_ticks.wrapping_sub(BEAM - 40_000),
                ..true_one
            },
            ReadingFault::FiredTooEarly { ticks: 10_000 },
        ),
        (
            "fired in an hour's time",
            |true_one| Reading {
                fired_ticks: true_one.fired_ticks.wrapping_add(900_000_000),
                ..true_one
            },
            ReadingFault::FiredInFuture { ticks: 0 },
        ),
    ];
    for (name, lie, expected) in lies {
        let mut stranger = Stranger::sweeping();
        for index in 0..12 {
            let told = stranger.reading(index);
            stranger.tell(if index == 5 { lie(told) } else { told });
        }
        let faults: Vec<_> = stranger
            .events
            .iter()
            .filter_map(|event| match event {
                HostEvent::ReadingRefused { reading, fault } => Some((reading.index, *fault)),
                _ => None,
            })
            .collect();
        let [(5, fault)] = faults[..] else { panic!("{name}: {:?}", stranger.events) };
        match (fault, expected) {
            // By how much depends on when it was told.
            (ReadingFault::FiredInFuture { .. }, ReadingFault::FiredInFuture { .. }) => {}
            _ => assert_eq!(fault, expected, "{name}"),
        }
        let end = stranger.events.last();
        let done = matches!(
            end,
            Some(HostEvent::SweepDone { delivered: 11, end: SweepState::Complete, .. })
        );
        assert!(done, "{name}: {end:?}");
        assert_eq!((stranger.host.stats().readings, stranger.host.stats().refused), (11, 1));
    }
}

#[test]
fn a_ping_without_sense_is_refused_by_its_name() {
    let ping = Reading {
        sweep: 0,
        index: 0,
        step: 0,
        fired_ticks: BEGAN.wrapping_add(5_000),
        status: ReadingStatus::Echo,
        echoes: Echoes::from_ticks(&[9_000]),
    };
    let wrong = |index, step, planned| HostError::WrongReading { index, step, planned };
    let early = ReadingFault::FiredTooEarly { ticks: 1 };
    let lies = [
        (ping, None),
        (Reading { index: 3, ..ping }, Some(wrong(3, 0, None))),
        (Reading { step: 9, ..ping }, Some(wrong(0, 9, Some(0)))),
        (
            Reading { status: ReadingStatus::NoEcho, ..ping },
            Some(HostError::SenselessReading(ReadingFault::EchoUnexpected { echoes: 1 })),
        ),
        (
            Reading { fired_ticks: BEGAN.wrapping_sub(1), ..ping },
            Some(HostError::SenselessReading(early)),
        ),
    ];
    for (lie, error) in lies {
        let mut stranger = Stranger::homed();
        stranger.run(Command::Ping, Reply::Reading(lie));
        let failed = stranger.events.iter().find_map(|event| match event {
            HostEvent::Failed(error) => Some(*error),
            _ => None,
        });
        assert_eq!(failed, error, "{lie:?}");
        assert!(!stranger.host.is_busy());
    }
}

#[test]
fn answers_without_sense_are_refused_by_their_names() {
    let mut stranger = Stranger::homed();
    stranger.run(Command::Home, Reply::Homed { drift_steps: 201 });
    let status = Status { homed: true, step: 2_000_000, ..Status::BLANK };
    stranger.run(Command::Status, Reply::StatusReport(status));
    assert_eq!(
        stranger.events,
        [ReplyFault::Drift { drift_steps: 201 }, ReplyFault::Position { step: 2_000_000 }]
            .map(|fault| HostEvent::Failed(HostError::SenselessReply(fault)))
    );
}

/// The error that a command ends with, when every Stop is acknowledged.
fn end_of(stranger: &mut Stranger, mut answer: impl FnMut(&mut Stranger)) -> HostError {
    for _ in 0..200 {
        let failed = stranger.events.iter().find_map(|event| match event {
            HostEvent::Failed(error) => Some(*error),
            _ => None,
        });
        if let Some(error) = failed {
            return error;
        }
        if matches!(stranger.last().1, Request::Stop) {
            stranger.answer(Reply::Ack);
        } else {
            answer(stranger);
        }
    }
    panic!("no end: {:?}", stranger.events);
}

#[test]
fn a_host_that_gives_up_on_a_device_that_answers_stops_it_first() {
    type Deed = fn(&mut Stranger);
    let deeds: [(&str, Deed, HostError); 6] = [
        (
            "a beam that is not in the plan",
            |stranger| stranger.tell(stranger.reading(12)),
            HostError::WrongReading { index: 12, step: 12, planned: None },
        ),
        (
            "a beam at another step",
            |stranger| stranger.tell(Reading { step: 4, ..stranger.reading(0) }),
            HostError::WrongReading { index: 0, step: 4, planned: Some(0) },
        ),
        (
            "another sweep",
            |stranger| {
                stranger.wait();
                let alive = Alive { sweep: 1, state: SweepState::Running, ..Alive::BLANK };
                stranger.answer(Reply::Alive(alive));
            },
            HostError::SweepLost,
        ),
        (
            "no progress",
            |stranger| {
                stranger.wait();
                stranger.alive(0, SweepState::Running);
            },
            HostError::Stalled { fired: 0 },
        ),
        (
            "more beams than there are",
            |stranger| {
                stranger.wait();
                stranger.alive(13, SweepState::Running);
            },
            HostError::SenselessReply(ReplyFault::Progress { fired: 13, sent: 13, beams: 12 }),
        ),
        (
            "a refusal in the middle",
            |stranger| {
                stranger.wait();
                stranger.answer(Reply::Nak { reason: NakReason::Busy });
            },
            HostError::Refused(NakReason::Busy),
        ),
    ];
    for (name, deed, expected) in deeds {
        let mut stranger = Stranger::sweeping();
        assert_eq!(end_of(&mut stranger, deed), expected, "{name}");
        assert!(stranger.asks_to_stop(), "{name}: fires on until its lease");
        assert!(!stranger.host.is_busy());
    }
}

#[test]
fn a_device_that_does_not_answer_is_not_asked_to_stop() {
    let mut stranger = Stranger::sweeping();
    let error = end_of(&mut stranger, |stranger| assert!(stranger.wait()));
    assert_eq!(error, HostError::NoAnswer { attempts: ATTEMPTS });
    assert!(!stranger.asks_to_stop());
}

#[test]
fn a_stop_that_is_not_answered_either_changes_nothing_about_the_cause() {
    let mut stranger = Stranger::sweeping();
    stranger.tell(stranger.reading(12));
    while stranger.wait() {}
    let stops = stranger.asked.iter().filter(|(_, request)| *request == Request::Stop).count();
    assert_eq!(stops, usize::from(STOP_ATTEMPTS));
    let wrong = HostError::WrongReading { index: 12, step: 12, planned: None };
    assert_eq!(stranger.events.last(), Some(&HostEvent::Failed(wrong)));
}

#[test]
fn a_home_that_is_only_ever_started_ends_by_its_name() {
    let mut stranger = Stranger::homed();
    let began_us = stranger.now_us;
    stranger.begin(Command::Home);
    let error = end_of(&mut stranger, |stranger| {
        // Again and again, which must not begin the time anew.
        for _ in 0..10 {
            stranger.answer(Reply::Started);
            stranger.now_us += 1_000;
        }
        stranger.wait();
    });
    let homes = stranger.asked.iter().filter(|(_, request)| *request == Request::Home).count();
    assert_eq!(homes, 1 + usize::from(OVERRUNS), "with that of the beginning");
    assert!(matches!(error, HostError::Overrun { .. }), "{error:?}");
    assert!(stranger.asks_to_stop());
    // Two turns take 0.825 s at these settings.
    let took_us = stranger.now_us - began_us;
    assert!((2_400_000..8_000_000).contains(&took_us), "{took_us} us");
}

#[test]
fn a_flood_of_faults_hides_no_end() {
    let mut stranger = Stranger::homed();
    stranger.begin(Command::Home);
    let (header, _) = stranger.last();
    let fault = (Header { seq: 0, ..header }, Reply::Fault { kind: FaultKind::MotionFault });
    let mut replies = vec![fault; 200];
    replies.push((header, Reply::Nak { reason: NakReason::MotionFault }));
    stranger.say_all(&replies);
    let end = HostEvent::Failed(HostError::Refused(NakReason::MotionFault));
    assert_eq!(stranger.events.last(), Some(&end));
}

#[test]
fn a_restart_between_commands_is_told_as_one() {
    let mut stranger = Stranger::homed();
    stranger.boot = BOOT + 1;
    let announced = Identity { boot: BOOT + 1, reset_cause: ResetCause::BrownOut, ..IDENTITY };
    stranger.say(0, Reply::Identity(announced));
    assert_eq!(stranger.events, [HostEvent::Rebooted { old: BOOT, new: BOOT + 1 }]);
    let begun = stranger.host.start(stranger.now_us, Command::Home);
    assert_eq!(begun, Err(StartError::Restarted));
    let mut nobody = Stranger::new();
    assert_eq!(nobody.host.start(0, Command::Home), Err(StartError::NotIdentified));
}

#[test]
fn another_board_under_the_same_nonce_is_noticed() {
    let other = Identity { steps_per_revolution: 800, ..IDENTITY };
    let restarted = HostEvent::Rebooted { old: BOOT, new: BOOT };
    let mut announces = Stranger::homed();
    announces.say(0, Reply::Identity(other));
    assert_eq!(announces.events, [restarted]);
    assert!(announces.host.identity().is_none());

    let mut replugged = Stranger::homed();
    replugged.host.handle_hangup(replugged.now_us);
    replugged.run(Command::Identify, Reply::Identity(other));
    assert_eq!(replugged.events, [restarted, HostEvent::Identified(other)]);
    let begun = replugged.host.start(replugged.now_us, Command::Home);
    assert_eq!(begun, Err(StartError::NotConfigured), "its settings are not the other one's");
}

#[test]
fn no_frame_of_boot_0_restarts_a_device() {
    let mut stranger = Stranger::homed();
    stranger.boot = 0;
    stranger.run(Command::Status, Reply::StatusReport(Status::BLANK));
    assert_eq!(stranger.events, []);
    assert_eq!(stranger.host.identity(), Some(&IDENTITY));
}

/// Which number a reply bears.
#[derive(Debug, Clone, Copy)]
enum Number {
    Asked,
    Sweep,
    Any(u16),
}

fn reading(sweeps: BoxedStrategy<u16>) -> impl Strategy<Value = Reading> {
    let status = prop::sample::select(vec![
        ReadingStatus::Echo,
        ReadingStatus::NoEcho,
        ReadingStatus::ModuleFault,
        ReadingStatus::StepDoubtful,
    ]);
    let echoes = prop::collection::vec(prop_oneof![0..45_000_u32, 0..2_000_000_u32], 0..5);
    let step_off = prop_oneof![9 => Just(0_i32), 1 => any::<i32>()];
    let fired = prop_oneof![
        8 => (0..20_u32, 0..80_000_u32)
            .prop_map(|(beam, jitter)| BEGAN.wrapping_add(beam * BEAM).wrapping_add(jitter)),
        1 => any::<u32>(),
    ];
    (sweeps, 0..14_u16, step_off, fired, status, echoes).prop_map(
        |(sweep, index, step_off, fired_ticks, status, echoes)| Reading {
            sweep,
            index,
            step: i32::from(index).wrapping_add(step_off),
            fired_ticks,
            status,
            echoes: Echoes::from_ticks(&echoes),
        },
    )
}

fn reply() -> impl Strategy<Value = Reply> {
    // 0 stands for the sweep that was asked for: its number is put in when it is told.
    let sweeps = || prop_oneof![9 => Just(0_u16), 1 => any::<u16>()].boxed();
    let state = || {
        prop::sample::select(vec![
            SweepState::None,
            SweepState::Running,
            SweepState::Running,
            SweepState::Holding,
            SweepState::Complete,
            SweepState::Stopped,
            SweepState::LeaseExpired,
        ])
    };
    let identity = (any::<u16>(), 0..3_u32, 0..3_u16, any::<u16>(), 0..300_u16).prop_map(
        |(boot, rate, steps, capabilities, ring_bytes)| Identity {
            boot: if boot < 40_000 { BOOT } else { boot },
            tick_hz: rate * 1_000_000,
            steps_per_revolution: steps * 200,
            capabilities: Capabilities(capabilities),
            ring_bytes,
            ..IDENTITY
        },
    );
    let reason = prop::sample::select(vec![
        NakReason::Busy,
        NakReason::WrongBoot,
        NakReason::SequenceReused,
        NakReason::NotHomed,
    ]);
    prop_oneof![
        12 => reading(sweeps()).prop_map(Reply::Reading),
        2 => (any::<u32>(), sweeps(), 0..14_u16, 0..14_u16, state()).prop_map(
            |(ticks, sweep, fired, sent, state)| {
                Reply::Alive(Alive { ticks, sweep, fired, sent, state })
            }
        ),
        1 => (sweeps(), 0..14_u16, state())
            .prop_map(|(sweep, fired, end)| Reply::SweepDone(SweepDone { sweep, fired, end })),
        1 => identity.prop_map(Reply::Identity),
        2 => Just(Reply::Ack),
        1 => Just(Reply::Started),
        1 => any::<i32>().prop_map(|drift_steps| Reply::Homed { drift_steps }),
        1 => reason.prop_map(|reason| Reply::Nak { reason }),
        1 => Just(Reply::Fault { kind: FaultKind::EmergencyStop }),
        1 => (any::<u32>(), any::<i32>(), any::<bool>()).prop_map(|(ticks, step, homed)| {
            Reply::StatusReport(Status {
                ticks,
                state: DeviceState::Idle,
                homed,
                step,
                ..Status::BLANK
            })
        }),
    ]
}

/// What may be told of a sweep's beams, whatever was said, checked without the host's own code.
fn assert_sense(events: &[HostEvent]) {
    let mut fired: BTreeMap<u16, (u32, bool)> = BTreeMap::new();
    for event in events {
        let HostEvent::Reading { reading, .. } = event else { continue };
        let Reading { index, step, fired_ticks, status, echoes, .. } = *reading;
        assert!(index < 12 && step == i32::from(index), "{reading:?}");
        assert!(echoes.len() <= 2 && echoes.iter().all(|&ticks| ticks <= 40_000), "{reading:?}");
        assert!(echoes.windows(2).all(|pair| pair[0] < pair[1]), "{reading:?}");
        match status {
            ReadingStatus::Echo => assert!(!echoes.is_empty(), "{reading:?}"),
            ReadingStatus::StepDoubtful => {}
            _ => assert!(echoes.is_empty(), "{reading:?}"),
        }
        let listened = status != ReadingStatus::ModuleFault;
        assert!(fired.insert(index, (fired_ticks, listened)).is_none(), "beam {index} twice");
        let since = fired_ticks.wrapping_sub(BEGAN).cast_signed();
        assert!(since >= 0, "before the sweep: {reading:?}");
    }
    for (earlier, later) in fired.values().zip(fired.values().skip(1)) {
        let apart = later.0.wrapping_sub(earlier.0).cast_signed();
        let least = if earlier.1 { 50_000 } else { 50_000.max(SETTINGS.settle_ticks as i32) };
        assert!(apart >= least, "{fired:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// Whatever a device says, the host takes nothing that makes no sense, and comes to an end
    /// once the device says no more.
    #[test]
    fn no_reply_makes_a_host_believe_what_cannot_be(
        replies in prop::collection::vec(
            (
                prop_oneof![
                    5 => Just(Number::Asked),
                    5 => Just(Number::Sweep),
                    1 => any::<u16>().prop_map(Number::Any),
                ],
                prop_oneof![30 => Just(BOOT), 1 => Just(0_u16), 1 => any::<u16>()],
                reply(),
                any::<bool>(),
            ),
            1..60,
        ),
    ) {
        let mut stranger = Stranger::sweeping();
        let (sweep, sweep_seq) = stranger.sweep();
        for (number, boot, mut reply, wait) in replies {
            match &mut reply {
                Reply::Reading(reading) if reading.sweep == 0 => reading.sweep = sweep,
                Reply::Alive(alive) if alive.sweep == 0 => alive.sweep = sweep,
                Reply::SweepDone(done) if done.sweep == 0 => done.sweep = sweep,
                _ => {}
            }
            if wait {
                stranger.wait();
            }
            let seq = match number {
                Number::Asked => stranger.last().0.seq,
                Number::Sweep => sweep_seq,
                Number::Any(seq) => seq,
            };
            stranger.say_all(&[(Header { boot, seq }, reply)]);
        }
        assert_sense(&stranger.events);
        let quiet_us = stranger.now_us;
        while stranger.host.is_busy() {
            prop_assert!(stranger.wait(), "busy, and waits for nothing");
            prop_assert!(stranger.now_us - quiet_us < 60_000_000, "never ends");
        }
        let ends = stranger.events.iter().filter(|event| {
            matches!(event, HostEvent::Failed(_) | HostEvent::SweepDone { .. })
        });
        prop_assert_eq!(ends.count(), 1, "{:?}", stranger.events);
    }

    /// The same of Identify.
    #[test]
    fn no_identity_is_taken_that_cannot_be(
        identities in prop::collection::vec(
            (any::<u16>(), any::<u32>(), any::<u16>(), any::<u16>(), any::<u16>(), any::<bool>()),
            1..20,
        ),
    ) {
        for (boot, tick_hz, steps_per_revolution, capabilities, ring_bytes, right) in identities {
            let mut stranger = Stranger::new();
            stranger.boot = if right { boot } else { BOOT };
            let tick_hz = if right { 2_000_000 } else { tick_hz };
            let capabilities = Capabilities(capabilities);
            let told = Identity {
                boot, tick_hz, steps_per_revolution, capabilities, ring_bytes, ..IDENTITY
            };
            stranger.run(Command::Identify, Reply::Identity(told));
            let least = if capabilities.has(Capabilities::MULTIPLE_ECHOES) { 29 } else { 8 };
            let sound = boot != 0 && boot == stranger.boot && tick_hz == 2_000_000
                && steps_per_revolution > 0 && ring_bytes >= least;
            prop_assert_eq!(stranger.host.identity().is_some(), sound, "{:?}", told);
        }
    }
}
