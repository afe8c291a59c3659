//! What a host must refuse, and how it parts from a device that it gives up on: a table of lies;
//! arbitrary well-formed replies are in `stranger/made_up.rs`.

mod stranger;

use firmware_protocol::frame::Header;
use firmware_protocol::host::{
    ATTEMPTS, Command, HostError, HostEvent, IdentityFault, OVERRUNS, ReadingFault, ReplyFault,
    STOP_ATTEMPTS, StartError,
};
use firmware_protocol::messages::{
    Alive, Capabilities, Echoes, FaultKind, Identity, NakReason, Reading, ReadingStatus, Reply,
    Request, ResetCause, Status, SweepState, Wire as _,
};
use stranger::{BEAM, BEGAN, BOOT, IDENTITY, Stranger};

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

/// What a device makes of a true reading.
type Lie = fn(Reading) -> Reading;

/// Lies about beam 5 of twelve, and the names by which they are refused.
fn lies() -> [(&'static str, Lie, ReadingFault); 10] {
    [
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
    ]
}

/// Each lie alone; the other beams are told truly.
#[test]
fn a_reading_without_sense_is_refused_by_its_name_and_its_sweep_goes_on() {
    for (name, lie, expected) in lies() {
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
