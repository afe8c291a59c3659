//! The search for sequences of paths with the face between them.

use num_complex::Complex64;
use smallvec::{SmallVec, smallvec};

use super::{
    bound::Best,
    face_path::{DirectedPath, FacePath, MultipleEcho},
};
use crate::acoustics::{Disc, FaceAspect};

/// Sequences longer than this in all would not be told apart any more.
const MOST_PATHS: usize = 32;

/// More multiple echoes than this come only from a face that all but touches several walls, where rays
/// no longer say much; the search ends there.
const MOST_ECHOES: usize = 4096;

/// Sequences of paths, each longer one from a shorter one.
pub(crate) struct Search {
    face: Disc,
    floor: f64,
    /// The longest that is asked for, metres.
    most_m: f64,
    best: Best,
    /// The paths out run backwards, which a sequence may end with, and then the paths out themselves.
    paths: Vec<FacePath>,
    /// Each ending's weight by the beam pattern.
    weights: Vec<f64>,
    /// Paths that leave or come back within the beam, by their index.
    middles: Vec<usize>,
    /// The reflection at the disc from each path into each, once it is known: sequences meet the same pairs
    /// again and again.
    reflections_m: Vec<Option<Complex64>>,
    found: Vec<MultipleEcho>,
}

impl Search {
    pub(crate) fn new(face: Disc, outs: &[(FacePath, f64)], floor: f64, most_m: f64) -> Self {
        let backwards = |(path, _): &(FacePath, f64)| FacePath {
            path: DirectedPath { echo: path.path.echo, reversed: !path.own_reverse },
            leaves_rad: path.returns_rad,
            returns_rad: path.leaves_rad,
            ..*path
        };
        let count = outs.len();
        let others = (0..count).filter(|at| !outs[*at].0.own_reverse).map(|at| count + at);
        Self {
            face,
            floor,
            most_m,
            best: Best::of(outs.iter().map(|(out, weight)| (out.length_m, *weight))),
            paths: outs.iter().map(backwards).chain(outs.iter().map(|(out, _)| *out)).collect(),
            weights: outs.iter().map(|(_, weight)| *weight).collect(),
            middles: (0..count).chain(others).collect(),
            reflections_m: vec![None; 4 * count * count],
            found: Vec::new(),
        }
    }

    /// All sequences.
    pub(crate) fn run(mut self) -> Vec<MultipleEcho> {
        for (at, leaving) in self.weights.clone().into_iter().enumerate() {
            let first = self.weights.len() + at;
            let out = self.paths[first];
            let strength = out.phase * (leaving / out.length_m);
            self.extend(&smallvec![out.path], first, strength, out.length_m);
        }
        self.found
    }

    /// Ends a sequence of paths, and goes on with it. `strength` is its field over its spreading,
    /// one over metres: `1/L1 S1 1/L2 S2 ... 1/Ln`, to which a last path adds `S 1/L (L1 + L2 + ... + L)`.
    ///
    /// Given up as soon as no last path could lift the field above the floor; the disc's strength bounds each
    /// further reflection, so what is given up stays below.
    fn extend(
        &mut self,
        paths: &SmallVec<[DirectedPath; 4]>,
        last: usize,
        strength: Complex64,
        length_m: f64,
    ) {
        let disc_m = self.face.strength_m();
        let bound = strength.norm() * disc_m;
        let too_many = paths.len() >= MOST_PATHS || self.found.len() >= MOST_ECHOES;
        if too_many || bound * self.best.beside(length_m) < self.floor {
            return;
        }
        for at in 0..self.weights.len() {
            let (end, weight) = (self.paths[at], self.weights[at]);
            let total_m = length_m + end.length_m;
            if bound * weight / end.length_m * total_m < self.floor || total_m > self.most_m {
                continue;
            }
            let field = strength
                * self.reflection_m(last, at)
                * end.phase
                * (weight / end.length_m * total_m);
            if field.norm() >= self.floor {
                let mut paths = paths.clone();
                paths.push(end.path);
                let (amplitude, phase_rad) = field.to_polar();
                self.found.push(MultipleEcho { paths, length_m: total_m, phase_rad, amplitude });
            }
        }
        for middle in 0..self.middles.len() {
            let at = self.middles[middle];
            let middle = self.paths[at];
            let total_m = length_m + middle.length_m;
            let per_m = middle.amplitude / middle.length_m;
            if bound * per_m * disc_m * self.best.beside(total_m) < self.floor
                || total_m >= self.most_m
            {
                continue;
            }
            let mut paths = paths.clone();
            paths.push(middle.path);
            let next = strength * self.reflection_m(last, at) * middle.phase * per_m;
            self.extend(&paths, at, next, total_m);
        }
    }

    /// Strength with which the disc scatters from one path into the next, metres.
    fn reflection_m(&mut self, last: usize, next: usize) -> Complex64 {
        let [from, to] = [last, next].map(|at| &self.paths[at]);
        let face = self.face;
        let of_pair = &mut self.reflections_m[last * self.paths.len() + next];
        *of_pair.get_or_insert_with(|| {
            let aspect = FaceAspect {
                in_m: from.length_m,
                out_m: to.length_m,
                in_rad: from.returns_rad,
                out_rad: to.leaves_rad,
            };
            let apart = from.length_m * to.length_m / (from.length_m + to.length_m);
            apart * face.reflection(&aspect)
        })
    }
}
