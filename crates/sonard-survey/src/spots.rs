//! Stretches of walls that echoes observe: the Fresnel zones of mirror reflections.

use std::collections::BTreeSet;

use sonard_model::{
    geometry::{DVec2, distance_to_segment},
    model::{Mechanism, Path, Reflector},
};

use crate::{
    arrangement::{JOINED_M, LineArrangement, PieceSet, Run},
    judge::{Judge, Predictions},
    trace::{ExplainedArc, explain},
};

/// Share of the beams of an arc that must agree.
const SHARE: f64 = 0.5;
/// Minimum number of sweeps whose echoes determine a wall. From one place, the echo of a wall looks
/// like that of an edge or of a path of higher order.
const MIN_SWEEPS: usize = 2;
/// Minimum share of all arcs that a plan explains for its walls to be observed: complete plans of
/// simulated rooms leave 2 % at most.
const MIN_EXPLAINED_OF_ALL: f64 = 0.92;
/// Minimum share for an array. Directions of its arcs are known to the step between rangers only,
/// and a plan with a wrong wall has left as few as 4 % unexplained.
const MIN_EXPLAINED_OF_ARRAY: f64 = 0.97;
/// Minimum cosine of an angle of incidence.
const MIN_COSINE: f64 = 0.1;

/// Reflection of an explained echo by a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    /// Position along the line, metres.
    along_m: f64,
    /// Half-width of the first Fresnel zone along the line, metres.
    half_m: f64,
}

/// Echo of mirror reflections only.
struct MirrorEcho {
    sweep: usize,
    /// Part of a wall and spot of each reflection.
    reflections: Vec<(usize, Spot)>,
}

/// Stretches of each wall of a plan, in the order of its runs, along its line in metres, ordered
/// and apart.
///
/// Walls are divided where others end on them or cross them. Echoes of a single reflection, and
/// those of several whose other walls are determined, count. A wall is determined by such echoes
/// from two sweeps or more. At an end without a corner with another determined wall, a stretch ends
/// half a zone before the last point of reflection: an edge that near returns an echo of nearly the
/// same range.
pub(crate) fn observed_stretches(
    plan: &LineArrangement,
    walls: &PieceSet,
    judge: &Judge,
) -> Vec<Vec<[f64; 2]>> {
    let runs = plan.runs(walls);
    let parts = parts_of(plan, walls, &runs);
    let Some((_, predictions)) = judge.predictions(&plan.segments(walls)) else {
        return vec![Vec::new(); runs.len()];
    };
    let wavelength_m = judge.workspace.wavelength_m();
    let mut echoes = Vec::new();
    for explained in consistent_arcs(judge, &predictions).unwrap_or_default() {
        let Some(path) = explained.path() else { continue };
        let sweep = explained.arc.sweep;
        let place = (judge.poses[sweep].position(), wavelength_m);
        if let Some(reflections) = mirror_spots(plan, &runs, &parts, path, place) {
            echoes.push(MirrorEcho { sweep, reflections });
        }
    }
    let spots = determined_spots(&echoes, parts.len());
    let is_corner = |of: &WallPart, along_m: f64| {
        let end = plan.lines[runs[of.wall].line].at(along_m);
        parts.iter().zip(&spots).any(|(other, spots)| {
            let line = &plan.lines[runs[other.wall].line];
            let [a, b] = other.range_m.map(|along_m| line.at(along_m));
            other.wall != of.wall && !spots.is_empty() && distance_to_segment(end, a, b) < JOINED_M
        })
    };
    let mut stretches = vec![Vec::new(); runs.len()];
    for (part, spots) in parts.iter().zip(&spots) {
        let ends = part.range_m.map(|along_m| (along_m, is_corner(part, along_m)));
        stretches[part.wall].extend(stretches_of(spots, ends));
    }
    stretches
}

