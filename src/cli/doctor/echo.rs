//! Check of module and transducer from readings of repeated pings. Pure.

use firmware_protocol::messages::{Reading, ReadingStatus};

use super::report::{Cause, Check};
use crate::scan::text::format_length;

/// Speed of sound for quoted ranges at 20 degrees Celsius, metres per second.
const SOUND_M_S: f64 = 343.4;
/// Tick period, seconds.
const TICK_S: f64 = 0.5e-6;
/// Earliest plausible echo, seconds: the module's blanking, less a tolerance of a tenth.
const EARLIEST_S: f64 = 0.9 * 2.38e-3;
/// Maximum spread of readings of a single wall, metres.
const MAX_SPREAD_M: f64 = 0.1;

/// Checks the readings of pings in one direction, with windows of `window_ticks`.
pub(super) fn check_echoes(readings: &[Reading], window_ticks: u32) -> Check {
    let count = |status| readings.iter().filter(|reading| reading.status == status).count();
    let stuck = count(ReadingStatus::ModuleFault);
    if stuck > 0 {
        return Check::failed(
            "echo",
            Cause::StuckEcho,
            format!("ECHO was high before {stuck} of {} pings", readings.len()),
            "ECHO must be low until INIT rises: check the module's 5 V and ground, that its 4.7 \
             kohm pull-up goes to its own supply, and that INIT and ECHO are not swapped",
        );
    }
    let times_s: Vec<f64> = readings
        .iter()
        .filter_map(|reading| reading.echoes.first())
        .map(|ticks| f64::from(*ticks) * TICK_S)
        .collect();
    if let Some(check) = check_times(&times_s, f64::from(window_ticks) * TICK_S) {
        return check;
    }
    let mut ranges_m: Vec<f64> = times_s.iter().map(|time_s| range_m(*time_s)).collect();
    ranges_m.sort_by(f64::total_cmp);
    let Some(median_m) = ranges_m.get(ranges_m.len() / 2).copied() else {
        return Check::failed(
            "echo",
            Cause::MissingEcho,
            format!("no echo in {} pings", readings.len()),
            "point the ranger at a wall 0.5 to 5 m away; if it clicks at each ping, ECHO does not \
             reach the board (its wire, its 4.7 kohm pull-up); if it does not click, check INIT's wire, \
             the module's 5 V and the transducer's cable",
        );
    };
    check_spread(&ranges_m, median_m, readings.len())
}

/// Detects echoes at impossible times.
fn check_times(times_s: &[f64], window_s: f64) -> Option<Check> {
    let early = times_s.iter().filter(|&&time_s| time_s < EARLIEST_S).count();
    let late = times_s.iter().filter(|&&time_s| time_s > window_s).count();
    let (count, time_s, why) = if early > 0 {
        let first = times_s.iter().copied().fold(f64::INFINITY, f64::min);
        (early, first, "before the end of the module's blanking, 2.38 ms after the ping")
    } else if late > 0 {
        (late, times_s.iter().copied().fold(0.0, f64::max), "after the listening window")
    } else {
        return None;
    };
    Some(Check::failed(
        "echo",
        Cause::EchoTime,
        format!(
            "{count} of {} echoes came {why}: {:.3} ms, {:.3} m",
            times_s.len(),
            time_s * 1e3,
            range_m(time_s)
        ),
        "this is not sound: ECHO picks up INIT or the motor (keep its wire apart, check its pull-up and \
         the module's 0.1 uF), or the firmware measures something else",
    ))
}

/// Checks that ranges, sorted in ascending order, agree.
fn check_spread(ranges_m: &[f64], median_m: f64, pings: usize) -> Check {
    // Up to a tenth at either end may come from a person walking by.
    let tail = ranges_m.len() / 10;
    let inner = ranges_m.get(tail..ranges_m.len() - tail).unwrap_or_default();
    let spread_m = inner.last().unwrap_or(&median_m) - inner.first().unwrap_or(&median_m);
    let detail = format!(
        "{} of {pings} pings received an echo, at {median_m:.3} m (spread {})",
        ranges_m.len(),
        format_length(spread_m)
    );
    if spread_m > MAX_SPREAD_M {
        return Check::failed(
            "echo",
            Cause::Scatter,
            detail,
            "readings of one wall agree to millimetres: point the ranger squarely at a hard wall 0.5 to \
             5 m away with nothing in between, and let nothing move; if they still scatter, the \
             module's supply or the wire of ECHO is noisy",
        );
    }
    if 2 * ranges_m.len() < pings {
        return Check::warning(
            "echo",
            Cause::MissingEcho,
            detail,
            "more than half received no echo: point the ranger squarely at a hard wall",
        );
    }
    Check::ok("echo", detail)
}

fn range_m(time_s: f64) -> f64 {
    time_s * SOUND_M_S / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_protocol::messages::Echoes;

    fn cause(ranges_m: &[f64]) -> Option<Cause> {
        let reading = |range_m: &f64| Reading {
            sweep: 0,
            index: 0,
            step: 0,
            fired_ticks: 0,
            status: ReadingStatus::Echo,
            echoes: Echoes::from_ticks(&[(range_m / SOUND_M_S * 2.0 / TICK_S) as u32]),
        };
        check_echoes(&ranges_m.iter().map(reading).collect::<Vec<_>>(), 124_000).cause
    }

    #[test]
    fn impossible_times_and_scatter() {
        assert_eq!(cause(&[1.0; 10]), None);
        assert_eq!(cause(&[0.42; 10]), None, "at the end of the blanking");
        assert_eq!(cause(&[0.001; 10]), Some(Cause::EchoTime));
        assert_eq!(cause(&[1.0, 1.0, 0.001]), Some(Cause::EchoTime));
        assert_eq!(cause(&[172.0; 10]), Some(Cause::EchoTime));
        let scattered: Vec<f64> = (0..10).map(|n| 1.0 + 0.07 * f64::from(n)).collect();
        assert_eq!(cause(&scattered), Some(Cause::Scatter));
        assert_eq!(cause(&[1.0, 1.7]), Some(Cause::Scatter));
        let walked_by = [[2.0; 9].as_slice(), &[1.0]].concat();
        assert_eq!(cause(&walked_by), None);
        assert_eq!(cause(&[]), Some(Cause::MissingEcho));
    }
}
