//! Rules of a scene: unique and existing names, values in range, accessible poses.

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
};

use sha2::{Digest, Sha256};

use super::{
    Cylinder, DEFAULT_SNAP_M, Material, Robot, RobotShape, Scene, SceneProblem, Wall,
    error::MAX_COORDINATE_M,
    file::{CircleFile, CylinderFile, Point, RobotFile, SceneFile, WallFile},
    locate::{JsonPath, MemberPart},
    outline::{SceneOutlines, contains},
    pose::{CLEARANCE_M, MAX_HEADING_DEG},
};
use crate::geometry::{DVec2, Pose, distance_to_segment};

/// Minimum length of a wall, metres: far below the wavelength, far above rounding.
const MIN_WALL_M: f64 = 1e-4;

/// Maximum of `snap_m`, metres: below the wavelength of any ranger.
const MAX_SNAP_M: f64 = 5e-3;

/// Violated rule, and the member of the file that violates it.
pub(super) struct RuleViolation {
    pub(super) path: JsonPath,
    pub(super) part: MemberPart,
    pub(super) problem: SceneProblem,
}

/// Validates a well-formed file and converts it to a scene; `text` is its source.
pub(super) fn checked(file: SceneFile, text: &str) -> Result<Scene, RuleViolation> {
    let root = JsonPath::root();
    is_name(&file.name, &root.key("name"))?;
    let mut rules = Rules::new(file.materials)?;
    let mut walls = Vec::new();
    for (index, wall) in file.walls.iter().enumerate() {
        walls.extend(rules.walls(wall, index, &root.key("walls").index(index))?);
    }
    let mut cylinders = Vec::new();
    for (index, cylinder) in file.cylinders.into_iter().enumerate() {
        let path = root.key("cylinders").index(index);
        cylinders.push(rules.cylinder(cylinder, index, &path)?);
    }
    let robot = file.robot.map(|robot| rules.robot(robot, &root.key("robot"))).transpose()?;
    floor_below_ceiling(file.floor_z_m, file.ceiling_z_m, &root)?;
    let [floor_material, ceiling_material] = [
        ("floor_material", &file.floor_material, "floor_z_m", file.floor_z_m),
        ("ceiling_material", &file.ceiling_material, "ceiling_z_m", file.ceiling_z_m),
    ]
    .map(|level| rules.level(level, &root));
    let (floor_material, ceiling_material) = (floor_material?, ceiling_material?);
    let scene = Scene {
        name: file.name,
        source: file.source,
        approximate: file.approximate,
        materials: rules.materials,
        walls,
        cylinders,
        floor_z_m: file.floor_z_m,
        ceiling_z_m: file.ceiling_z_m,
        floor_material,
        ceiling_material,
        snap_m: snap(file.snap_m, &root.key("snap_m"))?,
        poses: file.poses,
        robot,
        sha256: Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect(),
        text: text.into(),
    };
    check_poses(&scene, &root.key("poses"))?;
    Ok(scene)
}

