//! What is left of a plan when some of its beams have been measured.

/// A run of beams that one sweep can cover.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// First stop, index into the plan's stops.
    pub first_stop: u32,
    /// Number of stops.
    pub stops: u32,
    /// First firing wanted at each stop.
    pub first_ping: u32,
    /// Firings wanted at each stop.
    pub pings: u32,
}

impl Segment {
    /// The first run of beams not yet `done` (index: stop times pings-per-stop plus ping);
    /// `None` when all are.
    ///
    /// A stop that was left half measured makes a segment of its own, so that no beam is fired
    /// twice.
    #[must_use]
    pub fn next(done: &[bool], pings_per_stop: u32) -> Option<Self> {
        let per_stop = pings_per_stop.max(1) as usize;
        let first = done.iter().position(|&done| !done)?;
        let (stop, ping) = (first / per_stop, first % per_stop);
        let untouched = |stop: &[bool]| stop.iter().all(|&done| !done);
        let stops = done.chunks(per_stop).skip(stop).take_while(|stop| untouched(stop)).count();
        let (stops, pings) = if stops > 0 {
            (stops, per_stop)
        } else {
            let rest = done.chunks(per_stop).nth(stop)?.get(ping..)?;
            (1, rest.iter().take_while(|&&done| !done).count())
        };
        Some(Self {
            first_stop: stop as u32,
            stops: stops as u32,
            first_ping: ping as u32,
            pings: pings as u32,
        })
    }

    /// Index in the plan of the sweep's beam `local`.
    #[must_use]
    pub const fn index(&self, local: u32, pings_per_stop: u32) -> u32 {
        (self.first_stop + local / self.pings) * pings_per_stop
            + self.first_ping
            + local % self.pings
    }

    /// Number of beams.
    #[must_use]
    pub const fn beams(&self) -> u32 {
        self.stops * self.pings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_untouched_plan_is_one_segment() {
        let segment = Segment::next(&[false; 12], 3).expect("all is left");
        assert_eq!(segment, Segment { first_stop: 0, stops: 4, first_ping: 0, pings: 3 });
        assert_eq!(Segment::next(&[true; 12], 3), None);
        assert_eq!(Segment::next(&[], 3), None);
    }

    proptest! {
        #[test]
        fn segments_cover_each_missing_beam_exactly_once(
            pings_per_stop in 1_u32..5,
            stops in proptest::collection::vec(any::<u8>(), 0..20),
        ) {
            let mut done: Vec<bool> = stops
                .iter()
                .flat_map(|bits| (0..pings_per_stop).map(move |ping| bits >> ping & 1 == 1))
                .collect();
            let missing = done.iter().filter(|&&done| !done).count();
            let mut fired = 0;
            while let Some(segment) = Segment::next(&done, pings_per_stop) {
                prop_assert!(segment.beams() > 0);
                for local in 0..segment.beams() {
                    let index = segment.index(local, pings_per_stop) as usize;
                    prop_assert!(!done[index], "beam {index} was fired twice");
                    done[index] = true;
                    fired += 1;
                }
            }
            prop_assert_eq!(fired, missing);
        }
    }
}
