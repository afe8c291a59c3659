use super::*;
use sonard_records::decode_line;

const LOG: &str = include_str!("../../../../tests/fixtures/small.jsonl");

fn ping(step: i32, range_m: Option<f64>) -> Record {
    let record = decode_line(LOG.lines().nth(2).expect("a reading").as_bytes());
    let Ok(Record::Ping(mut ping)) = record else { panic!("a reading") };
    (ping.step, ping.range_m, ping.residual_m) = (step, range_m, None);
    Record::Ping(ping)
}

fn control() -> Record {
    decode_line(LOG.lines().nth(1).expect("a start").as_bytes()).expect("clean")
}

fn session() -> Record {
    decode_line(LOG.lines().next().expect("a session").as_bytes()).expect("clean")
}

async fn all(subscription: &mut Subscription, hub: &Hub) -> Vec<serde_json::Value> {
    hub.close();
    let mut lines = Vec::new();
    while let Some(line) = subscription.next().await {
        assert!(line.ends_with(b"}\n"));
        lines.push(serde_json::from_slice(&line).expect("JSON"));
    }
    lines
}

#[tokio::test]
async fn a_slow_subscriber_loses_the_oldest_readings_with_a_count_in_their_place_and_no_control() {
    let hub = Hub::new(10);
    let mut slow = hub.subscribe(Wanted::default());
    hub.publish(&control());
    for step in 0..25 {
        hub.publish(&ping(step, Some(1.0)));
    }
    hub.publish(&control());
    let lines = all(&mut slow, &hub).await;
    assert_eq!(lines[0]["type"], "scan_start");
    assert_eq!(lines[1], serde_json::json!({"type": "dropped", "readings": 15}));
    let steps: Vec<i64> = lines.iter().filter_map(|line| line["step"].as_i64()).collect();
    assert_eq!(steps, (15..25).collect::<Vec<_>>());
    assert_eq!(lines.iter().filter(|line| line["type"] == "scan_start").count(), 2);
    assert_eq!(hub.dropped(), 15);
}

#[tokio::test]
async fn readings_missed_on_both_sides_of_a_scans_start_are_told_on_both() {
    let hub = Hub::new(2);
    let mut slow = hub.subscribe(Wanted::default());
    (0..5).for_each(|step| hub.publish(&ping(step, Some(1.0))));
    hub.publish(&control());
    (5..10).for_each(|step| hub.publish(&ping(step, Some(1.0))));
    let told: Vec<String> = all(&mut slow, &hub)
        .await
        .iter()
        .map(|line| line["readings"].as_u64().map_or(line["type"].to_string(), |n| n.to_string()))
        .collect();
    assert_eq!(told, ["5", "\"scan_start\"", "3", "\"ping\"", "\"ping\""]);
}

#[tokio::test]
async fn only_what_moved_is_sent_on_request() {
    let hub = Hub::new(100);
    let mut some = hub.subscribe(Wanted { moved_m: Some(0.05), ..Wanted::default() });
    for (step, range_m) in [
        (0, Some(1.0)),
        (0, Some(1.04)),
        // Creeping away in small steps is noticed against what was sent, not the last one.
        (0, Some(1.08)),
        (1, Some(1.08)),
        (0, Some(1.09)),
        (0, Some(0.9)),
    ] {
        hub.publish(&ping(step, range_m));
    }
    let ranges: Vec<_> = all(&mut some, &hub)
        .await
        .iter()
        .map(|line| (line["step"].as_i64().unwrap_or(-1), line["range_m"].as_f64()))
        .collect();
    assert_eq!(ranges, [(0, Some(1.0)), (0, Some(1.08)), (1, Some(1.08)), (0, Some(0.9))]);
}

#[tokio::test]
async fn verdicts_and_viewpoints_come_to_who_wants_them_alone() {
    let hub = Hub::new(100);
    // Who begins to listen in mid-scan sees its readings from the same places.
    hub.publish(&session());
    hub.publish(&control());
    let mut judged = hub.subscribe(Wanted { verdicts: true, ..Wanted::default() });
    let mut plain = hub.subscribe(Wanted::default());
    hub.publish(&ping(0, Some(1.0)));
    let judged = all(&mut judged, &hub).await.remove(0);
    assert_eq!(judged["verdict"].as_str().map(str::is_empty), Some(false));
    let Record::ScanStart(start) = control() else { panic!("a start") };
    assert_eq!(judged["viewpoint"]["x_m"], start.pose.x_m);
    let plain = all(&mut plain, &hub).await.remove(0);
    assert_eq!((plain.get("verdict"), plain.get("viewpoint")), (None, None));
}

#[tokio::test]
async fn scans_are_told_in_order_and_a_subscriber_that_never_asks_is_cut_off() {
    let hub = Hub::new(100);
    let (mut one, mut dead) = (hub.subscribe_scans(), hub.subscribe_scans());
    hub.publish_scan(Uuid::from_u128(1));
    hub.publish_scan(Uuid::from_u128(2));
    assert_eq!(one.next().await, Some(Uuid::from_u128(1)));
    assert_eq!(one.next().await, Some(Uuid::from_u128(2)));
    (0..=CONTROLS as u128).for_each(|n| hub.publish_scan(Uuid::from_u128(n)));
    assert_eq!((dead.next().await, hub.cut_off()), (None, 1));
}

#[tokio::test]
async fn a_subscriber_that_never_reads_is_cut_off_and_one_that_leaves_is_forgotten() {
    let hub = Hub::new(10);
    let mut dead = hub.subscribe(Wanted::default());
    for _ in 0..=CONTROLS {
        hub.publish(&control());
    }
    assert_eq!((dead.next().await, dead.next().await, hub.cut_off()), (None, None, 1));
    assert_eq!(hub.subscribers(), 1);
    drop(dead);
    assert_eq!(hub.subscribers(), 0);
}

#[tokio::test]
async fn what_waits_is_bounded_in_bytes_and_kept_once_for_all() {
    let hub = Hub::new(100_000);
    let slow: Vec<Subscription> = (0..100).map(|_| hub.subscribe(Wanted::default())).collect();
    for step in 0..50_000 {
        hub.publish(&ping(step, Some(1.0)));
    }
    let held = {
        let waiting = held(&hub.inner.waiting);
        let numbers = waiting.readings.first()..waiting.readings.end();
        let lines = numbers.filter_map(|number| waiting.readings.get(number));
        lines.map(|reading| reading.line.len()).sum::<usize>()
    };
    assert!((READING_BYTES / 2..=READING_BYTES).contains(&held), "{held} bytes wait");
    drop(slow);
    assert!(super::held(&hub.inner.waiting).readings.get(49_999).is_none());
}
