//! Frame tree of `/tf` and `/tf_static` over time.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use thiserror::Error;

use super::message::{TransformMessage, timestamp};

/// Frames of a recording, by name.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct FrameTree {
    frames: BTreeMap<String, FrameHistory>,
    count: usize,
}

/// Placement of a frame in its parent over time.
#[derive(Debug, Clone, PartialEq)]
struct FrameHistory {
    parent: String,
    is_fixed: bool,
    /// Placements by time, nanoseconds since 1970; a fixed frame keeps only the last.
    placements: Vec<(i64, Placement)>,
}

/// Position and rotation in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    pub(crate) at: DVec3,
    pub(crate) turn: DQuat,
}

/// Fault of the frames of a recording.
#[derive(Debug, Clone, PartialEq, Error)]
pub(crate) enum TransformError {
    #[error(
        "no transform of frame `{child}` in `{parent}` at {time}: available from {from} to {to}"
    )]
    Missing { child: String, parent: String, time: String, from: String, to: String },
    #[error(
        "no transform of frame `{child}` in `{parent}` from {from} to {to}, during which it moved"
    )]
    Gap { child: String, parent: String, from: String, to: String },
    #[error("frame `{0}` is its own parent")]
    Loop(String),
    #[error("frame `{child}` has two parents: `{parent}` and `{other}`")]
    TwoParents { child: String, parent: String, other: String },
    #[error("a transform of frame `{0}` has no finite position or no rotation")]
    NotFinite(String),
    #[error("more than {MAX_TRANSFORMS} transforms")]
    TooMany,
}

/// Maximum number of transforms: 64 MB.
const MAX_TRANSFORMS: usize = 1 << 20;
/// Maximum gap between transforms of a moving frame for interpolation, nanoseconds.
const MAX_GAP_NS: i64 = 5_000_000_000;
/// Displacement and rotation from which a frame counts as moved, metres and radians.
const MOVED_M: f64 = 0.05;
const MOVED_RAD: f64 = 0.05;
/// Maximum distance of a robot from the origin of its map, metres.
const MAX_DISTANCE_M: f64 = 1e9;
/// Cosine of a tilt that is only a rounding error.
const LEVEL: f64 = 1.0 - 1e-12;
/// Maximum depth of the frame tree.
const MAX_DEPTH: usize = 64;

impl Placement {
    pub(crate) const ORIGIN: Self = Self { at: DVec3::ZERO, turn: DQuat::IDENTITY };

    /// Composes this placement with an inner one.
    pub(crate) fn then(self, inner: Self) -> Self {
        Self { at: self.at + self.turn * inner.at, turn: self.turn * inner.turn }
    }

    /// Returns the azimuth of a beam rotated about the z axis by `turned_deg`, degrees
    /// counter-clockwise.
    pub(crate) fn beam_deg(self, turned_deg: f64) -> f64 {
        match self.upright().z {
            // Level mounts avoid the rounding errors of a rotation.
            up if up > LEVEL => self.yaw_deg() + turned_deg,
            up if up < -LEVEL => self.yaw_deg() - turned_deg,
            _ => {
                let beam = self.turn * DQuat::from_rotation_z(turned_deg.to_radians()) * DVec3::X;
                beam.y.atan2(beam.x).to_degrees()
            }
        }
    }

    /// Returns the direction of the z axis.
    fn upright(self) -> DVec3 {
        self.turn * DVec3::Z
    }

    /// Returns the tilt of the x-y plane, regardless of which side is up, degrees.
    pub(crate) fn tilt_deg(self) -> f64 {
        self.upright().z.abs().min(1.0).acos().to_degrees()
    }

    /// Returns the elevation of the x axis, degrees.
    pub(crate) fn elevation_deg(self) -> f64 {
        (self.turn * DVec3::X).z.clamp(-1.0, 1.0).asin().to_degrees()
    }

    fn has_moved(self, from: Self) -> bool {
        self.at.distance(from.at) > MOVED_M || self.turn.angle_between(from.turn) > MOVED_RAD
    }

    /// Returns the azimuth of the x axis, degrees counter-clockwise.
    pub(crate) fn yaw_deg(self) -> f64 {
        let ahead = self.turn * DVec3::X;
        ahead.y.atan2(ahead.x).to_degrees()
    }

    fn between(self, other: Self, part: f64) -> Self {
        Self { at: self.at.lerp(other.at, part), turn: self.turn.slerp(other.turn, part) }
    }
}

