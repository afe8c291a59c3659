use std::{collections::BTreeSet, time::Duration};

use bytes::Bytes;
use proptest::prelude::*;

use super::{super::topics::Kind, *};

const NOW: Duration = Duration::ZERO;

fn place(line: u64) -> LogPosition {
    LogPosition { file: "log".into(), bytes: line }
}

/// The line of this number; every fifth is none that could be sent.
fn line(number: u64) -> Read {
    let payload = Bytes::from(format!("{number:>20}"));
    let message = (number % 5 != 4).then_some(Message { kind: Kind::Ping, payload });
    Read { message, after: place(number + 1) }
}

fn number_in(message: &Message) -> u64 {
    std::str::from_utf8(&message.payload).expect("text").trim().parse().expect("a number")
}

#[derive(Debug, Clone)]
enum Step {
    Read(usize),
    Give(usize),
    /// Acknowledges one of what is under way.
    Acknowledge(prop::sample::Index),
    /// Acknowledges what was never given out, or was on an earlier connection.
    Stray(u64),
    Disconnect,
    Remember(u64),
    /// The daemon is killed, and goes on from what is remembered.
    Crash,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        4 => (0..30_usize).prop_map(Step::Read),
        4 => (0..30_usize).prop_map(Step::Give),
        8 => any::<prop::sample::Index>().prop_map(Step::Acknowledge),
        1 => (0..400_u64).prop_map(Step::Stray),
        1 => Just(Step::Disconnect),
        2 => (0..5_u64).prop_map(Step::Remember),
        1 => Just(Step::Crash),
    ];
    prop::collection::vec(step, 0..200)
}

/// Plays a window against a broker that counts what it has.
struct Play {
    window: Window,
    next_line: u64,
    /// Number of a message and of its line, under way on this connection.
    under_way: Vec<(u64, u64)>,
    /// Lines that the broker has.
    had: BTreeSet<u64>,
    /// Lines in the order of their first delivery on this connection.
    order: Vec<u64>,
    remembered: LogPosition,
    now: Duration,
}

impl Play {
    fn new(most_bytes: usize) -> Self {
        Self {
            window: Window::new(most_bytes, place(0)),
            next_line: 0,
            under_way: Vec::new(),
            had: BTreeSet::new(),
            order: Vec::new(),
            remembered: place(0),
            now: NOW,
        }
    }

    fn read(&mut self, most: usize) {
        for _ in 0..most {
            if self.window.room() == 0 {
                return;
            }
            self.window.put(line(self.next_line));
            self.next_line += 1;
        }
    }

    fn give(&mut self, most: usize) {
        for _ in 0..most {
            let Some((number, message)) = self.window.give() else { return };
            let line = number_in(&message);
            self.under_way.push((number, line));
            self.order.push(line);
        }
    }

    fn acknowledge(&mut self, at: usize) {
        let (number, line) = self.under_way.swap_remove(at);
        self.had.insert(line);
        self.window.acknowledge(number, self.now);
    }

    fn disconnect(&mut self) {
        self.window.disconnect();
        self.under_way.clear();
        self.order.clear();
    }

    fn take(&mut self, step: &Step, most_bytes: usize) {
        match step {
            Step::Read(most) => self.read(*most),
            Step::Give(most) => self.give(*most),
            Step::Acknowledge(index) if !self.under_way.is_empty() => {
                self.acknowledge(index.index(self.under_way.len()));
            }
            Step::Acknowledge(_) => {}
            Step::Stray(number) => {
                if self.under_way.iter().all(|(one, _)| one != number) {
                    self.window.acknowledge(*number, self.now);
                }
            }
            Step::Disconnect => self.disconnect(),
            Step::Remember(seconds) => {
                self.now += Duration::from_secs(*seconds);
                if let Some(place) = self.window.due(self.now).cloned() {
                    self.window.remembered(&place, self.now);
                    self.remembered = place;
                }
            }
            Step::Crash => {
                self.disconnect();
                self.window = Window::new(most_bytes, self.remembered.clone());
                self.next_line = self.remembered.bytes;
            }
        }
    }

    fn check(&self, most_bytes: usize) -> Result<(), TestCaseError> {
        // What is remembered, and what would be, the broker has to the last line before it.
        for place in [self.window.place(), &self.remembered] {
            let before = (0..place.bytes).filter(|line| line % 5 != 4);
            for line in before {
                prop_assert!(self.had.contains(&line), "line {line} is left out");
            }
        }
        prop_assert!(self.order.is_sorted(), "{:?}", self.order);
        prop_assert!(self.under_way.len() <= MOST_UNDER_WAY);
        prop_assert!(self.window.waiting() >= self.under_way.len());
        // One more than fits, and no more.
        prop_assert!(self.window.bytes <= most_bytes + BESIDE_BYTES + 20);
        Ok(())
    }
}

proptest! {
    /// Whatever is read, lost, doubled or killed in whichever order: no line before a place that is remembered
    /// lacks, lines go out in order, and what is under way is bounded. When the line then holds, the broker has
    /// everything.
    #[test]
    fn nothing_is_left_out_whatever_happens(steps in steps(), most_bytes in 100..20_000_usize) {
        let mut play = Play::new(most_bytes);
        for step in &steps {
            play.take(step, most_bytes);
            play.check(most_bytes)?;
        }
        play.disconnect();
        let end = play.next_line;
        for _ in 0..=end {
            play.give(usize::MAX);
            while !play.under_way.is_empty() {
                play.acknowledge(0);
            }
        }
        prop_assert_eq!(play.window.place(), &place(end));
        prop_assert_eq!(play.window.waiting(), 0);
        play.check(most_bytes)?;
    }
}

#[test]
fn a_place_is_remembered_after_a_while_or_many_records_and_not_before() {
    let mut play = Play::new(1 << 20);
    play.read(2000);
    play.give(1);
    play.acknowledge(0);
    let after = |millis| Duration::from_millis(millis);
    assert_eq!(play.window.due(after(1999)), None);
    assert_eq!(play.window.due(after(2000)), Some(&place(1)));
    play.window.remembered(&place(1), after(2000));
    assert_eq!((play.window.due(after(9000)), play.window.last()), (None, None));
    for _ in 0..1000 {
        play.give(1);
        play.acknowledge(0);
    }
    assert!(play.window.due(after(2000)).is_some_and(|place| place.bytes > 1200));
    assert_eq!(play.window.acknowledged(), 1001);
    assert_eq!(play.window.passed_over(), 400);
}

#[test]
fn acknowledgements_out_of_turn_move_nothing_but_are_not_sent_again() {
    let mut play = Play::new(1 << 20);
    play.read(4);
    play.give(4);
    play.window.acknowledge(2, NOW);
    assert_eq!((play.window.place(), play.window.waiting()), (&place(0), 3));
    play.disconnect();
    play.give(4);
    assert_eq!(play.order, [0, 1, 3]);
    play.window.acknowledge(0, NOW);
    play.window.acknowledge(1, NOW);
    assert_eq!(play.window.place(), &place(3));
}
