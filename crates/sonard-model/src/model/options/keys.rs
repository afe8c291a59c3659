//! Settings of all engines in one flat structure, as in flags, configuration and records.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{ConeOptions, EngineKind, EngineOptions, FanOptions, Options, PathOptions};
use crate::acoustics::{EdgeLawKind, Response};

/// Settings of all engines in one flat structure, as in flags, configuration keys and records.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(feature = "clap", command(next_help_heading = "Model"))]
#[serde(default)]
pub struct OptionKeys {
    /// Simulation engine.
    #[cfg_attr(feature = "clap", arg(long, value_enum, default_value_t))]
    pub engine: EngineKind,
    /// Maximum range, metres, instead of the sensor's.
    #[cfg_attr(feature = "clap", arg(long = "max-range", value_name = "M"))]
    #[schemars(range(min = 0.1, max = 100), example = 4)]
    pub max_range_m: Option<f64>,
    /// Detection threshold, instead of the sensor's; a head-on, perfect wall gives 1.
    #[cfg_attr(feature = "clap", arg(long, value_name = "T"))]
    #[schemars(range(min = 0.000_001, max = 1), example = 0.04)]
    pub threshold: Option<f64>,
    /// Aperture response, instead of the sensor's (engine `paths` only).
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    #[schemars(example = &"full")]
    pub response: Option<Response>,
    /// Ideal receiver: no interference, no time walk (engine `paths` only; the others always use
    /// it).
    #[cfg_attr(feature = "clap", arg(long))]
    pub ideal_receiver: bool,
    /// Disable the absorption of the air (engines `paths` and `fan`).
    #[cfg_attr(feature = "clap", arg(long))]
    pub lossless: bool,
    /// Maximum number of mirror reflections on a path (engines `paths` and `fan`).
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[schemars(range(min = 0, max = 65_535), example = 3)]
    pub max_order: Option<u32>,
    /// Edge diffraction model, instead of the sensor's or utd (engine `paths` only).
    #[cfg_attr(feature = "clap", arg(long, value_enum, value_name = "LAW"))]
    #[schemars(example = &"kuc-siegel")]
    pub edge_law: Option<EdgeLawKind>,
    /// Find paths diffracted at two edges, too (engine `paths` only).
    #[cfg_attr(feature = "clap", arg(long))]
    pub double_diffraction: bool,
    /// Disable crosstalk between the rangers of an array (engine `paths` only; the others have
    /// none).
    #[cfg_attr(feature = "clap", arg(long))]
    pub without_crosstalk: bool,
    /// Angle between the rays, degrees, instead of 0.05 (engine `fan` only).
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    #[schemars(range(min = 0.0001, max = 5), example = 0.1)]
    pub ray_spacing_deg: Option<f64>,
    /// Full aperture, degrees, instead of the sensor's two-way -6 dB width (engine `cone` only).
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    #[schemars(range(min = 0, max = 180), example = 15)]
    pub aperture_deg: Option<f64>,
}

/// A setting that belongs to a different engine than the selected one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{option} is not an option of the engine {}", engine.name())]
pub struct ForeignOption {
    /// Name of the setting, as in [`OptionKeys`].
    pub option: &'static str,
    /// Engine that was selected.
    pub engine: EngineKind,
    /// Engines with this setting.
    pub engines: &'static [EngineKind],
}

impl ForeignOption {
    /// Returns a suggested correction.
    #[must_use]
    pub fn help(&self) -> String {
        let of: Vec<_> = self.engines.iter().map(|engine| engine.name()).collect();
        format!("remove it, or choose the engine {}", of.join(" or "))
    }
}

impl From<&Options> for OptionKeys {
    fn from(options: &Options) -> Self {
        let keys = Self {
            engine: options.engine.kind(),
            max_range_m: options.max_range_m,
            threshold: options.threshold,
            ..Self::default()
        };
        match options.engine {
            EngineOptions::Paths(paths) => Self {
                response: paths.response,
                ideal_receiver: paths.ideal_receiver,
                lossless: paths.lossless,
                max_order: paths.max_order,
                edge_law: paths.edge_law,
                double_diffraction: paths.double_diffraction,
                without_crosstalk: paths.without_crosstalk,
                ..keys
            },
            EngineOptions::Fan(fan) => Self {
                lossless: fan.lossless,
                max_order: fan.max_order,
                ray_spacing_deg: Some(fan.ray_spacing_deg),
                ..keys
            },
            EngineOptions::Cone(cone) => Self { aperture_deg: cone.aperture_deg, ..keys },
        }
    }
}

