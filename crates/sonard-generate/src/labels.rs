//! Ground truth of a scene: the feature label of an echo, and the features of the scene.

use sonard_model::{
    geometry::{DVec2, distance_to_segment},
    model::{Diffractor, Mechanism, Path, Reflector},
    scene::{Scene, Wall},
};

/// Maximum distance between walls that share a vertex, metres.
const JOINT_M: f64 = 2e-3;
/// Distance from a vertex at which free space is tested, metres.
const PROBE_M: f64 = 0.01;
/// Maximum change of direction between collinear walls, radians.
const STRAIGHT_RAD: f64 = 0.02;

/// Returns the feature label of an echo, by its propagation path.
pub(crate) fn feature_of(path: &Path, scene: &Scene) -> &'static str {
    let mut mechanisms = path.mechanisms();
    match (mechanisms.next(), mechanisms.next(), mechanisms.next()) {
        (Some(Mechanism::Reflection(Reflector::Wall(_))), None, _) => "plane",
        (Some(Mechanism::Reflection(Reflector::Cylinder(_))), None, _)
        | (Some(Mechanism::Diffraction(Diffractor::Post { .. })), None, _) => "cylinder",
        (Some(Mechanism::Diffraction(_)), None, _) => "edge",
        (Some(Mechanism::Scattering { .. }), None, _) => "rough",
        (Some(Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling)), None, _) => "level",
        (
            Some(Mechanism::Reflection(Reflector::Wall(a))),
            Some(Mechanism::Reflection(Reflector::Wall(b))),
            None,
        ) if share_vertex(&scene.walls[a as usize], &scene.walls[b as usize]) => "corner",
        _ => "multiple",
    }
}

fn share_vertex(a: &Wall, b: &Wall) -> bool {
    let touches = |point: DVec2, wall: &Wall| distance_to_segment(point, wall.a, wall.b) < JOINT_M;
    [a.a, a.b].iter().any(|end| touches(*end, b)) || [b.a, b.b].iter().any(|end| touches(*end, a))
}

/// Feature of a scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SceneFeature {
    /// Feature kind: `plane`, `corner`, `edge` or `cylinder`.
    pub(crate) kind: &'static str,
    /// Names of the walls or of the cylinder.
    pub(crate) id: String,
    /// First end of a plane; the position of other features.
    pub(crate) at: DVec2,
    /// Second end of a plane.
    pub(crate) to: Option<DVec2>,
    pub(crate) radius_m: Option<f64>,
    /// Opening angle toward free space, degrees: below 180 for a corner, above for an edge.
    pub(crate) opening_deg: Option<f64>,
}

/// Returns the planes, corners, edges and cylinders of a scene.
pub(crate) fn features(scene: &Scene) -> Vec<SceneFeature> {
    let planes = scene.walls.iter().map(|wall| SceneFeature {
        kind: "plane",
        id: wall.id.to_string(),
        at: wall.a,
        to: Some(wall.b),
        radius_m: None,
        opening_deg: None,
    });
    let cylinders = scene.cylinders.iter().map(|cylinder| SceneFeature {
        kind: "cylinder",
        id: cylinder.id.to_string(),
        at: cylinder.center,
        to: None,
        radius_m: Some(cylinder.radius_m),
        opening_deg: None,
    });
    planes.chain(cylinders).chain(joints(scene)).collect()
}

/// Sector between two walls at a vertex: position, opening angle, bisector and walls.
struct JointSector {
    at: DVec2,
    opening_rad: f64,
    middle: DVec2,
    walls: [usize; 2],
}

/// Returns the corners and edges, where walls share a vertex or end.
fn joints(scene: &Scene) -> Vec<SceneFeature> {
    let mut places: Vec<DVec2> = Vec::new();
    for end in scene.walls.iter().flat_map(|wall| [wall.a, wall.b]) {
        if places.iter().all(|place| place.distance(end) >= JOINT_M) {
            places.push(end);
        }
    }
    let sectors: Vec<JointSector> =
        places.iter().flat_map(|place| sectors(scene, *place)).collect();
    let probes: Vec<DVec2> =
        sectors.iter().map(|sector| sector.at + PROBE_M * sector.middle).collect();
    let is_open = scene.are_accessible(&probes);
    let open = sectors.into_iter().zip(is_open).filter(|(_, is_open)| *is_open);
    open.map(|(sector, _)| {
        let [a, b] = sector.walls.map(|wall| &*scene.walls[wall].id);
        SceneFeature {
            kind: if sector.opening_rad < std::f64::consts::PI { "corner" } else { "edge" },
            id: if a == b { a.to_owned() } else { format!("{a} {b}") },
            at: sector.at,
            to: None,
            radius_m: None,
            opening_deg: Some(sector.opening_rad.to_degrees()),
        }
    })
    .collect()
}

/// Returns the sectors between the walls at a vertex, without straight angles.
fn sectors(scene: &Scene, at: DVec2) -> Vec<JointSector> {
    let mut leaving: Vec<(f64, usize)> = Vec::new();
    for (index, wall) in scene.walls.iter().enumerate() {
        if distance_to_segment(at, wall.a, wall.b) < JOINT_M {
            let ends = [wall.a, wall.b].into_iter().filter(|end| end.distance(at) >= JOINT_M);
            leaving.extend(ends.map(|end| ((end - at).to_angle(), index)));
        }
    }
    leaving.sort_by(|a, b| a.0.total_cmp(&b.0));
    let next = leaving.iter().cycle().skip(1);
    let sector = |(a, b): (&(f64, usize), &(f64, usize))| {
        let gap = (b.0 - a.0).rem_euclid(std::f64::consts::TAU);
        let opening_rad = if gap == 0.0 { std::f64::consts::TAU } else { gap };
        let middle = DVec2::from_angle(a.0 + 0.5 * opening_rad);
        JointSector { at, opening_rad, middle, walls: [a.1, b.1] }
    };
    let all = leaving.iter().zip(next).map(sector);
    all.filter(|sector| (sector.opening_rad - std::f64::consts::PI).abs() > STRAIGHT_RAD).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_corners_and_edges() {
        let room = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let scene = Scene::builder("room")
            .material("wall", 1.0)
            .room("room", &room, "wall")
            .room("box", &[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]], "wall")
            .walls("partition", &[[3.0, 0.0], [3.0, 1.0]], "wall")
            .cylinder("leg", [3.5, 2.0], 0.05, "wall")
            .build()
            .expect("a scene");
        let found = features(&scene);
        let of = |kind: &'static str| found.iter().filter(move |feature| feature.kind == kind);
        assert_eq!(of("plane").count(), 9);
        assert_eq!(of("cylinder").count(), 1);
        // Four of the room and two at the foot of the partition.
        let corners: Vec<_> = of("corner").map(|corner| corner.opening_deg).collect();
        assert_eq!(corners.len(), 6);
        assert!(corners.iter().flatten().all(|deg| (deg - 90.0).abs() < 1e-9), "{corners:?}");
        // Four of the box, and the free end of the partition.
        let mut edges: Vec<_> = of("edge").filter_map(|edge| edge.opening_deg).collect();
        edges.sort_by(f64::total_cmp);
        assert_eq!(edges.len(), 5);
        assert!((edges[0] - 270.0).abs() < 1e-9 && edges[4] == 360.0, "{edges:?}");
    }
}
