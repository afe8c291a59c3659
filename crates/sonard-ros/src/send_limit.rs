//! How much of a topic may wait for subscribers. Pure.

/// What a message costs beside its bytes while it waits, bytes.
const OVERHEAD: usize = 256;

/// The longest message that is told, bytes.
pub(super) const MOST_MESSAGE_BYTES: usize = 1 << 20;

/// What of a topic's messages waits, at most: it is only known whether all were acknowledged, not which.
#[derive(Debug)]
pub(super) struct Budget {
    waiting: usize,
    most: usize,
}

impl Budget {
    /// One of so many bytes.
    pub(super) const fn new(most: usize) -> Self {
        Self { waiting: 0, most }
    }

    /// Whether there is room for a message; `all_taken` is asked whether all before it were acknowledged from when the room
    /// seems to be half full: acknowledgments take some time, so that the answer at one moment is chance. What alone is more than may wait finds room when nothing else waits.
    pub(super) fn has_room(&mut self, bytes: usize, all_taken: impl FnOnce() -> bool) -> bool {
        if bytes > MOST_MESSAGE_BYTES {
            return false;
        }
        let then = self.waiting + bytes + OVERHEAD;
        if self.waiting > 0 && then > self.most / 2 {
            if all_taken() {
                self.waiting = 0;
            } else if then > self.most {
                return false;
            }
        }
        true
    }

    /// Counts a message that waits from now on.
    pub(super) const fn put(&mut self, bytes: usize) {
        self.waiting += bytes + OVERHEAD;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_stays_within_its_bound_until_it_is_taken() {
        let mut budget = Budget::new(10_000);
        let mut put = 0;
        while budget.has_room(744, || false) {
            budget.put(744);
            put += 1;
        }
        assert_eq!(put, 10);
        assert!(!budget.has_room(744, || false), "it stays full");
        assert!(budget.has_room(744, || true) && budget.has_room(744, || panic!("it has room")));
    }

    #[test]
    fn nothing_is_left_out_where_all_but_the_last_few_are_always_acknowledged() {
        let mut budget = Budget::new(10_000);
        // Two messages one behind the other, of which the first is still on its way when the second comes.
        for message in 0..10_000 {
            assert!(budget.has_room(744, || message % 2 == 0), "message {message}");
            budget.put(744);
        }
    }

    #[test]
    fn a_large_message_goes_alone_and_a_larger_one_not_at_all() {
        let mut budget = Budget::new(10_000);
        assert!(budget.has_room(50_000, || false));
        budget.put(50_000);
        assert!(!budget.has_room(1, || false) && budget.has_room(1, || true));
        assert!(!Budget::new(usize::MAX).has_room(MOST_MESSAGE_BYTES + 1, || true));
    }
}
