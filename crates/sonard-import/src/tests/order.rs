//! Order of the readings of a sweep, and the angles of a LaserScan.

use proptest::prelude::*;

use super::*;

fn rows(directions_deg: &[f64]) -> String {
    let row = |deg: &f64| format!("{deg},{}\n", 150.0 + 40.0 * deg.to_radians().sin());
    directions_deg.iter().map(row).collect()
}

fn mapping() -> Mapping {
    columns("azimuth_deg=1,range_cm=2")
}

/// Directions of several sweeps in one sense, or back and forth.
fn sweeps(from: i32, count: i32, step: i32, sweeps: i32, turns: bool) -> Vec<f64> {
    let one: Vec<f64> = (0..count).map(|at| f64::from(from + at * step)).collect();
    let sweep = |number: i32| {
        let mut sweep = one.clone();
        if turns && number % 2 == 1 {
            sweep.reverse();
        }
        sweep
    };
    (0..sweeps).flat_map(sweep).collect()
}

proptest! {
    #[test]
    fn random_order_needs_an_option(
        directions in Just(sweeps(-90, 120, 3, 1, false)).prop_shuffle(),
        from in 0.0..360.0_f64,
        step in 0.1..1.0_f64,
    ) {
        let directions: Vec<f64> = directions.iter().map(|deg| from + step * deg).collect();
        let text = rows(&directions);
        let error = error_text(examine(text.as_bytes(), mapping(), assumptions()));
        prop_assert!(error.contains("not in the order") && error.contains("--unordered"), "{error}");
        let records = import(&text, Mapping { unordered: true, ..mapping() }).expect("one scan");
        let (starts, pings) = (starts(&records), pings(&records));
        prop_assert_eq!((starts.len(), pings.len()), (1, 120));
        // Each reading has the index of its direction in an evenly spaced plan.
        let plan = &starts[0].plan;
        prop_assert!((plan.step_deg - 3.0 * step).abs() < 1e-6, "{plan:?}");
        for ping in &pings {
            let planned_deg = plan.from_deg + f64::from(ping.index) * plan.step_deg;
            let off_deg = sonard_model::geometry::wrap_180(planned_deg - ping.azimuth_deg);
            prop_assert!(off_deg.abs() < 1e-3, "{planned_deg} {ping:?}");
        }
    }

    #[test]
    fn sweeps_need_no_option(
        (from, count, step) in (-180_i32..180, 2_i32..72, prop::sample::select(vec![1_i32, 2, 5, -5, 9])),
        number in 1..12,
        turns: bool,
        jitter in prop::collection::vec(-0.1..0.1, 900),
    ) {
        let count = count.min(360 / step.abs());
        let directions = sweeps(from, count, step, number, turns);
        let jittered: Vec<f64> = directions
            .iter()
            .zip(&jitter)
            .map(|(deg, jitter)| deg + jitter * f64::from(step))
            .collect();
        for directions in [&directions, &jittered] {
            let examined = examine(rows(directions).as_bytes(), mapping(), assumptions());
            let error = examined.map_err(|error| error.to_string()).err().unwrap_or_default();
            prop_assert!(!error.contains("order"), "{error}");
        }
    }
}

#[test]
fn scan_numbers_replace_the_order() {
    let directions: Vec<f64> = (0..40).map(|at| f64::from(at * 151 % 360)).collect();
    let text: String = rows(&directions).lines().map(|line| format!("{line},7\n")).collect();
    let mapping = columns("azimuth_deg=1,range_cm=2,scan=3");
    assert_eq!(starts(&import(&text, mapping).expect("one scan")).len(), 1);
}

/// `angle_max` is redundant; drivers state the last beam or the end of its step.
#[test]
fn contradictory_angle_max_is_noted() {
    let scan = |max: f64| {
        format!(
            r#"{{"angle_min":-0.5,"angle_max":{max},"angle_increment":0.1,"range_min":0.02,"range_max":4,"ranges":[1,1.1,1.2,1.3,1.2,1.1,1,1.1,1.2,1.3,1.2]}}"#
        )
    };
    let notes = |max: f64| {
        let found = examine(scan(max).as_bytes(), Mapping::default(), assumptions());
        found.expect("a scan").notes.join("; ")
    };
    for max in [0.5, 0.6, 0.5 + std::f64::consts::TAU] {
        assert!(!notes(max).contains("angle_max"), "{max}: {}", notes(max));
    }
    for max in [0.3, 0.8, 3.1, -0.5] {
        let notes = notes(max);
        assert!(
            notes.contains("angle_max contradicts the number of ranges in 1 of 1 scans")
                && notes.contains("11 ranges in steps of 0.1000 rad end at 0.500"),
            "{max}: {notes}"
        );
    }
}
