//! How messages are made.

/// What a `Range` says of silence and of what is too near. REP 117 and the obstacle layer of nav2 contradict
/// each other: that leaves out infinite ranges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Profile {
    /// Infinite, as REP 117 says: positive for silence, negative for what is too near.
    #[default]
    Rep117,
    /// Exactly the greatest range for silence, and the least for what is too near: nav2's `RangeSensorLayer` then
    /// clears the beam, and marks what is near.
    Nav2,
}

impl Profile {
    pub(crate) const fn in_words(self) -> &'static str {
        match self {
            Self::Rep117 => "rep117",
            Self::Nav2 => "nav2",
        }
    }
}

/// Whose definitions messages follow: `sensor_msgs/Range` is not the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// Up to Humble: a range has no variance.
    Humble,
    /// Iron, Jazzy and later.
    #[default]
    Jazzy,
}

/// How messages are made.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// What a `Range` says of silence.
    pub profile: Profile,
    /// Whose definitions messages follow.
    pub distribution: Distribution,
    /// Whether it is told where the robot is, `base_link` in `map`. Where others tell that, two would contradict each other.
    pub places_robot: bool,
    /// Full angle of what a reading is valid for, degrees; without it, as far as the beam is 6 dB down, there and
    /// back.
    pub field_of_view_deg: Option<f64>,
    /// The frame of the transducer, which others are named after.
    pub frame: String,
}

impl Default for Settings {
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