/// Owner of an id: its list, and its index in the list.
type Owner = (&'static str, Option<usize>);

/// Shared state of the checks: defined materials, and ids in use.
struct Rules {
    materials: BTreeMap<String, Material>,
    ids: HashMap<Arc<str>, Owner>,
}

impl Rules {
    fn new(materials: BTreeMap<String, Material>) -> Result<Self, RuleViolation> {
        for (name, material) in &materials {
            let path = JsonPath::root().key("materials").key(name);
            is_name(name, &path)
                .map_err(|fault| RuleViolation { part: MemberPart::Key, ..fault })?;
            share("reflectance", material.reflectance, &path)?;
            share("roughness", material.roughness, &path)?;
        }
        Ok(Self { materials, ids: HashMap::new() })
    }

    fn walls(
        &mut self,
        file: &WallFile,
        number: usize,
        path: &JsonPath,
    ) -> Result<Vec<Wall>, RuleViolation> {
        let material = self.material(&file.material, path)?;
        let z_m = heights(file.z_m, path)?;
        let corners = corners(file, path)?;
        is_name(&file.id, &path.key("id"))?;
        let single = file.polyline.is_none();
        corners
            .into_iter()
            .enumerate()
            .map(|(index, (a, b))| {
                let id = if single { file.id.clone() } else { format!("{}.{index}", file.id) };
                let id = self.take_id(id, ("walls", Some(number)), path)?;
                Ok(Wall { id, a, b, material, z_m })
            })
            .collect()
    }

    fn cylinder(
        &mut self,
        file: CylinderFile,
        number: usize,
        path: &JsonPath,
    ) -> Result<Cylinder, RuleViolation> {
        Ok(Cylinder {
            center: point(file.center, &path.key("center"))?,
            radius_m: radius(file.radius_m, &path.key("radius_m"))?,
            material: self.material(&file.material, path)?,
            z_m: heights(file.z_m, path)?,
            id: self.take_id(file.id, ("cylinders", Some(number)), path)?,
        })
    }

    fn robot(&mut self, file: RobotFile, path: &JsonPath) -> Result<Robot, RuleViolation> {
        let shape = match (file.circle, file.outline) {
            (Some(circle), None) => round_body(&circle, &path.key("circle"))?,
            (None, Some(outline)) => flat_body(&outline, &path.key("outline"))?,
            _ => return fault(path, SceneProblem::RobotShape),
        };
        Ok(Robot {
            shape,
            material: self.material(&file.material, path)?,
            z_m: heights(file.z_m, path)?,
            id: self.take_id(file.id, ("robot", None), path)?,
        })
    }

    /// Material of floor or ceiling, whose height has to be defined.
    fn level(
        &self,
        (field, name, height, z_m): (&str, &Option<String>, &'static str, Option<f64>),
        root: &JsonPath,
    ) -> Result<Material, RuleViolation> {
        let Some(name) = name else { return Ok(Material::RIGID) };
        if z_m.is_none() {
            return fault(&root.key(field), SceneProblem::NoSuchLevel(height));
        }
        self.material_at(name, root.key(field))
    }

    fn material(&self, name: &str, path: &JsonPath) -> Result<Material, RuleViolation> {
        self.material_at(name, path.key("material"))
    }

    fn material_at(&self, name: &str, path: JsonPath) -> Result<Material, RuleViolation> {
        self.materials.get(name).copied().ok_or_else(|| RuleViolation {
            path,
            part: MemberPart::Value,
            problem: SceneProblem::UnknownMaterial {
                name: name.to_owned(),
                known: self.materials.keys().cloned().collect(),
            },
        })
    }

    fn take_id(
        &mut self,
        id: String,
        owner: Owner,
        path: &JsonPath,
    ) -> Result<Arc<str>, RuleViolation> {
        is_name(&id, &path.key("id"))?;
        if let Some(&(list, number)) = self.ids.get(id.as_str()) {
            let first = JsonPath::root().key(list);
            let first = number.map_or(first.clone(), |number| first.index(number)).to_string();
            return fault(&path.key("id"), SceneProblem::DuplicateId { id, first });
        }
        let id: Arc<str> = id.into();
        self.ids.insert(Arc::clone(&id), owner);
        Ok(id)
    }
}

/// Segments of a wall by their end points.
fn corners(file: &WallFile, path: &JsonPath) -> Result<Vec<(DVec2, DVec2)>, RuleViolation> {
    match (file.from, file.to, &file.polyline) {
        (Some(from), Some(to), None) if !file.closed => {
            let from = point(from, &path.key("from"))?;
            let to_path = path.key("to");
            Ok(vec![side(from, point(to, &to_path)?, &to_path)?])
        }
        (Some(_), Some(_), None) => {
            fault(&path.key("closed"), SceneProblem::WallShape("only a polyline can be closed"))
        }
        (None, None, Some(points)) => sides(points, file.closed, &path.key("polyline")),
        (None, None, None) => {
            fault(path, SceneProblem::WallShape("this wall has neither ends nor a polyline"))
        }
        (_, _, Some(_)) => {
            fault(path, SceneProblem::WallShape("this wall has both a polyline and `from` or `to`"))
        }
        (None, Some(_), None) => fault(path, SceneProblem::MissingField("from".to_owned())),
        (Some(_), None, None) => fault(path, SceneProblem::MissingField("to".to_owned())),
    }
}

fn sides(
    points: &[Point],
    closed: bool,
    path: &JsonPath,
) -> Result<Vec<(DVec2, DVec2)>, RuleViolation> {
    let needed = if closed { 3 } else { 2 };
    if points.len() < needed {
        return fault(path, SceneProblem::TooFewPoints { points: points.len(), needed });
    }
    let mut corners = points
        .iter()
        .enumerate()
        .map(|(index, &corner)| point(corner, &path.index(index)))
        .collect::<Result<Vec<_>, _>>()?;
    if closed {
        corners.push(corners[0]);
    }
    corners
        .windows(2)
        .enumerate()
        .map(|(index, ends)| side(ends[0], ends[1], &path.index((index + 1).min(points.len() - 1))))
        .collect()
}

fn side(from: DVec2, to: DVec2, path: &JsonPath) -> Result<(DVec2, DVec2), RuleViolation> {
    if from.distance(to) >= MIN_WALL_M {
        return Ok((from, to));
    }
    fault(path, SceneProblem::NoLength { from: from.to_array(), to: to.to_array() })
}

fn round_body(circle: &CircleFile, path: &JsonPath) -> Result<RobotShape, RuleViolation> {
    let center = point(circle.center, &path.key("center"))?;
    let radius_m = radius(circle.radius_m, &path.key("radius_m"))?;
    if center.length() - radius_m < CLEARANCE_M {
        return fault(path, SceneProblem::RangerInBody);
    }
    Ok(RobotShape::Circle { center, radius_m })
}

fn flat_body(outline: &[Point], path: &JsonPath) -> Result<RobotShape, RuleViolation> {
    let sides = sides(outline, true, path)?;
    let touches = sides.iter().any(|&(a, b)| distance_to_segment(DVec2::ZERO, a, b) < CLEARANCE_M);
    if touches || contains(&sides, DVec2::ZERO) {
        return fault(path, SceneProblem::RangerInBody);
    }
    Ok(RobotShape::Outline(sides.into_iter().map(|(a, _)| a).collect()))
}

fn check_poses(scene: &Scene, path: &JsonPath) -> Result<(), RuleViolation> {
    if scene.poses.is_empty() {
        return Ok(());
    }
    let outlines = SceneOutlines::from_scene(scene);
    for (name, pose) in &scene.poses {
        let path = path.key(name);
        let bad_name =
            |problem| RuleViolation { path: path.clone(), part: MemberPart::Key, problem };
        is_name(name, &path).map_err(|fault| bad_name(fault.problem))?;
        if name.contains(',') {
            return Err(bad_name(SceneProblem::CommaInName(name.clone())));
        }
        let Pose { x_m, y_m, heading_deg } = *pose;
        length(x_m, &path.key("x_m"))?;
        length(y_m, &path.key("y_m"))?;
        if heading_deg.is_nan() || heading_deg.abs() > MAX_HEADING_DEG {
            return fault(&path.key("heading_deg"), SceneProblem::Heading(heading_deg));
        }
        scene.check_pose_among(&outlines, pose).or_else(|error| fault(&path, error.into()))?;
    }
    Ok(())
}

fn floor_below_ceiling(
    floor_z_m: Option<f64>,
    ceiling_z_m: Option<f64>,
    root: &JsonPath,
) -> Result<(), RuleViolation> {
    let ceiling_path = root.key("ceiling_z_m");
    floor_z_m.map(|height_m| length(height_m, &root.key("floor_z_m"))).transpose()?;
    ceiling_z_m.map(|height_m| length(height_m, &ceiling_path)).transpose()?;
    match (floor_z_m, ceiling_z_m) {
        (Some(lower), Some(upper)) => {
            rising(("floor_z_m", lower), ("ceiling_z_m", upper), &ceiling_path)
        }
        _ => Ok(()),
    }
}

fn heights(z_m: Option<[f64; 2]>, path: &JsonPath) -> Result<Option<[f64; 2]>, RuleViolation> {
    let path = path.key("z_m");
    if let Some([lower, upper]) = z_m {
        length(lower, &path.index(0))?;
        length(upper, &path.index(1))?;
        rising(("the lower height", lower), ("the upper height", upper), &path)?;
    }
    Ok(z_m)
}

fn rising(
    (lower_name, lower): (&'static str, f64),
    (upper_name, upper): (&'static str, f64),
    path: &JsonPath,
) -> Result<(), RuleViolation> {
    if lower < upper {
        return Ok(());
    }
    fault(path, SceneProblem::HeightsReversed { lower_name, lower, upper_name, upper })
}

fn point([x, y]: Point, path: &JsonPath) -> Result<DVec2, RuleViolation> {
    length(x, &path.index(0))?;
    length(y, &path.index(1))?;
    Ok(DVec2::new(x, y))
}

fn length(value: f64, path: &JsonPath) -> Result<(), RuleViolation> {
    // Written so that NaN fails as well.
    if value.abs() <= MAX_COORDINATE_M {
        return Ok(());
    }
    fault(path, SceneProblem::OutOfBounds { value })
}

fn radius(radius_m: f64, path: &JsonPath) -> Result<f64, RuleViolation> {
    if radius_m > 0.0 && radius_m <= MAX_COORDINATE_M {
        return Ok(radius_m);
    }
    fault(path, SceneProblem::Radius(radius_m))
}

fn snap(snap_m: Option<f64>, path: &JsonPath) -> Result<f64, RuleViolation> {
    let snap_m = snap_m.unwrap_or(DEFAULT_SNAP_M);
    if (0.0..=MAX_SNAP_M).contains(&snap_m) {
        return Ok(snap_m);
    }
    fault(path, SceneProblem::Snap(snap_m))
}

fn share(field: &'static str, value: f64, path: &JsonPath) -> Result<(), RuleViolation> {
    if (0.0..=1.0).contains(&value) {
        return Ok(());
    }
    fault(&path.key(field), SceneProblem::Share { field, value })
}

fn is_name(name: &str, path: &JsonPath) -> Result<(), RuleViolation> {
    if name.trim().is_empty() {
        return fault(path, SceneProblem::EmptyName);
    }
    match name.chars().find(|found| found.is_control()) {
        Some(found) => fault(path, SceneProblem::ControlCharacter(found)),
        None => Ok(()),
    }
}

fn fault<T>(path: &JsonPath, problem: SceneProblem) -> Result<T, RuleViolation> {
    Err(RuleViolation { path: path.clone(), part: MemberPart::Value, problem })
}
