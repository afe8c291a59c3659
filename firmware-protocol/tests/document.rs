//! `PROTOCOL.md` must say what the code does: its tables, limits and examples are read here
//! and compared.

mod samples;

use firmware_protocol::device::DeviceTimer;
use firmware_protocol::frame::{Frame, Header};
use firmware_protocol::host::HostTimer;
use firmware_protocol::messages::{
    Alive, Blanking, Capabilities, DeviceState, FaultKind, Field, FirmwareVersion, Identity,
    NakReason, PROTOCOL_VERSION, ProtocolId, Reading, ReadingStatus, Reply, Request, ResetCause,
    SCHEMA_HASH, Settings, Status, Sweep, SweepDone, SweepState, Variant, Wire, limits,
};

const DOCUMENT: &str = include_str!("../PROTOCOL.md");

/// The rows of the table that follows the line `title`, as trimmed cells.
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
fn messages_are_as_documented() {
    check_variants("### Requests", Request::VARIANTS, true);
    check_variants("### Replies", Reply::VARIANTS, true);
    check_variants("Blanking", Blanking::VARIANTS, true);
}

#[test]
fn codes_are_as_documented() {
    check_variants("ReadingStatus", ReadingStatus::VARIANTS, false);
    check_variants("SweepState", SweepState::VARIANTS, false);
    check_variants("DeviceState", DeviceState::VARIANTS, false);
    check_variants("FaultKind", FaultKind::VARIANTS, false);
    check_variants("ResetCause", ResetCause::VARIANTS, false);
    check_variants("NakReason", NakReason::VARIANTS, false);
}

#[test]
fn records_are_as_documented() {
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
fn capabilities_are_as_documented() {
    let documented: Vec<_> = table("### Capabilities")
        .iter()
        .map(|row| (row[0].parse::<u16>().expect("a number"), row[1]))
        .collect();
    let coded: Vec<_> = Capabilities::NAMES.iter().map(|(bit, name)| (bit.0, *name)).collect();
    assert_eq!(documented, coded);
}

#[test]
fn limits_are_as_documented() {
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
fn timers_are_as_documented() {
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
fn version_and_schema_are_as_documented() {
    let line = format!("Version {PROTOCOL_VERSION}, schema `{SCHEMA_HASH:08x}`.");
    assert!(DOCUMENT.contains(&line), "the document should say: {line}");
}

/// The blocks marked `hex`: a line that names a sample and its header, a line of bytes.
#[test]
fn examples_are_as_documented() {
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
