//! Clusters, fits and merging against their definitions.

use std::collections::BTreeSet;

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{
    FitSettings, LaserReturn, LaserScan, LineKind, LineMap, LineMapSettings, MAX_ERROR_M, MapLine,
    MergeSettings, clusters, fit, map_error, merge,
};
use crate::interpret::{BeamOutcome, Sweep, SweepBeam};
use sonard_model::geometry::{DVec2, Pose};

/// Graph by definition, from all pairs.
fn by_definition(points: &[DVec2], min_m: f64) -> Vec<Vec<usize>> {
    let radius = |at: usize| {
        let others = (0..points.len()).filter(|other| *other != at);
        let nearest = others.map(|other| points[at].distance(points[other]));
        let nearest_m = nearest.fold(f64::INFINITY, f64::min);
        if nearest_m.is_finite() { nearest_m.max(min_m) } else { min_m }
    };
    let mut group: Vec<usize> = (0..points.len()).collect();
    for a in 0..points.len() {
        for b in 0..a {
            if points[a].distance(points[b]) <= radius(a) + radius(b) {
                let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    let names: BTreeSet<usize> = group.iter().copied().collect();
    names.iter().map(|name| (0..points.len()).filter(|at| group[*at] == *name).collect()).collect()
}

proptest! {
    #[test]
    fn clusters_are_graph_components(
        raw in prop::collection::vec((0..40_i32, 0..40_i32), 0..60),
        min_m in 0.0..2.0_f64,
    ) {
        let points: Vec<DVec2> =
            raw.iter().map(|(x, y)| DVec2::new(f64::from(*x), f64::from(*y).powf(1.1))).collect();
        prop_assert_eq!(clusters(&points, min_m), by_definition(&points, min_m));
    }
}

#[test]
fn empty_and_non_finite_points() {
    assert!(clusters(&[], 0.1).is_empty());
    assert_eq!(clusters(&[DVec2::NAN, DVec2::ONE], 0.1), [[1]]);
    assert_eq!(clusters(&[DVec2::ONE; 5], 0.0), [[0, 1, 2, 3, 4]]);
}

fn along(a: DVec2, b: DVec2, count: usize) -> impl Iterator<Item = DVec2> {
    (0..count).map(move |i| a + (b - a) * i as f64 / (count - 1) as f64)
}

#[test]
fn corner_is_two_segments() {
    let corner = [DVec2::ZERO, DVec2::X, DVec2::ONE];
    let clean: Vec<DVec2> =
        along(corner[0], corner[1], 40).chain(along(corner[1], corner[2], 40)).collect();
    let settings = FitSettings::default();
    let exact = fit(&clean, &settings);
    assert_eq!(exact.len(), 2, "{exact:?}");
    assert!(
        exact[0].ends[0].distance(corner[0]) < 1e-9 && exact[1].ends[1].distance(corner[2]) < 1e-9
    );
    let mut rng = Pcg64::seed_from_u64(1);
    let mut jitter = || rng.random_range(-0.01..0.01);
    let noisy: Vec<DVec2> = clean.iter().map(|p| *p + DVec2::new(jitter(), jitter())).collect();
    let rough = fit(&noisy, &settings);
    assert_eq!(rough.len(), 2, "{rough:?}");
    for (clean, noisy) in exact.iter().zip(&rough) {
        assert!(noisy.confidence < clean.confidence && noisy.confidence > 0.5, "{noisy:?}");
        for (a, b) in clean.ends.iter().zip(noisy.ends) {
            assert!(a.distance(b) < 0.03, "{a} {b}");
        }
    }
}

#[test]
fn few_points_are_no_segment() {
    let settings = FitSettings::default();
    assert!(fit(&[], &settings).is_empty());
    assert!(fit(&[DVec2::ZERO, DVec2::X], &settings).is_empty());
    assert!(fit(&[DVec2::ONE; 10], &settings).is_empty(), "no length");
    assert!(fit(&[DVec2::NAN; 10], &settings).is_empty());
}

fn line(a: [f64; 2], b: [f64; 2], kind: LineKind, confidence: f64) -> MapLine {
    MapLine {
        ends: [a.into(), b.into()],
        terminal: [false; 2],
        kind,
        confidence,
        seen_from: DVec2::Y,
    }
}

#[test]
fn slopes_blend_by_equation_1() {
    // l1 = 2, f1 = 0.9; l2 = 1, f2 = 0.6: g = max(0.6, 0.2) = 0.6.
    let main = line([0.0, 0.0], [2.0, 0.0], LineKind::Sonar, 0.9);
    let length_m = 0.04_f64.hypot(1.0);
    let minor = line([2.1, 0.0], [2.1 + 1.0 / length_m, 0.04 / length_m], LineKind::Sonar, 0.6);
    let merged = merge(&minor, &main, &MergeSettings::default()).expect("one wall");
    let along = merged.ends[1] - merged.ends[0];
    assert!((along.y / along.x - 0.4 * 0.04).abs() < 1e-9, "{merged:?}");
    // Through the point between the nearest ends, (2, 0) and (2.1, 0).
    let through = DVec2::new(0.6 * 2.0 + 0.4 * 2.1, 0.0);
    assert!(along.perp_dot(through - merged.ends[0]).abs() < 1e-9);
    assert_eq!(merged.kind, LineKind::Sonar);
    assert!((merged.confidence - 0.8).abs() < 1e-9);
    assert!((merged.length_m() - 3.1).abs() < 0.01);
}

/// l1 = 2, f1 = 0.5; l2 = 1.5, f2 = 0.6: g = max(2 / 3.5 0.5, 1.5 / 3.5 0.6).
#[test]
fn weight_of_equation_1_is_relative() {
    let main = line([0.0, 0.0], [2.0, 0.0], LineKind::Sonar, 0.5);
    let end = DVec2::new(2.0, 0.0) + 1.5 * DVec2::new(1.0, 0.04).normalize();
    let minor = line([2.0, 0.0], end.to_array(), LineKind::Sonar, 0.6);
    let merged = merge(&main, &minor, &MergeSettings::default()).expect("one wall");
    let along = merged.ends[1] - merged.ends[0];
    let slope = (1.0 - 2.0 / 3.5 * 0.5) * 0.04;
    assert!((along.y / along.x - slope).abs() < 1e-9, "{merged:?}");
    assert!((merged.confidence - 1.9 / 3.5).abs() < 1e-12, "{merged:?}");
}

/// Distance is measured where the lines overlap: beyond the end of one, they may diverge.
#[test]
fn closeness_is_measured_on_the_overlap() {
    let wall = line([0.0, 0.0], [1.0, 0.0], LineKind::Sonar, 0.9);
    let slanted = |at_end_m: f64, beyond_m: f64| {
        line([0.5, 0.0], [1.0 + beyond_m, at_end_m * (0.5 + beyond_m) / 0.5], LineKind::Sonar, 0.5)
    };
    let merged = |other: &MapLine| merge(&wall, other, &MergeSettings::default()).is_some();
    assert!(merged(&slanted(0.03, 1.0)) && merged(&slanted(0.045, 0.2)));
    assert!(!merged(&slanted(0.055, 0.2)));
}

#[test]
fn crossing_lines_keep_their_crossing() {
    let level = line([0.0, 0.0], [2.0, 0.0], LineKind::Laser, 1.0);
    let tilted = line([0.5, -0.02], [1.5, 0.02], LineKind::Laser, 1.0);
    let merged = merge(&level, &tilted, &MergeSettings::default()).expect("one wall");
    let along = merged.ends[1] - merged.ends[0];
    assert!(along.perp_dot(DVec2::X - merged.ends[0]).abs() < 1e-9);
    assert_eq!(merged.kind, LineKind::Laser);
}

#[test]
fn sonar_is_projected_onto_laser() {
    let mut laser = line([0.0, 0.0], [1.0, 0.0], LineKind::Laser, 0.9);
    laser.terminal = [true, false];
    let sonar = line([-0.3, 0.03], [2.0, 0.02], LineKind::Sonar, 0.5);
    for merged in [
        merge(&laser, &sonar, &MergeSettings::default()),
        merge(&sonar, &laser, &MergeSettings::default()),
    ] {
        let merged = merged.expect("one wall");
        assert_eq!((merged.kind, merged.terminal), (LineKind::Complex, [true, false]));
        assert!(merged.ends[0].length() < 1e-12, "the confirmed end stays: {merged:?}");
        assert!(merged.ends[1].distance(DVec2::new(2.0, 0.0)) < 1e-9);
    }
}

#[test]
fn distant_or_crossing_lines_stay_two() {
    let wall = line([0.0, 0.0], [1.0, 0.0], LineKind::Sonar, 0.9);
    for other in [
        line([0.0, 0.06], [1.0, 0.06], LineKind::Sonar, 0.9),
        line([1.3, 0.0], [2.0, 0.0], LineKind::Sonar, 0.9),
        line([0.5, 0.0], [0.5, 1.0], LineKind::Sonar, 0.9),
        line([0.5, 0.0], [0.5, 0.0], LineKind::Sonar, 0.9),
    ] {
        assert_eq!(merge(&wall, &other, &MergeSettings::default()), None, "{other:?}");
    }
}

/// Sweep that reads the given points from a position.
fn sweep(place: DVec2, points: &[DVec2]) -> Sweep {
    let beams = (0..).zip(points).map(|(index, point)| {
        let off = *point - place;
        let (azimuth_deg, outcome) = (off.to_angle().to_degrees(), BeamOutcome::Echo(off.length()));
        SweepBeam { azimuth_deg, index, outcome, mount: DVec2::ZERO }
    });
    let pose = Pose { x_m: place.x, y_m: place.y, heading_deg: 0.0 };
    Sweep { pose, step_deg: 0.9, beams: beams.collect(), closed: true }
}

/// Laser scan that reads the given points from a position.
fn laser(place: DVec2, points: &[DVec2]) -> LaserScan {
    let pose = Pose { x_m: place.x, y_m: place.y, heading_deg: 0.0 };
    let mut returns: Vec<LaserReturn> = points
        .iter()
        .map(|point| *point - place)
        .map(|off| LaserReturn {
            azimuth_deg: off.to_angle().to_degrees(),
            range_m: Some(off.length()),
        })
        .collect();
    returns.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
    LaserScan { pose, returns }
}

#[test]
fn three_rules_discard_readings() {
    let mut map = LineMap::new(LineMapSettings::default());
    // Beyond the logical distance.
    assert_eq!(
        map.add_sonar(&sweep(DVec2::ZERO, &[DVec2::new(3.5, 0.0), DVec2::new(2.0, 0.0)])),
        1
    );
    // Within half a metre of an earlier robot position where nothing was detected.
    let later = [DVec2::new(0.2, 0.1), DVec2::new(0.8, 0.0)];
    assert_eq!(map.add_sonar(&sweep(DVec2::new(1.5, 0.0), &later)), 1);
    // Between the laser and its reading; points on that wall stay.
    let wall: Vec<DVec2> = along(DVec2::new(4.0, -1.0), DVec2::new(4.0, 1.0), 100).collect();
    map.add_laser(&laser(DVec2::new(2.5, 0.0), &wall));
    let suspect = [DVec2::new(3.5, 0.1), DVec2::new(3.98, 0.1), DVec2::new(3.5, 2.0)];
    assert_eq!(map.add_sonar(&sweep(DVec2::new(2.5, 1.0), &suspect)), 1);
}

#[test]
fn wall_from_two_positions_is_one_line() {
    let wall = |from: f64, to: f64| -> Vec<DVec2> {
        along(DVec2::new(from, 1.0), DVec2::new(to, 1.0), 60).collect()
    };
    let mut map = LineMap::new(LineMapSettings::default());
    map.add_sonar(&sweep(DVec2::ZERO, &wall(-0.5, 0.7)));
    map.add_sonar(&sweep(DVec2::X, &wall(0.6, 1.5)));
    map.add_laser(&laser(DVec2::X, &wall(1.3, 1.9)));
    let [line] = map.lines() else { panic!("{:?}", map.lines()) };
    assert_eq!(line.kind, LineKind::Complex);
    assert!((line.length_m() - 2.4).abs() < 1e-6, "{line:?}");
}

/// Noiseless laser scan of walls given by their ends, over a field of view in degrees.
fn shot(place: DVec2, field_deg: [f64; 2], walls: &[[DVec2; 2]]) -> LaserScan {
    let returns = (0..512).map(|at| {
        let azimuth_deg = field_deg[0] + (field_deg[1] - field_deg[0]) * f64::from(at) / 511.0;
        let ray = DVec2::from_angle(azimuth_deg.to_radians());
        let hit = |[a, b]: &[DVec2; 2]| {
            let (side, to_a) = (*b - *a, *a - place);
            let across = ray.perp_dot(side);
            let (range_m, share) = (to_a.perp_dot(side) / across, to_a.perp_dot(ray) / across);
            (range_m > 0.0 && (0.0..=1.0).contains(&share)).then_some(range_m)
        };
        let range_m = walls.iter().filter_map(hit).min_by(f64::total_cmp);
        LaserReturn { azimuth_deg, range_m }
    });
    let pose = Pose { x_m: place.x, y_m: place.y, heading_deg: 0.0 };
    LaserScan { pose, returns: returns.collect() }
}

/// Ends of the detected segments with their terminal flags, sorted by x, then y.
fn ends_of(scan: &LaserScan) -> Vec<(DVec2, bool)> {
    let lines = scan.lines(&LineMapSettings::default());
    let mut ends: Vec<(DVec2, bool)> = lines
        .iter()
        .flat_map(|line| [0, 1].map(|end| (line.ends[end], line.terminal[end])))
        .collect();
    ends.sort_by(|a, b| a.0.x.total_cmp(&b.0.x).then(a.0.y.total_cmp(&b.0.y)));
    ends
}

#[test]
fn laser_confirms_borders_and_corners() {
    let at = DVec2::new;
    let wall = [at(1.2, -2.0), at(1.2, 2.0)];
    // The field of view ends on a wall: nothing is confirmed.
    let seen = ends_of(&shot(DVec2::ZERO, [-12.0, 12.0], &[wall]));
    assert_eq!(seen.iter().map(|end| end.1).collect::<Vec<_>>(), [false, false]);
    // A wall ends within the field of view, with nothing behind it.
    let seen = ends_of(&shot(DVec2::ZERO, [-12.0, 12.0], &[[at(1.2, -2.0), at(1.2, 0.1)]]));
    let (border, _) = seen.iter().find(|end| end.1).expect("a border");
    assert!(border.distance(at(1.2, 0.1)) < 1e-3, "{border}");
    assert_eq!(seen.iter().filter(|end| end.1).count(), 1);
    // A corner, from inside and from outside.
    let corner = at(1.2, 0.2);
    for side in [at(0.6, 0.2), at(1.8, 0.2)] {
        let seen = ends_of(&shot(
            DVec2::ZERO,
            [-5.0, 22.0],
            &[[at(1.2, -2.0), at(1.2, 0.2)], [at(1.2, 0.2), side]],
        ));
        let at_corner: Vec<_> = seen.iter().filter(|end| end.0.distance(corner) < 2e-3).collect();
        assert!(at_corner.iter().all(|end| end.1), "{seen:?}");
        // The wall itself hides the outer face: then the corner is a border.
        assert_eq!(at_corner.len(), if side.x < 1.2 { 2 } else { 1 }, "{seen:?}");
    }
    // Something nearer hides the rest of a wall: only the end of the nearer object is confirmed.
    let seen = ends_of(&shot(DVec2::ZERO, [-12.0, 12.0], &[wall, [at(0.8, 0.0), at(0.8, 2.0)]]));
    let confirmed: Vec<_> = seen.iter().filter(|end| end.1).collect();
    assert_eq!(confirmed.len(), 1, "{seen:?}");
    assert!(confirmed[0].0.distance(at(0.8, 0.0)) < 1e-3);
}

#[test]
fn laser_cuts_sonar_lines() {
    let at = DVec2::new;
    let mut map = LineMap::new(LineMapSettings::default());
    let phantom: Vec<DVec2> = along(at(1.0, -0.4), at(1.0, 0.4), 40).collect();
    let behind: Vec<DVec2> = along(at(2.4, -0.2), at(2.4, 0.2), 40).collect();
    map.add_sonar(&sweep(DVec2::ZERO, &[phantom, behind].concat()));
    assert_eq!(map.lines().len(), 2);
    map.add_laser(&shot(DVec2::ZERO, [-30.0, 30.0], &[[at(1.5, -2.0), at(1.5, 2.0)]]));
    let [wall] = map.lines() else { panic!("{:?}", map.lines()) };
    assert_eq!(wall.kind, LineKind::Laser);
}

/// A line near which nothing is detected loses its part close to the robot.
#[test]
fn line_without_echo_is_cut_near_the_robot() {
    let at = DVec2::new;
    let mut map = LineMap::new(LineMapSettings::default());
    let seen: Vec<DVec2> = along(at(-0.5, 1.0), at(2.0, 1.0), 100).collect();
    map.add_sonar(&sweep(DVec2::ZERO, &seen));
    assert_eq!(map.lines().len(), 1);
    map.add_sonar(&sweep(at(0.0, 0.8), &[at(0.0, -1.0)]));
    let [rest] = map.lines() else { panic!("{:?}", map.lines()) };
    let (low, high) = (rest.ends[0].x.min(rest.ends[1].x), rest.ends[0].x.max(rest.ends[1].x));
    // Half a metre from the robot is 0.46 m along it; lines are cut to 2 cm.
    let known_m = (0.5_f64.powi(2) - 0.2_f64.powi(2)).sqrt();
    assert!((0.0..0.021).contains(&(low - known_m)) && (high - 2.0).abs() < 1e-9, "{rest:?}");
}

#[test]
fn two_confirmed_ends_fix_a_line() {
    let mut near = line([0.0, 0.0], [1.0, 0.01], LineKind::Laser, 0.9);
    near.terminal = [true, false];
    let mut far = line([1.1, 0.0], [3.0, 0.02], LineKind::Laser, 0.8);
    far.terminal = [false, true];
    let merged = merge(&near, &far, &MergeSettings::default()).expect("one wall");
    assert_eq!(
        (merged.ends, merged.terminal),
        ([DVec2::ZERO, DVec2::new(3.0, 0.02)], [true, true])
    );
}

#[test]
fn map_errors_match_closed_forms() {
    let text = r#"{"name":"t","materials":{"m":{"reflectance":0.9}},"walls":[
        {"id":"a","from":[0,0],"to":[2,0],"material":"m"}]}"#;
    let scene = sonard_model::scene::Scene::from_json(text).expect("a scene");
    let error = |lines: &[MapLine]| map_error(lines, &scene);
    let right = line([0.0, 0.0], [2.0, 0.0], LineKind::Laser, 1.0);
    assert_eq!(error(&[right]).map_error_m, 0.0);
    assert_eq!(error(&[]).map_error_m, MAX_ERROR_M);
    // Offset from the wall by 1 cm over its whole length.
    let offset = error(&[line([0.0, 0.01], [2.0, 0.01], LineKind::Laser, 1.0)]);
    assert!(
        (offset.line_error_m - 0.01).abs() < 1e-12
            && (offset.endpoint_error_m - 0.01).abs() < 1e-12
    );
    // Half of the wall is missing: at 0 to 0.5 m over the first half metre, then at 0.5 m.
    let half = error(&[line([0.0, 0.0], [1.0, 0.0], LineKind::Laser, 1.0)]);
    assert_eq!(half.false_m, 0.0);
    assert!((half.missing_m - (0.5 * 0.25 + 0.5 * 0.5) / 2.0).abs() < 1e-3, "{half:?}");
    assert!((half.missing_end_m - 0.25).abs() < 1e-12 && (half.false_end_m - 0.25).abs() < 1e-12);
}
