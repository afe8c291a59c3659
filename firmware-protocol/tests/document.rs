//! Comparison of the tables, limits and examples in `PROTOCOL.md` with the code.

mod samples;

use firmware_protocol::device::DeviceTimer;
use firmware_protocol::frame::{Frame, Header};
use firmware_protocol::host::{self, HostTimer, IdentityFault, ReadingFault, ReplyFault};
use firmware_protocol::messages::{
    Alive, Blanking, Capabilities, DeviceState, FaultKind, Field, FirmwareVersion, Identity,
    NakReason, PROTOCOL_VERSION, ProtocolId, Reading, ReadingStatus, Reply, Request, ResetCause,
    SCHEMA_HASH, Settings, Status, Sweep, SweepDone, SweepState, Variant, Wire, limits,
};

const DOCUMENT: &str = include_str!("../PROTOCOL.md");

/// Returns the rows of the table after the line `title`, as trimmed cells.
fn table(title: &str) -> Vec<Vec<&'static str>> {
    let mut lines = DOCUMENT.lines().skip_while(|line| *line != title);
    assert!(lines.next().is_some(), "no table {title}");
    let rows: Vec<Vec<_>> = lines
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .skip(2)
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    assert!(!rows.is_empty(), "the table {title} is empty");
    rows
}

fn fields_text(fields: &[Field]) -> String {
    let texts: Vec<_> = fields
        .iter()
        .map(|field| match field.name {
            "" => field.kind.to_string(),
            name => format!("{name}: {}", field.kind),
        })
        .collect();
    texts.join(", ")
}

fn check_variants(title: &str, variants: &[Variant], with_fields: bool) {
    let rows = table(title);
    assert_eq!(rows.len(), variants.len(), "{title}");
    for (row, variant) in rows.iter().zip(variants) {
        assert_eq!(row[0], variant.code.to_string(), "{title}");
        assert_eq!(row[1], variant.name, "{title}");
        if with_fields {
            assert_eq!(row[2], fields_text(variant.fields), "{title} {}", variant.name);
        } else {
            assert!(variant.fields.is_empty(), "{title} {} has fields", variant.name);
        }
    }
}

#[test]
fn messages_match() {
    check_variants("### Requests", Request::VARIANTS, true);
    check_variants("### Replies", Reply::VARIANTS, true);
    check_variants("Blanking", Blanking::VARIANTS, true);
}

#[test]
fn codes_match() {
    check_variants("ReadingStatus", ReadingStatus::VARIANTS, false);
    check_variants("SweepState", SweepState::VARIANTS, false);
    check_variants("DeviceState", DeviceState::VARIANTS, false);
    check_variants("FaultKind", FaultKind::VARIANTS, false);
    check_variants("ResetCause", ResetCause::VARIANTS, false);
    check_variants("NakReason", NakReason::VARIANTS, false);
}

#[test]
fn records_match() {
    for (title, fields) in [
        ("ProtocolId", ProtocolId::FIELDS),
        ("FirmwareVersion", FirmwareVersion::FIELDS),
        ("Identity", Identity::FIELDS),
        ("Settings", Settings::FIELDS),
        ("Sweep", Sweep::FIELDS),
        ("Reading", Reading::FIELDS),
        ("Alive", Alive::FIELDS),
        ("SweepDone", SweepDone::FIELDS),
        ("Status", Status::FIELDS),
    ] {
        let documented: Vec<_> =
            table(title).iter().map(|row| format!("{}: {}", row[0], row[1])).collect();
        let coded: Vec<_> =
            fields.iter().map(|field| format!("{}: {}", field.name, field.kind)).collect();
        assert_eq!(documented, coded, "{title}");
    }
}

#[test]
fn capabilities_match() {
    let documented: Vec<_> = table("### Capabilities")
        .iter()
        .map(|row| (row[0].parse::<u16>().expect("a number"), row[1]))
        .collect();
    let coded: Vec<_> = Capabilities::NAMES.iter().map(|(bit, name)| (bit.0, *name)).collect();
    assert_eq!(documented, coded);
}

