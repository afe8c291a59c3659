//! How often it is said that messages were left out. Pure.

use std::time::{Duration, Instant};

/// Least time from one sentence to the next.
const BETWEEN: Duration = Duration::from_secs(60);

/// Messages that were left out, until it is said.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    left_out: u64,
    topic: String,
    said: Option<Instant>,
}

impl Gaps {
    /// A message of a topic was left out.
    pub(super) fn add(&mut self, topic: &str) {
        if self.left_out == 0 {
            topic.clone_into(&mut self.topic);
        }
        self.left_out += 1;
    }

    /// What there is to say now: at most a sentence a minute, however much is left out.
    pub(super) fn say(&mut self, now: Instant) -> Option<String> {
        let is_early = self.said.is_some_and(|said| now.saturating_duration_since(said) < BETWEEN);
        if self.left_out == 0 || is_early {
            return None;
        }
        self.said = Some(now);
        let left_out = std::mem::take(&mut self.left_out);
        let topic = &self.topic;
        Some(format!(
            "{left_out} messages left out, the first of {topic}: a subscriber does not take them, or they are too long"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn much_that_is_left_out_is_one_sentence_a_minute() {
        let (mut gaps, start) = (Gaps::default(), Instant::now());
        assert_eq!(gaps.say(start), None);
        gaps.add("/sonar/range");
        assert!(gaps.say(start).is_some_and(|words| words.starts_with("1 messages left out")));
        for _ in 0..1000 {
            gaps.add("/tf");
            assert_eq!(gaps.say(start + Duration::from_secs(59)), None);
        }
        let words = gaps.say(start + BETWEEN).expect("it is time");
        assert!(words.starts_with("1000 messages left out, the first of /tf"), "{words}");
        assert_eq!(gaps.say(start + 2 * BETWEEN), None);
    }
}
