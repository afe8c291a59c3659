use proptest::prelude::*;
use serde_json::{Value, json};
use sonard_export::{Live, Settings};
use sonard_records::{Record, decode_line};

use super::*;

const LOG: &str = include_str!("../../../../../../tests/fixtures/small.jsonl");

/// The topics of a ranger that turns.
fn topics() -> Vec<Topic> {
    let mut live = Live::new(Settings::default());
    let record = decode_line(LOG.lines().next().expect("a session").as_bytes()).expect("clean");
    assert!(matches!(record, Record::Session(_)));
    live.take(record, |_| ()).expect("a whole session");
    live.topics().to_vec()
}

fn queue(most_bytes: usize) -> MessageQueue {
    let mut queue = MessageQueue::new(most_bytes);
    queue.set_topics(&topics());
    queue
}

fn put(queue: &mut MessageQueue, topic: &str, number: u64, bytes: usize) {
    queue.put(&LiveMessage { topic, at_ns: number, bytes: &vec![7; bytes] });
}

/// What a viewer is told until there is nothing more.
#[derive(Debug, Default)]
struct Told {
    texts: Vec<Value>,
    /// Subscription and time of each message.
    messages: Vec<(u32, u64)>,
    is_over: bool,
}

impl Told {
    fn of(viewer: &mut Viewer, queue: &MessageQueue) -> Self {
        let mut told = Self::default();
        loop {
            match viewer.look(queue) {
                Found::Something(Outgoing::Text(text)) => {
                    told.texts.push(serde_json::from_str(&text).expect("JSON"));
                }
                Found::Something(Outgoing::Binary(frame)) => {
                    let id = u32::from_le_bytes(frame[1..5].try_into().expect("four"));
                    let at_ns = u64::from_le_bytes(frame[5..13].try_into().expect("eight"));
                    told.messages.push((id, at_ns));
                }
                Found::Nothing => return told,
                Found::Over | Found::ShownOut => {
                    told.is_over = true;
                    return told;
                }
            }
        }
    }

    fn times(&self, id: u32) -> Vec<u64> {
        let of = self.messages.iter().filter(|(of, _)| *of == id);
        of.map(|(_, at_ns)| *at_ns).collect()
    }

    fn left_out(&self) -> u64 {
        let words = self.texts.iter().filter_map(|text| text["message"].as_str());
        let counts = words.filter_map(|words| words.strip_suffix(" messages left out"));
        counts.map(|count| count.parse::<u64>().expect("a number")).sum()
    }
}

fn channel(queue: &MessageQueue, topic: &str) -> u32 {
    let found = queue.channels.iter().find(|(_, channel)| channel.topic.name == topic);
    *found.expect("a channel").0
}

fn subscribe(viewer: &mut Viewer, queue: &MessageQueue, topic: &str, id: u32) {
    let wish = json!({"id": id, "channelId": channel(queue, topic)});
    let order = json!({"op": "subscribe", "subscriptions": [wish]});
    viewer.take_text(&order.to_string(), queue);
}

#[test]
fn who_comes_is_greeted_and_told_of_the_channels() {
    let mut queue = MessageQueue::new(1000);
    let mut early = Viewer::new(&queue, "{\"op\":\"serverInfo\"}".into());
    let told = Told::of(&mut early, &queue);
    assert_eq!(told.texts[0]["op"], "serverInfo");
    assert!(told.texts[1]["message"].as_str().is_some_and(|words| words.contains("first scan")));
    queue.set_topics(&topics());
    let told = Told::of(&mut early, &queue);
    assert_eq!((told.texts.len(), &told.texts[0]["op"]), (1, &json!("advertise")));
    let mut late = Viewer::new(&queue, "{\"op\":\"serverInfo\"}".into());
    let ops: Vec<_> =
        Told::of(&mut late, &queue).texts.iter().map(|text| text["op"].clone()).collect();
    assert_eq!(ops, ["serverInfo", "advertise"]);
    queue.close();
    assert!(Told::of(&mut late, &queue).is_over);
}

#[test]
fn who_comes_late_is_told_the_last_of_what_stands_still_and_no_reading_of_before() {
    let mut queue = queue(1000);
    for number in 0..10 {
        put(&mut queue, "/tf_static", number, 10);
        put(&mut queue, "/sonar/range", number, 10);
    }
    let mut late = Viewer::new(&queue, "{}".into());
    subscribe(&mut late, &queue, "/tf_static", 1);
    subscribe(&mut late, &queue, "/sonar/range", 2);
    let told = Told::of(&mut late, &queue);
    assert_eq!((told.times(1), told.times(2)), (vec![9], vec![]));
    put(&mut queue, "/tf_static", 10, 10);
    put(&mut queue, "/sonar/range", 10, 10);
    let told = Told::of(&mut late, &queue);
    assert_eq!((told.times(1), told.times(2), told.left_out()), (vec![10], vec![10], 0));
}

#[test]
fn a_slow_viewer_is_told_what_it_missed_and_still_what_stands_still() {
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
    let told = Told::of(&mut slow, &queue);
    let ranges = told.times(1);
    assert!(ranges.len() > 5 && ranges.len() < 20 && ranges.last() == Some(&99), "{ranges:?}");
    assert_eq!((told.times(2), told.times(3)), (vec![1], vec![]));
    // The first of what stands still, and the ranges.
    assert_eq!(told.left_out(), 1 + 100 - ranges.len() as u64);
}

