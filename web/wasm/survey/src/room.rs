//! Rooms that the page hides.

use std::str::FromStr as _;

use rand::RngExt as _;
use serde::Deserialize;
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_survey::trial::{RoomKind, draw_trial, generator};
use sonard_wasm_module::RequestError;

/// Kinds of which a room of any kind is one. Surveys with posts take minutes.
const QUICK: [RoomKind; 5] =
    [RoomKind::Rectangle, RoomKind::Oblique, RoomKind::Cut, RoomKind::L, RoomKind::Box];

/// Room of a course.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Room {
    /// Random room.
    Random {
        /// Name of a [`RoomKind`]; any kind without posts if omitted.
        #[serde(default)]
        kind: Option<String>,
        /// Number of the room.
        seed: u64,
    },
    /// Room of the user.
    Drawn {
        /// Text of the scene file.
        scene: String,
        /// Pose at which a course begins.
        start: Pose,
    },
}

impl Room {
    /// Scene of the room, and the pose at which a course begins.
    pub(crate) fn open(&self) -> Result<(Scene, Pose), RequestError> {
        match self {
            Self::Random { kind, seed } => random_room(kind.as_deref(), *seed),
            Self::Drawn { scene, start } => {
                let scene = Scene::from_json(scene)?;
                scene.check_pose(start)?;
                Ok((scene, *start))
            }
        }
    }
}

fn random_room(kind: Option<&str>, seed: u64) -> Result<(Scene, Pose), RequestError> {
    let kind = match kind {
        Some(name) => RoomKind::from_str(name).map_err(|error| RequestError::new(&error, ""))?,
        None => {
            // A stream of its own, so that rooms of one kind are independent of the choice.
            let at = generator(RoomKind::Rectangle, !seed).random_range(0..QUICK.len());
            QUICK[at]
        }
    };
    let (scene, course) = draw_trial(kind, 1, &mut generator(kind, seed))?;
    Ok((scene, course[0]))
}
