//! What is true of a scene: which feature an echo is of, which features there are.

use sonard_model::{
    geometry::{DVec2, distance_to_segment},
    model::{Diffractor, Mechanism, Path, Reflector},
    scene::{Scene, Wall},
};

/// Walls this near to each other meet, metres.
const JOINT_M: f64 = 2e-3;
/// How far from a joint it is looked whether something can stand there, metres.
const BESIDE_M: f64 = 0.01;
/// Walls that differ less in direction go straight on, radians.
const STRAIGHT_RAD: f64 = 0.02;

/// The word for what a path is the echo of.
pub(crate) fn feature_of(path: &Path, scene: &Scene) -> &'static str {
    let mut met = path.mechanisms();
    match (met.next(), met.next(), met.next()) {
        (Some(Mechanism::Reflection(Reflector::Wall(_))), None, _) => "plane",
        (Some(Mechanism::Reflection(Reflector::Cylinder(_))), None, _)
        | (Some(Mechanism::Diffraction(Diffractor::Post { .. })), None, _) => "cylinder",
        (Some(Mechanism::Diffraction(_)), None, _) => "edge",
        (Some(Mechanism::Scattering { .. }), None, _) => "rough",
        (Some(Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling)), None, _) => "level",
        (
            Some(Mechanism::Reflection(Reflector::Wall(one))),
            Some(Mechanism::Reflection(Reflector::Wall(other))),
            None,
        ) if meet(&scene.walls[one as usize], &scene.walls[other as usize]) => "corner",
        _ => "multiple",
    }
}

fn meet(one: &Wall, other: &Wall) -> bool {
    let touches = |point: DVec2, wall: &Wall| distance_to_segment(point, wall.a, wall.b) < JOINT_M;
    [one.a, one.b].iter().any(|end| touches(*end, other))
        || [other.a, other.b].iter().any(|end| touches(*end, one))
}

/// A feature of a scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Feature {
    /// `plane`, `corner`, `edge` or `cylinder`.
    pub(crate) kind: &'static str,
    /// The names of the walls or of the cylinder.
    pub(crate) id: String,
    /// One end of a plane; the place of others.
    pub(crate) at: DVec2,
    /// The other end of a plane.
    pub(crate) to: Option<DVec2>,
    pub(crate) radius_m: Option<f64>,
    /// How wide it is open to where one can stand, degrees: below 180 a corner, above an edge.
    pub(crate) opening_deg: Option<f64>,
}

/// The planes, corners, edges and cylinders of a scene that a ranger could have before it.
pub(crate) fn features(scene: &Scene) -> Vec<Feature> {
    let planes = scene.walls.iter().map(|wall| Feature {
        kind: "plane",
        id: wall.id.to_string(),
        at: wall.a,
        to: Some(wall.b),
        radius_m: None,
        opening_deg: None,
    });
    let cylinders = scene.cylinders.iter().map(|cylinder| Feature {
        kind: "cylinder",
        id: cylinder.id.to_string(),
        at: cylinder.center,
        to: None,
        radius_m: Some(cylinder.radius_m),
        opening_deg: None,
    });
    planes.chain(cylinders).chain(joints(scene)).collect()
}

/// A sector between two walls at a joint: its place, its opening in radians, the direction of its middle, the walls.
struct Sector {
    at: DVec2,
    opening_rad: f64,
    middle: DVec2,
    walls: [usize; 2],
}

/// Corners and edges: where walls meet or end.
fn joints(scene: &Scene) -> Vec<Feature> {
    let mut places: Vec<DVec2> = Vec::new();
    for end in scene.walls.iter().flat_map(|wall| [wall.a, wall.b]) {
        if places.iter().all(|place| place.distance(end) >= JOINT_M) {
            places.push(end);
        }
    }
    let sectors: Vec<Sector> = places.iter().flat_map(|place| sectors(scene, *place)).collect();
    let beside: Vec<DVec2> =
        sectors.iter().map(|sector| sector.at + BESIDE_M * sector.middle).collect();
    let is_open = scene.can_stand(&beside);
    let open = sectors.into_iter().zip(is_open).filter(|(_, is_open)| *is_open);
    open.map(|(sector, _)| {
        let [one, other] = sector.walls.map(|wall| &*scene.walls[wall].id);
        Feature {
            kind: if sector.opening_rad < std::f64::consts::PI { "corner" } else { "edge" },
            id: if one == other { one.to_owned() } else { format!("{one} {other}") },
            at: sector.at,
            to: None,
            radius_m: None,
            opening_deg: Some(sector.opening_rad.to_degrees()),
        }
    })
    .collect()
}

/// The sectors between the walls that leave a place, but those that go straight on.
fn sectors(scene: &Scene, at: DVec2) -> Vec<Sector> {
    let mut leaving: Vec<(f64, usize)> = Vec::new();
    for (index, wall) in scene.walls.iter().enumerate() {
        if distance_to_segment(at, wall.a, wall.b) < JOINT_M {
            let ends = [wall.a, wall.b].into_iter().filter(|end| end.distance(at) >= JOINT_M);
            leaving.extend(ends.map(|end| ((end - at).to_angle(), index)));
        }
    }
    leaving.sort_by(|one, other| one.0.total_cmp(&other.0));
    let next = leaving.iter().cycle().skip(1);
    let sector = |(one, other): (&(f64, usize), &(f64, usize))| {
        let gap = (other.0 - one.0).rem_euclid(std::f64::consts::TAU);
        let opening_rad = if gap == 0.0 { std::f64::consts::TAU } else { gap };
        let middle = DVec2::from_angle(one.0 + 0.5 * opening_rad);
        Sector { at, opening_rad, middle, walls: [one.1, other.1] }
    };
    let all = leaving.iter().zip(next).map(sector);
    all.filter(|sector| (sector.opening_rad - std::f64::consts::PI).abs() > STRAIGHT_RAD).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_has_corners_inside_and_a_box_in_it_edges_outside() {
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
        // Four of the room and two beside the partition's foot.
        let corners: Vec<_> = of("corner").map(|corner| corner.opening_deg).collect();
        assert_eq!(corners.len(), 6);
        assert!(corners.iter().flatten().all(|deg| (deg - 90.0).abs() < 1e-9), "{corners:?}");
        // Four of the box and the partition's free end.
        let mut edges: Vec<_> = of("edge").filter_map(|edge| edge.opening_deg).collect();
        edges.sort_by(f64::total_cmp);
        assert_eq!(edges.len(), 5);
        assert!((edges[0] - 270.0).abs() < 1e-9 && edges[4] == 360.0, "{edges:?}");
    }
}
