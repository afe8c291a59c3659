//! The topics, by name.

use sonard_model::array::RangerArray;
use sonard_records::{Provenance, Session};

use super::{
    frames::{Frames, names},
    settings::Distribution,
};
use crate::ros::interface::{
    FLOAT, Interface, LASER_SCAN, MARKERS, OCCUPANCY_GRID, POINT_CLOUD, RANGE, RANGE_OF_HUMBLE,
    TRANSFORMS,
};

pub(crate) const TRANSFORMS_TOPIC: &str = "/tf";
pub(crate) const FIXED_TRANSFORMS: &str = "/tf_static";
pub(crate) const SCENE: &str = "/sonar/scene";
pub(crate) const SCAN: &str = "/sonar/scan";
pub(crate) const POINTS: &str = "/sonar/points";
pub(crate) const PATHS: &str = "/sonar/paths";
pub(crate) const PREDICTED_POINTS: &str = "/sonar/predicted/points";
pub(crate) const MAP_TOPIC: &str = "/map";

/// What is told of each reading; of those of an array by `/sonar/RANGER/range` and the like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OfReading {
    Range,
    Predicted,
    Residual,
}

impl OfReading {
    pub(super) const ALL: [Self; 3] = [Self::Range, Self::Predicted, Self::Residual];

    /// The topic of a ranger, which has a name if it is one of an array.
    pub(super) fn topic(self, ranger: Option<&str>) -> String {
        let (above, last) = match self {
            Self::Range => ("/sonar", "range"),
            Self::Predicted => ("/sonar/predicted", "range"),
            Self::Residual => ("/sonar", "residual"),
        };
        match ranger {
            Some(ranger) => format!("{above}/{ranger}/{last}"),
            None => format!("{above}/{last}"),
        }
    }

    pub(super) const fn interface(self, distribution: Distribution) -> Interface {
        match (self, distribution) {
            (Self::Range | Self::Predicted, Distribution::Jazzy) => RANGE,
            (Self::Range | Self::Predicted, Distribution::Humble) => RANGE_OF_HUMBLE,
            (Self::Residual, _) => FLOAT,
        }
    }
}

/// A topic that a session has messages for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// As `/sonar/range`.
    pub name: String,
    /// Whether its last message is still true when no other comes, so that who comes late should have it: all but
    /// what is told of each reading.
    pub is_kept: bool,
    interface: Interface,
}

impl Topic {
    /// What there will be messages of, as far as can be told before the first session says: of a ranger that turns, or of
    /// an array's; with predictions, and with a scene, if there are any.
    #[must_use]
    pub fn expected(
        array: Option<&RangerArray>,
        predicts: bool,
        draws_scene: bool,
        distribution: Distribution,
    ) -> Vec<Self> {
        let rangers = array.map(names).unwrap_or_default();
        let rangers: Vec<&str> = rangers.iter().map(String::as_str).collect();
        of_rangers(&rangers, predicts, draws_scene, distribution)
    }

    /// A map of what was seen so far.
    #[must_use]
    pub fn map() -> Self {
        Self { name: MAP_TOPIC.to_owned(), is_kept: true, interface: OCCUPANCY_GRID }
    }

    /// Whether it tells what stands still, so that each subscriber must get it whenever it comes: transient local,
    /// in words of ROS 2.
    #[must_use]
    pub fn stands_still(&self) -> bool {
        stands_still(&self.name)
    }

    /// The type of its messages, as `package/msg/Type`.
    #[must_use]
    pub const fn type_name(&self) -> &'static str {
        self.interface.name
    }

    /// The definition of that type and those of its parts, as the encoding `ros2msg` of schemas has them.
    #[must_use]
    pub fn definition(&self) -> String {
        self.interface.definition()
    }
}

/// Whether the messages of a topic tell what stands still.
pub(crate) fn stands_still(topic: &str) -> bool {
    const STILL: [&str; 5] =
        [FIXED_TRANSFORMS, SCENE, MAP_TOPIC, "/sonar/lines", "/sonar/features"];
    STILL.contains(&topic)
}

/// The topics of a session, those of an array's rangers by their names.
pub(super) fn of_session(
    session: &Session,
    frames: &Frames,
    draws_scene: bool,
    distribution: Distribution,
) -> Vec<Topic> {
    // Of what the model made itself there is nothing beside it.
    let predicts = session.model.is_some() && session.provenance != Provenance::Simulated;
    of_rangers(&frames.rangers(), predicts, draws_scene, distribution)
}

/// The topics of a ranger that turns, or of an array's by their names.
fn of_rangers(
    rangers: &[&str],
    predicts: bool,
    draws_scene: bool,
    distribution: Distribution,
) -> Vec<Topic> {
    let kept = |name: &str, interface| Topic { name: name.to_owned(), is_kept: true, interface };
    let mut topics = vec![kept(FIXED_TRANSFORMS, TRANSFORMS), kept(TRANSFORMS_TOPIC, TRANSFORMS)];
    if draws_scene {
        topics.push(kept(SCENE, MARKERS));
    }
    if rangers.is_empty() {
        topics.push(kept(SCAN, LASER_SCAN));
    }
    topics.extend([kept(POINTS, POINT_CLOUD), kept(PATHS, MARKERS)]);
    if predicts {
        topics.push(kept(PREDICTED_POINTS, POINT_CLOUD));
    }
    let rangers: Vec<Option<&str>> =
        if rangers.is_empty() { vec![None] } else { rangers.iter().copied().map(Some).collect() };
    for ranger in rangers {
        let told = OfReading::ALL.into_iter();
        let told = told.filter(|one| predicts || *one == OfReading::Range);
        topics.extend(told.map(|one| Topic {
            name: one.topic(ranger),
            is_kept: false,
            interface: one.interface(distribution),
        }));
    }
    topics
}
