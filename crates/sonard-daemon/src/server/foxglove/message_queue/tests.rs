use proptest::prelude::*;
use serde_json::{Value, json};
use sonard_export::{ExportSettings, LiveConverter};
use sonard_records::{Record, decode_line};

use super::*;

const LOG: &str = include_str!("../../../../../../tests/fixtures/small.jsonl");

/// Topics of a scanning ranger.
fn topics() -> Vec<Topic> {
    let mut live = LiveConverter::new(ExportSettings::default());
    let record = decode_line(LOG.lines().next().expect("a session").as_bytes()).expect("clean");
    assert!(matches!(record, Record::Session(_)));
    live.convert(record, |_| ()).expect("a whole session");
    live.topics().to_vec()
}

fn queue(max_bytes: usize) -> ViewerQueue {
    let mut queue = ViewerQueue::new(max_bytes);
    queue.set_topics(&topics());
    queue
}

fn put(queue: &mut ViewerQueue, topic: &str, number: u64, bytes: usize) {
    queue.put(&LiveMessage { topic, at_ns: number, bytes: &vec![7; bytes] });
}

/// Everything that a viewer receives until the queue is empty.
#[derive(Debug, Default)]
struct Received {
    texts: Vec<Value>,
    /// Subscription and time of each message.
    messages: Vec<(u32, u64)>,
    is_closed: bool,
}

impl Received {
    fn read_all(viewer: &mut Viewer, queue: &ViewerQueue) -> Self {
        let mut received = Self::default();
        loop {
            match viewer.next(queue) {
                Delivery::Message(Outgoing::Text(text)) => {
                    received.texts.push(serde_json::from_str(&text).expect("JSON"));
                }
                Delivery::Message(Outgoing::Binary(frame)) => {
                    let id = u32::from_le_bytes(frame[1..5].try_into().expect("four"));
                    let at_ns = u64::from_le_bytes(frame[5..13].try_into().expect("eight"));
                    received.messages.push((id, at_ns));
                }
                Delivery::Nothing => return received,
                Delivery::Closed | Delivery::Rejected => {
                    received.is_closed = true;
                    return received;
                }
            }
        }
    }

    fn times(&self, id: u32) -> Vec<u64> {
        let messages = self.messages.iter().filter(|(subscription, _)| *subscription == id);
        messages.map(|(_, at_ns)| *at_ns).collect()
    }

    fn left_out(&self) -> u64 {
        let texts = self.texts.iter().filter_map(|text| text["message"].as_str());
        let counts = texts.filter_map(|texts| texts.strip_suffix(" messages left out"));
        counts.map(|count| count.parse::<u64>().expect("a number")).sum()
    }
}

fn channel(queue: &ViewerQueue, topic: &str) -> u32 {
    let found = queue.channels.iter().find(|(_, channel)| channel.topic.name == topic);
    *found.expect("a channel").0
}

fn subscribe(viewer: &mut Viewer, queue: &ViewerQueue, topic: &str, id: u32) {
    let wish = json!({"id": id, "channelId": channel(queue, topic)});
    let order = json!({"op": "subscribe", "subscriptions": [wish]});
    viewer.take_text(&order.to_string(), queue);
}

#[test]
fn greeting_and_channels() {
    let mut queue = ViewerQueue::new(1000);
    let mut early = Viewer::new(&queue, "{\"op\":\"serverInfo\"}".into());
    let received = Received::read_all(&mut early, &queue);
    assert_eq!(received.texts[0]["op"], "serverInfo");
    assert!(
        received.texts[1]["message"].as_str().is_some_and(|texts| texts.contains("first scan"))
    );
    queue.set_topics(&topics());
    let received = Received::read_all(&mut early, &queue);
    assert_eq!((received.texts.len(), &received.texts[0]["op"]), (1, &json!("advertise")));
    let mut late = Viewer::new(&queue, "{\"op\":\"serverInfo\"}".into());
    let ops: Vec<_> =
        Received::read_all(&mut late, &queue).texts.iter().map(|text| text["op"].clone()).collect();
    assert_eq!(ops, ["serverInfo", "advertise"]);
    queue.close();
    assert!(Received::read_all(&mut late, &queue).is_closed);
}

