use std::collections::BTreeMap;

use proptest::prelude::*;
use serde_json::{Value, json};

use crate::foxglove::{MOST_TEXT_BYTES, Session, Step, advertise};

/// The channels that there are in these tests.
fn is_there(channel: u32) -> bool {
    (1..=6).contains(&channel)
}

fn take(session: &mut Session, order: &Value) -> Vec<Step> {
    session.take_text(&order.to_string(), is_there)
}

fn subscribe(wishes: &[[u32; 2]]) -> Value {
    let wish = |[id, channel]: &[u32; 2]| json!({"id": id, "channelId": channel});
    json!({"op": "subscribe", "subscriptions": wishes.iter().map(wish).collect::<Vec<_>>()})
}

/// The words of a status, which must be the only step.
fn refusal(steps: &[Step]) -> String {
    let [Step::Say(text)] = steps else { panic!("{steps:?}") };
    let status: Value = serde_json::from_str(text).expect("JSON");
    assert_eq!((&status["op"], &status["level"]), (&json!("status"), &json!(2)));
    status["message"].as_str().expect("words").to_owned()
}

#[test]
fn who_subscribes_is_told_by_its_own_number() {
    let mut session = Session::default();
    assert_eq!(
        take(&mut session, &subscribe(&[[70, 3], [71, 1]])),
        [Step::Begin(3), Step::Begin(1)]
    );
    let frame = session.frame(3, 0x0102_0304_0506_0708, b"body").expect("subscribed");
    assert_eq!(frame, b"\x01\x46\0\0\0\x08\x07\x06\x05\x04\x03\x02\x01body");
    assert_eq!(session.frame(2, 0, b"body"), None);
    let order = json!({"op": "unsubscribe", "subscriptionIds": [70]});
    assert_eq!(take(&mut session, &order), [Step::Cease(3)]);
    assert_eq!((session.frame(3, 0, b""), session.channels().collect::<Vec<_>>()), (None, vec![1]));
    session.keep_only(|channel| channel == 2);
    assert_eq!(session.frame(1, 0, b""), None, "that channel is gone");
}

#[test]
fn what_makes_no_sense_is_refused_in_words_and_costs_nothing() {
    let mut session = Session::default();
    take(&mut session, &subscribe(&[[1, 1]]));
    let long = "x".repeat(MOST_TEXT_BYTES);
    for (text, words) in [
        ("{", "no message of the protocol"),
        ("", "no message of the protocol"),
        ("[]", "no message of the protocol"),
        (r#"{"op":7}"#, "no message of the protocol"),
        (r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#, "no message"),
        (r#"{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]}"#, "no message"),
        (r#"{"op":"subscribe","subscriptions":[{"id":2,"channelId":7}]}"#, "no channel 7"),
        (r#"{"op":"subscribe","subscriptions":[{"id":2,"channelId":1}]}"#, "already"),
        (r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]}"#, "of another channel"),
        (r#"{"op":"unsubscribe","subscriptionIds":[2]}"#, "no subscription 2"),
        (r#"{"op":"advertise","channels":[]}"#, "only tells"),
        (r#"{"op":"getParameters"}"#, "only tells"),
        (&format!(r#"{{"op":"{long}"}}"#), "at most 65536 bytes"),
        (&format!(r#"{{"op":"{}"}}"#, &long[20..]), "only tells"),
        (&"[".repeat(60_000), "no message of the protocol"),
    ] {
        let words_said = refusal(&session.take_text(text, is_there));
        let expected = words_said.contains(words) || words_said.chars().count() == 200;
        assert!(expected && words_said.chars().count() <= 200, "{words_said}");
    }
    assert!(refusal(&session.take_binary()).contains("only tells"));
    assert_eq!(session.channels().collect::<Vec<_>>(), [1]);
}

#[test]
fn ten_thousand_subscriptions_are_one_sentence_and_no_memory() {
    let mut session = Session::default();
    let wishes: Vec<[u32; 2]> = (0..2000).map(|number| [number, number]).collect();
    let steps = take(&mut session, &subscribe(&wishes));
    let said = steps.iter().filter(|step| matches!(step, Step::Say(_))).count();
    assert_eq!((steps.len(), said, session.channels().count()), (7, 1, 6), "{steps:?}");
    let Some(Step::Say(text)) = steps.last() else { panic!("{steps:?}") };
    assert!(text.contains("there is no channel 0, and 1993 more"), "{text}");
    let wishes: Vec<[u32; 2]> = (0..10_000).map(|number| [number, number]).collect();
    assert!(refusal(&take(&mut session, &subscribe(&wishes))).contains("at most"));
}

#[test]
fn who_goes_on_making_no_sense_is_shown_out() {
    let mut session = Session::default();
    let ended = (1..=100).find(|_| session.take_text("?", is_there).contains(&Step::End));
    assert_eq!(ended, Some(100));
}

#[test]
fn channels_declare_what_their_messages_are() {
    let mut live = crate::Live::new(crate::Settings::default());
    for record in super::scans::records_of_measured() {
        live.take(record, |_| ()).expect("a whole session");
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

/// Texts of a client, most of them nearly right.
fn text() -> impl Strategy<Value = String> {
    let wish =
        (0..12_u32, 0..9_u32).prop_map(|(id, channel)| json!({"id": id, "channelId": channel}));
    let wishes = prop::collection::vec(wish, 0..5);
    prop_oneof![
        4 => wishes.prop_map(|wishes| json!({"op": "subscribe", "subscriptions": wishes}).to_string()),
        3 => prop::collection::vec(0..12_u32, 0..5)
            .prop_map(|ids| json!({"op": "unsubscribe", "subscriptionIds": ids}).to_string()),
        1 => "\\PC{0,40}",
    ]
}

proptest! {
    /// Whatever is sent: what was begun and did not cease is what messages come of, each subscription by a number of
    /// its own, and only of channels that there are.
    #[test]
    fn steps_and_subscriptions_say_the_same(texts in prop::collection::vec(text(), 0..40)) {
        let (mut session, mut told) = (Session::default(), BTreeMap::new());
        for text in texts {
            for step in session.take_text(&text, is_there) {
                match step {
                    Step::Begin(channel) => prop_assert!(told.insert(channel, ()).is_none()),
                    Step::Cease(channel) => prop_assert!(told.remove(&channel).is_some()),
                    Step::Say(text) => prop_assert!(serde_json::from_str::<Value>(&text).is_ok()),
                    Step::End => {}
                }
            }
            prop_assert!(told.keys().all(|channel| is_there(*channel)));
            prop_assert!(session.channels().eq(told.keys().copied()));
            let numbers = session.channels().filter_map(|channel| session.frame(channel, 0, b""));
            let numbers: Vec<_> = numbers.collect();
            let distinct: std::collections::BTreeSet<_> = numbers.iter().collect();
            prop_assert_eq!(distinct.len(), told.len());
        }
    }
}
