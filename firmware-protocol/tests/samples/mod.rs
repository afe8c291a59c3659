//! One sample of every message, with extreme values where the length matters.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part")]

use firmware_protocol::messages::{
    Alive, Blanking, Capabilities, DeviceState, Echoes, FaultKind, FirmwareVersion, Identity,
    NakReason, ProtocolId, Reading, ReadingStatus, Reply, Request, ResetCause, Settings, Status,
    Sweep, SweepDone, SweepState,
};

/// Boot nonce in all samples.
pub const BOOT: u16 = 0x1234;
/// Sequence number in all samples.
pub const SEQ: u16 = 0x0042;

pub fn requests() -> Vec<(&'static str, Request)> {
    let settings = Settings {
        window_ticks: 48_000,
        min_interval_ticks: 0,
        settle_ticks: 40_000,
        max_echoes: 3,
        blanking: Blanking::Internal,
        speed: 2_000,
        acceleration: 40_000,
        hold_s: 60,
    };
    let short = Settings { blanking: Blanking::Short { ticks: 1_200 }, ..settings };
    let plan = Sweep {
        sweep: 7,
        first_step: -200,
        stride: 1,
        stops: 400,
        pings_per_stop: 1,
        lease_ms: 1_000,
    };
    vec![
        ("identify", Request::Identify),
        ("stop", Request::Stop),
        ("reset", Request::Reset),
        ("configure", Request::Configure(settings)),
        ("configure-short-blanking", Request::Configure(short)),
        ("home", Request::Home),
        ("move-to", Request::MoveTo { step: -1_000_000 }),
        ("ping", Request::Ping),
        ("sweep", Request::Sweep(plan)),
        ("resend", Request::Resend { sweep: 7, first: 300, count: 5 }),
        ("keep-alive", Request::KeepAlive { sweep: 7, next: 128 }),
        ("status", Request::Status),
    ]
}

pub fn replies() -> Vec<(&'static str, Reply)> {
    vec![
        ("identity", Reply::Identity(identity())),
        ("ack", Reply::Ack),
        ("nak", Reply::Nak { reason: NakReason::NotHomed }),
        ("started", Reply::Started),
        ("homed", Reply::Homed { drift_steps: -3 }),
        ("reading-one-echo", Reply::Reading(reading(ReadingStatus::Echo, &[9_652]))),
        ("reading-no-echo", Reply::Reading(reading(ReadingStatus::NoEcho, &[]))),
        ("reading-eight-echoes", Reply::Reading(reading(ReadingStatus::Echo, &EIGHT))),
        (
            "alive",
            Reply::Alive(Alive {
                ticks: 123_456_789,
                sweep: 7,
                fired: 130,
                sent: 129,
                state: SweepState::Running,
            }),
        ),
        (
            "sweep-done",
            Reply::SweepDone(SweepDone { sweep: 7, fired: 400, end: SweepState::Complete }),
        ),
        ("status-report", Reply::StatusReport(status())),
        ("fault", Reply::Fault { kind: FaultKind::EmergencyStop }),
    ]
}

const EIGHT: [u32; 8] = [5_000, 10_000, 20_000, 40_000, 80_000, 160_000, 320_000, 640_000];

pub fn identity() -> Identity {
    Identity {
        protocol: ProtocolId { version: 1, schema: firmware_protocol::messages::SCHEMA_HASH },
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: *b"MOCK000001",
        boot: BOOT,
        last_seq: Some(0x41),
        tick_hz: 2_000_000,
        steps_per_revolution: 400,
        capabilities: Capabilities::INDEX_SENSOR.with(Capabilities::COIL_RELEASE),
        ring_bytes: 256,
        reset_cause: ResetCause::External,
    }
}

pub fn reading(status: ReadingStatus, echoes: &[u32]) -> Reading {
    let echoes = Echoes::from_ticks(echoes);
    Reading { sweep: 7, index: 129, step: -71, fired_ticks: 123_400_000, status, echoes }
}

fn status() -> Status {
    Status {
        ticks: 123_456_789,
        state: DeviceState::Sweeping,
        configured: true,
        homed: true,
        step: -71,
        sweep: 7,
        fired: 130,
        fault: None,
        dropped_checksum: 2,
        dropped_stuffing: 1,
        dropped_too_long: 0,
        dropped_line: 0,
        undecodable: 0,
        stale: 3,
    }
}
