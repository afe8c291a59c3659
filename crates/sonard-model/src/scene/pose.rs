//! Poses: named or in numbers, and whether a ranger can stand there.

use thiserror::Error;

use super::{
    FloorPlan, Scene,
    error::{MAX_COORDINATE_M, suggest},
    outline::Outlines,
    robot::wall_between,
};
use crate::geometry::{DVec2, Pose, distance_to_segment};

/// A ranger closer to a surface than this is taken to be inside it, metres.
pub(super) const CLEARANCE_M: f64 = 1e-3;

/// Largest magnitude of a heading, degrees.
pub(super) const MAX_HEADING_DEG: f64 = 360.0;

/// A pose that can't be used.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PoseError {
    /// Not the name of a pose.
    #[error("the scene `{scene}` has no pose `{name}`")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The scene.
        scene: String,
        /// The poses it has.
        known: Vec<String>,
    },
    /// Numbers, but not two or three.
    #[error("`{0}` is not a pose")]
    Malformed(String),
    /// A part that is not a number within bounds.
    #[error("{field} `{text}` is not a number from -{limit} to {limit}")]
    BadNumber {
        /// X, Y or DEG.
        field: &'static str,
        /// What was written.
        text: String,
        /// Largest magnitude.
        limit: f64,
    },
    /// Beyond the walls.
    #[error("the pose ({x_m}, {y_m}) m is outside the room")]
    OutsideRoom {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Lower left corner of the room's extent, metres.
        low: [f64; 2],
        /// Upper right corner of the room's extent, metres.
        high: [f64; 2],
    },
    /// In a body that sound does not enter.
    #[error("the pose ({x_m}, {y_m}) m is inside `{body}`")]
    InsideBody {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Name of the cylinder or of the ring of walls.
        body: String,
        /// The room's extent, if there is a room, lower left and upper right corner, metres.
        room: Option<[[f64; 2]; 2]>,
    },
    /// On a surface.
    #[error("the pose ({x_m}, {y_m}) m is {:.2} mm from `{reflector}`", distance_m * 1e3)]
    TooClose {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Name of the wall or cylinder.
        reflector: String,
        /// Distance, metres.
        distance_m: f64,
        /// The room's extent, if there is a room, lower left and upper right corner, metres.
        room: Option<[[f64; 2]; 2]>,
    },
    /// A wall separates it from the robot that carries it.
    #[error("the place ({x_m}, {y_m}) m is on the other side of `{reflector}` than the robot")]
    BehindWall {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Name of the wall.
        reflector: String,
    },
    /// The robot's body does not fit there.
    #[error(
        "at the pose ({x_m}, {y_m}) m, heading {heading_deg} degrees, the body `{robot}` runs into `{reflector}`"
    )]
    BodyCollides {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Heading, degrees.
        heading_deg: f64,
        /// Name of the robot.
        robot: String,
        /// Name of what it runs into.
        reflector: String,
    },
}

impl PoseError {
    /// What would be right.
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
                None => "stand outside it".to_owned(),
            },
            Self::TooClose { room, .. } => match room {
                Some([low, high]) => format!("keep 1 mm away from surfaces; {}", extent(low, high)),
                None => "keep 1 mm away from surfaces".to_owned(),
            },
            Self::BehindWall { .. } => "keep the robot clear of walls".to_owned(),
            Self::BodyCollides { .. } => {
                "move or turn the pose; the body stands as `robot` in the scene says, relative to \
                 position and heading"
                    .to_owned()
            }
        }
    }
}

fn extent(low: &[f64; 2], high: &[f64; 2]) -> String {
    format!("the room spans x {} to {} m and y {} to {} m", low[0], high[0], low[1], high[1])
}

