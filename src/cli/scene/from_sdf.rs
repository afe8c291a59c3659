//! `sonard scene from-sdf`.

use std::path::PathBuf;

use glam::{DAffine3, DMat3, DVec3};
use roxmltree::{Document, Node};

use super::{
    super::{Failure, Outcome, numbers::within},
    made::{MadeArgs, read, refuse},
};
use crate::scene::Surfaces;

/// Options of `sonard scene from-sdf`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromSdfArgs {
    /// World or model of Gazebo, an SDF file
    #[arg(value_name = "WORLD")]
    world: PathBuf,
    /// Height at which the world is cut, that of the ranger, metres
    #[arg(long, value_name = "M", default_value_t = 0.2, value_parser = within(-1e4..=1e4), allow_negative_numbers = true)]
    cut_z_m: f64,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene of a world of Gazebo: boxes and outlines of an SDF file are walls, cylinders are cylinders.

What has to do with collisions is cut at the height of the ranger (--cut-z-m), so the ground is none, and a table's top is \
only for a ranger at its height; boxes, cylinders and outlines (polyline) that stand upright count, \
each named by its model. Meshes, spheres, models from elsewhere (include), poses that are told relative to something \
else, and what leans are left out with a warning. All is of one material: give walls their own in the file that comes out.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-sdf arena.sdf -o arena.json
  sonard scene from-sdf arena.sdf --cut-z-m 0.45 -o arena.json
  sonard scene draw arena.json -o check.svg";

pub(super) fn run(args: &FromSdfArgs) -> Outcome {
    let help = "give an SDF file, as Gazebo reads it";
    let bytes = read(&args.world, help)?;
    let text = String::from_utf8(bytes).map_err(|error| refuse(&args.world, &error, help))?;
    let document = Document::parse(&text).map_err(|error| refuse(&args.world, &error, help))?;
    let root = document.root_element();
    if !root.has_tag_name("sdf") {
        let what = format!("the outermost element is {}, not sdf", root.tag_name().name());
        return Err(refuse(&args.world, &what, help));
    }
    let mut world = World { args, found: Surfaces::default() };
    world.add(root, "body", &DAffine3::IDENTITY)?;
    let help = "give a world with boxes, cylinders or outlines that the height of --cut-z-m meets";
    args.made.write(&args.world, &world.found, help)
}

/// What was found so far.
struct World<'a> {
    args: &'a FromSdfArgs,
    found: Surfaces,
}

