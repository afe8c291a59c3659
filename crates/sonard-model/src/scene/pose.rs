//! Poses by name or coordinates, and checks of their accessibility.

use thiserror::Error;

use super::{
    FloorPlan, Scene,
    error::{MAX_COORDINATE_M, suggest},
    outline::SceneOutlines,
    robot::wall_between,
};
use crate::geometry::{DVec2, Pose, distance_to_segment};

/// Minimum distance of a ranger from a surface, metres.
pub(super) const CLEARANCE_M: f64 = 1e-3;

/// Maximum magnitude of a heading, degrees.
pub(super) const MAX_HEADING_DEG: f64 = 360.0;

/// Pose that is malformed or inaccessible.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PoseError {
    /// Request of a named pose that does not exist.
    #[error("the scene `{scene}` has no pose `{name}`")]
    Unknown {
        /// Name of the requested pose.
        name: String,
        /// Name of the scene.
        scene: String,
        /// Names of the scene's poses.
        known: Vec<String>,
    },
    /// Wrong number of coordinates: neither two nor three.
    #[error("`{0}` is not a pose")]
    Malformed(String),
    /// Coordinate that is not a number within bounds.
    #[error("{field} `{text}` is not a number from -{limit} to {limit}")]
    BadNumber {
        /// Name of the coordinate: X, Y or DEG.
        field: &'static str,
        /// Text of the rejected coordinate.
        text: String,
        /// Maximum magnitude of the coordinate.
        limit: f64,
    },
    /// Pose outside the rooms.
    #[error("the pose ({x_m}, {y_m}) m is outside the room")]
    OutsideRoom {
        /// World x of the position, metres.
        x_m: f64,
        /// World y of the position, metres.
        y_m: f64,
        /// Lower left corner of the room's extent, metres.
        low: [f64; 2],
        /// Upper right corner of the room's extent, metres.
        high: [f64; 2],
    },
    /// Pose inside a body that sound does not enter.
    #[error("the pose ({x_m}, {y_m}) m is inside `{body}`")]
    InsideBody {
        /// World x of the position, metres.
        x_m: f64,
        /// World y of the position, metres.
        y_m: f64,
        /// Name of the cylinder or of the ring of walls.
        body: String,
        /// Bounding box of the rooms, if there are any: lower left and upper right corner, metres.
        room: Option<[[f64; 2]; 2]>,
    },
    /// Pose on a surface.
    #[error("the pose ({x_m}, {y_m}) m is {:.2} mm from `{reflector}`", distance_m * 1e3)]
    TooClose {
        /// World x of the position, metres.
        x_m: f64,
        /// World y of the position, metres.
        y_m: f64,
        /// Name of the wall or cylinder.
        reflector: String,
        /// Distance from the reflector, metres.
        distance_m: f64,
        /// Bounding box of the rooms, if there are any: lower left and upper right corner, metres.
        room: Option<[[f64; 2]; 2]>,
    },
    /// Wall between a face and the robot that carries it.
    #[error("the position ({x_m}, {y_m}) m is separated from the robot by `{reflector}`")]
    BehindWall {
        /// World x of the position, metres.
        x_m: f64,
        /// World y of the position, metres.
        y_m: f64,
        /// Name of the wall.
        reflector: String,
    },
    /// Collision of the robot's body with a reflector.
    #[error(
        "at the pose ({x_m}, {y_m}) m, heading {heading_deg} degrees, the body `{robot}` collides with `{reflector}`"
    )]
    BodyCollides {
        /// World x of the position, metres.
        x_m: f64,
        /// World y of the position, metres.
        y_m: f64,
        /// Heading of the robot, degrees.
        heading_deg: f64,
        /// Identifier of the robot.
        robot: String,
        /// Identifier of the reflector.
        reflector: String,
    },
}

