//! Replies that a host must reject, and the end of commands that it gives up on. Cases are listed
//! here; arbitrary well-formed replies are in `rogue/arbitrary.rs`.

mod rogue;

use firmware_protocol::frame::Header;
use firmware_protocol::host::{
    ATTEMPTS, Command, HostError, HostEvent, IdentityFault, OVERRUNS, Outcome, ReadingFault,
    ReplyFault, STOP_ATTEMPTS, StartError,
};
use firmware_protocol::messages::{
    Alive, Capabilities, Echoes, FaultKind, Identity, NakReason, Reading, ReadingStatus, Reply,
    Request, ResetCause, Status, SweepState, Wire as _,
};
use rogue::{BEAM, BEGAN, BOOT, IDENTITY, RogueDevice};

#[test]
fn rejects_invalid_identity() {
    let cases = [
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
    for (altered, fault) in cases {
        let mut rogue = RogueDevice::new();
        rogue.run(Command::Identify, Reply::Identity(altered));
        let rejected = HostEvent::Failed(HostError::InvalidIdentity(fault));
        assert_eq!(rogue.events, [rejected], "{altered:?}");
        assert!(rogue.host.identity().is_none());
        assert_eq!(rogue.host.stats().rejected, 1);
    }
}

/// Alteration of a valid reading.
type Alteration = fn(Reading) -> Reading;

/// Alterations of beam 5 of twelve, and the expected faults.
fn cases() -> [(&'static str, Alteration, ReadingFault); 10] {
    [
        (
            "an echo after the window",
            |valid| Reading { echoes: Echoes::from_ticks(&[40_001]), ..valid },
            ReadingFault::EchoAfterWindow { ticks: 40_001, window: 40_000 },
        ),
        (
            "no echo, with echoes",
            |valid| Reading { status: ReadingStatus::NoEcho, ..valid },
            ReadingFault::EchoUnexpected { echoes: 2 },
        ),
        (
            "not fired, with echoes",
            |valid| Reading { status: ReadingStatus::ModuleFault, ..valid },
            ReadingFault::EchoUnexpected { echoes: 2 },
        ),
        (
            "an echo, without one",
            |valid| Reading { echoes: Echoes::new(), ..valid },
            ReadingFault::EchoMissing,
        ),
        (
            "falling echoes",
            |valid| Reading { echoes: Echoes::from_ticks(&[20_000, 9_000]), ..valid },
            ReadingFault::EchoesOutOfOrder,
        ),
        (
            "more echoes than requested",
            |valid| Reading { echoes: Echoes::from_ticks(&[1, 2, 3]), ..valid },
            ReadingFault::TooManyEchoes { echoes: 3, requested: 2 },
        ),
        (
            "fired before the sweep",
            |valid| Reading { fired_ticks: BEGAN.wrapping_sub(1), ..valid },
            ReadingFault::FiredTooEarly { ticks: 4 * BEAM + 1_001 + 50_000 },
        ),
        (
            "fired with the previous beam",
            |valid| Reading { fired_ticks: valid.fired_ticks.wrapping_sub(BEAM), ..valid },
            ReadingFault::FiredTooEarly { ticks: 50_000 },
        ),
        (
            "fired in the window of the previous beam",
            |valid| Reading { fired_ticks: valid.fired_ticks.wrapping_sub(BEAM - 40_000), ..valid },
            ReadingFault::FiredTooEarly { ticks: 10_000 },
        ),
        (
            "fired in an hour's time",
            |valid| Reading { fired_ticks: valid.fired_ticks.wrapping_add(900_000_000), ..valid },
            ReadingFault::FiredInFuture { ticks: 0 },
        ),
    ]
}

/// Only beam 5 is altered; the sweep continues.
#[test]
fn rejects_invalid_beam() {
    for (name, alter, expected) in cases() {
        let mut rogue = RogueDevice::sweeping();
        for index in 0..12 {
            let valid = rogue.reading(index);
            rogue.send_reading(if index == 5 { alter(valid) } else { valid });
        }
        let faults: Vec<_> = rogue
            .events
            .iter()
            .filter_map(|event| match event {
                HostEvent::ReadingRejected { reading, fault } => Some((reading.index, *fault)),
                _ => None,
            })
            .collect();
        let [(5, fault)] = faults[..] else { panic!("{name}: {:?}", rogue.events) };
        match (fault, expected) {
            // The amount depends on the time of reception.
            (ReadingFault::FiredInFuture { .. }, ReadingFault::FiredInFuture { .. }) => {}
            _ => assert_eq!(fault, expected, "{name}"),
        }
        let end = rogue.events.last();
        let done = matches!(
            end,
            Some(HostEvent::SweepDone { delivered: 11, end: SweepState::Complete, .. })
        );
        assert!(done, "{name}: {end:?}");
        assert_eq!((rogue.host.stats().readings, rogue.host.stats().rejected), (11, 1));
    }
}

#[test]
fn rejects_invalid_ping() {
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
    let cases = [
        (ping, None),
        (Reading { index: 3, ..ping }, Some(wrong(3, 0, None))),
        (Reading { step: 9, ..ping }, Some(wrong(0, 9, Some(0)))),
        (
            Reading { status: ReadingStatus::NoEcho, ..ping },
            Some(HostError::InvalidReading(ReadingFault::EchoUnexpected { echoes: 1 })),
        ),
        (
            Reading { fired_ticks: BEGAN.wrapping_sub(1), ..ping },
            Some(HostError::InvalidReading(early)),
        ),
    ];
    for (altered, error) in cases {
        let mut rogue = RogueDevice::homed();
        rogue.run(Command::Ping, Reply::Reading(altered));
        let failed = rogue.events.iter().find_map(|event| match event {
            HostEvent::Failed(error) => Some(*error),
            _ => None,
        });
        assert_eq!(failed, error, "{altered:?}");
        assert!(!rogue.host.is_busy());
    }
}

#[test]
fn rejects_invalid_reply() {
    let mut rogue = RogueDevice::homed();
    rogue.run(Command::Home, Reply::Homed { drift_steps: 201 });
    let status = Status { homed: true, step: 2_000_000, ..Status::BLANK };
    rogue.run(Command::Status, Reply::StatusReport(status));
    assert_eq!(
        rogue.events,
        [ReplyFault::Drift { drift_steps: 201 }, ReplyFault::Position { step: 2_000_000 }]
            .map(|fault| HostEvent::Failed(HostError::InvalidReply(fault)))
    );
}

/// Runs until the command fails, acknowledging every Stop; returns the error.
fn run_to_failure(rogue: &mut RogueDevice, mut reply: impl FnMut(&mut RogueDevice)) -> HostError {
    for _ in 0..200 {
        let failed = rogue.events.iter().find_map(|event| match event {
            HostEvent::Failed(error) => Some(*error),
            _ => None,
        });
        if let Some(error) = failed {
            return error;
        }
        if matches!(rogue.last_request().1, Request::Stop) {
            rogue.reply(Reply::Ack);
        } else {
            reply(rogue);
        }
    }
    panic!("no end: {:?}", rogue.events);
}

#[test]
fn stops_device_before_failing() {
    type Behaviour = fn(&mut RogueDevice);
    let cases: [(&str, Behaviour, HostError); 6] = [
        (
            "a beam that is not in the plan",
            |rogue| rogue.send_reading(rogue.reading(12)),
            HostError::WrongReading { index: 12, step: 12, planned: None },
        ),
        (
            "a beam at another step",
            |rogue| rogue.send_reading(Reading { step: 4, ..rogue.reading(0) }),
            HostError::WrongReading { index: 0, step: 4, planned: Some(0) },
        ),
        (
            "another sweep",
            |rogue| {
                rogue.wait();
                let alive = Alive { sweep: 1, state: SweepState::Running, ..Alive::BLANK };
                rogue.reply(Reply::Alive(alive));
            },
            HostError::SweepLost,
        ),
        (
            "no progress",
            |rogue| {
                rogue.wait();
                rogue.alive(0, SweepState::Running);
            },
            HostError::Stalled { fired: 0 },
        ),
        (
            "more beams than planned",
            |rogue| {
                rogue.wait();
                rogue.alive(13, SweepState::Running);
            },
            HostError::InvalidReply(ReplyFault::Progress { fired: 13, sent: 13, beams: 12 }),
        ),
        (
            "a rejection in the middle",
            |rogue| {
                rogue.wait();
                rogue.reply(Reply::Nak { reason: NakReason::Busy });
            },
            HostError::Rejected(NakReason::Busy),
        ),
    ];
    for (name, behaviour, expected) in cases {
        let mut rogue = RogueDevice::sweeping();
        assert_eq!(run_to_failure(&mut rogue, behaviour), expected, "{name}");
        assert!(rogue.received_stop(), "{name}: the device fires until its lease ends");
        assert!(!rogue.host.is_busy());
    }
}

#[test]
fn no_stop_without_replies() {
    let mut rogue = RogueDevice::sweeping();
    let error = run_to_failure(&mut rogue, |rogue| assert!(rogue.wait()));
    assert_eq!(error, HostError::NoAnswer { attempts: ATTEMPTS });
    assert!(!rogue.received_stop());
}

#[test]
fn unanswered_stop_keeps_cause() {
    let mut rogue = RogueDevice::sweeping();
    rogue.send_reading(rogue.reading(12));
    while rogue.wait() {}
    let stops = rogue.requests.iter().filter(|(_, request)| *request == Request::Stop).count();
    assert_eq!(stops, usize::from(STOP_ATTEMPTS));
    let wrong = HostError::WrongReading { index: 12, step: 12, planned: None };
    assert_eq!(rogue.events.last(), Some(&HostEvent::Failed(wrong)));
}

/// Sweep of which beam 5 is lost, then `losses` times sent again in vain.
fn losing_beam_5(losses: u8) -> RogueDevice {
    let mut rogue = RogueDevice::sweeping();
    for index in (0..12).filter(|&index| index != 5) {
        rogue.send_reading(rogue.reading(index));
    }
    // This Alive follows new readings, so it does not count.
    assert!(matches!(rogue.last_request().1, Request::KeepAlive { .. }));
    rogue.alive(12, SweepState::Complete);
    for _ in 0..losses {
        assert!(matches!(rogue.last_request().1, Request::Resend { first: 5, count: 1, .. }));
        rogue.alive(12, SweepState::Complete);
    }
    rogue
}

#[test]
fn lost_beam_is_requested_again() {
    let mut rogue = losing_beam_5(ATTEMPTS);
    rogue.send_reading(rogue.reading(5));
    let end = rogue.events.last();
    assert!(matches!(end, Some(HostEvent::SweepDone { delivered: 12, .. })), "{end:?}");

    let mut rogue = losing_beam_5(ATTEMPTS + 1);
    rogue.reply(Reply::Ack);
    assert_eq!(rogue.events.last(), Some(&HostEvent::Failed(HostError::Stalled { fired: 12 })));
    assert!(rogue.received_stop());
}

#[test]
fn endless_home_is_overrun() {
    let mut rogue = RogueDevice::homed();
    let began_us = rogue.now_us;
    rogue.begin(Command::Home);
    let error = run_to_failure(&mut rogue, |rogue| {
        // Repeatedly, which must not restart the deadline.
        for _ in 0..10 {
            rogue.reply(Reply::Started);
            rogue.now_us += 1_000;
        }
        rogue.wait();
    });
    let homes = rogue.requests.iter().filter(|(_, request)| *request == Request::Home).count();
    assert_eq!(homes, 1 + usize::from(OVERRUNS), "including the first transmission");
    assert!(matches!(error, HostError::Overrun { .. }), "{error:?}");
    assert!(rogue.received_stop());
    // Two revolutions take 0.825 s at these settings.
    let took_us = rogue.now_us - began_us;
    assert!((2_400_000..8_000_000).contains(&took_us), "{took_us} us");
}

/// The line loses all but the last of the permitted transmissions, and then the final reply.
#[test]
fn started_renews_attempts() {
    let mut rogue = RogueDevice::homed();
    rogue.begin(Command::Home);
    for _ in 1..ATTEMPTS {
        assert!(rogue.wait());
    }
    rogue.reply(Reply::Started);
    let before = rogue.requests.len();
    for _ in 0..ATTEMPTS {
        assert!(rogue.wait());
    }
    assert_eq!(rogue.requests.len() - before, usize::from(ATTEMPTS));
    assert!(rogue.requests[before..].iter().all(|(_, request)| *request == Request::Home));
    rogue.reply(Reply::Homed { drift_steps: 0 });
    assert_eq!(rogue.events, [HostEvent::Done(Outcome::Homed { drift_steps: 0 })]);
}

#[test]
fn silence_after_started_is_no_answer() {
    let mut rogue = RogueDevice::homed();
    rogue.begin(Command::Home);
    rogue.reply(Reply::Started);
    let before = rogue.requests.len();
    let error = run_to_failure(&mut rogue, |rogue| assert!(rogue.wait()));
    assert_eq!(error, HostError::NoAnswer { attempts: ATTEMPTS });
    let repeated =
        rogue.requests[before..].iter().filter(|(_, request)| *request == Request::Home).count();
    assert_eq!(repeated, usize::from(ATTEMPTS));
}

#[test]
fn renumbering_keeps_overruns() {
    let mut rogue = RogueDevice::homed();
    rogue.begin(Command::Home);
    let error = run_to_failure(&mut rogue, |rogue| {
        rogue.reply(Reply::Started);
        rogue.wait();
        rogue.reply(Reply::Nak { reason: NakReason::SequenceReused });
    });
    assert!(matches!(error, HostError::Overrun { .. }), "{error:?}");
}

#[test]
fn fault_flood_keeps_end_event() {
    let mut rogue = RogueDevice::homed();
    rogue.begin(Command::Home);
    let (header, _) = rogue.last_request();
    let fault = (Header { seq: 0, ..header }, Reply::Fault { kind: FaultKind::MotionFault });
    let mut replies = vec![fault; 200];
    replies.push((header, Reply::Nak { reason: NakReason::MotionFault }));
    rogue.send_all(&replies);
    let end = HostEvent::Failed(HostError::Rejected(NakReason::MotionFault));
    assert_eq!(rogue.events.last(), Some(&end));
}

#[test]
fn reports_restart_when_idle() {
    let mut rogue = RogueDevice::homed();
    rogue.boot = BOOT + 1;
    let announced = Identity { boot: BOOT + 1, reset_cause: ResetCause::BrownOut, ..IDENTITY };
    rogue.send(0, Reply::Identity(announced));
    assert_eq!(rogue.events, [HostEvent::Rebooted { old: BOOT, new: BOOT + 1 }]);
    let begun = rogue.host.start(rogue.now_us, Command::Home);
    assert_eq!(begun, Err(StartError::Restarted));
    let mut unidentified = RogueDevice::new();
    assert_eq!(unidentified.host.start(0, Command::Home), Err(StartError::NotIdentified));
}

#[test]
fn detects_replaced_board() {
    let other = Identity { steps_per_revolution: 800, ..IDENTITY };
    let restarted = HostEvent::Rebooted { old: BOOT, new: BOOT };
    let mut announces = RogueDevice::homed();
    announces.send(0, Reply::Identity(other));
    assert_eq!(announces.events, [restarted]);
    assert!(announces.host.identity().is_none());

    let mut replugged = RogueDevice::homed();
    replugged.host.handle_hangup(replugged.now_us);
    replugged.run(Command::Identify, Reply::Identity(other));
    assert_eq!(replugged.events, [restarted, HostEvent::Identified(other)]);
    let begun = replugged.host.start(replugged.now_us, Command::Home);
    assert_eq!(begun, Err(StartError::NotConfigured), "settings belong to the previous board");
}

#[test]
fn ignores_boot_zero() {
    let mut rogue = RogueDevice::homed();
    rogue.boot = 0;
    rogue.run(Command::Status, Reply::StatusReport(Status::BLANK));
    assert_eq!(rogue.events, []);
    assert_eq!(rogue.host.identity(), Some(&IDENTITY));
}
