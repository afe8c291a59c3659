use std::collections::BTreeMap;

use proptest::prelude::*;
use serde_json::{Value, json};

use crate::foxglove::{MAX_TEXT_BYTES, ViewerAction, ViewerSession, advertise};

/// Channels that exist in these tests.
fn is_there(channel: u32) -> bool {
    (1..=6).contains(&channel)
}

fn take(session: &mut ViewerSession, order: &Value) -> Vec<ViewerAction> {
    session.handle_text(&order.to_string(), is_there)
}

fn subscribe(requests: &[[u32; 2]]) -> Value {
    let request = |[id, channel]: &[u32; 2]| json!({"id": id, "channelId": channel});
    json!({"op": "subscribe", "subscriptions": requests.iter().map(request).collect::<Vec<_>>()})
}

/// Returns the message of a status, which must be the only step.
fn rejection(steps: &[ViewerAction]) -> String {
    let [ViewerAction::SendText(text)] = steps else { panic!("{steps:?}") };
    let status: Value = serde_json::from_str(text).expect("JSON");
    assert_eq!((&status["op"], &status["level"]), (&json!("status"), &json!(2)));
    status["message"].as_str().expect("words").to_owned()
}

#[test]
fn subscribes_and_frames_messages() {
    let mut session = ViewerSession::default();
    assert_eq!(
        take(&mut session, &subscribe(&[[70, 3], [71, 1]])),
        [ViewerAction::StartChannel(3), ViewerAction::StartChannel(1)]
    );
    let frame = session.frame(3, 0x0102_0304_0506_0708, b"body").expect("subscribed");
    assert_eq!(frame, b"\x01\x46\0\0\0\x08\x07\x06\x05\x04\x03\x02\x01body");
    assert_eq!(session.frame(2, 0, b"body"), None);
    let order = json!({"op": "unsubscribe", "subscriptionIds": [70]});
    assert_eq!(take(&mut session, &order), [ViewerAction::StopChannel(3)]);
    assert_eq!((session.frame(3, 0, b""), session.channels().collect::<Vec<_>>()), (None, vec![1]));
    session.retain_channels(|channel| channel == 2);
    assert_eq!(session.frame(1, 0, b""), None, "the channel no longer exists");
}

#[test]
fn rejects_invalid_messages() {
    let mut session = ViewerSession::default();
    take(&mut session, &subscribe(&[[1, 1]]));
    let long = "x".repeat(MAX_TEXT_BYTES);
    for (text, words) in [
        ("{", "invalid message"),
        ("", "invalid message"),
        ("[]", "invalid message"),
        (r#"{"op":7}"#, "invalid message"),
        (r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#, "invalid message"),
        (
            r#"{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]}"#,
            "invalid message",
        ),
        (r#"{"op":"subscribe","subscriptions":[{"id":2,"channelId":7}]}"#, "unknown channel 7"),
        (r#"{"op":"subscribe","subscriptions":[{"id":2,"channelId":1}]}"#, "already"),
        (r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]}"#, "for another channel"),
        (r#"{"op":"unsubscribe","subscriptionIds":[2]}"#, "unknown subscription 2"),
        (r#"{"op":"advertise","channels":[]}"#, "only publishes"),
        (r#"{"op":"getParameters"}"#, "only publishes"),
        (&format!(r#"{{"op":"{long}"}}"#), "at most 65536 bytes"),
        (&format!(r#"{{"op":"{}"}}"#, &long[20..]), "only publishes"),
        (&"[".repeat(60_000), "invalid message"),
    ] {
        let message = rejection(&session.handle_text(text, is_there));
        let is_expected = message.contains(words) || message.chars().count() == 200;
        assert!(is_expected && message.chars().count() <= 200, "{message}");
    }
    assert!(rejection(&session.handle_binary()).contains("only publishes"));
    assert_eq!(session.channels().collect::<Vec<_>>(), [1]);
}

#[test]
fn bounds_subscriptions() {
    let mut session = ViewerSession::default();
    let requests: Vec<[u32; 2]> = (0..2000).map(|number| [number, number]).collect();
    let steps = take(&mut session, &subscribe(&requests));
    let statuses = steps.iter().filter(|step| matches!(step, ViewerAction::SendText(_))).count();
    assert_eq!((steps.len(), statuses, session.channels().count()), (7, 1, 6), "{steps:?}");
    let Some(ViewerAction::SendText(text)) = steps.last() else { panic!("{steps:?}") };
    assert!(text.contains("unknown channel 0, and 1993 more"), "{text}");
    let requests: Vec<[u32; 2]> = (0..10_000).map(|number| [number, number]).collect();
    assert!(rejection(&take(&mut session, &subscribe(&requests))).contains("at most"));
}

#[test]
fn closes_after_repeated_faults() {
    let mut session = ViewerSession::default();
    let ended =
        (1..=100).find(|_| session.handle_text("?", is_there).contains(&ViewerAction::Close));
    assert_eq!(ended, Some(100));
}

#[test]
fn advertises_message_types() {
    let mut live = crate::LiveConverter::new(crate::ExportSettings::default());
    for record in super::scans::measured_records() {
        live.convert(record, |_| ()).expect("a whole session");
    }
    let text = advertise((1..).zip(live.topics()));
    let advertised: Value = serde_json::from_str(&text).expect("JSON");
    let channels = advertised["channels"].as_array().expect("channels");
    assert_eq!(channels.len(), live.topics().len());
    let range = channels.iter().find(|one| one["topic"] == "/sonar/range").expect("it");
    assert_eq!((&range["encoding"], &range["schemaEncoding"]), (&json!("cdr"), &json!("ros2msg")));
    assert_eq!(range["schemaName"], "sensor_msgs/msg/Range");
    assert!(range["schema"].as_str().is_some_and(|text| text.contains("float32 variance")));
}

/// Client messages, most of them nearly valid.
fn text() -> impl Strategy<Value = String> {
    let request =
        (0..12_u32, 0..9_u32).prop_map(|(id, channel)| json!({"id": id, "channelId": channel}));
    let requests = prop::collection::vec(request, 0..5);
    prop_oneof![
        4 => requests.prop_map(|requests| json!({"op": "subscribe", "subscriptions": requests}).to_string()),
        3 => prop::collection::vec(0..12_u32, 0..5)
            .prop_map(|ids| json!({"op": "unsubscribe", "subscriptionIds": ids}).to_string()),
        1 => "\\PC{0,40}",
    ]
}

proptest! {
    /// Channels that were begun and not ceased are those with messages, each with a distinct
    /// subscription id.
    #[test]
    fn steps_match_subscriptions(texts in prop::collection::vec(text(), 0..40)) {
        let (mut session, mut begun) = (ViewerSession::default(), BTreeMap::new());
        for text in texts {
            for step in session.handle_text(&text, is_there) {
                match step {
                    ViewerAction::StartChannel(channel) => prop_assert!(begun.insert(channel, ()).is_none()),
                    ViewerAction::StopChannel(channel) => prop_assert!(begun.remove(&channel).is_some()),
                    ViewerAction::SendText(text) => prop_assert!(serde_json::from_str::<Value>(&text).is_ok()),
                    ViewerAction::Close => {}
                }
            }
            prop_assert!(begun.keys().all(|channel| is_there(*channel)));
            prop_assert!(session.channels().eq(begun.keys().copied()));
            let numbers = session.channels().filter_map(|channel| session.frame(channel, 0, b""));
            let numbers: Vec<_> = numbers.collect();
            let distinct: std::collections::BTreeSet<_> = numbers.iter().collect();
            prop_assert_eq!(distinct.len(), begun.len());
        }
    }
}