impl PoseError {
    /// Hint for correcting the pose.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Unknown { name, known, .. } => {
                format!("{}; or give X,Y,DEG (metres, degrees)", suggest(name, known, "poses"))
            }
            Self::Malformed(_) | Self::BadNumber { .. } => {
                "give X,Y,DEG (metres, degrees counter-clockwise; without DEG the heading is 0), as \
                 in 0.774,0.085,90, or the name of a pose in the scene"
                    .to_owned()
            }
            Self::OutsideRoom { low, high, .. } => extent(low, high),
            Self::InsideBody { room, .. } => match room {
                Some([low, high]) => extent(low, high),
                None => "choose a pose outside the body".to_owned(),
            },
            Self::TooClose { room, .. } => match room {
                Some([low, high]) => format!("keep at least 1 mm from surfaces; {}", extent(low, high)),
                None => "keep at least 1 mm from surfaces".to_owned(),
            },
            Self::BehindWall { .. } => "keep the robot clear of walls".to_owned(),
            Self::BodyCollides { .. } => {
                "move or turn the pose; the body is defined by `robot` in the scene, relative to \
                 position and heading"
                    .to_owned()
            }
        }
    }
}

fn extent(low: &[f64; 2], high: &[f64; 2]) -> String {
    format!("the room spans x {} to {} m and y {} to {} m", low[0], high[0], low[1], high[1])
}

/// Parses a pose written as `X,Y,DEG` or `X,Y`, in metres and degrees.
///
/// # Errors
/// If the text is not two or three numbers within bounds.
pub fn parse_pose(spec: &str) -> Result<Pose, PoseError> {
    let parts: Vec<&str> = spec.split(',').map(str::trim).collect();
    let (x, y, heading) = match parts[..] {
        [x, y] => (x, y, "0"),
        [x, y, heading] => (x, y, heading),
        _ => return Err(PoseError::Malformed(spec.to_owned())),
    };
    Ok(Pose {
        x_m: number("X", x, MAX_COORDINATE_M)?,
        y_m: number("Y", y, MAX_COORDINATE_M)?,
        heading_deg: number("DEG", heading, MAX_HEADING_DEG)?,
    })
}

impl Scene {
    /// Resolves `X,Y,DEG`, `X,Y`, or the name of a pose of this scene. [`Scene::check_pose`] checks
    /// whether the pose is accessible.
    ///
    /// # Errors
    /// If the scene has no pose of that name, or the numbers are invalid.
    pub fn pose(&self, spec: &str) -> Result<Pose, PoseError> {
        if let Some(pose) = self.poses.get(spec) {
            return Ok(*pose);
        }
        if !spec.contains(',') {
            return Err(PoseError::Unknown {
                name: spec.to_owned(),
                scene: self.name.clone(),
                known: self.poses.keys().cloned().collect(),
            });
        }
        parse_pose(spec)
    }

    /// Checks that a ranger fits at a pose: inside a room (if walls enclose rooms and nothing is
    /// outside them), in no closed body, at least a millimetre from every surface, and without
    /// collision of the robot's body, if there is one. The result follows from the plan
    /// ([`Scene::floor_plan`]), independent of the order of walls.
    ///
    /// # Errors
    /// Names the violated condition and the extent of the room.
    pub fn check_pose(&self, pose: &Pose) -> Result<(), PoseError> {
        self.check_pose_among(&SceneOutlines::from_scene(self), pose)
    }

    /// Checks many poses as [`check_pose`](Self::check_pose) does, finding the outlines once.
    ///
    /// # Errors
    /// Returns the index of the first pose that fails, and its error.
    pub fn check_poses(&self, poses: &[Pose]) -> Result<(), (usize, PoseError)> {
        let outlines = SceneOutlines::from_scene(self);
        let check =
            |(at, pose)| self.check_pose_among(&outlines, pose).map_err(|error| (at, error));
        poses.iter().enumerate().try_for_each(check)
    }

    /// Checks a pose against precomputed outlines.
    pub(super) fn check_pose_among(
        &self,
        outlines: &SceneOutlines,
        pose: &Pose,
    ) -> Result<(), PoseError> {
        within("DEG", pose.heading_deg, MAX_HEADING_DEG)?;
        self.check_place(outlines, pose.position())?;
        self.check_robot(outlines.plan(), pose)
    }

    /// Checks that a robot fits at a pose with its rangers' faces at `places`: inside the room, in
    /// no body, at least a millimetre from every surface including its own body, and without a wall
    /// between a face and the pose.
    ///
    /// # Errors
    /// Returns the error of the pose, or the index of the first face that fails with its error.
    pub fn check_face_positions(
        &self,
        pose: &Pose,
        places: &[DVec2],
    ) -> Result<(), (Option<usize>, PoseError)> {
        self.check_places_among(&SceneOutlines::from_scene(self), pose, places)
    }