#[test]
fn a_message_that_is_too_long_is_missed_by_everybody() {
    let mut queue = queue(10 << 20);
    let mut viewer = Viewer::new(&queue, "{}".into());
    subscribe(&mut viewer, &queue, "/sonar/points", 1);
    for (number, bytes) in [(0, 10), (1, MOST_MESSAGE_BYTES + 1), (2, MOST_MESSAGE_BYTES)] {
        put(&mut queue, "/sonar/points", number, bytes);
    }
    let told = Told::of(&mut viewer, &queue);
    assert_eq!((told.times(1), told.left_out()), (vec![0, 2], 1));
}

#[test]
fn topics_that_go_end_their_subscriptions_and_numbers_are_not_given_twice() {
    let mut queue = queue(1000);
    let mut viewer = Viewer::new(&queue, "{}".into());
    subscribe(&mut viewer, &queue, "/sonar/scan", 1);
    drop(Told::of(&mut viewer, &queue));
    let before = channel(&queue, "/sonar/scan");
    let others: Vec<Topic> =
        topics().into_iter().filter(|topic| topic.name != "/sonar/scan").collect();
    queue.set_topics(&others);
    let told = Told::of(&mut viewer, &queue);
    assert_eq!(told.texts, [json!({"op": "unadvertise", "channelIds": [before]})]);
    queue.set_topics(&topics());
    assert!(channel(&queue, "/sonar/scan") > before);
    put(&mut queue, "/sonar/scan", 0, 10);
    let told = Told::of(&mut viewer, &queue);
    assert_eq!((told.messages.len(), &told.texts[0]["op"]), (0, &json!("advertise")));
}

#[test]
fn what_waits_is_bounded_in_bytes_however_many_viewers_sleep() {
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
    let numbers = queue.waiting.first()..queue.waiting.end();
    let waiting = numbers.filter_map(|number| queue.waiting.get(number));
    let bytes: usize = waiting.map(|message| message.bytes.len()).sum();
    assert!((1 << 18..=1 << 20).contains(&bytes), "{bytes} bytes wait");
    let held = asleep.iter().map(|viewer| viewer.texts.len() + viewer.late_for.len());
    assert!(held.max() <= Some(3), "a viewer that sleeps holds nothing");
}

/// What happens at a queue.
#[derive(Debug, Clone)]
enum Happens {
    Put { topic: usize, bytes: usize },
    Subscribe(usize),
    Unsubscribe(usize),
    Look { times: usize },
}

fn happens() -> impl Strategy<Value = Happens> {
    prop_oneof![
        6 => (0..4_usize, 0..300_usize).prop_map(|(topic, bytes)| Happens::Put { topic, bytes }),
        1 => (0..4_usize).prop_map(Happens::Subscribe),
        1 => (0..4_usize).prop_map(Happens::Unsubscribe),
        3 => (0..6_usize).prop_map(|times| Happens::Look { times }),
    ]
}

proptest! {
    /// Whatever order things come in: each message that is published while a viewer is subscribed is told once, in order,
    /// or counted as left out.
    #[test]
    fn each_message_is_told_once_or_counted(steps in prop::collection::vec(happens(), 0..200)) {
        // No kept ones among them: those may be told again.
        let names = ["/sonar/range", "/sonar/residual", "/sonar/predicted/range"];
        let mut queue = queue(1500);
        let mut viewer = Viewer::new(&queue, "{}".into());
        let mut all = Told::default();
        let (mut expected, mut subscribed) = (0, [false; 4]);
        let mut look = |viewer: &mut Viewer, queue: &MessageQueue, times: usize| {
            for _ in 0..times {
                match viewer.look(queue) {
                    Found::Something(Outgoing::Text(text)) => {
                        all.texts.push(serde_json::from_str(&text).expect("JSON"));
                    }
                    Found::Something(Outgoing::Binary(frame)) => {
                        let id = u32::from_le_bytes(frame[1..5].try_into().expect("four"));
                        let at_ns = u64::from_le_bytes(frame[5..13].try_into().expect("eight"));
                        all.messages.push((id, at_ns));
                    }
                    Found::Nothing | Found::Over | Found::ShownOut => break,
                }
            }
        };
        for (number, step) in (0..).zip(steps) {
            match step {
                Happens::Put { topic, bytes } => {
                    let Some(name) = names.get(topic) else { continue };
                    put(&mut queue, name, number, bytes);
                    expected += u64::from(subscribed[topic]);
                }
                Happens::Subscribe(topic) => {
                    let Some(name) = names.get(topic) else { continue };
                    subscribe(&mut viewer, &queue, name, topic as u32);
                    subscribed[topic] = true;
                }
                Happens::Unsubscribe(topic) => {
                    // What it was still to be told is over with that: it takes that first.
                    look(&mut viewer, &queue, usize::MAX);
                    let order = json!({"op": "unsubscribe", "subscriptionIds": [topic]});
                    viewer.take_text(&order.to_string(), &queue);
                    subscribed[topic] = false;
                }
                Happens::Look { times } => look(&mut viewer, &queue, times),
            }
        }
        look(&mut viewer, &queue, usize::MAX);
        prop_assert_eq!(all.messages.len() as u64 + all.left_out(), expected);
        for id in 0..3 {
            prop_assert!(all.times(id).is_sorted_by(|a, b| a < b));
        }
    }
}
