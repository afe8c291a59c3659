//! Detection of wrong units of angles and ranges.

use super::*;

fn rows(count: usize, angle: impl Fn(f64) -> f64) -> String {
    let row = |at: usize| format!("{:.4},{}\n", angle(at as f64 / count as f64), 150 + at % 5);
    (0..count).map(row).collect()
}

#[test]
fn finds_radians_over_any_span() {
    use std::f64::consts::{PI, TAU};
    let mapping = || columns("azimuth_deg=1,range_cm=2");
    for (name, text) in [
        ("a turn from 0", rows(36, |part| TAU * part)),
        ("a turn about 0", rows(36, |part| TAU * part - PI)),
        ("half a turn", rows(36, |part| PI * part)),
        ("the front", rows(36, |part| PI * part - PI / 2.0)),
        ("few", rows(5, |part| TAU * part)),
        ("sixteen", rows(16, |part| TAU * part)),
    ] {
        let message = error_text(examine(text.as_bytes(), mapping(), assumptions()));
        assert!(
            message.contains("looks like radians")
                && message.contains("--columns azimuth_rad=1,range_cm=2"),
            "{name}: {message}"
        );
        let radians = columns("azimuth_rad=1,range_cm=2");
        examine(text.as_bytes(), radians, assumptions()).expect(name);
    }
    for (name, text) in [
        (
            "whole degrees of a small sector",
            "0,150\n1,151\n2,150\n3,150\n4,151\n5,150\n6,150\n".to_owned(),
        ),
        ("tenths of degrees", rows(36, |part| 360.0 * part)),
        ("beyond", rows(36, |part| 6.5 * part)),
    ] {
        examine(text.as_bytes(), mapping(), assumptions()).expect(name);
    }
}

#[test]
fn finds_wrong_length_units() {
    let table = |scale: f64| -> String {
        (0..36)
            .map(|at| format!("{},{:.3}\n", 10 * at, scale * (1.2 + 0.01 * f64::from(at))))
            .collect()
    };
    for (scale, given, right) in [
        (1.0, "range_cm=2", "range_m=2"),
        (100.0, "range_m=2", "range_cm=2"),
        (1000.0, "range_cm=2", "range_mm=2"),
        (1000.0, "range_m=2", "range_mm=2"),
    ] {
        let mapping = columns(&format!("azimuth_deg=1,{given}"));
        let message = error_text(examine(table(scale).as_bytes(), mapping, assumptions()));
        let option = format!("--columns azimuth_deg=1,{right}");
        assert!(
            message.contains("is the unit right?") && message.contains(&option),
            "{scale}: {message}"
        );
        let mapping = columns(&format!("azimuth_deg=1,{right}"));
        assert_eq!(
            examine(table(scale).as_bytes(), mapping, assumptions()).expect("right").echoes,
            36
        );
    }
    // Ranges of a few centimetres are plausible.
    let near: String = (0..36).map(|at| format!("{},{}\n", 10 * at, 6 + at % 4)).collect();
    examine(near.as_bytes(), columns("azimuth_deg=1,range_cm=2"), assumptions())
        .expect("a few centimetres");
}

#[test]
fn rejects_positions_of_echoes() {
    let plotted = |turn: bool, own: [f64; 2]| -> String {
        let row = |at: i32| {
            let (angle, range) = (f64::from(10 * at), 120.0 + f64::from(at * 7 % 5));
            let (sin, cos) = angle.to_radians().sin_cos();
            let [x, y] = if turn { [range * sin, range * cos] } else { [range * cos, range * sin] };
            format!("{angle},{range},{:.1},{:.1}\n", own[0] + x, own[1] + y)
        };
        (0..18).map(row).collect()
    };
    for text in [plotted(false, [0.0; 2]), plotted(true, [0.0; 2]), plotted(false, [50.0, 20.0])] {
        let text = format!("angle_deg,distance_cm,x_cm,y_cm\n{text}");
        let message = error_text(examine(text.as_bytes(), Mapping::default(), assumptions()));
        let option = "--columns azimuth_deg=angle_deg,range_cm=distance_cm";
        assert!(
            message.contains("the position of the echo") && message.contains(option),
            "{message}"
        );
        let mapping = columns("azimuth_deg=angle_deg,range_cm=distance_cm");
        assert!(!examine(text.as_bytes(), mapping, assumptions()).expect("answered").has_poses);
    }
    // Moving robot.
    let driven: String =
        (0..18).map(|at| format!("{},{},{},{}\n", 20 * at, 120 + at, 5 * at, 2 * at)).collect();
    let mapping = columns("azimuth_deg=1,range_cm=2,x_cm=3,y_cm=4");
    assert!(examine(driven.as_bytes(), mapping, assumptions()).expect("a course").has_poses);
}

