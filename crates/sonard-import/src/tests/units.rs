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
