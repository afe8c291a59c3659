//! Settings of the model: common ones, and those of each engine.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::acoustics::{EdgeLawKind, Response};

mod keys;

pub use keys::{ForeignOption, OptionKeys};

/// Simulation engine that finds the echoes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum EngineKind {
    /// Exact echo paths, all of them.
    #[default]
    Paths,
    /// Rays with mirror reflections and diffraction, after Dudek, Jenkin, Milios and Wilkes.
    Fan,
    /// Nearest hit of one ray per degree.
    Cone,
}

/// Settings of the model; a `None` is replaced by the value of the sensor or the engine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// Engine and its own settings.
    pub engine: EngineOptions,
    /// Maximum range, metres: half the longest path that is received.
    pub max_range_m: Option<f64>,
    /// Detection threshold, relative to a head-on, perfectly reflecting wall.
    pub threshold: Option<f64>,
}

/// An engine with its settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EngineOptions {
    /// [`PathEngine`](super::paths::PathEngine): all echo paths, exactly.
    Paths(PathOptions),
    /// [`Fan`](super::Fan): the ray model with reflections and diffraction.
    Fan(FanOptions),
    /// [`Cone`](super::Cone): nearest hit within an aperture.
    Cone(ConeOptions),
}

/// Settings of the engine `paths`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PathOptions {
    /// Aperture response; `None` for the sensor's.
    pub response: Option<Response>,
    /// Ideal receiver without interference and time walk
    /// ([`Combining::Ideal`](crate::acoustics::Combining::Ideal)). The other engines have no phases
    /// and always use it.
    pub ideal_receiver: bool,
    /// Disables the absorption of the air.
    pub lossless: bool,
    /// Maximum number of mirror reflections on a path; `None` for all that can matter.
    pub max_order: Option<u32>,
    /// Edge diffraction model; `None` for the sensor's.
    pub edge_law: Option<EdgeLawKind>,
    /// Adds paths diffracted at two edges.
    pub double_diffraction: bool,
    /// Disables crosstalk between the rangers of an array.
    pub without_crosstalk: bool,
}

/// Settings of the engine `fan`, whose edges follow Kuc and Siegel's law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FanOptions {
    /// Disables the absorption of the air.
    pub lossless: bool,
    /// Maximum number of mirror reflections on a path; `None` for all that can matter.
    pub max_order: Option<u32>,
    /// Angle between the rays, degrees. The default reads the same as a finer fan in every shipped
    /// scene as long as no round body is hit (there is a test).
    pub ray_spacing_deg: f64,
}

/// Settings of the engine `cone`, which has neither air nor reflections.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ConeOptions {
    /// Full aperture, degrees; `None` for the sensor's two-way -6 dB width.
    pub aperture_deg: Option<f64>,
}

impl EngineKind {
    /// Name in records and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paths => "paths",
            Self::Fan => "fan",
            Self::Cone => "cone",
        }
    }

    /// Returns the engine with its default settings.
    #[must_use]
    pub fn options(self) -> EngineOptions {
        match self {
            Self::Paths => EngineOptions::Paths(PathOptions::default()),
            Self::Fan => EngineOptions::Fan(FanOptions::default()),
            Self::Cone => EngineOptions::Cone(ConeOptions::default()),
        }
    }
}

impl EngineOptions {
    /// Returns the kind of engine.
    #[must_use]
    pub const fn kind(&self) -> EngineKind {
        match self {
            Self::Paths(_) => EngineKind::Paths,
            Self::Fan(_) => EngineKind::Fan,
            Self::Cone(_) => EngineKind::Cone,
        }
    }

    /// Returns the settings of `paths`, the only engine with phases; `None` for another engine.
    pub(super) const fn paths(&self) -> Option<&PathOptions> {
        match self {
            Self::Paths(paths) => Some(paths),
            _ => None,
        }
    }
}

impl Default for EngineOptions {
    fn default() -> Self {
        EngineKind::default().options()
    }
}

impl Default for FanOptions {
    fn default() -> Self {
        Self { lossless: false, max_order: None, ray_spacing_deg: 0.05 }
    }
}

impl From<PathOptions> for EngineOptions {
    fn from(options: PathOptions) -> Self {
        Self::Paths(options)
    }
}

impl From<FanOptions> for EngineOptions {
    fn from(options: FanOptions) -> Self {
        Self::Fan(options)
    }
}

impl From<ConeOptions> for EngineOptions {
    fn from(options: ConeOptions) -> Self {
        Self::Cone(options)
    }
}

impl From<EngineOptions> for Options {
    fn from(engine: EngineOptions) -> Self {
        Self { engine, max_range_m: None, threshold: None }
    }
}

impl From<PathOptions> for Options {
    fn from(options: PathOptions) -> Self {
        EngineOptions::from(options).into()
    }
}

impl From<FanOptions> for Options {
    fn from(options: FanOptions) -> Self {
        EngineOptions::from(options).into()
    }
}

impl From<ConeOptions> for Options {
    fn from(options: ConeOptions) -> Self {
        EngineOptions::from(options).into()
    }
}

/// An option outside its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OutOfRange {
    pub(super) option: &'static str,
    pub(super) value: f64,
    pub(super) expected: &'static str,
}

impl Options {
    /// Checks that every value is in its range.
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if let Some(range_m) = self.max_range_m {
            within("max_range_m", range_m, [0.01, 100.0], "from 0.01 to 100 metres")?;
        }
        if let Some(threshold) = self.threshold {
            within("threshold", threshold, [1e-6, 1.0], "from 0.000001 to 1")?;
        }
        match self.engine {
            EngineOptions::Paths(_) | EngineOptions::Cone(ConeOptions { aperture_deg: None }) => {
                Ok(())
            }
            EngineOptions::Fan(FanOptions { ray_spacing_deg, .. }) => {
                let expected = "from 0.0001 to 5 degrees";
                within("ray_spacing_deg", ray_spacing_deg, [1e-4, 5.0], expected)
            }
            EngineOptions::Cone(ConeOptions { aperture_deg: Some(aperture_deg) }) => {
                within("aperture_deg", aperture_deg, [0.0, 180.0], "from 0 to 180 degrees")
            }
        }
    }
}

fn within(
    option: &'static str,
    value: f64,
    [min, max]: [f64; 2],
    expected: &'static str,
) -> Result<(), OutOfRange> {
    if (min..=max).contains(&value) { Ok(()) } else { Err(OutOfRange { option, value, expected }) }
}