#[test]
fn limits_match() {
    let coded = [
        ("TICK_HZ", i64::from(limits::TICK_HZ)),
        ("POSITION_MAX", i64::from(limits::POSITION_MAX)),
        ("WINDOW_TICKS_MIN", i64::from(limits::WINDOW_TICKS_MIN)),
        ("WINDOW_TICKS_MAX", i64::from(limits::WINDOW_TICKS_MAX)),
        ("INTERVAL_TICKS_MAX", i64::from(limits::INTERVAL_TICKS_MAX)),
        ("SETTLE_TICKS_MAX", i64::from(limits::SETTLE_TICKS_MAX)),
        ("MAX_ECHOES", i64::from(limits::MAX_ECHOES)),
        ("SHORT_BLANKING_TICKS_MIN", i64::from(limits::SHORT_BLANKING_TICKS_MIN)),
        ("SHORT_BLANKING_TICKS_MAX", i64::from(limits::SHORT_BLANKING_TICKS_MAX)),
        ("SPEED_MAX", i64::from(limits::SPEED_MAX)),
        ("ACCELERATION_MAX", i64::from(limits::ACCELERATION_MAX)),
        ("HOLD_S_MAX", i64::from(limits::HOLD_S_MAX)),
        ("LEASE_MS_MIN", i64::from(limits::LEASE_MS_MIN)),
        ("BEAMS_MAX", i64::from(limits::BEAMS_MAX)),
        ("RING_BYTES", i64::from(limits::RING_BYTES)),
        ("KEPT_READING_BYTES", i64::from(limits::KEPT_READING_BYTES)),
        ("KEPT_ECHO_BYTES", i64::from(limits::KEPT_ECHO_BYTES)),
    ];
    let documented: Vec<_> = table("### Limits")
        .iter()
        .map(|row| (row[0], row[1].parse::<i64>().expect("a number")))
        .collect();
    assert_eq!(documented, coded);
}

#[test]
fn timers_match() {
    let device =
        [DeviceTimer::Settle, DeviceTimer::MinInterval, DeviceTimer::Lease, DeviceTimer::Hold];
    let host = [HostTimer::Reply, HostTimer::Completion, HostTimer::KeepAlive, HostTimer::Progress];
    let coded: Vec<_> = device
        .iter()
        .map(|timer| (format!("{timer:?}"), "device"))
        .chain(host.iter().map(|timer| (format!("{timer:?}"), "host")))
        .collect();
    let documented: Vec<_> =
        table("## Timers").iter().map(|row| (row[0].to_string(), row[1])).collect();
    assert_eq!(documented, coded);
}

#[test]
fn timer_constants_match() {
    let coded = [
        ("ATTEMPTS", u32::from(host::ATTEMPTS)),
        ("OVERRUNS", u32::from(host::OVERRUNS)),
        ("STOP_ATTEMPTS", u32::from(host::STOP_ATTEMPTS)),
        ("INITIAL_MARGIN_US", host::INITIAL_MARGIN_US),
        ("MIN_MARGIN_US", host::MIN_MARGIN_US),
        ("MAX_MARGIN_US", host::MAX_MARGIN_US),
        ("KEEP_ALIVES_PER_LEASE", u32::from(host::KEEP_ALIVES_PER_LEASE)),
        ("ACKNOWLEDGEMENTS_PER_RING", u32::from(host::ACKNOWLEDGEMENTS_PER_RING)),
        ("READINGS_AHEAD", u32::from(host::READINGS_AHEAD)),
        ("SEQ_GAP_MAX", u32::from(host::SEQ_GAP_MAX)),
    ];
    let documented: Vec<_> = table("### Timer constants")
        .iter()
        .map(|row| (row[0], row[1].parse::<u32>().expect("a number")))
        .collect();
    assert_eq!(documented, coded);
}

