use super::*;

const SHORT: Duration = Duration::from_secs(1);

/// Simulated broker that closes the connection at rejected messages.
struct StrictBroker {
    accepts: fn(&SentMessage) -> bool,
    diagnosis: Diagnosis,
    /// Messages to send until they are accepted or rejected.
    queue: Vec<SentMessage>,
    accepted: Vec<SentMessage>,
    dropped: Vec<(SentMessage, Cause)>,
    connections: usize,
}

const fn record(number: u64, kind: MessageKind, bytes: usize) -> SentMessage {
    SentMessage { record: Some(number), kind: Some(kind), bytes }
}

const ONLINE: SentMessage = SentMessage { record: None, kind: Some(MessageKind::Online), bytes: 4 };

impl StrictBroker {
    fn new(
        accepts: fn(&SentMessage) -> bool,
        queue: impl IntoIterator<Item = SentMessage>,
    ) -> Self {
        Self {
            accepts,
            diagnosis: Diagnosis::default(),
            queue: queue.into_iter().collect(),
            accepted: Vec::new(),
            dropped: Vec::new(),
            connections: 0,
        }
    }

    /// Runs a connection with the `online` message first and up to eight messages in flight.
    fn connect(&mut self) -> Finding {
        self.connections += 1;
        let mut in_flight = Vec::new();
        if self.diagnosis.rejects(ONLINE.kind, ONLINE.bytes).is_none() {
            self.diagnosis.sent(ONLINE);
            in_flight.push(ONLINE);
        }
        loop {
            let max_in_flight = if self.diagnosis.allows_many() { 8 } else { 1 };
            while in_flight.len() < max_in_flight {
                let is_new = |message: &&SentMessage| !in_flight.contains(message);
                let Some(next) = self.queue.iter().find(is_new).copied() else { break };
                if let Some(cause) = self.diagnosis.rejects(next.kind, next.bytes) {
                    self.queue.retain(|message| *message != next);
                    self.dropped.push((next, cause));
                    continue;
                }
                self.diagnosis.sent(next);
                in_flight.push(next);
            }
            if in_flight.is_empty() {
                return Finding::Open;
            }
            let first = in_flight.remove(0);
            if !(self.accepts)(&first) {
                return self.diagnosis.ended(true, SHORT);
            }
            self.diagnosis.acknowledged(first);
            self.accepted.extend(first.record.map(|_| first));
            self.queue.retain(|message| *message != first);
        }
    }

    /// Connects until every message is accepted or dropped, at most `max_connections` times.
    fn deliver(&mut self, max_connections: usize) -> Vec<Cause> {
        let mut causes = Vec::new();
        while !self.queue.is_empty() && self.connections < max_connections {
            match self.connect() {
                Finding::Open => {}
                Finding::Cause(cause) => causes.push(cause),
                Finding::Rejected(sending, cause) => {
                    self.queue.retain(|message| *message != sending);
                    self.dropped.push((sending, cause));
                }
            }
        }
        causes
    }
}

fn numbers(messages: &[SentMessage]) -> Vec<u64> {
    messages.iter().filter_map(|message| message.record).collect()
}

#[test]
fn size_limit_is_learnt() {
    let messages = (0..60).map(|n| match n % 20 {
        0 => record(n, MessageKind::Session, 7000 + n as usize),
        _ => record(n, MessageKind::Ping, 300),
    });
    let mut broker = StrictBroker::new(|message| message.bytes < 4000, messages);
    assert_eq!(broker.deliver(100), []);
    let dropped: Vec<_> = broker.dropped.iter().filter_map(|(message, _)| message.record).collect();
    assert_eq!(dropped, [0, 20, 40]);
    assert!(broker.dropped.iter().all(|(_, cause)| matches!(cause, Cause::Size(7000..))));
    assert_eq!(numbers(&broker.accepted), (0..60).filter(|n| n % 20 != 0).collect::<Vec<_>>());
    assert_eq!(broker.connections, 4, "closed with many in flight and twice alone, then working");
}

