//! Remaining beams of a partially measured plan.

/// Run of beams that one sweep can cover.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BeamRun {
    /// First stop, index into the plan's stops.
    pub first_stop: u32,
    /// Number of consecutive stops.
    pub stops: u32,
    /// First requested ping at each stop.
    pub first_ping: u32,
    /// Number of requested pings at each stop.
    pub pings: u32,
}

impl BeamRun {
    /// First run of beams not yet `done` (index: stop times pings-per-stop plus ping); `None` if
    /// all are.
    ///
    /// A partially measured stop becomes a run of its own, so that no beam is fired twice.
    #[must_use]
    pub fn first_missing(done: &[bool], pings_per_stop: u32) -> Option<Self> {
        let per_stop = pings_per_stop.max(1) as usize;
        let first = done.iter().position(|&done| !done)?;
        let (stop, ping) = (first / per_stop, first % per_stop);
        let is_missing = |stop: &[bool]| stop.iter().all(|&done| !done);
        let stops = done.chunks(per_stop).skip(stop).take_while(|stop| is_missing(stop)).count();
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

    /// Number of beams in the run.
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
    fn new_plan_is_one_run() {
        let segment = BeamRun::first_missing(&[false; 12], 3).expect("all beams remain");
        assert_eq!(segment, BeamRun { first_stop: 0, stops: 4, first_ping: 0, pings: 3 });
        assert_eq!(BeamRun::first_missing(&[true; 12], 3), None);
        assert_eq!(BeamRun::first_missing(&[], 3), None);
    }

    proptest! {
        #[test]
        fn runs_cover_each_beam_once(
            pings_per_stop in 1_u32..5,
            stops in proptest::collection::vec(any::<u8>(), 0..20),
        ) {
            let mut done: Vec<bool> = stops
                .iter()
                .flat_map(|bits| (0..pings_per_stop).map(move |ping| bits >> ping & 1 == 1))
                .collect();
            let missing = done.iter().filter(|&&done| !done).count();
            let mut fired = 0;
            while let Some(segment) = BeamRun::first_missing(&done, pings_per_stop) {
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