impl World<'_> {
    /// All that is in an element, whose frame is known in the world.
    fn add(&mut self, element: Node, name: &str, frame: &DAffine3) -> Outcome {
        for child in element.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "world" => self.add(child, name, frame)?,
                kind @ ("model" | "link" | "collision") => {
                    if let Some(frame) = self.frame(child, frame)? {
                        let of_model = (kind == "model").then(|| child.attribute("name")).flatten();
                        self.add(child, of_model.unwrap_or(name), &frame)?;
                    }
                }
                "geometry" => self.geometry(child, name, frame)?,
                "include" => self.found.leave_out("models from elsewhere (include)"),
                _ => {}
            }
        }
        Ok(())
    }

    /// The frame of an element, in the world; none where it is told relative to another.
    fn frame(&mut self, element: Node, parent: &DAffine3) -> Result<Option<DAffine3>, Failure> {
        let Some(pose) = child(element, "pose") else { return Ok(Some(*parent)) };
        let is_relative = |name: &str| pose.attribute(name).is_some_and(|frame| !frame.is_empty());
        if is_relative("relative_to") || is_relative("frame") {
            self.found.leave_out("poses relative to something else");
            return Ok(None);
        }
        let text = pose.text().unwrap_or_default();
        let [x, y, z, roll, pitch, yaw] = match text.trim().is_empty() {
            true => [0.0; 6],
            false => self.numbers(pose)?,
        };
        let unit = match pose.attribute("degrees") {
            Some("true" | "1") => 1_f64.to_radians(),
            _ => 1.0,
        };
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(|angle| unit * angle);
        let turn = DMat3::from_rotation_z(yaw)
            * DMat3::from_rotation_y(pitch)
            * DMat3::from_rotation_x(roll);
        Ok(Some(*parent * DAffine3::from_mat3_translation(turn, DVec3::new(x, y, z))))
    }

    fn geometry(&mut self, geometry: Node, name: &str, frame: &DAffine3) -> Outcome {
        for shape in geometry.children().filter(Node::is_element) {
            match shape.tag_name().name() {
                "box" => {
                    let half = 0.5 * DVec3::from(self.numbers_of(shape, "size")?);
                    self.upright_box(name, frame, half);
                }
                "cylinder" => {
                    let [radius_m] = self.numbers_of(shape, "radius")?;
                    let [length_m] = self.numbers_of(shape, "length")?;
                    self.cylinder(name, frame, radius_m, length_m);
                }
                "polyline" => self.outline(shape, name, frame)?,
                "plane" | "empty" => {}
                _ => self.found.leave_out("meshes, spheres and other shapes"),
            }
        }
        Ok(())
    }

    /// A box that stands on one of its sides, half as long along its axes as `half` says, metres.
    fn upright_box(&mut self, name: &str, frame: &DAffine3, half: DVec3) {
        let Some(up) = axis_up(frame) else { return self.found.leave_out(LEANS) };
        if !self.cuts(frame.translation.z, half[up]) {
            return;
        }
        let along = |axis: usize| half[axis] * frame.matrix3.col(axis).truncate();
        let (a, b) = (along((up + 1) % 3), along((up + 2) % 3));
        let corners =
            [-a - b, a - b, a + b, b - a].map(|corner| frame.translation.truncate() + corner);
        self.found.walls(name, corners.to_vec(), true);
    }

    fn cylinder(&mut self, name: &str, frame: &DAffine3, radius_m: f64, length_m: f64) {
        if axis_up(frame) != Some(AXIS_Z) {
            self.found.leave_out(LEANS);
        } else if self.cuts(frame.translation.z, 0.5 * length_m) {
            self.found.round(name, frame.translation.truncate(), radius_m);
        }
    }

    /// An outline that stands on its frame's ground.
    fn outline(&mut self, shape: Node, name: &str, frame: &DAffine3) -> Outcome {
        let [height_m] = self.numbers_of(shape, "height")?;
        let points = shape.children().filter(|child| child.has_tag_name("point"));
        let corners = points.map(|point| {
            let [x, y] = self.numbers(point)?;
            Ok(frame.transform_point3(DVec3::new(x, y, 0.0)).truncate())
        });
        let corners = corners.collect::<Result<Vec<_>, Failure>>()?;
        if axis_up(frame) != Some(AXIS_Z) {
            self.found.leave_out(LEANS);
        } else {
            let up_m = height_m * frame.matrix3.z_axis.z.signum();
            if self.cuts(frame.translation.z + 0.5 * up_m, 0.5 * height_m) {
                self.found.walls(name, corners, true);
            }
        }
        Ok(())
    }

    /// Whether the height of the cut meets a body whose middle is so high, metres.
    fn cuts(&self, middle_z_m: f64, half_m: f64) -> bool {
        (self.args.cut_z_m - middle_z_m).abs() <= half_m
    }

    /// The numbers of an element's child.
    fn numbers_of<const N: usize>(&self, element: Node, name: &str) -> Result<[f64; N], Failure> {
        match child(element, name) {
            Some(child) => self.numbers(child),
            None => {
                Err(self.refuse(element, &format!("{} has no {name}", element.tag_name().name())))
            }
        }
    }

    fn numbers<const N: usize>(&self, element: Node) -> Result<[f64; N], Failure> {
        let text = element.text().unwrap_or_default().trim();
        let numbers: Option<Vec<f64>> = text
            .split_whitespace()
            .map(|number| number.parse().ok().filter(|number: &f64| number.is_finite()))
            .collect();
        numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
            let name = element.tag_name().name();
            self.refuse(element, &format!("{name} is `{text}`: {N} numbers are wanted"))
        })
    }

    fn refuse(&self, element: Node, what: &str) -> Failure {
        let at = element.document().text_pos_at(element.range().start);
        let place = format!("line {}, column {}: {what}", at.row, at.col);
        refuse(&self.args.world, &place, "mend it, as http://sdformat.org describes the format")
    }
}

const LEANS: &str = "bodies that lean or lie";
const AXIS_Z: usize = 2;
/// Cosine of the lean that is none: a quarter of a degree.
const UPRIGHT: f64 = 1.0 - 1e-5;

/// The axis of a frame that is upright: 0 to 2 for x, y, z.
fn axis_up(frame: &DAffine3) -> Option<usize> {
    (0..3).find(|axis| frame.matrix3.col(*axis).z.abs() > UPRIGHT)
}

/// The first child of a name.
fn child<'a, 'input>(element: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    element.children().find(|child| child.has_tag_name(name))
}
