//! Where frames were: the tree that `/tf` and `/tf_static` tell, over time.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use thiserror::Error;

use super::message::{Transform, moment};

/// Transforms by the frame that they place.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Transforms {
    frames: BTreeMap<String, Link>,
    count: usize,
}

/// Where a frame is in its parent.
#[derive(Debug, Clone, PartialEq)]
struct Link {
    parent: String,
    is_fixed: bool,
    /// By time, nanoseconds since 1970; of a fixed one the last counts.
    places: Vec<(i64, Placed)>,
}

/// Where something is in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placed {
    pub(crate) at: DVec3,
    pub(crate) turn: DQuat,
}

/// What is wrong with the frames of a recording.
#[derive(Debug, Clone, PartialEq, Error)]
pub(crate) enum TransformError {
    #[error(
        "there is no transform of the frame `{child}` in `{parent}` at {time}: they go from {from} to {to}"
    )]
    Lacks { child: String, parent: String, time: String, from: String, to: String },
    #[error(
        "the transforms of the frame `{child}` in `{parent}` have a gap from {from} to {to}, and it moved"
    )]
    Gap { child: String, parent: String, from: String, to: String },
    #[error("the frame `{0}` is its own parent")]
    Loop(String),
    #[error("the frame `{child}` is in `{parent}` and in `{other}`")]
    TwoParents { child: String, parent: String, other: String },
    #[error("a transform of the frame `{0}` has no finite place or no direction")]
    Senseless(String),
    #[error("there are more than {MOST} transforms")]
    TooMany,
}

/// As many as are kept: 64 MB.
const MOST: usize = 1 << 20;
/// A frame that moved is not where it was between, after so long without a transform, nanoseconds.
const MAX_GAP_NS: i64 = 5_000_000_000;
/// A frame that moved by more than this has moved, metres and radians.
const MOVED_M: f64 = 0.05;
const MOVED_RAD: f64 = 0.05;
/// No robot is so far from where its map begins, metres.
const MOST_M: f64 = 1e9;
/// Cosine of a tilt that is none.
const LEVEL: f64 = 1.0 - 1e-12;
/// No tree of a robot is this deep.
const MOST_DEEP: usize = 64;

impl Placed {
    pub(crate) const ORIGIN: Self = Self { at: DVec3::ZERO, turn: DQuat::IDENTITY };

    /// What is placed so in a frame that is itself placed.
    pub(crate) fn then(self, inner: Self) -> Self {
        Self { at: self.at + self.turn * inner.at, turn: self.turn * inner.turn }
    }

    /// Direction over the floor of a beam that is turned about its z axis, degrees counter-clockwise.
    pub(crate) fn beam_deg(self, turned_deg: f64) -> f64 {
        match self.upright().z {
            // Level: without the rounding of a rotation.
            up if up > LEVEL => self.yaw_deg() + turned_deg,
            up if up < -LEVEL => self.yaw_deg() - turned_deg,
            _ => {
                let beam = self.turn * DQuat::from_rotation_z(turned_deg.to_radians()) * DVec3::X;
                beam.y.atan2(beam.x).to_degrees()
            }
        }
    }

    /// Direction of its z axis.
    fn upright(self) -> DVec3 {
        self.turn * DVec3::Z
    }

    /// By how much the plane of its x and y is tilted, whichever side is up, degrees.
    pub(crate) fn tilt_deg(self) -> f64 {
        self.upright().z.abs().min(1.0).acos().to_degrees()
    }

    /// Elevation of its x axis, degrees.
    pub(crate) fn elevation_deg(self) -> f64 {
        (self.turn * DVec3::X).z.clamp(-1.0, 1.0).asin().to_degrees()
    }

    fn has_moved(self, from: Self) -> bool {
        self.at.distance(from.at) > MOVED_M || self.turn.angle_between(from.turn) > MOVED_RAD
    }

    /// Direction of its x axis over the floor, degrees counter-clockwise.
    pub(crate) fn yaw_deg(self) -> f64 {
        let ahead = self.turn * DVec3::X;
        ahead.y.atan2(ahead.x).to_degrees()
    }

    fn between(self, other: Self, part: f64) -> Self {
        Self { at: self.at.lerp(other.at, part), turn: self.turn.slerp(other.turn, part) }
    }
}

