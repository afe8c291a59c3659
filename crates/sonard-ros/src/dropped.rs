//! Rate-limited reports of dropped messages. Pure.

use std::time::{Duration, Instant};

/// Minimum interval between two reports.
const REPORT_INTERVAL: Duration = Duration::from_secs(60);

/// Count of dropped messages since the last report.
#[derive(Debug, Default)]
pub(super) struct DroppedMessages {
    count: u64,
    /// Topic of the first dropped message.
    topic: String,
    reported: Option<Instant>,
}

impl DroppedMessages {
    /// Counts a dropped message of a topic.
    pub(super) fn add(&mut self, topic: &str) {
        if self.count == 0 {
            topic.clone_into(&mut self.topic);
        }
        self.count += 1;
    }

    /// Takes the report, at most once per minute.
    pub(super) fn take_report(&mut self, now: Instant) -> Option<String> {
        let is_early = self
            .reported
            .is_some_and(|reported| now.saturating_duration_since(reported) < REPORT_INTERVAL);
        if self.count == 0 || is_early {
            return None;
        }
        self.reported = Some(now);
        let count = std::mem::take(&mut self.count);
        let topic = &self.topic;
        Some(format!(
            "{count} messages dropped, the first of {topic}: a subscriber does not acknowledge \
             them, or they are too long"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_are_reported_once_per_minute() {
        let (mut dropped, start) = (DroppedMessages::default(), Instant::now());
        assert_eq!(dropped.take_report(start), None);
        dropped.add("/sonar/range");
        assert!(
            dropped.take_report(start).is_some_and(|text| text.starts_with("1 messages dropped"))
        );
        for _ in 0..1000 {
            dropped.add("/tf");
            assert_eq!(dropped.take_report(start + Duration::from_secs(59)), None);
        }
        let text = dropped.take_report(start + REPORT_INTERVAL).expect("it is time");
        assert!(text.starts_with("1000 messages dropped, the first of /tf"), "{text}");
        assert_eq!(dropped.take_report(start + 2 * REPORT_INTERVAL), None);
    }
}