/// Explained arcs; `None` where a sweep has too many unexplained ones: then its pose may be wrong,
/// and the walls that it shares with the others.
pub(crate) fn consistent_arcs<'a>(
    judge: &Judge<'a>,
    predictions: &'a Predictions,
) -> Option<Vec<ExplainedArc<'a>>> {
    let workspace = judge.workspace;
    let explained_m = workspace.errors.explained_m();
    let min_share = 1.0 - workspace.max_unexplained_share();
    let mut all = Vec::new();
    for (arcs, (readings, predictions)) in
        workspace.arcs.iter().zip(judge.readings().iter().zip(predictions))
    {
        let of = |arc| explain(arc, readings, predictions, explained_m, SHARE);
        let explained: Vec<ExplainedArc> = arcs.iter().filter_map(of).collect();
        let is_lost = (explained.len() as f64) < min_share * arcs.len() as f64;
        // A round of an array has few arcs, and odometry holds its pose.
        if is_lost && !workspace.is_array {
            return None;
        }
        all.extend(explained);
    }
    let count: usize = workspace.arcs.iter().map(Vec::len).sum();
    let min_share = if workspace.is_array { MIN_EXPLAINED_OF_ARRAY } else { MIN_EXPLAINED_OF_ALL };
    (all.len() as f64 >= min_share * count as f64).then_some(all)
}

/// Part of a wall between others that end on it or cross it.
struct WallPart {
    wall: usize,
    /// Range along the line, metres.
    range_m: [f64; 2],
}

fn parts_of(plan: &LineArrangement, walls: &PieceSet, runs: &[Run]) -> Vec<WallPart> {
    let mut parts = Vec::new();
    for (wall, run) in runs.iter().enumerate() {
        let cuts = &plan.cuts[run.line];
        let is_met = |cut: &usize| plan.is_met(walls, run.line, *cut);
        let inner = (run.first + 1..=run.last).filter(is_met).map(|cut| cuts[cut].along_m);
        let mut from_m = cuts[run.first].along_m;
        for to_m in inner.chain([cuts[run.last + 1].along_m]) {
            parts.push(WallPart { wall, range_m: [from_m, to_m] });
            from_m = to_m;
        }
    }
    parts
}

/// Parts of walls and spots of a path of mirror reflections by walls; `None` for any other path.
fn mirror_spots(
    plan: &LineArrangement,
    runs: &[Run],
    parts: &[WallPart],
    path: &Path,
    (place, wavelength_m): (DVec2, f64),
) -> Option<Vec<(usize, Spot)>> {
    let points = path.polyline([place; 2]);
    let lengths_m: Vec<f64> = points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
    let whole_m: f64 = lengths_m.iter().sum();
    let mut before_m = 0.0;
    let mut found = Vec::new();
    for (at, interaction) in path.interactions.iter().enumerate() {
        let Mechanism::Reflection(Reflector::Wall(wall)) = interaction.mechanism else {
            return None;
        };
        let wall = wall as usize;
        let line = &plan.lines[runs.get(wall)?.line];
        before_m += lengths_m[at];
        let along = (interaction.point - points[at]).normalize_or_zero();
        let cosine = along.dot(line.normal()).abs().max(MIN_COSINE);
        let half_m = fresnel_half_m(wavelength_m, before_m, whole_m - before_m) / cosine;
        let along_m = line.along_m(interaction.point);
        let part = parts.iter().rposition(|of| of.wall == wall && of.range_m[0] <= along_m);
        let part = part.or_else(|| parts.iter().position(|of| of.wall == wall))?;
        found.push((part, Spot { along_m, half_m }));
    }
    Some(found)
}

/// Radius of the first Fresnel zone at distances from source and receiver along a path, metres.
fn fresnel_half_m(wavelength_m: f64, before_m: f64, after_m: f64) -> f64 {
    (wavelength_m * before_m * after_m / (before_m + after_m).max(1e-9)).sqrt()
}

/// Spots of each part of a wall by echoes that determine it.
fn determined_spots(echoes: &[MirrorEcho], parts: usize) -> Vec<Vec<Spot>> {
    let mut is_determined = vec![false; parts];
    loop {
        let mut spots = vec![Vec::new(); parts];
        let mut sweeps = vec![BTreeSet::new(); parts];
        for echo in echoes {
            for (wall, spot) in &echo.reflections {
                let mut others = echo.reflections.iter().filter(|(other, _)| other != wall);
                if others.all(|(other, _)| is_determined[*other]) {
                    spots[*wall].push(*spot);
                    sweeps[*wall].insert(echo.sweep);
                }
            }
        }
        let now: Vec<bool> = sweeps.iter().map(|of| of.len() >= MIN_SWEEPS).collect();
        if now == is_determined {
            let of_wall = spots.into_iter().zip(now);
            return of_wall.map(|(of, is_kept)| if is_kept { of } else { Vec::new() }).collect();
        }
        is_determined = now;
    }
}

