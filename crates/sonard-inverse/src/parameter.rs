//! What can be fitted.

use std::fmt;

/// One number that predictions depend on, told as a difference from the world that is started from.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// Where the ranger stood in a sweep, by the sweep's place in the list: x, metres.
    X(usize),
    /// The same along y, metres.
    Y(usize),
    /// Where its azimuth 0 pointed, degrees.
    Heading(usize),
    /// Azimuth that the stepper's zero is off by, in all sweeps, degrees.
    HeadingZero,
    /// Share by which the stepper turns further than it says.
    Gear,
    /// Transducer farther ahead of the axis, metres.
    Ahead,
    /// Transducer farther left of the axis, metres.
    Left,
    /// Transducer higher, metres.
    Height,
    /// Share by which sound is faster.
    SoundSpeed,
    /// What is added to every range, metres: a constant delay.
    Delay,
    /// Higher threshold, decibels.
    Threshold,
    /// Threshold that rises faster with the range, decibels a metre.
    ThresholdRise,
    /// Natural logarithm of how much wider the radiating face is; a wider one has a narrower beam.
    Aperture,
    /// Natural logarithm of how much wider the band of transducer and receiver is; a wider one lets pulses rise faster.
    Bandwidth,
    /// Stronger skirts of the beam, decibels; only of a piston that has some.
    Skirts,
    /// Natural logarithm of how much more a material reflects.
    Reflectance(String),
    /// Larger share of what a material gives back that it scatters.
    Roughness(String),
    /// A wall farther along its normal, which is left of the way from its first to its second end, by its index in
    /// the scene; metres.
    Wall(usize),
}

impl Parameter {
    /// The sweep that it is of alone.
    #[must_use]
    pub const fn sweep(&self) -> Option<usize> {
        match self {
            Self::X(sweep) | Self::Y(sweep) | Self::Heading(sweep) => Some(*sweep),
            _ => None,
        }
    }

    /// How far it may be moved at a time before predictions have to be made again, in its unit.
    pub(crate) const fn step(&self) -> f64 {
        match self {
            Self::X(_) | Self::Y(_) | Self::Ahead | Self::Left | Self::Wall(_) | Self::Height => {
                0.04
            }
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
        }
    }
}