#[test]
fn late_viewer_gets_latched_only() {
    let mut queue = queue(1000);
    for number in 0..10 {
        put(&mut queue, "/tf_static", number, 10);
        put(&mut queue, "/sonar/range", number, 10);
    }
    let mut late = Viewer::new(&queue, "{}".into());
    subscribe(&mut late, &queue, "/tf_static", 1);
    subscribe(&mut late, &queue, "/sonar/range", 2);
    let received = Received::read_all(&mut late, &queue);
    assert_eq!((received.times(1), received.times(2)), (vec![9], vec![]));
    put(&mut queue, "/tf_static", 10, 10);
    put(&mut queue, "/sonar/range", 10, 10);
    let received = Received::read_all(&mut late, &queue);
    assert_eq!(
        (received.times(1), received.times(2), received.left_out()),
        (vec![10], vec![10], 0)
    );
}

#[test]
fn slow_viewer_gets_drop_count() {
    let mut queue = queue(2000);
    let mut slow = Viewer::new(&queue, "{}".into());
    for (topic, id) in [("/sonar/range", 1), ("/tf_static", 2), ("/sonar/points", 3)] {
        subscribe(&mut slow, &queue, topic, id);
    }
    put(&mut queue, "/tf_static", 0, 10);
    put(&mut queue, "/tf_static", 1, 10);
    for number in 0..100 {
        put(&mut queue, "/sonar/range", number, 100);
    }
    let received = Received::read_all(&mut slow, &queue);
    let ranges = received.times(1);
    assert!(ranges.len() > 5 && ranges.len() < 20 && ranges.last() == Some(&99), "{ranges:?}");
    assert_eq!((received.times(2), received.times(3)), (vec![1], vec![]));
    // The first latched message, and the ranges.
    assert_eq!(received.left_out(), 1 + 100 - ranges.len() as u64);
}

#[test]
fn oversized_messages_are_counted() {
    let mut queue = queue(10 << 20);
    let mut viewer = Viewer::new(&queue, "{}".into());
    subscribe(&mut viewer, &queue, "/sonar/points", 1);
    for (number, bytes) in [(0, 10), (1, MAX_MESSAGE_BYTES + 1), (2, MAX_MESSAGE_BYTES)] {
        put(&mut queue, "/sonar/points", number, bytes);
    }
    let received = Received::read_all(&mut viewer, &queue);
    assert_eq!((received.times(1), received.left_out()), (vec![0, 2], 1));
}

#[test]
fn removed_topics_end_subscriptions() {
    let mut queue = queue(1000);
    let mut viewer = Viewer::new(&queue, "{}".into());
    subscribe(&mut viewer, &queue, "/sonar/scan", 1);
    drop(Received::read_all(&mut viewer, &queue));
    let before = channel(&queue, "/sonar/scan");
    let others: Vec<Topic> =
        topics().into_iter().filter(|topic| topic.name != "/sonar/scan").collect();
    queue.set_topics(&others);
    let received = Received::read_all(&mut viewer, &queue);
    assert_eq!(received.texts, [json!({"op": "unadvertise", "channelIds": [before]})]);
    queue.set_topics(&topics());
    assert!(channel(&queue, "/sonar/scan") > before);
    put(&mut queue, "/sonar/scan", 0, 10);
    let received = Received::read_all(&mut viewer, &queue);
    assert_eq!((received.messages.len(), &received.texts[0]["op"]), (0, &json!("advertise")));
}