impl FrameTree {
    /// Adds a transform.
    pub(crate) fn add(
        &mut self,
        transform: TransformMessage,
        is_fixed: bool,
    ) -> Result<(), TransformError> {
        let TransformMessage { header, child, translation_m, rotation } = transform;
        let (at, turn) = (DVec3::from(translation_m), DQuat::from_array(rotation));
        if !(at.is_finite()
            && at.abs().max_element() < MAX_DISTANCE_M
            && turn.is_finite()
            && turn.length_squared() > 1e-6)
        {
            return Err(TransformError::NotFinite(child));
        }
        let placed = Placement { at, turn: turn.normalize() };
        let fresh =
            || FrameHistory { parent: header.frame.clone(), is_fixed, placements: Vec::new() };
        let link = self.frames.entry(child.clone()).or_insert_with(fresh);
        if link.parent != header.frame {
            let parent = link.parent.clone();
            return Err(TransformError::TwoParents { child, parent, other: header.frame });
        }
        if is_fixed {
            link.placements.clear();
        } else if let [.., (_, before), (last, at)] = &mut link.placements[..]
            && *before == placed
            && *at == placed
            && *last <= header.stamp_ns
        {
            // Transforms of a resting frame repeat: the first and the last are sufficient.
            *last = header.stamp_ns;
            return Ok(());
        } else {
            self.count += 1;
            if self.count > MAX_TRANSFORMS {
                return Err(TransformError::TooMany);
            }
        }
        link.placements.push((header.stamp_ns, placed));
        Ok(())
    }

    /// Returns `true` for a frame that has a parent or a child.
    pub(crate) fn contains(&self, frame: &str) -> bool {
        self.frames.contains_key(frame) || self.frames.values().any(|link| link.parent == frame)
    }

    /// Sorts the placements of all frames by time.
    pub(crate) fn sort(&mut self) {
        for link in self.frames.values_mut() {
            link.placements.sort_by_key(|(time, _)| *time);
        }
    }

    /// Returns the path from a frame to the root of its tree.
    pub(crate) fn path_to_root<'a>(
        &'a self,
        frame: &'a str,
    ) -> Result<Vec<&'a str>, TransformError> {
        let mut path = vec![frame];
        let mut at = frame;
        while let Some(link) = self.frames.get(at) {
            at = &link.parent;
            path.push(at);
            if path.len() > MAX_DEPTH {
                return Err(TransformError::Loop(frame.to_owned()));
            }
        }
        Ok(path)
    }

    /// Returns the interpolated placement of a frame in one of its ancestors.
    pub(crate) fn place(
        &self,
        frame: &str,
        above: &str,
        time_ns: i64,
    ) -> Result<Placement, TransformError> {
        let mut placed = Placement::ORIGIN;
        for child in self.path_to_root(frame)?.into_iter().take_while(|frame| *frame != above) {
            let Some(link) = self.frames.get(child) else { break };
            placed = link.place(child, time_ns)?.then(placed);
        }
        Ok(placed)
    }
}

impl FrameHistory {
    fn place(&self, child: &str, time_ns: i64) -> Result<Placement, TransformError> {
        let after = self.placements.partition_point(|(time, _)| *time < time_ns);
        let last = self.placements.last();
        if let Some((_, placed)) = last.filter(|_| self.is_fixed) {
            return Ok(*placed);
        }
        if let Some((time, placed)) = self.placements.get(after) {
            if *time == time_ns {
                return Ok(*placed);
            }
            if let Some((before, from)) =
                after.checked_sub(1).and_then(|at| self.placements.get(at))
            {
                if time - before > MAX_GAP_NS && placed.has_moved(*from) {
                    return Err(TransformError::Gap {
                        child: child.to_owned(),
                        parent: self.parent.clone(),
                        from: timestamp(*before).to_string(),
                        to: timestamp(*time).to_string(),
                    });
                }
                let part = (time_ns - before) as f64 / (time - before) as f64;
                return Ok(from.between(*placed, part));
            }
        }
        let time = |at: Option<&(i64, Placement)>| {
            at.map_or("none".to_owned(), |(time, _)| timestamp(*time).to_string())
        };
        Err(TransformError::Missing {
            child: child.to_owned(),
            parent: self.parent.clone(),
            time: timestamp(time_ns).to_string(),
            from: time(self.placements.first()),
            to: time(last),
        })
    }
}
