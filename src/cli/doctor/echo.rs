//! What firings say of module and transducer. Pure.

use firmware_protocol::messages::{Reading, ReadingStatus};

use super::report::{Cause, Check};

/// Speed of sound that a range is quoted with, metres a second: 20 degrees Celsius.
const SOUND_M_S: f64 = 343.4;
/// A tick, seconds.
const TICK_S: f64 = 0.5e-6;
/// The module's receiver is closed for this long after firing, seconds; a tenth less is its tolerance.
const EARLIEST_S: f64 = 0.9 * 2.38e-3;
/// Readings of one wall that scatter more than this are of more than one thing, metres.
const MAX_SPREAD_M: f64 = 0.1;

/// Judges the readings of firings into one direction, with windows of so many ticks.
pub(super) fn judge(readings: &[Reading], window_ticks: u32) -> Check {
    let count = |status| readings.iter().filter(|reading| reading.status == status).count();
    let stuck = count(ReadingStatus::ModuleFault);
    if stuck > 0 {
        return Check::failed(
            "echo",
            Cause::StuckEcho,
            format!("ECHO was high before {stuck} of {} firings", readings.len()),
            "ECHO must be low until INIT rises: check the module's 5 V and ground, that its 4.7 \
             kohm pull-up goes to its own supply, and that INIT and ECHO are not swapped",
        );
    }
    let times_s: Vec<f64> = readings
        .iter()
        .filter_map(|reading| reading.echoes.first())
        .map(|ticks| f64::from(*ticks) * TICK_S)
        .collect();
    if let Some(check) = impossible(&times_s, f64::from(window_ticks) * TICK_S) {
        return check;
    }
    let mut ranges_m: Vec<f64> = times_s.iter().map(|time_s| range_m(*time_s)).collect();
    ranges_m.sort_by(f64::total_cmp);
    let Some(median_m) = ranges_m.get(ranges_m.len() / 2).copied() else {
        return Check::failed(
            "echo",
            Cause::MissingEcho,
            format!("no echo in {} firings", readings.len()),
            "point the ranger at a wall 0.5 to 5 m away; if it clicks at each firing, ECHO does not \
             reach the board (its wire, its 4.7 kohm pull-up); if it is silent, check INIT's wire, \
             the module's 5 V and the transducer's cable",
        );
    };
    steady(&ranges_m, median_m, readings.len())
}

/// Echoes that no sound can have made.
fn impossible(times_s: &[f64], window_s: f64) -> Option<Check> {
    let early = times_s.iter().filter(|&&time_s| time_s < EARLIEST_S).count();
    let late = times_s.iter().filter(|&&time_s| time_s > window_s).count();
    let (count, time_s, why) = if early > 0 {
        let first = times_s.iter().copied().fold(f64::INFINITY, f64::min);
        (early, first, "before the module's receiver opens, 2.38 ms after firing")
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
        "that is no sound: ECHO picks up INIT or the motor (keep its wire apart, check its pull-up and \
         the module's 0.1 uF), or the firmware times something else",
    ))
}

/// Whether the firings, echoes of which come from these ranges in order, agree.
fn steady(ranges_m: &[f64], median_m: f64, firings: usize) -> Check {
    // One in ten at either end may be what a person did who walked by.
    let tail = ranges_m.len() / 10;
    let inner = ranges_m.get(tail..ranges_m.len() - tail).unwrap_or_default();
    let spread_m = inner.last().unwrap_or(&median_m) - inner.first().unwrap_or(&median_m);
    let heard = format!(
        "{} of {firings} firings heard an echo, at {median_m:.3} m (spread {:.1} mm)",
        ranges_m.len(),
        spread_m * 1e3
    );
    if spread_m > MAX_SPREAD_M {
        return Check::failed(
            "echo",
            Cause::Scatter,
            heard,
            "readings of one wall agree to millimetres: point the ranger squarely at a hard wall 0.5 to \
             5 m away with nothing in between, and let nothing move; if they still scatter, the \
             module's supply or the wire of ECHO is noisy",
        );
    }
    if 2 * ranges_m.len() < firings {
        return Check::warning(
            "echo",
            Cause::MissingEcho,
            heard,
            "more than half of them heard nothing: point the ranger squarely at a hard wall",
        );
    }
    Check::ok("echo", heard)
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
        judge(&ranges_m.iter().map(reading).collect::<Vec<_>>(), 124_000).cause
    }

    #[test]
    fn echoes_that_no_sound_made_and_readings_that_disagree_are_found() {
        assert_eq!(cause(&[1.0; 10]), None);
        assert_eq!(cause(&[0.42; 10]), None, "when the receiver opens");
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