impl OptionKeys {
    /// Returns the options that are set.
    ///
    /// # Errors
    /// The first option that the engine does not have.
    pub fn options(&self) -> Result<Options, ForeignOption> {
        let known = self.engine_options();
        let foreign =
            OPTIONS.iter().find(|(option, of)| !of.contains(&self.engine) && self.is_set(option));
        match foreign {
            None => Ok(known),
            Some(&(option, of)) => Err(ForeignOption { option, engine: self.engine, engines: of }),
        }
    }

    /// Returns the options of the engine; others are ignored. Early logs contain those of every
    /// engine.
    #[must_use]
    pub fn engine_options(&self) -> Options {
        let engine = match self.engine {
            EngineKind::Paths => EngineOptions::Paths(PathOptions {
                response: self.response,
                ideal_receiver: self.ideal_receiver,
                lossless: self.lossless,
                max_order: self.max_order,
                edge_law: self.edge_law,
                double_diffraction: self.double_diffraction,
                without_crosstalk: self.without_crosstalk,
            }),
            EngineKind::Fan => EngineOptions::Fan(FanOptions {
                lossless: self.lossless,
                max_order: self.max_order,
                ray_spacing_deg: self
                    .ray_spacing_deg
                    .unwrap_or_else(|| FanOptions::default().ray_spacing_deg),
            }),
            EngineKind::Cone => {
                EngineOptions::Cone(ConeOptions { aperture_deg: self.aperture_deg })
            }
        };
        Options { engine, max_range_m: self.max_range_m, threshold: self.threshold }
    }

    /// Returns `true` if an option of [`OPTIONS`] is set.
    fn is_set(&self, option: &str) -> bool {
        match option {
            "response" => self.response.is_some(),
            "ideal_receiver" => self.ideal_receiver,
            "lossless" => self.lossless,
            "max_order" => self.max_order.is_some(),
            "edge_law" => self.edge_law.is_some(),
            "double_diffraction" => self.double_diffraction,
            "without_crosstalk" => self.without_crosstalk,
            "ray_spacing_deg" => self.ray_spacing_deg.is_some(),
            _ => self.aperture_deg.is_some(),
        }
    }
}

/// Options that not every engine has, with the engines that have them.
const OPTIONS: [(&str, &[EngineKind]); 9] = [
    ("response", &[EngineKind::Paths]),
    ("ideal_receiver", &[EngineKind::Paths]),
    ("lossless", &[EngineKind::Paths, EngineKind::Fan]),
    ("max_order", &[EngineKind::Paths, EngineKind::Fan]),
    ("edge_law", &[EngineKind::Paths]),
    ("double_diffraction", &[EngineKind::Paths]),
    ("without_crosstalk", &[EngineKind::Paths]),
    ("ray_spacing_deg", &[EngineKind::Fan]),
    ("aperture_deg", &[EngineKind::Cone]),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Sets every option, for an engine.
    fn everything(engine: EngineKind) -> OptionKeys {
        OptionKeys {
            engine,
            max_range_m: Some(4.0),
            threshold: Some(0.05),
            response: Some(Response::Full),
            ideal_receiver: true,
            lossless: true,
            max_order: Some(2),
            edge_law: Some(EdgeLawKind::Utd),
            double_diffraction: true,
            without_crosstalk: true,
            ray_spacing_deg: Some(0.2),
            aperture_deg: Some(20.0),
        }
    }

    #[test]
    fn foreign_options_are_rejected() {
        let engines = [EngineKind::Paths, EngineKind::Fan, EngineKind::Cone];
        for engine in engines {
            let own = OptionKeys::from(&everything(engine).engine_options());
            assert_eq!(OptionKeys::from(&own.options().expect("its own")), own);
            assert_eq!(
                (own.engine, own.max_range_m, own.threshold),
                (engine, Some(4.0), Some(0.05))
            );
            // Each option alone is either kept or rejected.
            for (option, of) in OPTIONS {
                let text = serde_json::to_value(everything(engine)).expect("JSON");
                let one = serde_json::json!({ "engine": engine, option: text[option] });
                let one: OptionKeys = serde_json::from_value(one).expect("keys");
                assert!(one.is_set(option), "{option}");
                match one.options() {
                    Ok(options) => {
                        assert!(of.contains(&engine), "{option}");
                        let kept = serde_json::to_value(OptionKeys::from(&options)).expect("JSON");
                        assert_eq!(kept[option], text[option], "{option}");
                    }
                    Err(error) => {
                        assert!(!of.contains(&engine), "{option}");
                        assert_eq!((error.option, error.engine), (option, engine));
                    }
                }
            }
        }
        let error = everything(EngineKind::Cone).options().expect_err("others' options");
        assert_eq!(error.to_string(), "response is not an option of the engine cone");
        assert_eq!(error.help(), "remove it, or choose the engine paths");
    }
}