#[test]
fn memory_is_bounded() {
    let mut queue = queue(1 << 20);
    let asleep: Vec<Viewer> = (0..100)
        .map(|_| {
            let mut viewer = Viewer::new(&queue, "{}".into());
            topics().iter().zip(1..).for_each(|(topic, id)| {
                subscribe(&mut viewer, &queue, &topic.name, id);
            });
            viewer
        })
        .collect();
    for number in 0..20_000 {
        put(&mut queue, "/sonar/range", number, 100);
        put(&mut queue, "/tf", number, 200);
    }
    let numbers = queue.messages.first()..queue.messages.end();
    let messages = numbers.filter_map(|number| queue.messages.get(number));
    let bytes: usize = messages.map(|message| message.bytes.len()).sum();
    assert!((1 << 18..=1 << 20).contains(&bytes), "{bytes} bytes wait");
    let held = asleep.iter().map(|viewer| viewer.texts.len() + viewer.latched_due.len());
    assert!(held.max() <= Some(3), "a sleeping viewer holds nothing");
}

/// Operation on a queue.
#[derive(Debug, Clone)]
enum Operation {
    Put { topic: usize, bytes: usize },
    Subscribe(usize),
    Unsubscribe(usize),
    Look { times: usize },
}

fn operation() -> impl Strategy<Value = Operation> {
    prop_oneof![
        6 => (0..4_usize, 0..300_usize).prop_map(|(topic, bytes)| Operation::Put { topic, bytes }),
        1 => (0..4_usize).prop_map(Operation::Subscribe),
        1 => (0..4_usize).prop_map(Operation::Unsubscribe),
        3 => (0..6_usize).prop_map(|times| Operation::Look { times }),
    ]
}

proptest! {
    /// In any order of operations, each message published while a viewer is subscribed is received
    /// once, in order, or counted as left out.
    #[test]
    fn messages_arrive_once_or_count(steps in prop::collection::vec(operation(), 0..200)) {
        // Latched topics are excluded: their messages can be sent again.
        let names = ["/sonar/range", "/sonar/residual", "/sonar/predicted/range"];
        let mut queue = queue(1500);
        let mut viewer = Viewer::new(&queue, "{}".into());
        let mut all = Received::default();
        let (mut expected, mut subscribed) = (0, [false; 4]);
        let mut look = |viewer: &mut Viewer, queue: &ViewerQueue, times: usize| {
            for _ in 0..times {
                match viewer.next(queue) {
                    Delivery::Message(Outgoing::Text(text)) => {
                        all.texts.push(serde_json::from_str(&text).expect("JSON"));
                    }
                    Delivery::Message(Outgoing::Binary(frame)) => {
                        let id = u32::from_le_bytes(frame[1..5].try_into().expect("four"));
                        let at_ns = u64::from_le_bytes(frame[5..13].try_into().expect("eight"));
                        all.messages.push((id, at_ns));
                    }
                    Delivery::Nothing | Delivery::Closed | Delivery::Rejected => break,
                }
            }
        };
        for (number, step) in (0..).zip(steps) {
            match step {
                Operation::Put { topic, bytes } => {
                    let Some(name) = names.get(topic) else { continue };
                    put(&mut queue, name, number, bytes);
                    expected += u64::from(subscribed[topic]);
                }
                Operation::Subscribe(topic) => {
                    let Some(name) = names.get(topic) else { continue };
                    subscribe(&mut viewer, &queue, name, topic as u32);
                    subscribed[topic] = true;
                }
                Operation::Unsubscribe(topic) => {
                    // Unsubscribing discards queued messages, so they are read first.
                    look(&mut viewer, &queue, usize::MAX);
                    let order = json!({"op": "unsubscribe", "subscriptionIds": [topic]});
                    viewer.take_text(&order.to_string(), &queue);
                    subscribed[topic] = false;
                }
                Operation::Look { times } => look(&mut viewer, &queue, times),
            }
        }
        look(&mut viewer, &queue, usize::MAX);
        prop_assert_eq!(all.messages.len() as u64 + all.left_out(), expected);
        for id in 0..3 {
            prop_assert!(all.times(id).is_sorted_by(|a, b| a < b));
        }
    }
}
