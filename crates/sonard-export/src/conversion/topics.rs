//! Topic names, types and durability.

use sonard_model::array::RangerArray;
use sonard_records::{Provenance, Session};

use super::{
    frames::{RangerFrames, names},
    settings::Distribution,
};
use crate::ros::interface::{
    FLOAT, Interface, LASER_SCAN, MARKERS, OCCUPANCY_GRID, POINT_CLOUD, RANGE, RANGE_HUMBLE,
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

/// Topic of individual readings; those of an array are named `/sonar/RANGER/range` and the like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReadingTopic {
    Range,
    Predicted,
    Residual,
}

impl ReadingTopic {
    pub(super) const ALL: [Self; 3] = [Self::Range, Self::Predicted, Self::Residual];

    /// Returns the topic name for a ranger, which is named only in an array.
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
            (Self::Range | Self::Predicted, Distribution::Humble) => RANGE_HUMBLE,
            (Self::Residual, _) => FLOAT,
        }
    }
}

/// Topic of a session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Topic name, such as `/sonar/range`.
    pub name: String,
    /// True if the last message remains valid and late subscribers should receive it; false for
    /// topics of individual readings.
    pub is_retained: bool,
    interface: Interface,
}

impl Topic {
    /// Returns the topics expected before the first session: for a rotating ranger or an array,
    /// with predictions and with a scene if requested.
    #[must_use]
    pub fn expected(
        array: Option<&RangerArray>,
        predicts: bool,
        draws_scene: bool,
        distribution: Distribution,
    ) -> Vec<Self> {
        let rangers = array.map(names).unwrap_or_default();
        let rangers: Vec<&str> = rangers.iter().map(String::as_str).collect();
        topics_of_rangers(&rangers, predicts, draws_scene, distribution)
    }

    /// Returns the topic of the map built so far.
    #[must_use]
    pub fn map() -> Self {
        Self { name: MAP_TOPIC.to_owned(), is_retained: true, interface: OCCUPANCY_GRID }
    }

    /// Returns `true` for static content, which every late subscriber must receive ("transient
    /// local" in ROS 2).
    #[must_use]
    pub fn is_static(&self) -> bool {
        is_static_topic(&self.name)
    }

    /// Returns the message type, as `package/msg/Type`.
    #[must_use]
    pub const fn type_name(&self) -> &'static str {
        self.interface.name
    }

    /// Returns the message definition with those of nested types, in the schema encoding `ros2msg`.
    #[must_use]
    pub fn definition(&self) -> String {
        self.interface.definition()
    }
}

/// Returns `true` if the messages of a topic are static.
pub(crate) fn is_static_topic(topic: &str) -> bool {
    const STATIC_TOPICS: [&str; 5] =
        [FIXED_TRANSFORMS, SCENE, MAP_TOPIC, "/sonar/lines", "/sonar/features"];
    STATIC_TOPICS.contains(&topic)
}

/// Returns the topics of a session; those of an array contain the ranger names.
pub(super) fn session_topics(
    session: &Session,
    frames: &RangerFrames,
    draws_scene: bool,
    distribution: Distribution,
) -> Vec<Topic> {
    // Simulated sessions are predictions themselves.
    let predicts = session.model.is_some() && session.provenance != Provenance::Simulated;
    topics_of_rangers(&frames.rangers(), predicts, draws_scene, distribution)
}

/// Returns the topics of a rotating ranger, or of an array's rangers by name.
fn topics_of_rangers(
    rangers: &[&str],
    predicts: bool,
    draws_scene: bool,
    distribution: Distribution,
) -> Vec<Topic> {
    let kept =
        |name: &str, interface| Topic { name: name.to_owned(), is_retained: true, interface };
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
        let kinds = ReadingTopic::ALL.into_iter();
        let kinds = kinds.filter(|kind| predicts || *kind == ReadingTopic::Range);
        topics.extend(kinds.map(|kind| Topic {
            name: kind.topic(ranger),
            is_retained: false,
            interface: kind.interface(distribution),
        }));
    }
    topics
}
