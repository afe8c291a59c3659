use std::{collections::BTreeSet, time::Duration};

use bytes::Bytes;
use proptest::prelude::*;

use super::{super::topics::MessageKind, *};

const NOW: Duration = Duration::ZERO;

fn place(line: u64) -> LogPosition {
    LogPosition { file: "log".into(), bytes: line }
}

/// Line with the given number; every fifth is not a valid record.
fn line(number: u64) -> LogLine {
    let payload = Bytes::from(format!("{number:>20}"));
    let message = (number % 5 != 4).then_some(RecordMessage { kind: MessageKind::Ping, payload });
    LogLine { message, after: place(number + 1) }
}

fn number_in(message: &RecordMessage) -> u64 {
    std::str::from_utf8(&message.payload).expect("text").trim().parse().expect("a number")
}

#[derive(Debug, Clone)]
enum Step {
    Read(usize),
    Give(usize),
    /// Acknowledges a message in flight.
    Acknowledge(prop::sample::Index),
    /// Acknowledges a message that was never sent, or was sent on an earlier connection.
    Stray(u64),
    Disconnect,
    Checkpoint(u64),
    /// Kills the daemon and restarts it from the checkpoint.
    Crash,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        4 => (0..30_usize).prop_map(Step::Read),
        4 => (0..30_usize).prop_map(Step::Give),
        8 => any::<prop::sample::Index>().prop_map(Step::Acknowledge),
        1 => (0..400_u64).prop_map(Step::Stray),
        1 => Just(Step::Disconnect),
        2 => (0..5_u64).prop_map(Step::Checkpoint),
        1 => Just(Step::Crash),
    ];
    prop::collection::vec(step, 0..200)
}

/// Queue of messages with a simulated broker that records what it received.
struct Bench {
    queue: InFlightQueue,
    next_line: u64,
    /// Sequence number and line of each message in flight on this connection.
    under_way: Vec<(u64, u64)>,
    /// Lines that the broker received.
    received: BTreeSet<u64>,
    /// Lines in the order of their first delivery on this connection.
    order: Vec<u64>,
    remembered: LogPosition,
    now: Duration,
}

impl Bench {
    fn new(max_bytes: usize) -> Self {
        Self {
            queue: InFlightQueue::new(max_bytes, place(0)),
            next_line: 0,
            under_way: Vec::new(),
            received: BTreeSet::new(),
            order: Vec::new(),
            remembered: place(0),
            now: NOW,
        }
    }

    fn read(&mut self, most: usize) {
        for _ in 0..most {
            if self.queue.room() == 0 {
                return;
            }
            self.queue.push(line(self.next_line));
            self.next_line += 1;
        }
    }

    fn give(&mut self, most: usize) {
        for _ in 0..most {
            let Some((number, message)) = self.queue.pop_next() else { return };
            let line = number_in(&message);
            self.under_way.push((number, line));
            self.order.push(line);
        }
    }

    fn acknowledge(&mut self, at: usize) {
        let (number, line) = self.under_way.swap_remove(at);
        self.received.insert(line);
        self.queue.acknowledge(number, self.now);
    }

    fn disconnect(&mut self) {
        self.queue.disconnect();
        self.under_way.clear();
        self.order.clear();
    }

    fn take(&mut self, step: &Step, max_bytes: usize) {
        match step {
            Step::Read(most) => self.read(*most),
            Step::Give(most) => self.give(*most),
            Step::Acknowledge(index) if !self.under_way.is_empty() => {
                self.acknowledge(index.index(self.under_way.len()));
            }
            Step::Acknowledge(_) => {}
            Step::Stray(number) => {
                if self.under_way.iter().all(|(sent, _)| sent != number) {
                    self.queue.acknowledge(*number, self.now);
                }
            }
            Step::Disconnect => self.disconnect(),
            Step::Checkpoint(seconds) => {
                self.now += Duration::from_secs(*seconds);
                if let Some(place) = self.queue.due_checkpoint(self.now).cloned() {
                    self.queue.checkpointed(&place, self.now);
                    self.remembered = place;
                }
            }
            Step::Crash => {
                self.disconnect();
                self.queue = InFlightQueue::new(max_bytes, self.remembered.clone());
                self.next_line = self.remembered.bytes;
            }
        }
    }

    fn check(&self, max_bytes: usize) -> Result<(), TestCaseError> {
        // The broker received every line before the checkpoint and before the present position.
        for place in [self.queue.position(), &self.remembered] {
            let before = (0..place.bytes).filter(|line| line % 5 != 4);
            for line in before {
                prop_assert!(self.received.contains(&line), "line {line} is missing");
            }
        }
        prop_assert!(self.order.is_sorted(), "{:?}", self.order);
        prop_assert!(self.under_way.len() <= MAX_IN_FLIGHT);
        prop_assert!(self.queue.waiting() >= self.under_way.len());
        // The limit may be exceeded by one record only.
        prop_assert!(self.queue.bytes <= max_bytes + OVERHEAD_BYTES + 20);
        Ok(())
    }
}

proptest! {
    /// For any order of reads, losses, duplicates and crashes: no line before a checkpoint is
    /// missing, lines are sent in order, and the queue is bounded. Over a stable connection the
    /// broker finally receives everything.
    #[test]
    fn every_record_is_delivered(steps in steps(), max_bytes in 100..20_000_usize) {
        let mut bench = Bench::new(max_bytes);
        for step in &steps {
            bench.take(step, max_bytes);
            bench.check(max_bytes)?;
        }
        bench.disconnect();
        let end = bench.next_line;
        for _ in 0..=end {
            bench.give(usize::MAX);
            while !bench.under_way.is_empty() {
                bench.acknowledge(0);
            }
        }
        prop_assert_eq!(bench.queue.position(), &place(end));
        prop_assert_eq!(bench.queue.waiting(), 0);
        bench.check(max_bytes)?;
    }
}

#[test]
fn checkpoint_is_due_by_time_or_count() {
    let mut bench = Bench::new(1 << 20);
    bench.read(2000);
    bench.give(1);
    bench.acknowledge(0);
    let after = |millis| Duration::from_millis(millis);
    assert_eq!(bench.queue.due_checkpoint(after(1999)), None);
    assert_eq!(bench.queue.due_checkpoint(after(2000)), Some(&place(1)));
    bench.queue.checkpointed(&place(1), after(2000));
    assert_eq!(
        (bench.queue.due_checkpoint(after(9000)), bench.queue.final_checkpoint()),
        (None, None)
    );
    for _ in 0..1000 {
        bench.give(1);
        bench.acknowledge(0);
    }
    assert!(bench.queue.due_checkpoint(after(2000)).is_some_and(|place| place.bytes > 1200));
    assert_eq!(bench.queue.acknowledged(), 1001);
    assert_eq!(bench.queue.passed_over(), 400);
}

#[test]
fn acknowledgement_out_of_order() {
    let mut bench = Bench::new(1 << 20);
    bench.read(4);
    bench.give(4);
    bench.queue.acknowledge(2, NOW);
    assert_eq!((bench.queue.position(), bench.queue.waiting()), (&place(0), 3));
    bench.disconnect();
    bench.give(4);
    assert_eq!(bench.order, [0, 1, 3]);
    bench.queue.acknowledge(0, NOW);
    bench.queue.acknowledge(1, NOW);
    assert_eq!(bench.queue.position(), &place(3));
}
