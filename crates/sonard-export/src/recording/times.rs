//! When the readings of a scan were fired, for tools that ask for a time of everything.

use std::collections::BTreeSet;

use jiff::Timestamp;

use sonard_records::{Ping, ScanView};

use crate::{conversion::Firings, ros::message::Stamp};

/// Where the times of a scan come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum TimeBase {
    /// The log says when each was fired.
    Clock,
    /// From the scan's start on, by the device's ticks: it played on a time of its own.
    Ticks,
    /// Made up: evenly from the scan's start on.
    MadeUp,
}

impl TimeBase {
    pub(super) const fn in_words(self) -> &'static str {
        match self {
            Self::Clock => "clock",
            Self::Ticks => "device ticks from the scan's start",
            Self::MadeUp => "made up: evenly from the scan's start",
        }
    }
}

/// Gives scans their times. Scans that were made faster than they would have taken are laid one after the
/// other.
#[derive(Debug, Default)]
pub(super) struct Times {
    /// Start of the first of the scans that are laid so, as the log has it, and end of the last.
    laid: Option<[u64; 2]>,
    /// What was used so far.
    pub(super) bases: BTreeSet<TimeBase>,
}

impl Times {
    /// The times of readings of a scan, which are in the order of their firing.
    pub(super) fn of(&mut self, scan: &ScanView, pings: &[&Ping], window_ns: u64) -> Firings {
        let started = scan.start.as_ref().map_or(0, |start| nanoseconds(start.time));
        let (base, offsets) = offsets(scan, pings, window_ns);
        self.bases.insert(base);
        let Some(offsets) = offsets else {
            let fired = pings.iter().map(|ping| ping.time.map(|time| Stamp(nanoseconds(time))));
            return Firings { fired: fired.collect(), window_ns };
        };
        let (chain, begins) = match self.laid {
            Some([first, end]) if (first..end).contains(&started) => (first, end),
            _ => (started, started),
        };
        let last = offsets.iter().flatten().max().copied().unwrap_or(0);
        self.laid = Some([chain, begins.saturating_add(last).saturating_add(window_ns)]);
        let at = |offset: u64| Stamp(begins.saturating_add(offset));
        Firings { fired: offsets.into_iter().map(|offset| offset.map(at)).collect(), window_ns }
    }
}

/// Nanoseconds from the first firing on, where the log does not tell times, and where they come from.
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
    let sensible = |ns: &f64| ns.is_finite() && *ns >= 1.0 && *ns <= MOST_APART_NS;
    let apart_ns = of_array.or(whole).filter(sensible).map_or(window_ns, |ns| ns as u64);
    (TimeBase::MadeUp, Some((0..pings.len() as u64).map(|place| Some(place * apart_ns)).collect()))
}

/// What no interval of a log is believed beyond, nanoseconds: an hour.
const MOST_APART_NS: f64 = 3.6e12;

/// By the device's ticks from the first firing on. A device that was started again counts anew: its first firing
/// comes one window after the last.
fn by_ticks(pings: &[&Ping], hz: u32, window_ns: u64) -> Vec<Option<u64>> {
    let mut last: Option<[u64; 2]> = None;
    let of = |ping: &&Ping| {
        let ticks = ping.fired_ticks?;
        let ns = match last {
            None => 0,
            Some([at, ns]) => match ticks.checked_sub(at) {
                Some(gone) => ns.saturating_add(in_nanoseconds(gone, hz)),
                None => ns.saturating_add(window_ns),
            },
        };
        last = Some([ticks, ns]);
        Some(ns)
    };
    pings.iter().map(of).collect()
}

fn in_nanoseconds(ticks: u64, hz: u32) -> u64 {
    u64::try_from(u128::from(ticks) * 1_000_000_000 / u128::from(hz)).unwrap_or(u64::MAX)
}

/// Since 1970; of what was before, 0.
pub(crate) fn nanoseconds(time: Timestamp) -> u64 {
    u64::try_from(time.as_nanosecond()).unwrap_or(0)
}
