//! Limit of the unacknowledged bytes of a topic. Pure.

/// Overhead per unacknowledged message, bytes.
const OVERHEAD_BYTES: usize = 256;

/// Maximum length of a published message, bytes.
pub(super) const MAX_MESSAGE_BYTES: usize = 1 << 20;

/// Limit of the unacknowledged bytes of a topic. DDS reports only whether all messages are
/// acknowledged, not which.
#[derive(Debug)]
pub(super) struct SendLimit {
    waiting_bytes: usize,
    max_bytes: usize,
}

impl SendLimit {
    pub(super) const fn new(max_bytes: usize) -> Self {
        Self { waiting_bytes: 0, max_bytes }
    }

    /// Returns `true` if there is room for a message.
    ///
    /// `all_acknowledged` is called from half of the limit on: acknowledgements take some time, so
    /// a single call at the limit could fail by chance. A message above the limit is accepted if no
    /// other one is waiting.
    pub(super) fn has_room(
        &mut self,
        bytes: usize,
        all_acknowledged: impl FnOnce() -> bool,
    ) -> bool {
        if bytes > MAX_MESSAGE_BYTES {
            return false;
        }
        let total = self.waiting_bytes + bytes + OVERHEAD_BYTES;
        if self.waiting_bytes > 0 && total > self.max_bytes / 2 {
            if all_acknowledged() {
                self.waiting_bytes = 0;
            } else if total > self.max_bytes {
                return false;
            }
        }
        true
    }

    /// Counts a sent message.
    pub(super) const fn add(&mut self, bytes: usize) {
        self.waiting_bytes += bytes + OVERHEAD_BYTES;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unacknowledged_bytes_are_bounded() {
        let mut limit = SendLimit::new(10_000);
        let mut added = 0;
        while limit.has_room(744, || false) {
            limit.add(744);
            added += 1;
        }
        assert_eq!(added, 10);
        assert!(!limit.has_room(744, || false), "it stays full");
        assert!(limit.has_room(744, || true) && limit.has_room(744, || panic!("it has room")));
    }

    #[test]
    fn slow_acknowledgements_drop_nothing() {
        let mut limit = SendLimit::new(10_000);
        // Pairs of messages, the first of which is unacknowledged when the second is sent.
        for message in 0..10_000 {
            assert!(limit.has_room(744, || message % 2 == 0), "message {message}");
            limit.add(744);
        }
    }

    #[test]
    fn large_message_is_sent_alone() {
        let mut limit = SendLimit::new(10_000);
        assert!(limit.has_room(50_000, || false));
        limit.add(50_000);
        assert!(!limit.has_room(1, || false) && limit.has_room(1, || true));
        assert!(!SendLimit::new(usize::MAX).has_room(MAX_MESSAGE_BYTES + 1, || true));
    }
}
