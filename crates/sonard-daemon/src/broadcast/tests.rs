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
async fn slow_subscriber_gets_drop_count() {
    let hub = Hub::new(10);
    let mut slow = hub.subscribe(SubscriptionFilter::default());
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
async fn drop_counts_around_a_scan_start() {
    let hub = Hub::new(2);
    let mut slow = hub.subscribe(SubscriptionFilter::default());
    (0..5).for_each(|step| hub.publish(&ping(step, Some(1.0))));
    hub.publish(&control());
    (5..10).for_each(|step| hub.publish(&ping(step, Some(1.0))));
    let received: Vec<String> = all(&mut slow, &hub)
        .await
        .iter()
        .map(|line| line["readings"].as_u64().map_or(line["type"].to_string(), |n| n.to_string()))
        .collect();
    assert_eq!(received, ["5", "\"scan_start\"", "3", "\"ping\"", "\"ping\""]);
}

#[tokio::test]
async fn deadband_suppresses_readings() {
    let hub = Hub::new(100);
    let mut some = hub
        .subscribe(SubscriptionFilter { deadband_m: Some(0.05), ..SubscriptionFilter::default() });
    for (step, range_m) in [
        (0, Some(1.0)),
        (0, Some(1.04)),
        // A slow drift is detected: ranges are compared with the last one sent.
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
async fn verdicts_are_sent_on_request() {
    let hub = Hub::new(100);
    // A subscription in mid-scan has the viewpoint of the running scan.
    hub.publish(&session());
    hub.publish(&control());
    let mut annotated =
        hub.subscribe(SubscriptionFilter { verdicts: true, ..SubscriptionFilter::default() });
    let mut plain = hub.subscribe(SubscriptionFilter::default());
    hub.publish(&ping(0, Some(1.0)));
    let annotated = all(&mut annotated, &hub).await.remove(0);
    assert_eq!(annotated["verdict"].as_str().map(str::is_empty), Some(false));
    let Record::ScanStart(start) = control() else { panic!("a start") };
    assert_eq!(annotated["viewpoint"]["x_m"], start.pose.x_m);
    let plain = all(&mut plain, &hub).await.remove(0);
    assert_eq!((plain.get("verdict"), plain.get("viewpoint")), (None, None));
}

#[tokio::test]
async fn scan_subscriber_is_cut_off() {
    let hub = Hub::new(100);
    let (mut one, mut idle) = (hub.subscribe_scans(), hub.subscribe_scans());
    hub.publish_scan(Uuid::from_u128(1));
    hub.publish_scan(Uuid::from_u128(2));
    assert_eq!(one.next().await, Some(Uuid::from_u128(1)));
    assert_eq!(one.next().await, Some(Uuid::from_u128(2)));
    (0..=MAX_CONTROLS as u128).for_each(|n| hub.publish_scan(Uuid::from_u128(n)));
    assert_eq!((idle.next().await, hub.cut_off()), (None, 1));
}

#[tokio::test]
async fn idle_subscriber_is_cut_off() {
    let hub = Hub::new(10);
    let mut idle = hub.subscribe(SubscriptionFilter::default());
    for _ in 0..=MAX_CONTROLS {
        hub.publish(&control());
    }
    assert_eq!((idle.next().await, idle.next().await, hub.cut_off()), (None, None, 1));
    assert_eq!(hub.subscribers(), 1);
    drop(idle);
    assert_eq!(hub.subscribers(), 0);
}

#[tokio::test]
async fn buffers_are_bounded_in_bytes() {
    let hub = Hub::new(100_000);
    let slow: Vec<Subscription> =
        (0..100).map(|_| hub.subscribe(SubscriptionFilter::default())).collect();
    for step in 0..50_000 {
        hub.publish(&ping(step, Some(1.0)));
    }
    let buffered = {
        let buffers = lock(&hub.inner.buffers);
        let numbers = buffers.readings.first()..buffers.readings.end();
        let lines = numbers.filter_map(|number| buffers.readings.get(number));
        lines.map(|reading| reading.line.len()).sum::<usize>()
    };
    assert!(
        (MAX_READING_BYTES / 2..=MAX_READING_BYTES).contains(&buffered),
        "{buffered} bytes buffered"
    );
    drop(slow);
    assert!(lock(&hub.inner.buffers).readings.get(49_999).is_none());
}
