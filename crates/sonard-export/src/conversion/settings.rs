//! Export settings of ROS 2 messages.

/// Encoding of missing echoes and of ranges below the minimum in `Range` messages. REP 117 and the
/// obstacle layer of nav2, which ignores infinite ranges, contradict each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Profile {
    /// REP 117: positive infinity for no echo, negative infinity for objects below the minimum
    /// range.
    #[default]
    Rep117,
    /// Maximum range for no echo, minimum range for nearer objects: nav2's `RangeSensorLayer` then
    /// clears the beam or marks the object.
    Nav2,
}

impl Profile {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Rep117 => "rep117",
            Self::Nav2 => "nav2",
        }
    }
}

/// ROS 2 distribution whose message definitions are used; `sensor_msgs/Range` differs between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// Humble and earlier: `Range` has no variance.
    Humble,
    /// Iron, Jazzy and later distributions.
    #[default]
    Jazzy,
}

/// Settings of the conversion to messages.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportSettings {
    /// Encoding of missing echoes.
    pub profile: Profile,
    /// Distribution whose message definitions are used.
    pub distribution: Distribution,
    /// True to publish the transform from `map` to `base_link`; false if another node publishes it.
    pub places_robot: bool,
    /// Full field of view of a reading, degrees; by default the width at which the two-way beam is
    /// 6 dB down.
    pub field_of_view_deg: Option<f64>,
    /// Frame of the transducer, and prefix of the other frames.
    pub frame: String,
}

impl Default for ExportSettings {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            distribution: Distribution::default(),
            places_robot: true,
            field_of_view_deg: None,
            frame: "sonar".to_owned(),
        }
    }
}