    /// Checks many poses as [`check_face_positions`](Self::check_face_positions) does, each with
    /// its face positions, finding the outlines once.
    ///
    /// # Errors
    /// Returns the index of the first pose that fails, with the error of
    /// [`Self::check_face_positions`].
    pub fn check_many_face_positions(
        &self,
        poses: impl IntoIterator<Item = (Pose, Vec<DVec2>)>,
    ) -> Result<(), (usize, (Option<usize>, PoseError))> {
        let outlines = SceneOutlines::from_scene(self);
        poses.into_iter().enumerate().try_for_each(|(at, (pose, places))| {
            self.check_places_among(&outlines, &pose, &places).map_err(|error| (at, error))
        })
    }

    fn check_places_among(
        &self,
        outlines: &SceneOutlines,
        pose: &Pose,
        places: &[DVec2],
    ) -> Result<(), (Option<usize>, PoseError)> {
        self.check_pose_among(outlines, pose).map_err(|error| (None, error))?;
        let check = |place: DVec2| {
            self.check_place(outlines, place)?;
            self.check_off_robot(pose, place, outlines.room)
        };
        for (at, &place) in places.iter().enumerate() {
            check(place).map_err(|error| (Some(at), error))?;
        }
        for (at, &place) in places.iter().enumerate() {
            if let Some(wall) = wall_between(outlines.plan(), pose.position(), place) {
                let reflector = self.walls[wall].id.to_string();
                let error = PoseError::BehindWall { x_m: place.x, y_m: place.y, reflector };
                return Err((Some(at), error));
            }
        }
        Ok(())
    }

    /// Accessibility of positions for the face of a ranger, by the rules of
    /// [`check_face_positions`](Self::check_face_positions).
    #[must_use]
    pub fn are_accessible(&self, places: &[DVec2]) -> Vec<bool> {
        let outlines = SceneOutlines::from_scene(self);
        places.iter().map(|place| self.check_place(&outlines, *place).is_ok()).collect()
    }

    fn check_place(&self, outlines: &SceneOutlines, position: DVec2) -> Result<(), PoseError> {
        let DVec2 { x: x_m, y: y_m } = position;
        within("X", x_m, MAX_COORDINATE_M)?;
        within("Y", y_m, MAX_COORDINATE_M)?;
        let room = outlines.room;
        if let Some((reflector, distance_m)) = self.nearest_surface(outlines.plan(), position)
            && distance_m < CLEARANCE_M
        {
            let reflector = reflector.to_owned();
            return Err(PoseError::TooClose { x_m, y_m, reflector, distance_m, room });
        }
        if let Some([low, high]) = room
            && outlines.is_outside(position)
        {
            return Err(PoseError::OutsideRoom { x_m, y_m, low, high });
        }
        match self.body_around(outlines, position) {
            Some(body) => Err(PoseError::InsideBody { x_m, y_m, body, room }),
            None => Ok(()),
        }
    }

    /// Id and distance (metres) of the nearest surface.
    fn nearest_surface(&self, plan: &FloorPlan, position: DVec2) -> Option<(&str, f64)> {
        let walls = self
            .walls
            .iter()
            .zip(&plan.walls)
            .map(|(wall, &(a, b))| (&*wall.id, distance_to_segment(position, a, b)));
        let cylinders = self.cylinders.iter().map(|cylinder| {
            (&*cylinder.id, (position.distance(cylinder.center) - cylinder.radius_m).abs())
        });
        walls.chain(cylinders).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Name of the body around a point.
    fn body_around(&self, outlines: &SceneOutlines, position: DVec2) -> Option<String> {
        let cylinder = self
            .cylinders
            .iter()
            .find(|cylinder| position.distance(cylinder.center) < cylinder.radius_m)
            .map(|cylinder| cylinder.id.to_string());
        cylinder.or_else(|| outlines.body_around(self, position))
    }
}

fn number(field: &'static str, text: &str, limit: f64) -> Result<f64, PoseError> {
    let rejected = || PoseError::BadNumber { field, text: text.to_owned(), limit };
    let value = text.parse().map_err(|_| rejected())?;
    within(field, value, limit).map_err(|_| rejected())?;
    Ok(value)
}

/// Range check that rejects NaN as well.
fn within(field: &'static str, value: f64, limit: f64) -> Result<(), PoseError> {
    if value.abs() <= limit {
        return Ok(());
    }
    Err(PoseError::BadNumber { field, text: value.to_string(), limit })
}
