//! Firing times of the readings of a scan, for tools that require a time for every message.

use std::collections::BTreeSet;

use jiff::Timestamp;

use sonard_records::{Ping, ScanView};

use crate::{conversion::FiringTimes, ros::message::Stamp};

/// Origin of the times of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum TimeBase {
    /// Firing times in the log.
    Clock,
    /// Device ticks from the start of the scan, for a device without a synchronized clock.
    Ticks,
    /// Synthetic, evenly spaced from the start of the scan.
    Synthetic,
}

impl TimeBase {
    pub(super) const fn description(self) -> &'static str {
        match self {
            Self::Clock => "clock",
            Self::Ticks => "device ticks from the scan's start",
            Self::Synthetic => "made up: evenly from the scan's start",
        }
    }
}

/// Assigns times to scans. Scans that were simulated faster than real time are placed one after the
/// other.
#[derive(Debug, Default)]
pub(super) struct ScanTimes {
    /// Start of the first such scan, as in the log, and end of the last one.
    placed: Option<[u64; 2]>,
    /// Origins used so far.
    pub(super) bases: BTreeSet<TimeBase>,
}

impl ScanTimes {
    /// Returns the firing times of a scan's readings, which are in firing order.
    pub(super) fn firing_times(
        &mut self,
        scan: &ScanView,
        pings: &[&Ping],
        window_ns: u64,
    ) -> FiringTimes {
        let started = scan.start.as_ref().map_or(0, |start| nanoseconds(start.time));
        let (base, offsets) = offsets(scan, pings, window_ns);
        self.bases.insert(base);
        let Some(offsets) = offsets else {
            let fired = pings.iter().map(|ping| ping.time.map(|time| Stamp(nanoseconds(time))));
            return FiringTimes { fired: fired.collect(), window_ns };
        };
        let (first_start, begins) = match self.placed {
            Some([first, end]) if (first..end).contains(&started) => (first, end),
            _ => (started, started),
        };
        let last = offsets.iter().flatten().max().copied().unwrap_or(0);
        self.placed = Some([first_start, begins.saturating_add(last).saturating_add(window_ns)]);
        let at = |offset: u64| Stamp(begins.saturating_add(offset));
        FiringTimes { fired: offsets.into_iter().map(|offset| offset.map(at)).collect(), window_ns }
    }
}

/// Returns the origin of the times and, if the log has no times, nanoseconds since the first
/// firing.
fn offsets(
    scan: &ScanView,
    pings: &[&Ping],
    window_ns: u64,
) -> (TimeBase, Option<Vec<Option<u64>>>) {
    if pings.iter().any(|ping| ping.time.is_some() && ping.time_sigma_us.is_some()) {
        return (TimeBase::Clock, None);
    }
    let session = scan.session.as_deref();
    let device = session.and_then(|session| session.device.as_ref());
    let tick_hz = device.map(|device| device.tick_hz).filter(|hz| *hz > 0);
    if let Some(hz) = tick_hz
        && pings.iter().any(|ping| ping.fired_ticks.is_some())
    {
        return (TimeBase::Ticks, Some(by_ticks(pings, hz, window_ns)));
    }
    if pings.iter().any(|ping| ping.time.is_some()) {
        return (TimeBase::Clock, None);
    }
    let array = session.and_then(|session| session.array.as_ref());
    let of_array = array.map(|array| array.interval_ms * 1e6);
    let whole = scan.end.as_ref().map(|end| end.duration_s * 1e9 / pings.len().max(1) as f64);
    let is_plausible = |ns: &f64| ns.is_finite() && *ns >= 1.0 && *ns <= MAX_INTERVAL_NS;
    let interval_ns = of_array.or(whole).filter(is_plausible).map_or(window_ns, |ns| ns as u64);
    (
        TimeBase::Synthetic,
        Some((0..pings.len() as u64).map(|index| Some(index * interval_ns)).collect()),
    )
}

/// Maximum plausible interval between firings, nanoseconds: an hour.
const MAX_INTERVAL_NS: f64 = 3.6e12;

/// Converts device ticks to nanoseconds since the first firing. After a device reset, the counter
/// restarts: its first firing is placed one window after the last.
fn by_ticks(pings: &[&Ping], hz: u32, window_ns: u64) -> Vec<Option<u64>> {
    let mut last: Option<[u64; 2]> = None;
    let since_first = |ping: &&Ping| {
        let ticks = ping.fired_ticks?;
        let ns = match last {
            None => 0,
            Some([at, ns]) => match ticks.checked_sub(at) {
                Some(elapsed) => ns.saturating_add(in_nanoseconds(elapsed, hz)),
                None => ns.saturating_add(window_ns),
            },
        };
        last = Some([ticks, ns]);
        Some(ns)
    };
    pings.iter().map(since_first).collect()
}

fn in_nanoseconds(ticks: u64, hz: u32) -> u64 {
    u64::try_from(u128::from(ticks) * 1_000_000_000 / u128::from(hz)).unwrap_or(u64::MAX)
}

/// Returns nanoseconds since 1970; 0 for earlier times.
pub(crate) fn nanoseconds(time: Timestamp) -> u64 {
    u64::try_from(time.as_nanosecond()).unwrap_or(0)
}
