//! Request rate limits (token buckets). Pure: the caller passes the time.

use std::time::Duration;

use super::access::Principal;

/// Token buckets, one per kind of principal.
#[derive(Debug, Clone)]
pub(super) struct Buckets {
    socket: Bucket,
    token: Bucket,
    guest: Bucket,
}

impl Buckets {
    /// Creates buckets of `per_s` requests per second each.
    pub(super) fn new(per_s: f64) -> Self {
        let bucket = Bucket::new(per_s);
        Self { socket: bucket.clone(), token: bucket.clone(), guest: bucket }
    }

    /// Takes a request from the bucket; `false` if it is empty.
    pub(super) fn take(&mut self, principal: Principal, now: Duration) -> bool {
        let bucket = match principal {
            Principal::Socket => &mut self.socket,
            Principal::Token => &mut self.token,
            Principal::Guest => &mut self.guest,
        };
        bucket.take(now)
    }
}

/// Token bucket that fills at a constant rate and holds one second's worth of requests.
#[derive(Debug, Clone)]
struct Bucket {
    per_s: f64,
    level: f64,
    at: Duration,
}

impl Bucket {
    fn new(per_s: f64) -> Self {
        Self { per_s, level: per_s.max(1.0), at: Duration::ZERO }
    }

    /// Takes a request from the bucket; `false` if it is empty.
    fn take(&mut self, now: Duration) -> bool {
        let since_s = now.saturating_sub(self.at).as_secs_f64();
        self.at = self.at.max(now);
        self.level = (self.level + since_s * self.per_s).min(self.per_s.max(1.0));
        let free = self.level >= 1.0;
        self.level -= f64::from(u8::from(free));
        free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn burst_then_constant_rate() {
        let mut bucket = Bucket::new(10.0);
        let passed = |bucket: &mut Bucket, from_ms: u64, to_ms: u64| {
            (from_ms..to_ms).filter(|&ms| bucket.take(Duration::from_millis(ms))).count()
        };
        assert_eq!(passed(&mut bucket, 0, 10), 10);
        let later = passed(&mut bucket, 10, 5010);
        assert!((49..=51).contains(&later), "{later} in five seconds");
    }
}
