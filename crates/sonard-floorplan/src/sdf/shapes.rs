//! Collision shapes, sliced at the height of the ranger.

use glam::{DAffine3, DVec3};
use roxmltree::Node;

use super::{Added, Body, World, child};
use crate::PlanError;

impl World<'_> {
    /// Adds a collision shape, in its frame.
    pub(super) fn geometry(&mut self, geometry: Node, body: Body, frame: &DAffine3) -> Added {
        let Body { name, scale } = body;
        for shape in geometry.children().filter(Node::is_element) {
            match shape.tag_name().name() {
                "box" => {
                    let half = 0.5 * scale * DVec3::from(self.numbers_of(shape, "size")?);
                    self.upright_box(name, frame, half);
                }
                "cylinder" => {
                    let [radius_m] = self.numbers_of(shape, "radius")?;
                    let [length_m] = self.numbers_of(shape, "length")?;
                    if (scale.x - scale.y).abs() > 1e-6 * scale.x.abs() {
                        self.note(format!(
                            "ignored: a cylinder of `{name}` that is scaled to an oval"
                        ));
                        continue;
                    }
                    self.cylinder(name, frame, scale.x * radius_m, scale.z * length_m);
                }
                "polyline" => self.outline(shape, body, frame)?,
                "plane" => self.plane(shape, name, frame)?,
                "empty" => {}
                kind => {
                    self.found.count_ignored("meshes, spheres and other shapes");
                    self.note(format!("ignored: {kind} of `{name}`"));
                }
            }
        }
        Ok(())
    }

    /// Ignores a horizontal plane as the ground, and notes others.
    fn plane(&mut self, shape: Node, name: &str, frame: &DAffine3) -> Added {
        let normal = match child(shape, "normal") {
            Some(normal) => DVec3::from(self.numbers(normal)?),
            None => DVec3::Z,
        };
        if (frame.matrix3 * normal.normalize_or(DVec3::Z)).z.abs() < UPRIGHT {
            self.note(format!("ignored: a plane of `{name}` that is not horizontal"));
        }
        Ok(())
    }

    /// Adds a box with a vertical axis; `half` are its half-lengths, metres.
    fn upright_box(&mut self, name: &str, frame: &DAffine3, half: DVec3) {
        let Some(up) = axis_up(frame) else { return self.ignore_tilted(name) };
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
            self.ignore_tilted(name);
        } else if self.cuts(frame.translation.z, 0.5 * length_m) {
            self.found.round(name, frame.translation.truncate(), radius_m);
        }
    }

    /// Adds an outline extruded from the ground of its frame.
    fn outline(&mut self, shape: Node, Body { name, scale }: Body, frame: &DAffine3) -> Added {
        let [height_m] = self.numbers_of(shape, "height")?;
        let height_m = scale.z * height_m;
        let points = shape.children().filter(|child| child.has_tag_name("point"));
        let corners = points.map(|point| {
            let [x, y] = self.numbers(point)?;
            Ok(frame.transform_point3(scale * DVec3::new(x, y, 0.0)).truncate())
        });
        let corners = corners.collect::<Result<Vec<_>, PlanError>>()?;
        if axis_up(frame) != Some(AXIS_Z) {
            self.ignore_tilted(name);
        } else {
            let up_m = height_m * frame.matrix3.z_axis.z.signum();
            if self.cuts(frame.translation.z + 0.5 * up_m, 0.5 * height_m) {
                self.found.walls(name, corners, true);
            }
        }
        Ok(())
    }

    fn ignore_tilted(&mut self, name: &str) {
        self.found.count_ignored(TILTED);
        self.note(format!("ignored: a tilted object of `{name}`"));
    }

    /// Returns `true` if the slice intersects a body with this centre height and half-height,
    /// metres; otherwise counts the body.
    fn cuts(&mut self, middle_z_m: f64, half_m: f64) -> bool {
        let is_cut = (self.options.cut_z_m - middle_z_m).abs() <= half_m;
        self.at_other_heights += usize::from(!is_cut);
        is_cut
    }

    /// Parses the numbers of an element's child.
    pub(super) fn numbers_of<const N: usize>(
        &self,
        element: Node,
        name: &str,
    ) -> Result<[f64; N], PlanError> {
        match child(element, name) {
            Some(child) => self.numbers(child),
            None => {
                Err(self.invalid(element, &format!("{} has no {name}", element.tag_name().name())))
            }
        }
    }

    pub(super) fn numbers<const N: usize>(&self, element: Node) -> Result<[f64; N], PlanError> {
        let text = element.text().unwrap_or_default().trim();
        let numbers: Option<Vec<f64>> = text
            .split_whitespace()
            .map(|number| number.parse().ok().filter(|number: &f64| number.is_finite()))
            .collect();
        numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
            let name = element.tag_name().name();
            self.invalid(element, &format!("{name} is `{text}`: {N} numbers are expected"))
        })
    }
}

const TILTED: &str = "tilted objects";
const AXIS_Z: usize = 2;
/// Cosine of the largest tilt of an upright object: a quarter of a degree.
const UPRIGHT: f64 = 1.0 - 1e-5;

/// Returns the vertical axis of a frame: 0 to 2 for x, y, z.
fn axis_up(frame: &DAffine3) -> Option<usize> {
    (0..3).find(|axis| frame.matrix3.col(*axis).z.abs() > UPRIGHT)
}