impl Transforms {
    /// Takes a transform in.
    pub(crate) fn add(
        &mut self,
        transform: Transform,
        is_fixed: bool,
    ) -> Result<(), TransformError> {
        let Transform { header, child, translation_m, rotation } = transform;
        let (at, turn) = (DVec3::from(translation_m), DQuat::from_array(rotation));
        if !(at.is_finite()
            && at.abs().max_element() < MOST_M
            && turn.is_finite()
            && turn.length_squared() > 1e-6)
        {
            return Err(TransformError::Senseless(child));
        }
        let placed = Placed { at, turn: turn.normalize() };
        let fresh = || Link { parent: header.frame.clone(), is_fixed, places: Vec::new() };
        let link = self.frames.entry(child.clone()).or_insert_with(fresh);
        if link.parent != header.frame {
            let parent = link.parent.clone();
            return Err(TransformError::TwoParents { child, parent, other: header.frame });
        }
        if is_fixed {
            link.places.clear();
        } else if let [.., (_, before), (last, at)] = &mut link.places[..]
            && *before == placed
            && *at == placed
            && *last <= header.stamp_ns
        {
            // A frame that rests is told again and again: its first time and its last are enough.
            *last = header.stamp_ns;
            return Ok(());
        } else {
            self.count += 1;
            if self.count > MOST {
                return Err(TransformError::TooMany);
            }
        }
        link.places.push((header.stamp_ns, placed));
        Ok(())
    }

    /// Checks whether a frame is placed in another, or another in it.
    pub(crate) fn knows(&self, frame: &str) -> bool {
        self.frames.contains_key(frame) || self.frames.values().any(|link| link.parent == frame)
    }

    /// Brings them into the order of time.
    pub(crate) fn sort(&mut self) {
        for link in self.frames.values_mut() {
            link.places.sort_by_key(|(time, _)| *time);
        }
    }

    /// The frames from one up to the root of its tree.
    pub(crate) fn way_up<'a>(&'a self, frame: &'a str) -> Result<Vec<&'a str>, TransformError> {
        let mut way = vec![frame];
        let mut at = frame;
        while let Some(link) = self.frames.get(at) {
            at = &link.parent;
            way.push(at);
            if way.len() > MOST_DEEP {
                return Err(TransformError::Loop(frame.to_owned()));
            }
        }
        Ok(way)
    }

    /// Where a frame was in one that it is below of, interpolated.
    pub(crate) fn place(
        &self,
        frame: &str,
        above: &str,
        time_ns: i64,
    ) -> Result<Placed, TransformError> {
        let mut placed = Placed::ORIGIN;
        for child in self.way_up(frame)?.into_iter().take_while(|frame| *frame != above) {
            let Some(link) = self.frames.get(child) else { break };
            placed = link.place(child, time_ns)?.then(placed);
        }
        Ok(placed)
    }
}

impl Link {
    fn place(&self, child: &str, time_ns: i64) -> Result<Placed, TransformError> {
        let after = self.places.partition_point(|(time, _)| *time < time_ns);
        let last = self.places.last();
        if let Some((_, placed)) = last.filter(|_| self.is_fixed) {
            return Ok(*placed);
        }
        if let Some((time, placed)) = self.places.get(after) {
            if *time == time_ns {
                return Ok(*placed);
            }
            if let Some((before, from)) = after.checked_sub(1).and_then(|at| self.places.get(at)) {
                if time - before > MAX_GAP_NS && placed.has_moved(*from) {
                    return Err(TransformError::Gap {
                        child: child.to_owned(),
                        parent: self.parent.clone(),
                        from: moment(*before).to_string(),
                        to: moment(*time).to_string(),
                    });
                }
                let part = (time_ns - before) as f64 / (time - before) as f64;
                return Ok(from.between(*placed, part));
            }
        }
        let told = |at: Option<&(i64, Placed)>| {
            at.map_or("none".to_owned(), |(time, _)| moment(*time).to_string())
        };
        Err(TransformError::Lacks {
            child: child.to_owned(),
            parent: self.parent.clone(),
            time: moment(time_ns).to_string(),
            from: told(self.places.first()),
            to: told(last),
        })
    }
}
