use super::*;

const SHORT: Duration = Duration::from_secs(1);

/// A broker that closes the connection at messages that it does not take.
struct Strict {
    takes: fn(&Sending) -> bool,
    diagnosis: Diagnosis,
    /// Messages that are to be sent, each until it is taken or refused.
    queue: Vec<Sending>,
    taken: Vec<Sending>,
    left_out: Vec<(Sending, Cause)>,
    connections: usize,
}

const fn record(number: u64, kind: Kind, bytes: usize) -> Sending {
    Sending { record: Some(number), kind: Some(kind), bytes }
}

const ONLINE: Sending = Sending { record: None, kind: Some(Kind::Online), bytes: 4 };

impl Strict {
    fn new(takes: fn(&Sending) -> bool, queue: impl IntoIterator<Item = Sending>) -> Self {
        Self {
            takes,
            diagnosis: Diagnosis::default(),
            queue: queue.into_iter().collect(),
            taken: Vec::new(),
            left_out: Vec::new(),
            connections: 0,
        }
    }

    /// One connection, with the greeting first and up to eight messages under way.
    fn connect(&mut self) -> Finding {
        self.connections += 1;
        let mut under_way = Vec::new();
        if self.diagnosis.refuses(ONLINE.kind, ONLINE.bytes).is_none() {
            self.diagnosis.sent(ONLINE);
            under_way.push(ONLINE);
        }
        loop {
            let most = if self.diagnosis.allows_many() { 8 } else { 1 };
            while under_way.len() < most {
                let is_new = |one: &&Sending| !under_way.contains(one);
                let Some(next) = self.queue.iter().find(is_new).copied() else { break };
                if let Some(cause) = self.diagnosis.refuses(next.kind, next.bytes) {
                    self.queue.retain(|one| *one != next);
                    self.left_out.push((next, cause));
                    continue;
                }
                self.diagnosis.sent(next);
                under_way.push(next);
            }
            if under_way.is_empty() {
                return Finding::Open;
            }
            let first = under_way.remove(0);
            if !(self.takes)(&first) {
                return self.diagnosis.ended(true, SHORT);
            }
            self.diagnosis.acknowledged(first);
            self.taken.extend(first.record.map(|_| first));
            self.queue.retain(|one| *one != first);
        }
    }

    /// Connections until everything is taken or left out, or for so many times.
    fn deliver(&mut self, most: usize) -> Vec<Cause> {
        let mut causes = Vec::new();
        while !self.queue.is_empty() && self.connections < most {
            match self.connect() {
                Finding::Open => {}
                Finding::Cause(cause) => causes.push(cause),
                Finding::Refused(sending, cause) => {
                    self.queue.retain(|one| *one != sending);
                    self.left_out.push((sending, cause));
                }
            }
        }
        causes
    }
}

fn numbers(messages: &[Sending]) -> Vec<u64> {
    messages.iter().filter_map(|message| message.record).collect()
}

#[test]
fn only_messages_above_the_limit_are_left_out_and_later_ones_without_a_loss() {
    let messages = (0..60).map(|n| match n % 20 {
        0 => record(n, Kind::Session, 7000 + n as usize),
        _ => record(n, Kind::Ping, 300),
    });
    let mut broker = Strict::new(|message| message.bytes < 4000, messages);
    assert_eq!(broker.deliver(100), []);
    let left_out: Vec<_> = broker.left_out.iter().filter_map(|(one, _)| one.record).collect();
    assert_eq!(left_out, [0, 20, 40]);
    assert!(broker.left_out.iter().all(|(_, cause)| matches!(cause, Cause::Size(7000..))));
    assert_eq!(numbers(&broker.taken), (0..60).filter(|n| n % 20 != 0).collect::<Vec<_>>());
    assert_eq!(broker.connections, 4, "two losses in a crowd and alone, and the one that works");
}

#[test]
fn a_topic_without_permission_is_left_out_and_the_others_are_published() {
    let kinds = [Kind::ScanStart, Kind::Ping, Kind::Ping, Kind::Event, Kind::ScanEnd];
    let messages = (0..50).map(|n| record(n, kinds[n as usize % 5], 300));
    let mut broker = Strict::new(|message| message.kind != Some(Kind::Event), messages);
    assert_eq!(broker.deliver(100), []);
    assert_eq!(broker.taken.len(), 40);
    assert_eq!(broker.left_out.len(), 10);
    assert!(broker.left_out.iter().all(|(one, cause)| {
        one.kind == Some(Kind::Event) && *cause == Cause::Kind(Some(Kind::Event))
    }));
}

#[test]
fn a_broker_that_takes_nothing_costs_no_record() {
    for takes in [|_: &Sending| false, |message: &Sending| message.kind == Some(Kind::Status)] {
        let mut broker = Strict::new(takes, (0..10).map(|n| record(n, Kind::Ping, 300)));
        let causes = broker.deliver(20);
        assert!(!causes.is_empty() && causes.iter().all(|cause| *cause == Cause::Everything));
        assert_eq!((broker.queue.len(), broker.left_out.len()), (10, 0));
    }
}

#[test]
fn another_client_of_the_same_id_is_suspected_if_no_message_is_to_blame() {
    let mut diagnosis = Diagnosis::default();
    for number in 0..10 {
        for sending in [ONLINE, record(number, Kind::Ping, 300)] {
            diagnosis.sent(sending);
            diagnosis.acknowledged(sending);
        }
        let finding = diagnosis.ended(true, SHORT);
        let is_row = number + 1 >= u64::from(UNEXPLAINED);
        assert_eq!(finding == Finding::Cause(Cause::OtherClient), is_row, "{number}");
    }
    // Others were under way by chance.
    let mut diagnosis = Diagnosis::default();
    let findings = (0..6).map(|number| {
        diagnosis.sent(ONLINE);
        diagnosis.acknowledged(ONLINE);
        diagnosis.sent(record(number, Kind::Ping, 300));
        diagnosis.ended(true, SHORT)
    });
    assert!(findings.into_iter().all(|finding| !matches!(finding, Finding::Refused(..))));
    assert_eq!(diagnosis.ended(true, STEADY), Finding::Open);
}

#[test]
fn losses_by_this_side_or_the_line_blame_nobody() {
    let mut diagnosis = Diagnosis::default();
    for _ in 0..20 {
        diagnosis.sent(record(1, Kind::Session, 7000));
        assert_eq!(diagnosis.ended(false, SHORT), Finding::Open);
    }
    assert!(diagnosis.allows_many());
}
