//! Parameters that can be fitted.

use std::fmt;

/// Parameter of the predictions, as a change relative to the initial world.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// Ranger position along x in a sweep, by its index in the list, metres.
    X(usize),
    /// Ranger position along y in a sweep, metres.
    Y(usize),
    /// World direction of azimuth 0 in a sweep, degrees.
    Heading(usize),
    /// Azimuth offset of the stepper's zero, common to all sweeps, degrees.
    HeadingZero,
    /// Relative error of the stepper's gear ratio.
    Gear,
    /// Transducer offset ahead of the axis, metres.
    Ahead,
    /// Transducer offset to the left of the axis, metres.
    Left,
    /// Transducer height above the floor, metres.
    Height,
    /// Relative change of the speed of sound.
    SoundSpeed,
    /// Constant delay, as a range offset in metres.
    Delay,
    /// Detection threshold of the receiver, decibels.
    Threshold,
    /// Slope of the threshold with range, dB/m.
    ThresholdRise,
    /// Natural logarithm of the aperture's width ratio; a wider aperture has a narrower beam.
    Aperture,
    /// Natural logarithm of the bandwidth ratio of transducer and receiver; a wider band shortens
    /// the rise of pulses.
    Bandwidth,
    /// Level of the side-lobe floor, decibels; only for a piston that has one.
    Skirts,
    /// Natural logarithm of a material's reflectance ratio.
    Reflectance(String),
    /// Change of the fraction of reflected energy that a material scatters.
    Roughness(String),
    /// Displacement of a wall along its normal, to the left from its first to its second end, by
    /// its index in the scene; metres.
    Wall(usize),
    /// Rotation of a wall about its middle, counter-clockwise, by its index in the scene; degrees.
    WallTurn(usize),
    /// Displacement of an end of a wall along the wall, outwards, by the wall's index in the scene;
    /// metres. Walls joined to the end follow it.
    WallEnd(usize, EndOfWall),
    /// Position or radius of a cylinder, by its index in the scene; metres.
    Post(usize, PostPart),
}

/// End of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EndOfWall {
    /// First end.
    A,
    /// Second end.
    B,
}

/// Dimension of a cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PostPart {
    /// Centre along x.
    X,
    /// Centre along y.
    Y,
    /// Radius.
    Radius,
}

impl EndOfWall {
    /// Name of the end in a scene.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::A => "a",
            Self::B => "b",
        }
    }
}

impl PostPart {
    /// Name of the dimension, with its unit.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::X => "x_m",
            Self::Y => "y_m",
            Self::Radius => "radius_m",
        }
    }
}

impl Parameter {
    /// Index of the sweep, for a parameter of a single sweep.
    #[must_use]
    pub const fn sweep(&self) -> Option<usize> {
        match self {
            Self::X(sweep) | Self::Y(sweep) | Self::Heading(sweep) => Some(*sweep),
            _ => None,
        }
    }

    /// Maximum step between predictions, in the parameter's unit.
    pub(crate) const fn step(&self) -> f64 {
        match self {
            Self::X(_) | Self::Y(_) | Self::Ahead | Self::Left | Self::Wall(_) | Self::Height => {
                0.04
            }
            Self::WallEnd(..) | Self::Post(_, PostPart::X | PostPart::Y) => 0.04,
            Self::Post(_, PostPart::Radius) => 0.02,
            Self::WallTurn(_) => 1.0,
            Self::Heading(_) | Self::HeadingZero => 3.0,
            Self::Gear => 0.02,
            Self::SoundSpeed => 0.015,
            Self::Delay => 0.05,
            Self::Threshold | Self::Skirts => 3.0,
            Self::ThresholdRise => 2.0,
            Self::Aperture | Self::Bandwidth | Self::Reflectance(_) => 0.15,
            Self::Roughness(_) => 0.05,
        }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::X(_) => f.write_str("x_m"),
            Self::Y(_) => f.write_str("y_m"),
            Self::Heading(_) => f.write_str("heading_deg"),
            Self::HeadingZero => f.write_str("heading_zero_deg"),
            Self::Gear => f.write_str("gear"),
            Self::Ahead => f.write_str("ahead_m"),
            Self::Left => f.write_str("left_m"),
            Self::Height => f.write_str("height_m"),
            Self::SoundSpeed => f.write_str("sound_speed"),
            Self::Delay => f.write_str("delay_m"),
            Self::Threshold => f.write_str("threshold_db"),
            Self::ThresholdRise => f.write_str("threshold_rise_db_per_m"),
            Self::Aperture => f.write_str("aperture"),
            Self::Bandwidth => f.write_str("bandwidth"),
            Self::Skirts => f.write_str("skirts_db"),
            Self::Reflectance(material) => write!(f, "reflectance {material}"),
            Self::Roughness(material) => write!(f, "roughness {material}"),
            Self::Wall(wall) => write!(f, "wall {wall}"),
            Self::WallTurn(wall) => write!(f, "wall {wall} turn_deg"),
            Self::WallEnd(wall, end) => write!(f, "wall {wall} end {}", end.name()),
            Self::Post(post, part) => write!(f, "cylinder {post} {}", part.name()),
        }
    }
}
