//! Search for sequences of paths with the face between them.

use num_complex::Complex64;
use smallvec::{SmallVec, smallvec};

use super::{
    bound::BestLastPath,
    face_path::{DirectedPath, FacePath, MultipleEcho},
};
use crate::acoustics::{Disc, FaceAspect};

/// Maximum number of paths of a sequence; longer ones can no longer be resolved.
const MAX_PATHS: usize = 32;

/// Maximum number of multiple echoes. Only a face that nearly touches several walls exceeds it,
/// where rays lose their meaning; the search ends there.
const MAX_ECHOES: usize = 4096;

/// Sequences of paths, each longer one built from a shorter one.
pub(crate) struct SequenceSearch {
    face: Disc,
    floor: f64,
    /// Maximum length, metres.
    max_m: f64,
    best: BestLastPath,
    /// Reversed paths, which can end a sequence, followed by the paths out themselves.
    paths: Vec<FacePath>,
    /// Weight of each ending by the beam pattern.
    weights: Vec<f64>,
    /// Indices of the paths that leave or return within the beam.
    middles: Vec<usize>,
    /// Cache of the reflection at the disc from each path into each: sequences contain the same
    /// pairs repeatedly.
    reflections_m: Vec<Option<Complex64>>,
    found: Vec<MultipleEcho>,
}

impl SequenceSearch {
    pub(crate) fn new(face: Disc, outs: &[(FacePath, f64)], floor: f64, max_m: f64) -> Self {
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
            max_m,
            best: BestLastPath::from_paths(
                outs.iter().map(|(out, weight)| (out.length_m, *weight)),
            ),
            paths: outs.iter().map(backwards).chain(outs.iter().map(|(out, _)| *out)).collect(),
            weights: outs.iter().map(|(_, weight)| *weight).collect(),
            middles: (0..count).chain(others).collect(),
            reflections_m: vec![None; 4 * count * count],
            found: Vec::new(),
        }
    }

    /// Runs the search and returns all sequences.
    pub(crate) fn run(mut self) -> Vec<MultipleEcho> {
        for (at, leaving) in self.weights.clone().into_iter().enumerate() {
            let first = self.weights.len() + at;
            let out = self.paths[first];
            let strength = out.phase * (leaving / out.length_m);
            self.extend(&smallvec![out.path], first, strength, out.length_m);
        }
        self.found
    }

    /// Ends a sequence of paths, and extends it. `strength` is its field over its spreading, one
    /// over metres: `1/L1 S1 1/L2 S2 ... 1/Ln`, to which a last path adds
    /// `S 1/L (L1 + L2 + ... + L)`.
    ///
    /// The search ends as soon as no last path could lift the field above the floor. The disc's
    /// strength bounds each further reflection, so all omitted sequences stay below.
    fn extend(
        &mut self,
        paths: &SmallVec<[DirectedPath; 4]>,
        last: usize,
        strength: Complex64,
        length_m: f64,
    ) {
        let disc_m = self.face.strength_m();
        let bound = strength.norm() * disc_m;
        let too_many = paths.len() >= MAX_PATHS || self.found.len() >= MAX_ECHOES;
        if too_many || bound * self.best.last_factor(length_m) < self.floor {
            return;
        }
        for at in 0..self.weights.len() {
            let (end, weight) = (self.paths[at], self.weights[at]);
            let total_m = length_m + end.length_m;
            if bound * weight / end.length_m * total_m < self.floor || total_m > self.max_m {
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
            if bound * per_m * disc_m * self.best.last_factor(total_m) < self.floor
                || total_m >= self.max_m
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
