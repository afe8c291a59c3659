//! Arbitrary well-formed replies: for any input the host accepts only plausible content.

use std::collections::BTreeMap;

use firmware_protocol::frame::Header;
use firmware_protocol::host::{Command, HostEvent};
use firmware_protocol::messages::{
    Alive, Capabilities, DeviceState, Echoes, FaultKind, Identity, NakReason, Reading,
    ReadingStatus, Reply, Status, SweepDone, SweepState, Wire as _,
};
use proptest::prelude::*;

use super::{BEAM, BEGAN, BOOT, IDENTITY, RogueDevice, SETTINGS};

/// Sequence number of a reply.
#[derive(Debug, Clone, Copy)]
enum Number {
    LastRequest,
    Sweep,
    Any(u16),
}

fn reading(sweeps: BoxedStrategy<u16>) -> impl Strategy<Value = Reading> {
    let status = prop::sample::select(vec![
        ReadingStatus::Echo,
        ReadingStatus::NoEcho,
        ReadingStatus::ModuleFault,
        ReadingStatus::StepUncertain,
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
    // 0 is replaced by the number of the requested sweep before sending.
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

/// Checks the accepted beams of a sweep for plausibility, without the host's own code.
fn assert_plausible(events: &[HostEvent]) {
    let mut fired: BTreeMap<u16, (u32, bool)> = BTreeMap::new();
    for event in events {
        let HostEvent::Reading { reading, .. } = event else { continue };
        let Reading { index, step, fired_ticks, status, echoes, .. } = *reading;
        assert!(index < 12 && step == i32::from(index), "{reading:?}");
        assert!(echoes.len() <= 2 && echoes.iter().all(|&ticks| ticks <= 40_000), "{reading:?}");
        assert!(echoes.windows(2).all(|pair| pair[0] < pair[1]), "{reading:?}");
        match status {
            ReadingStatus::Echo => assert!(!echoes.is_empty(), "{reading:?}"),
            ReadingStatus::StepUncertain => {}
            _ => assert!(echoes.is_empty(), "{reading:?}"),
        }
        let window_open = status != ReadingStatus::ModuleFault;
        assert!(fired.insert(index, (fired_ticks, window_open)).is_none(), "beam {index} twice");
        let since = fired_ticks.wrapping_sub(BEGAN).cast_signed();
        assert!(since >= 0, "before the sweep: {reading:?}");
    }
    for (earlier, later) in fired.values().zip(fired.values().skip(1)) {
        let apart = later.0.wrapping_sub(earlier.0).cast_signed();
        let min = if earlier.1 { 50_000 } else { 50_000.max(SETTINGS.settle_ticks as i32) };
        assert!(apart >= min, "{fired:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// For any replies, the host accepts only plausible readings, and the command ends once the
    /// device falls quiet.
    #[test]
    fn accepts_only_plausible_readings(
        replies in prop::collection::vec(
            (
                prop_oneof![
                    5 => Just(Number::LastRequest),
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
        let mut rogue = RogueDevice::sweeping();
        let (sweep, sweep_seq) = rogue.sweep();
        for (number, boot, mut reply, wait) in replies {
            match &mut reply {
                Reply::Reading(reading) if reading.sweep == 0 => reading.sweep = sweep,
                Reply::Alive(alive) if alive.sweep == 0 => alive.sweep = sweep,
                Reply::SweepDone(done) if done.sweep == 0 => done.sweep = sweep,
                _ => {}
            }
            if wait {
                rogue.wait();
            }
            let seq = match number {
                Number::LastRequest => rogue.last_request().0.seq,
                Number::Sweep => sweep_seq,
                Number::Any(seq) => seq,
            };
            rogue.send_all(&[(Header { boot, seq }, reply)]);
        }
        assert_plausible(&rogue.events);
        let silent_since_us = rogue.now_us;
        while rogue.host.is_busy() {
            prop_assert!(rogue.wait(), "busy, and waits for nothing");
            prop_assert!(rogue.now_us - silent_since_us < 60_000_000, "never ends");
        }
        let ends = rogue.events.iter().filter(|event| {
            matches!(event, HostEvent::Failed(_) | HostEvent::SweepDone { .. })
        });
        prop_assert_eq!(ends.count(), 1, "{:?}", rogue.events);
    }

    /// For any Identity, the host accepts only plausible ones.
    #[test]
    fn accepts_only_valid_identities(
        identities in prop::collection::vec(
            (any::<u16>(), any::<u32>(), any::<u16>(), any::<u16>(), any::<u16>(), any::<bool>()),
            1..20,
        ),
    ) {
        for (boot, tick_hz, steps_per_revolution, capabilities, ring_bytes, matching) in identities {
            let mut rogue = RogueDevice::new();
            rogue.boot = if matching { boot } else { BOOT };
            let tick_hz = if matching { 2_000_000 } else { tick_hz };
            let capabilities = Capabilities(capabilities);
            let identity = Identity {
                boot, tick_hz, steps_per_revolution, capabilities, ring_bytes, ..IDENTITY
            };
            rogue.run(Command::Identify, Reply::Identity(identity));
            let min = if capabilities.has(Capabilities::MULTIPLE_ECHOES) { 29 } else { 8 };
            let valid = boot != 0 && boot == rogue.boot && tick_hz == 2_000_000
                && steps_per_revolution > 0 && ring_bytes >= min;
            prop_assert_eq!(rogue.host.identity().is_some(), valid, "{:?}", identity);
        }
    }
}
