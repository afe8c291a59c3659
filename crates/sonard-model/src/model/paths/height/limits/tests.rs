//! Heights of paths that turn at floor and ceiling, compared with brute force.

use super::*;

/// Floor, ceiling and the ranger's height.
const PLACES: [(Option<f64>, Option<f64>, f64); 4] = [
    (Some(-0.3), Some(1.1), 0.4),
    (Some(-0.3), None, 0.4),
    (None, Some(1.1), 0.4),
    (None, None, 0.4),
];

fn heights((floor_z_m, ceiling_z_m, z_m): (Option<f64>, Option<f64>, f64)) -> Heights {
    Heights { floor_z_m, ceiling_z_m, z_m, ..Heights::default() }
}

/// Height of a ball that bounces between floor and ceiling, step by step.
fn bounced(place: (Option<f64>, Option<f64>, f64), z_m: f64) -> f64 {
    let (floor, ceiling, start_m) = place;
    let (mut at_m, mut ahead) = (start_m, (z_m - start_m).signum() * 1e-4);
    for _ in 0..((z_m - start_m).abs() * 1e4).round() as usize {
        at_m += ahead;
        if floor.is_some_and(|floor| at_m < floor) || ceiling.is_some_and(|top| at_m > top) {
            ahead = -ahead;
            at_m += ahead;
        }
    }
    at_m
}

#[test]
fn paths_fold_at_floor_and_ceiling() {
    for place in PLACES {
        let heights = heights(place);
        for step in -40..=40 {
            let z_m = 0.4 + 0.113 * f64::from(step);
            let expected_m = bounced(place, z_m);
            assert!((heights.folded_m(z_m) - expected_m).abs() < 3e-3, "{place:?} {z_m}");
        }
    }
    assert_eq!(heights(PLACES[3]).z_at(1.0), None);
    assert!((heights(PLACES[0]).z_at(1.0).expect("a height") - 0.8).abs() < 1e-12);
}

/// The climbs at which a path is at a wall are found by brute force.
#[test]
fn climbs_match_brute_force() {
    let highest_m = 4.0;
    for &place in &PLACES[..3] {
        let heights = heights(place);
        for stretch in [[-0.1, 0.15], [0.35, 0.5], [0.9, 1.1], [-0.3, -0.2]] {
            let spans = heights.unfolded([stretch], highest_m);
            let mut count = 0;
            for step in -3999..4000 {
                let climb_m = 1e-3 * f64::from(step) + 3e-4;
                let z_m = heights.folded_m(0.4 + climb_m);
                let is_there = stretch[0] <= z_m && z_m <= stretch[1];
                count += usize::from(is_there);
                let is_in = spans.iter().any(|[from, to]| (*from..=*to).contains(&climb_m));
                assert_eq!(is_there, is_in, "{place:?} {stretch:?} {climb_m}");
            }
            assert!(count > 90, "{place:?} {stretch:?}: {count}");
        }
    }
}

#[test]
fn blocking_between_two_heights() {
    for place in PLACES {
        let heights = heights(place);
        assert!(heights.blocks(None, [0.3, 0.4]), "what has no limits is everywhere");
        let [low_m, high_m] = [place.0.unwrap_or(-1.0), place.1.unwrap_or(2.0)];
        let stretches = [[low_m, low_m + 0.1], [0.35, 0.5], [high_m - 0.1, high_m]];
        for (from, to) in
            [(0.6, 0.8), (0.6, 1.5), (0.1, -0.9), (-3.0, 2.9), (2.3, 2.5), (-2.2, -2.5)]
        {
            for stretch in stretches {
                let meets = (0..=4000).any(|step| {
                    let z_m = heights.folded_m(from + f64::from(step) / 4000.0 * (to - from));
                    stretch[0] <= z_m && z_m <= stretch[1]
                });
                let found = heights.blocks(Some(stretch), [from, to]);
                assert_eq!(found, meets, "{place:?} {stretch:?} {from} {to}");
            }
        }
    }
}

/// Between a floor 0.7 m below and a ceiling 0.7 m above, of a path that climbs 3.5 m unfolded:
/// after a fifth, three fifths, and at its end.
#[test]
fn bounces_divide_paths_evenly() {
    let heights = heights(PLACES[0]);
    for (climb_m, first) in [(3.5, Reflector::Ceiling), (-3.5, Reflector::Floor)] {
        let found: Vec<_> = heights.bounces(climb_m, 3).collect();
        assert_eq!(found.len(), 3);
        for (bounce, share) in found.iter().zip([0.2, 0.6, 1.0]) {
            assert!((bounce.share - share).abs() < 1e-12, "{}", bounce.share);
            let expected_m = if bounce.surface == Reflector::Floor { -0.3 } else { 1.1 };
            assert_eq!(bounce.z_m, expected_m);
        }
        assert!(found[0].surface == first && found[1].surface != first);
    }
}
