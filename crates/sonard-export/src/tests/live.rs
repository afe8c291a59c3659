use std::collections::BTreeMap;

use sonard_records::{PingStatus, Record};

use crate::{Distribution, Export as _, ExportSettings, LiveConverter, McapExport, Topic};

use super::scans::{measured, measured_records, of_array};

type Messages = BTreeMap<String, Vec<(u64, Vec<u8>)>>;

fn converted(records: impl IntoIterator<Item = Record>) -> (LiveConverter, Messages) {
    converted_with(ExportSettings::default(), records)
}

fn converted_with(
    settings: ExportSettings,
    records: impl IntoIterator<Item = Record>,
) -> (LiveConverter, Messages) {
    let (mut live, mut messages) = (LiveConverter::new(settings), Messages::new());
    for record in records {
        live.convert(record, |message| {
            let copy = (message.at_ns, message.bytes.to_vec());
            messages.entry(message.topic.to_owned()).or_default().push(copy);
        })
        .expect("a whole session");
    }
    (live, messages)
}

/// Messages of a recording of the same scans.
fn recorded() -> Messages {
    let mut bytes = Vec::new();
    let mut export =
        Box::new(McapExport::new(&mut bytes, ExportSettings::default()).expect("memory"));
    for scan in measured() {
        export.scan("small.jsonl", &scan).expect("memory");
    }
    export.finish().expect("memory");
    let mut messages = Messages::new();
    for message in mcap::MessageStream::new(&bytes).expect("a recording") {
        let message = message.expect("a message");
        let read = (message.log_time, message.data.into_owned());
        messages.entry(message.channel.topic.clone()).or_default().push(read);
    }
    messages
}

#[test]
fn matches_recording() {
    let (live, converted) = converted(measured_records());
    let recorded = recorded();
    assert!(converted.len() > 6, "{:?}", converted.keys());
    assert_eq!(converted.keys().collect::<Vec<_>>(), recorded.keys().collect::<Vec<_>>());
    for (topic, messages) in &converted {
        assert!(messages == &recorded[topic], "{topic}");
    }
    let topics: Vec<_> = live.topics().iter().map(|topic| topic.name.as_str()).collect();
    assert!(converted.keys().all(|topic| topics.contains(&topic.as_str())), "{topics:?}");
}

#[test]
fn topics_follow_the_session() {
    let scan = of_array().remove(0);
    let session = scan.session.as_deref().expect("it has one").clone();
    let (live, _) = converted([Record::Session(Box::new(session))]);
    let names: Vec<_> = live.topics().iter().map(|topic| topic.name.as_str()).collect();
    assert!(names.contains(&"/sonar/s0/range") && !names.contains(&"/sonar/scan"), "{names:?}");
    assert!(live.topics().iter().all(|topic| topic.is_retained != topic.name.ends_with("/range")));
    assert_eq!(LiveConverter::new(ExportSettings::default()).topics(), []);
}

#[test]
fn expected_topics_match_session() {
    let jazzy = Distribution::Jazzy;
    let (live, _) = converted(measured_records());
    let draws =
        |live: &LiveConverter| live.topics().iter().any(|topic| topic.name == "/sonar/scene");
    let predicts =
        |live: &LiveConverter| live.topics().iter().any(|topic| topic.name == "/sonar/residual");
    assert!(predicts(&live));
    assert_eq!(Topic::expected(None, true, draws(&live), jazzy), live.topics());

    let session = of_array().remove(0).session.expect("it has one");
    let mut live = LiveConverter::new(ExportSettings::default());
    live.convert(Record::Session(Box::new((*session).clone())), |_| {}).expect("a whole session");
    let expected = Topic::expected(session.array.as_ref(), predicts(&live), draws(&live), jazzy);
    assert_eq!(expected, live.topics());
}

#[test]
fn humble_range_lacks_variance() {
    let humble = ExportSettings { distribution: Distribution::Humble, ..ExportSettings::default() };
    let (live, of_humble) = converted_with(humble, measured_records());
    let (_, of_jazzy) = converted(measured_records());
    for (topic, messages) in &of_jazzy {
        let less = if topic.ends_with("/range") { 4 } else { 0 };
        let cut = messages.iter().map(|(at, bytes)| (*at, bytes[..bytes.len() - less].to_vec()));
        assert!(of_humble[topic] == cut.collect::<Vec<_>>(), "{topic}");
    }
    let range = live.topics().iter().find(|topic| topic.name == "/sonar/range").expect("there");
    assert!(!range.definition().contains("variance"));
}

#[test]
fn robot_placement_is_optional() {
    let elsewhere = ExportSettings { places_robot: false, ..ExportSettings::default() };
    let (_, placed) = converted_with(elsewhere, measured_records());
    let (_, all) = converted(measured_records());
    let has = |bytes: &[u8], name: &[u8]| bytes.windows(name.len()).any(|part| part == name);
    assert_eq!(placed["/tf"].len(), all["/tf"].len());
    assert!(all["/tf"].iter().all(|(_, bytes)| has(bytes, b"map\0") && has(bytes, b"base_link\0")));
    assert!(placed["/tf"].iter().all(|(_, bytes)| !has(bytes, b"map\0") && has(bytes, b"sonar\0")));
    assert_eq!(placed["/tf_static"], all["/tf_static"]);
}

#[test]
fn invalid_session_has_no_topics() {
    let scan = measured().remove(0);
    let mut session = scan.session.as_deref().expect("it has one").clone();
    session.sensor.frequency_hz = -1.0;
    let mut live = LiveConverter::new(ExportSettings::default());
    let reject = |_: crate::LiveMessage<'_>| panic!("no message expected");
    assert!(live.convert(Record::Session(Box::new(session)), reject).is_err());
    assert_eq!(live.topics(), []);
    for record in measured_records().into_iter().skip(1) {
        live.convert(record, reject).expect("skipped");
    }
}

#[test]
fn long_scans_have_only_readings() {
    let records = measured_records();
    let at = records
        .iter()
        .position(|record| matches!(record, Record::Ping(ping) if ping.status == PingStatus::Echo));
    let at = at.expect("a reading");
    let Record::Ping(ping) = &records[at] else { panic!("a reading") };
    let more = (0..10_000_u32).map(|index| {
        let mut ping = ping.clone();
        ping.index = index;
        Record::Ping(ping)
    });
    let before = records[..at].iter().cloned();
    let (_, messages) = converted(before.chain(more).chain(records[at..].iter().cloned()));
    assert!(messages["/sonar/range"].len() > 10_000);
    assert!(!messages.contains_key("/sonar/points") && !messages.contains_key("/sonar/scan"));
}