/// Union of spots between two ends, each with `true` at a corner.
fn stretches_of(spots: &[Spot], ends: [(f64, bool); 2]) -> Vec<[f64; 2]> {
    let inner = |side: f64| spots.iter().map(move |spot| spot.along_m + side * spot.half_m);
    let [from, to] = ends;
    let low_m = if from.1 { from.0 } else { inner(1.0).fold(f64::INFINITY, f64::min) };
    let high_m = if to.1 { to.0 } else { inner(-1.0).fold(f64::NEG_INFINITY, f64::max) };
    let mut all: Vec<[f64; 2]> = spots
        .iter()
        .map(|spot| {
            [(spot.along_m - spot.half_m).max(low_m), (spot.along_m + spot.half_m).min(high_m)]
        })
        .filter(|[a, b]| a < b)
        .collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for [from, to] in all {
        match joined.last_mut().filter(|last| from <= last[1]) {
            Some(last) => last[1] = last[1].max(to),
            None => joined.push([from, to]),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echo(sweep: usize, walls: &[usize]) -> MirrorEcho {
        let spot = |wall: &usize| (*wall, Spot { along_m: *wall as f64, half_m: 0.1 });
        MirrorEcho { sweep, reflections: walls.iter().map(spot).collect() }
    }

    fn observed(echoes: &[MirrorEcho]) -> Vec<usize> {
        let spots = determined_spots(echoes, 3);
        (0..3).filter(|wall| !spots[*wall].is_empty()).collect()
    }

    #[test]
    fn two_places_determine_a_wall() {
        assert_eq!(observed(&[echo(0, &[0]), echo(0, &[0])]), [0; 0]);
        assert_eq!(observed(&[echo(0, &[0]), echo(1, &[0])]), [0]);
    }

    #[test]
    fn echo_of_several_reflections_determines_one_wall_at_most() {
        // Both walls of a corner are open.
        assert_eq!(observed(&[echo(0, &[0, 1]), echo(1, &[0, 1])]), [0; 0]);
        let known = || [echo(0, &[0]), echo(1, &[0])];
        let all: Vec<_> = known().into_iter().chain([echo(0, &[0, 1, 0])]).collect();
        assert_eq!(observed(&all), [0]);
        // By way of a wall that is determined itself only through another.
        let chain = [echo(0, &[0, 1]), echo(2, &[0, 1]), echo(0, &[1, 2, 1]), echo(1, &[2])];
        assert_eq!(observed(&known().into_iter().chain(chain).collect::<Vec<_>>()), [0, 1, 2]);
    }

    #[test]
    fn spots_reach_corners_but_no_free_ends() {
        let spots = [0.5, 0.6, 1.5].map(|along_m| Spot { along_m, half_m: 0.1 });
        let [a, b] = [(0.45, true), (1.55, false)];
        assert_eq!(stretches_of(&spots, [a, b]), [[0.45, 0.7]]);
        let both = stretches_of(&spots, [(0.45, false), (1.55, true)]);
        assert_eq!(both, [[0.6, 0.7], [1.4, 1.55]]);
        assert_eq!(stretches_of(&spots[..1], [(0.45, false), b]), [[0.0; 2]; 0]);
        assert_eq!(stretches_of(&[], [a, b]), [[0.0; 2]; 0]);
    }

    #[test]
    fn zone_of_a_perpendicular_echo_has_the_width_of_the_closed_form() {
        let (wavelength_m, range_m) = (0.007, 2.0);
        // The path over a point beside the foot is half a wavelength longer.
        let half_m = fresnel_half_m(wavelength_m, range_m, range_m);
        let longer_m = 2.0 * (range_m.hypot(half_m) - range_m);
        assert!((longer_m - 0.5 * wavelength_m).abs() < 1e-5, "{longer_m}");
    }
}
