//! Echo paths of an observation point that the face can reflect.

use std::f64::consts::FRAC_PI_2;

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{
    bound::BestLastPath,
    face_path::{DirectedPath, FacePath, MultipleEcho},
    search::SequenceSearch,
};
use crate::{
    acoustics::{BeamPattern, Disc},
    model::paths::{
        direction_index::{DirectionEntry, DirectionIndex, wrap_once},
        echo::PathEcho,
        pattern::{MULTIPLE_FLOOR_RATIO, PatternEnvelope},
        settings::PathSettings,
        tolerance::SAME_RAD,
    },
};

/// Echo paths from the face to the face.
pub(crate) struct FaceEchoes {
    face: Disc,
    /// Bound of the last path of a sequence.
    best: BestLastPath,
    /// Length of the shortest path, metres; infinite without any.
    shortest_m: f64,
    paths: Vec<FacePath>,
    /// Index by direction of departure.
    departures: DirectionIndex,
}

impl FaceEchoes {
    pub(crate) fn new(
        face: Disc,
        echoes: &[PathEcho],
        envelope: &PatternEnvelope,
        settings: &PathSettings,
    ) -> Self {
        let far = || echoes.iter().filter(|echo| is_far(&face, echo));
        let best = BestLastPath::from_paths(far().map(|echo| (echo.length_m, echo.amplitude)));
        let shortest_m = far().map(|echo| echo.length_m).fold(f64::INFINITY, f64::min);
        let departures = DirectionIndex::new(&[]);
        let mut found = Self { face, best, shortest_m, paths: Vec::new(), departures };
        let mut paths = Vec::new();
        let mut entries = Vec::new();
        for (echo, index) in echoes.iter().zip(0..) {
            let reach_rad = found.departure_reach_rad(echo, envelope, settings.floor);
            let Some(reach_rad) = reach_rad else { continue };
            let leaves_rad = echo.departure.to_angle();
            entries.push(DirectionEntry {
                middle_rad: leaves_rad,
                half_rad: 0.0,
                amplitude: echo.amplitude,
                reach_rad,
                echo: paths.len() as u32,
            });
            paths.push(FacePath {
                path: DirectedPath { echo: index, reversed: false },
                leaves_rad,
                returns_rad: echo.arrival.to_angle(),
                length_m: echo.length_m,
                amplitude: echo.amplitude,
                phase: Complex64::cis(echo.phase_rad),
                own_reverse: echo.departure.distance(echo.arrival) < SAME_RAD,
            });
        }
        (found.paths, found.departures) = (paths, DirectionIndex::new(&entries));
        found
    }

    /// Length of the shortest path that the face can reflect, metres; infinite without any.
    pub(crate) const fn shortest_m(&self) -> f64 {
        self.shortest_m
    }

    /// Offset from its departure beyond which no multiple echo can begin with an echo path, radians;
    /// `None` if none can in any direction. `floor` is the weakest echo of the search.
    pub(crate) fn departure_reach_rad(
        &self,
        echo: &PathEcho,
        envelope: &PatternEnvelope,
        floor: f64,
    ) -> Option<f64> {
        if !is_far(&self.face, echo) {
            return None;
        }
        let floor = MULTIPLE_FLOOR_RATIO * floor;
        // Upper bound, with the face in the direction of departure.
        let bound = self.best.after(&self.face, echo.length_m, echo.amplitude);
        let reach_rad = envelope.reach_rad(floor / bound);
        (bound >= floor && reach_rad > 0.0).then_some(reach_rad)
    }

    /// Returns all multiple echoes up to a length, metres, with at least one reflection at the
    /// face, which points in `direction_rad`; `floor` is the weakest echo of the search.
    pub(crate) fn multiple_echoes(
        &self,
        direction_rad: f64,
        beam: &BeamPattern,
        floor: f64,
        max_m: f64,
    ) -> Vec<MultipleEcho> {
        let floor = MULTIPLE_FLOOR_RATIO * floor;
        let within = self.paths.partition_point(|path| path.length_m < max_m) as u32;
        let mut near: SmallVec<[(&FacePath, f64); 16]> = SmallVec::new();
        self.departures.near(direction_rad, within, |entry, _| {
            let path = &self.paths[entry.echo as usize];
            let leaves_rad = wrap_once(path.leaves_rad - direction_rad);
            let returns_rad = wrap_once(path.returns_rad - direction_rad);
            if returns_rad.abs() < FRAC_PI_2 {
                near.push((path, entry.amplitude * beam.one_way(leaves_rad)));
            }
        });
        // Each path needs another one that can follow it.
        let best =
            BestLastPath::from_paths(near.iter().map(|(out, leaving)| (out.length_m, *leaving)));
        near.retain(|(out, leaving)| best.after(&self.face, out.length_m, *leaving) >= floor);
        if near.is_empty() {
            return Vec::new();
        }
        let turned = |&(path, leaving): &(&FacePath, f64)| {
            let leaves_rad = wrap_once(path.leaves_rad - direction_rad);
            let returns_rad = wrap_once(path.returns_rad - direction_rad);
            (FacePath { leaves_rad, returns_rad, ..*path }, leaving)
        };
        let outs: SmallVec<[(FacePath, f64); 16]> = near.iter().map(turned).collect();
        SequenceSearch::new(self.face, &outs, floor, max_m).run()
    }
}

/// Returns `true` for a path that the face can reflect: in the plane, and from the far field of the
/// disc's zones.
fn is_far(face: &Disc, echo: &PathEcho) -> bool {
    echo.length_m > 2.0 * face.face.radius_m && echo.rise_rad == [0.0; 2]
}