#[test]
fn forbidden_topic_is_dropped() {
    let kinds = [
        MessageKind::ScanStart,
        MessageKind::Ping,
        MessageKind::Ping,
        MessageKind::Event,
        MessageKind::ScanEnd,
    ];
    let messages = (0..50).map(|n| record(n, kinds[n as usize % 5], 300));
    let mut broker =
        StrictBroker::new(|message| message.kind != Some(MessageKind::Event), messages);
    assert_eq!(broker.deliver(100), []);
    assert_eq!(broker.accepted.len(), 40);
    assert_eq!(broker.dropped.len(), 10);
    assert!(broker.dropped.iter().all(|(message, cause)| {
        message.kind == Some(MessageKind::Event) && *cause == Cause::Kind(Some(MessageKind::Event))
    }));
}

#[test]
fn no_record_is_dropped_if_all_fail() {
    for accepts in
        [|_: &SentMessage| false, |message: &SentMessage| message.kind == Some(MessageKind::Status)]
    {
        let mut broker =
            StrictBroker::new(accepts, (0..10).map(|n| record(n, MessageKind::Ping, 300)));
        let causes = broker.deliver(20);
        assert!(!causes.is_empty() && causes.iter().all(|cause| *cause == Cause::Everything));
        assert_eq!((broker.queue.len(), broker.dropped.len()), (10, 0));
    }
}

#[test]
fn duplicate_client_is_suspected() {
    let mut diagnosis = Diagnosis::default();
    for number in 0..10 {
        for sending in [ONLINE, record(number, MessageKind::Ping, 300)] {
            diagnosis.sent(sending);
            diagnosis.acknowledged(sending);
        }
        let finding = diagnosis.ended(true, SHORT);
        let is_row = number + 1 >= u64::from(MAX_UNEXPLAINED);
        assert_eq!(finding == Finding::Cause(Cause::OtherClient), is_row, "{number}");
    }
    // Other messages were in flight by chance.
    let mut diagnosis = Diagnosis::default();
    let findings = (0..6).map(|number| {
        diagnosis.sent(ONLINE);
        diagnosis.acknowledged(ONLINE);
        diagnosis.sent(record(number, MessageKind::Ping, 300));
        diagnosis.ended(true, SHORT)
    });
    assert!(findings.into_iter().all(|finding| !matches!(finding, Finding::Rejected(..))));
    assert_eq!(diagnosis.ended(true, STABLE_AFTER), Finding::Open);
}

#[test]
fn line_failures_have_no_cause() {
    let mut diagnosis = Diagnosis::default();
    for _ in 0..20 {
        diagnosis.sent(record(1, MessageKind::Session, 7000));
        assert_eq!(diagnosis.ended(false, SHORT), Finding::Open);
    }
    assert!(diagnosis.allows_many());
}

#[test]
fn status_of_varying_length() {
    let mut broker = StrictBroker::new(|message| message.bytes < 2000, []);
    let mut lost = Vec::new();
    for n in 0..400 {
        // Each connection sends the current status, the length of which differs.
        broker.queue.retain(|message| message.record.is_some());
        let bytes = 2001 + n * 7919 % 200;
        broker.queue.push(SentMessage { record: None, kind: Some(MessageKind::Status), bytes });
        broker.queue.push(record(n as u64, MessageKind::Ping, 300));
        match broker.connect() {
            Finding::Open if broker.queue.is_empty() => {}
            Finding::Open => lost.push(n),
            Finding::Rejected(sending, cause) => {
                assert!(sending.kind == Some(MessageKind::Status) && sending.bytes > 2000);
                assert!(matches!(cause, Cause::Size(2001..)), "{cause:?}");
                lost.push(n);
            }
            Finding::Cause(cause) => panic!("{cause:?}"),
        }
    }
    // Each limit costs three connections, and the next one is smaller.
    assert!(lost.len() <= 30 && lost.iter().all(|n| *n < 250), "{lost:?}");
    assert_eq!(broker.accepted.len(), 400);
}