/// Radians over more than a revolution, in a narrow sector, and as headings.
#[test]
fn finds_radians_beyond_one_turn() {
    let table = |angles: &[f64]| -> String {
        let rows =
            angles.iter().zip(0..).map(|(angle, at)| format!("{angle:.4},{}\n", 120 + at % 7));
        format!("angle_deg,distance_cm\n{}", rows.collect::<String>())
    };
    let steps = |count: u32, step_deg: f64| -> Vec<f64> {
        (0..count).map(|at| (f64::from(at) * step_deg).to_radians()).collect()
    };
    for angles in
        [steps(100, 10.0), steps(300, 1.8), steps(9, 1.0), steps(2, 90.0), steps(64, 5.625)]
    {
        let message =
            error_text(examine(table(&angles).as_bytes(), Mapping::default(), assumptions()));
        assert!(
            message.contains("looks like radians") && message.contains("azimuth_rad=angle_deg"),
            "{message}"
        );
    }
    // Degrees with decimals beyond a revolution of radians, by usual and by unusual steps.
    for step_deg in [0.9, 1.125, 0.45, 3.6, 1.8, 0.703_125] {
        let angles: Vec<f64> = (0..200).map(|at| step_deg * f64::from(at)).collect();
        examine(table(&angles).as_bytes(), Mapping::default(), assumptions()).expect("degrees");
    }
    // Whole numbers are degrees.
    let whole: String = (0..20).map(|at| format!("{at},{}\n", 120 + at % 7)).collect();
    let message =
        error_text(examine(whole.as_bytes(), columns("azimuth_rad=1,range_cm=2"), assumptions()));
    assert!(message.contains("--columns azimuth_deg=1,range_cm=2"), "{message}");
}

#[test]
fn finds_headings_in_radians() {
    let table = |headings: &[&str]| -> String {
        let rows = headings.iter().zip(0..).flat_map(|(heading, at)| {
            (0..12).map(move |beam| format!("{},{},{at},2,{heading}\n", 30 * beam, 120 + beam % 5))
        });
        format!("angle_deg,distance_cm,x_m,y_m,heading_deg\n{}", rows.collect::<String>())
    };
    for headings in [&["0", "0.7", "1.4", "2.1"][..], &["1.5708", "1.5708"], &["-3.142", "0"]] {
        let message =
            error_text(examine(table(headings).as_bytes(), Mapping::default(), assumptions()));
        assert!(message.contains("heading_rad=heading_deg"), "{message}");
    }
    for headings in [&["0", "15", "30"][..], &["0.1", "0.4", "0.2"], &["2.5"], &["90", "90.5"]] {
        examine(table(headings).as_bytes(), Mapping::default(), assumptions()).expect("degrees");
    }
}

#[test]
fn offers_fitting_units() {
    let table = |scale: f64| -> String {
        (0..36)
            .map(|at| format!("{},{:.1}\n", 10 * at, scale * (1.2 + 0.01 * f64::from(at))))
            .collect()
    };
    for (scale, given, right) in [
        (5830.0, "range_cm=2", "tof_us=2"),
        (5.83, "tof_us=2", "tof_ms=2"),
        (100.0, "tof_us=2", "range_cm=2"),
    ] {
        let mapping = columns(&format!("azimuth_deg=1,{given}"));
        let message = error_text(examine(table(scale).as_bytes(), mapping, assumptions()));
        assert!(message.contains(&format!("--columns azimuth_deg=1,{right}")), "{message}");
    }
    // Most ranges just beyond what the sensor measures, or a few of them.
    let mapping = || columns("azimuth_deg=1,range_m=2");
    let message = error_text(examine(table(4.0).as_bytes(), mapping(), assumptions()));
    assert!(message.contains("the maximum range of the sensor hc-sr04"), "{message}");
    let found = examine(table(3.0).as_bytes(), mapping(), assumptions()).expect("plausible");
    assert!(found.notes.join(" ").contains("beyond 4 m"), "{:?}", found.notes);
}

/// Positions of echoes in plots: scaled, turned, with any axes.
#[test]
fn finds_plotted_positions() {
    let table = |place: &dyn Fn(f64, f64) -> [f64; 2], heading: &str| -> String {
        let row = |at: i32| {
            let (angle, range) = (f64::from(10 * at), 120.0 + f64::from(at * 7 % 5));
            let [x, y] = place(range, angle.to_radians());
            format!("{angle},{range},{x:.1},{y:.1},{heading}\n")
        };
        (0..18).map(row).collect()
    };
    let mapping = || columns("azimuth_deg=1,range_cm=2,x_cm=3,y_cm=4,heading_deg=5");
    for text in [
        table(&|range, turn| [-range * turn.cos(), -range * turn.sin()], "0"),
        table(&|range, turn| [2.0 * range * turn.cos(), 2.0 * range * turn.sin()], "0"),
        table(&|range, turn| [100.0 - range * turn.sin(), 50.0 - range * turn.cos()], "0"),
        table(&|range, turn| [range * (turn + 0.4).cos(), range * (turn + 0.4).sin()], "0"),
    ] {
        let message = error_text(examine(text.as_bytes(), mapping(), assumptions()));
        assert!(message.contains("the position of the echo"), "{message}");
    }
    // A fixed ranger on a robot that approaches a wall.
    let row = |at: i32| format!("0,{},{},0,0\n", 300 - 5 * at, 5 * at);
    let text: String = (0..30).map(row).collect();
    examine(text.as_bytes(), mapping(), assumptions()).expect("a course");
}
