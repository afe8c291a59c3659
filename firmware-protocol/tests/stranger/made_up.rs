//! Arbitrary well-formed replies: whatever a device says, the host believes nothing that can't be.

use std::collections::BTreeMap;

use firmware_protocol::frame::Header;
use firmware_protocol::host::{Command, HostEvent};
use firmware_protocol::messages::{
    Alive, Capabilities, DeviceState, Echoes, FaultKind, Identity, NakReason, Reading,
    ReadingStatus, Reply, Status, SweepDone, SweepState, Wire as _,
};
use proptest::prelude::*;

use super::{BEAM, BEGAN, BOOT, IDENTITY, SETTINGS, Stranger};

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