/// Every fault in the code has a row in the document, and every row a fault in the code.
#[test]
fn faults_match() {
    let names = |title| table(title).iter().map(|row| row[0].to_owned()).collect::<Vec<_>>();
    let name = |fault: &dyn core::fmt::Debug| {
        format!("{fault:?}").split([' ', '{']).next().expect("a name").to_owned()
    };
    let identity = [
        IdentityFault::Form,
        IdentityFault::BootZero,
        IdentityFault::BootNotOfFrame { frame: 0, identity: 0 },
        IdentityFault::TickRate { tick_hz: 0 },
        IdentityFault::NoSteps,
        IdentityFault::RingTooSmall { ring_bytes: 0, needed: 0 },
    ];
    let reading = [
        ReadingFault::EchoMissing,
        ReadingFault::EchoUnexpected { echoes: 1 },
        ReadingFault::TooManyEchoes { echoes: 1, requested: 0 },
        ReadingFault::EchoAfterWindow { ticks: 1, window: 0 },
        ReadingFault::EchoesOutOfOrder,
        ReadingFault::FiredTooEarly { ticks: 1 },
        ReadingFault::FiredInFuture { ticks: 1 },
    ];
    let reply = [
        ReplyFault::Drift { drift_steps: 1 },
        ReplyFault::Position { step: 1 },
        ReplyFault::Progress { fired: 1, sent: 0, beams: 0 },
    ];
    let coded: Vec<_> = identity.iter().map(|fault| name(fault)).collect();
    assert_eq!(names("An Identity (the device is not used):"), coded);
    let title = "A reading (in a sweep the beam counts as lost, is not requested again, and the \
                 sweep continues; a Ping fails):";
    let coded: Vec<_> = reading.iter().map(|fault| name(fault)).collect();
    assert_eq!(names(title), coded);
    let coded: Vec<_> = reply.iter().map(|fault| name(fault)).collect();
    assert_eq!(names("A reply to a command (the command fails; a sweep is stopped first):"), coded);
}

#[test]
fn version_and_schema_match() {
    let line = format!("Version {PROTOCOL_VERSION}, schema `{SCHEMA_HASH:08x}`.");
    assert!(DOCUMENT.contains(&line), "the document should contain: {line}");
}

/// Checks the blocks marked `hex`: a line that names a sample and its header, then a line of bytes.
#[test]
fn examples_match() {
    let mut examples = 0;
    let mut inside = false;
    let mut lines = DOCUMENT.lines();
    while let Some(line) = lines.next() {
        match line {
            "```hex" => inside = true,
            "```" => inside = false,
            title if inside => {
                let bytes = lines.next().expect("bytes below the title");
                assert_eq!(bytes, example(title), "{title}");
                examples += 1;
            }
            _ => {}
        }
    }
    assert_eq!(examples, 4);
}

fn example(title: &str) -> String {
    let words: Vec<_> = title.split(' ').collect();
    let [kind, name, "boot", boot, "seq", seq] = words[..] else { panic!("odd title: {title}") };
    let number = |text| u16::from_str_radix(text, 16).expect("four hex digits");
    let header = Header { boot: number(boot), seq: number(seq) };
    let frame = match kind {
        "request" => encode(header, &samples::requests(), name),
        "reply" => encode(header, &samples::replies(), name),
        other => panic!("neither request nor reply: {other}"),
    };
    let bytes: Vec<_> = frame.iter().map(|byte| format!("{byte:02x}")).collect();
    bytes.join(" ")
}

fn encode<M: Wire>(header: Header, samples: &[(&str, M)], name: &str) -> Frame {
    let (_, message) = samples.iter().find(|(sample, _)| *sample == name).expect("a sample");
    Frame::encode(header, message).expect("fits")
}
