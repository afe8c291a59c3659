//! Narrow strips of the floor plan: isolated walls of a wavelength or less, which scatter from
//! their middles.

use std::f64::consts::TAU;

use smallvec::SmallVec;

use crate::{
    acoustics::edge::{MAX_WAVELENGTHS, Strip},
    geometry::{Arrangement, DVec2, signed_angle_rad},
};

/// Bend, radians, and offset of a joint from the line, metres, within either of which consecutive
/// pieces of a wall are one.
const STRAIGHT_RAD: f64 = 1e-6;
const STRAIGHT_M: f64 = 1e-8;

/// A narrow strip in the floor plan.
#[derive(Debug)]
pub(crate) struct PlanStrip {
    /// Point of the middle.
    pub(crate) point: u32,
    /// First of the strip's walls.
    pub(crate) wall: u32,
    pub(crate) along: DVec2,
    pub(crate) strip: Strip,
}

/// Removes strips from a floor plan, where a point in the middle of each remains: sound passes
/// them. `gains` are the walls' reflectances. Walls that sound passes above or below are kept.
pub(crate) fn extract_strips(
    plan: &mut Arrangement,
    gains: &[f64],
    lets_pass: impl Fn(u32) -> bool,
    wave_number_per_m: f64,
) -> Vec<PlanStrip> {
    let max_m = TAU * MAX_WAVELENGTHS / wave_number_per_m;
    let chains = Chains::new(plan);
    let mut taken = vec![false; plan.pieces.len()];
    let mut strips = Vec::new();
    for from in 0..plan.points.len() as u32 {
        let Some((to, pieces)) = chains.from(from, max_m) else { continue };
        let walls = pieces.iter().map(|&piece| plan.pieces[piece as usize].segment);
        let Some(wall) = walls.clone().min() else { continue };
        let gain = gains[wall as usize];
        let is_one = walls.clone().all(|w| gains[w as usize] == gain && !lets_pass(w));
        let [a, b] = [from, to].map(|end| plan.points[end as usize]);
        // Each strip is found from both ends.
        let strip =
            (from < to && is_one).then(|| Strip::new(a.distance(b), gain, wave_number_per_m));
        if let Some(strip) = strip.flatten() {
            pieces.iter().for_each(|&piece| taken[piece as usize] = true);
            strips.push(([a, b], wall, strip));
        }
    }
    let mut taken = taken.into_iter();
    plan.pieces.retain(|_| !taken.next().unwrap_or(false));
    let add = |([a, b], wall, strip): ([DVec2; 2], u32, Strip)| {
        plan.points.push(0.5 * (a + b));
        PlanStrip { point: plan.points.len() as u32 - 1, wall, along: b - a, strip }
    };
    strips.into_iter().map(add).collect()
}

/// Returns `true` if a piece of a wall continues another one.
fn is_straight(before: DVec2, after: DVec2) -> bool {
    let off_m = before.perp_dot(after).abs() / (before + after).length();
    let bend_rad = signed_angle_rad(before, after).abs();
    bend_rad <= STRAIGHT_RAD || before.dot(after) > 0.0 && off_m <= STRAIGHT_M
}

/// Collinear chains of pieces from one free end to another.
struct Chains<'a> {
    plan: &'a Arrangement,
    /// Pieces that end at each point.
    around: Vec<SmallVec<[u32; 2]>>,
}

impl<'a> Chains<'a> {
    fn new(plan: &'a Arrangement) -> Self {
        let mut around = vec![SmallVec::new(); plan.points.len()];
        for (piece, number) in plan.pieces.iter().zip(0..) {
            piece.ends.iter().for_each(|&end| around[end as usize].push(number));
        }
        Self { plan, around }
    }

    /// Follows the chain that begins at a free end. Returns the other free end and the pieces
    /// between, if the chain is no longer than `max_m`.
    fn from(&self, point: u32, max_m: f64) -> Option<(u32, SmallVec<[u32; 2]>)> {
        let [first] = self.around[point as usize][..] else { return None };
        let mut pieces: SmallVec<[u32; 2]> = SmallVec::from_slice(&[first]);
        let mut at = self.other_end(first, point);
        while self.position(point).distance(self.position(at)) <= max_m {
            let last = pieces[pieces.len() - 1];
            let next = match self.around[at as usize][..] {
                [_] => return Some((at, pieces)),
                [a, b] => {
                    if a == last {
                        b
                    } else {
                        a
                    }
                }
                _ => return None,
            };
            let far = self.other_end(next, at);
            let so_far = self.position(at) - self.position(point);
            if !is_straight(so_far, self.position(far) - self.position(at)) {
                return None;
            }
            pieces.push(next);
            at = far;
        }
        None
    }

    fn other_end(&self, piece: u32, point: u32) -> u32 {
        let [a, b] = self.plan.pieces[piece as usize].ends;
        if a == point { b } else { a }
    }

    fn position(&self, point: u32) -> DVec2 {
        self.plan.points[point as usize]
    }
}
