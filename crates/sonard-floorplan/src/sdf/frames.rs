//! Frames of a world: poses and their reference frames (SDFormat, "Pose frame semantics").

use glam::{DAffine3, DMat3, DQuat, DVec3};
use roxmltree::Node;

use super::{World, child};
use crate::PlanError;

/// World, model or link whose members are placed in its frame.
pub(super) struct Scope<'s, 'n> {
    pub(super) element: Node<'n, 'n>,
    /// Frame in the world.
    pub(super) frame: DAffine3,
    /// Scale of its members.
    pub(super) scale: DVec3,
    pub(super) name: &'n str,
    pub(super) outer: Option<&'s Scope<'s, 'n>>,
}

/// Maximum length of a chain of reference frames.
const MAX_DEPTH: usize = 32;

impl<'n> Scope<'_, 'n> {
    pub(super) fn world(element: Node<'n, 'n>) -> Self {
        Self { element, frame: DAffine3::IDENTITY, scale: DVec3::ONE, name: "body", outer: None }
    }
}

/// Frame, or the name of a missing one.
pub(super) type Found = Result<DAffine3, String>;

impl World<'_> {
    /// Returns the frame of an element in the world, from its pose and reference frame.
    pub(super) fn frame<'n>(
        &self,
        element: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        depth: usize,
    ) -> Result<Found, PlanError> {
        let pose = child(element, "pose");
        let attribute = |name: &str| {
            let pose = pose.and_then(|pose| pose.attribute(name));
            pose.filter(|frame| !frame.is_empty())
        };
        let attached = element.attribute("attached_to").filter(|frame| !frame.is_empty());
        // The frame of a joint is that of its child link.
        let joined = child(element, "child").filter(|_| element.has_tag_name("joint"));
        let joined = joined.and_then(|link| link.text()).map(str::trim);
        let relative_to =
            attribute("relative_to").or_else(|| attribute("frame")).or(attached).or(joined);
        let base = match relative_to {
            Some(name) => match self.named(name, scope, depth)? {
                Ok(base) => base,
                Err(missing) => return Ok(Err(missing)),
            },
            None => scope.frame,
        };
        let own = match pose {
            Some(pose) => self.pose(pose)?,
            None => DAffine3::IDENTITY,
        };
        // Positions within a scaled model are scaled, too.
        let own = match relative_to {
            None => DAffine3 { translation: scope.scale * own.translation, ..own },
            Some(_) => own,
        };
        Ok(Ok(base * own))
    }

    /// Finds a frame by name, in a scope or the enclosing ones.
    fn named<'n>(
        &self,
        name: &str,
        scope: &Scope<'_, 'n>,
        depth: usize,
    ) -> Result<Found, PlanError> {
        let missing = || Ok(Err(name.to_owned()));
        if depth > MAX_DEPTH {
            return missing();
        }
        match name {
            "world" | "__root__" => return Ok(Ok(DAffine3::IDENTITY)),
            "__model__" => {
                let model = std::iter::successors(Some(scope), |scope| scope.outer)
                    .find(|scope| scope.element.has_tag_name("model"));
                return model.map_or_else(missing, |model| Ok(Ok(model.frame)));
            }
            _ => {}
        }
        let (first, rest) =
            name.split_once("::").map_or((name, None), |(first, rest)| (first, Some(rest)));
        let mut around = Some(scope);
        while let Some(scope) = around {
            let is_named = |node: &Node| {
                node.attribute("name") == Some(first)
                    && matches!(
                        node.tag_name().name(),
                        "link" | "model" | "frame" | "include" | "joint"
                    )
            };
            if let Some(element) = scope.element.children().find(is_named) {
                let frame = self.frame(element, scope, depth + 1)?;
                let (Some(rest), Ok(frame)) = (rest, &frame) else { return Ok(frame) };
                let inner = Scope {
                    element,
                    frame: *frame,
                    scale: scope.scale,
                    name: "",
                    outer: Some(scope),
                };
                return self.named(rest, &inner, depth + 1);
            }
            if scope.element.attribute("name") == Some(first) && rest.is_none() {
                return Ok(Ok(scope.frame));
            }
            around = scope.outer;
        }
        missing()
    }

    /// Parses a pose: x y z, and roll pitch yaw or a quaternion.
    pub(super) fn pose(&self, pose: Node) -> Result<DAffine3, PlanError> {
        if pose.text().unwrap_or_default().trim().is_empty() {
            return Ok(DAffine3::IDENTITY);
        }
        if pose.attribute("rotation_format") == Some("quat_xyzw") {
            let [x, y, z, qx, qy, qz, qw] = self.numbers(pose)?;
            let turn = DQuat::from_xyzw(qx, qy, qz, qw);
            if !turn.is_finite() || turn.length() < 1e-6 {
                return Err(self.invalid(pose, "the quaternion of the pose has no length"));
            }
            return Ok(DAffine3::from_rotation_translation(turn.normalize(), DVec3::new(x, y, z)));
        }
        let [x, y, z, roll, pitch, yaw] = self.numbers(pose)?;
        let unit = match pose.attribute("degrees") {
            Some("true" | "1") => 1_f64.to_radians(),
            _ => 1.0,
        };
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(|angle| unit * angle);
        let turn = DMat3::from_rotation_z(yaw)
            * DMat3::from_rotation_y(pitch)
            * DMat3::from_rotation_x(roll);
        Ok(DAffine3::from_mat3_translation(turn, DVec3::new(x, y, z)))
    }
}