/// The pose written `X,Y,DEG` or `X,Y`, metres and degrees.
///
/// # Errors
/// Numbers that make no pose.
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
    /// The pose meant by `X,Y,DEG`, `X,Y`, or the name of a pose of this scene. Whether a
    /// ranger can stand there is for [`Scene::check_pose`] to say.
    ///
    /// # Errors
    /// A name the scene does not have, or numbers that make no pose.
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

    /// Whether a ranger can stand at a pose: inside a room (if the walls close some, and nothing stands
    /// outside them), in no closed body, a millimetre from every surface, and the robot's
    /// body, if there is one, in nothing's way. The plan decides ([`Scene::floor_plan`]), not the order of walls.
    ///
    /// # Errors
    /// Which of these fails, and the room's extent.
    pub fn check_pose(&self, pose: &Pose) -> Result<(), PoseError> {
        self.check_pose_among(&Outlines::of(self), pose)
    }

    /// The same for many poses, with the outlines found once.
    ///
    /// # Errors
    /// The first pose that fails, by its index, and why.
    pub fn check_poses(&self, poses: &[Pose]) -> Result<(), (usize, PoseError)> {
        let outlines = Outlines::of(self);
        let check =
            |(at, pose)| self.check_pose_among(&outlines, pose).map_err(|error| (at, error));
        poses.iter().enumerate().try_for_each(check)
    }

    /// The same with the outlines found before.
    pub(super) fn check_pose_among(
        &self,
        outlines: &Outlines,
        pose: &Pose,
    ) -> Result<(), PoseError> {
        within("DEG", pose.heading_deg, MAX_HEADING_DEG)?;
        self.check_place(outlines, pose.position())?;
        self.check_robot(outlines.plan(), pose)
    }

    /// Whether a robot can stand at a pose whose rangers have their faces at some places: inside the room, in
    /// no body, a millimetre from every surface, its own body's too, and no wall between a face and the pose.
    ///
    /// # Errors
    /// Why the pose fails, or the first place that does, by its index.
    pub fn check_places(
        &self,
        pose: &Pose,
        places: &[DVec2],
    ) -> Result<(), (Option<usize>, PoseError)> {
        self.check_places_among(&Outlines::of(self), pose, places)
    }

    /// The same for many poses, each with the places of its faces, with the outlines found once.
    ///
    /// # Errors
    /// The first pose that fails, by its index, with what [`Self::check_places`] says of it.
    pub fn check_many_places(
        &self,
        stands: impl IntoIterator<Item = (Pose, Vec<DVec2>)>,
    ) -> Result<(), (usize, (Option<usize>, PoseError))> {
        let outlines = Outlines::of(self);
        stands.into_iter().enumerate().try_for_each(|(at, (pose, places))| {
            self.check_places_among(&outlines, &pose, &places).map_err(|error| (at, error))
        })
    }

    fn check_places_among(
        &self,
        outlines: &Outlines,
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

    /// At which of some places the face of a ranger can stand, as [`check_places`](Self::check_places) says.
    #[must_use]
    pub fn can_stand(&self, places: &[DVec2]) -> Vec<bool> {
        let outlines = Outlines::of(self);
        places.iter().map(|place| self.check_place(&outlines, *place).is_ok()).collect()
    }

    fn check_place(&self, outlines: &Outlines, position: DVec2) -> Result<(), PoseError> {
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

    /// Name and distance (metres) of the nearest surface.
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

    /// Name of the body that a point is in.
    fn body_around(&self, outlines: &Outlines, position: DVec2) -> Option<String> {
        let cylinder = self
            .cylinders
            .iter()
            .find(|cylinder| position.distance(cylinder.center) < cylinder.radius_m)
            .map(|cylinder| cylinder.id.to_string());
        cylinder.or_else(|| outlines.body_around(self, position))
    }
}

fn number(field: &'static str, text: &str, limit: f64) -> Result<f64, PoseError> {
    let refused = || PoseError::BadNumber { field, text: text.to_owned(), limit };
    let value = text.parse().map_err(|_| refused())?;
    within(field, value, limit).map_err(|_| refused())?;
    Ok(value)
}

/// Written so that NaN is refused too.
fn within(field: &'static str, value: f64, limit: f64) -> Result<(), PoseError> {
    if value.abs() <= limit {
        return Ok(());
    }
    Err(PoseError::BadNumber { field, text: value.to_string(), limit })
}
