//! Parameter groups by user-facing names, with default priors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::acoustics::Aperture;
use thiserror::Error;

use crate::{
    fit::Prior,
    parameter::{Parameter, PostPart},
    walls,
    world::World,
};

/// Group of parameters that are fitted together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum ParameterGroup {
    /// Pose of the ranger in each scan.
    Pose,
    /// Azimuth zero of the stepper.
    Heading,
    /// Gear ratio error of the stepper.
    Gear,
    /// Transducer offset from the axis.
    Mounting,
    /// Transducer height above the floor.
    Height,
    /// Speed of sound in air.
    Air,
    /// Constant offset of all ranges.
    Delay,
    /// Detection threshold of the receiver.
    Threshold,
    /// Slope of the threshold with range.
    Rise,
    /// Width of the main lobe.
    Beam,
    /// Rise time of a pulse: bandwidth of transducer and receiver.
    Pulse,
    /// Side-lobe floor of the beam.
    Skirts,
    /// Reflectance of each material.
    Materials,
    /// Roughness of each material.
    Roughness,
    /// Position of each wall.
    Walls,
    /// Orientation of each wall.
    Turns,
    /// Position of each free end of a wall along it.
    Ends,
    /// Position and radius of each cylinder.
    Posts,
}

impl ParameterGroup {
    /// User-facing name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Heading => "heading",
            Self::Gear => "gear",
            Self::Mounting => "mounting",
            Self::Height => "height",
            Self::Air => "air",
            Self::Delay => "delay",
            Self::Threshold => "threshold",
            Self::Rise => "rise",
            Self::Beam => "beam",
            Self::Pulse => "pulse",
            Self::Skirts => "skirts",
            Self::Materials => "materials",
            Self::Roughness => "roughness",
            Self::Walls => "walls",
            Self::Turns => "turns",
            Self::Ends => "ends",
            Self::Posts => "posts",
        }
    }
}

/// Invalid selection of parameters or priors.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GroupError {
    /// Height in a scene without floor and ceiling.
    #[error("height: the scene has neither floor nor ceiling")]
    NoHeight,
    /// Side-lobe floor of an aperture without one.
    #[error("skirts: the aperture of {sensor} has none")]
    NoSkirts {
        /// Name of the sensor.
        sensor: String,
    },
    /// Prior of a parameter that is not fitted.
    #[error("`{name}` is not fitted")]
    NotFitted {
        /// Name that was given.
        name: String,
        /// Names of the fitted parameters.
        fitted: Vec<String>,
    },
    /// Invalid standard deviation.
    #[error("the prior of {name} is {sigma}: it must be a number greater than 0")]
    Sigma {
        /// Name of the parameter.
        name: String,
        /// Given value, as text.
        sigma: String,
    },
}

impl GroupError {
    /// Hint for a correction.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NoHeight => "leave it out, or give the scene floor_z_m".to_owned(),
            Self::NoSkirts { .. } => {
                "give the sensor's file a piston with skirts_db to begin with, such as -12"
                    .to_owned()
            }
            Self::NotFitted { fitted, .. } => format!("fitted parameters: {}", fitted.join(", ")),
            Self::Sigma { .. } => {
                "give the prior standard deviation, in the parameter's unit".to_owned()
            }
        }
    }
}

/// Default prior standard deviation, in the parameter's unit.
const fn default_sigma(parameter: &Parameter) -> f64 {
    match parameter {
        Parameter::X(_) | Parameter::Y(_) | Parameter::Height => 0.1,
        Parameter::Heading(_) | Parameter::HeadingZero => 8.0,
        Parameter::Gear => 0.02,
        Parameter::Ahead | Parameter::Left | Parameter::Delay => 0.03,
        Parameter::SoundSpeed => 0.015,
        Parameter::Threshold | Parameter::Skirts => 6.0,
        Parameter::ThresholdRise => 5.0,
        Parameter::Aperture => 0.3,
        Parameter::Bandwidth => 0.5,
        Parameter::Reflectance(_) | Parameter::Roughness(_) => 0.1,
        Parameter::Wall(_) | Parameter::WallEnd(..) => 0.05,
        Parameter::WallTurn(_) => 2.0,
        Parameter::Post(_, PostPart::X | PostPart::Y) => 0.05,
        Parameter::Post(_, PostPart::Radius) => 0.02,
    }
}

/// User-facing name of a parameter; walls and cylinders are named by their id.
#[must_use]
pub fn name(parameter: &Parameter, world: &World) -> String {
    let scene = &world.scene;
    let wall = |at: usize| scene.walls.get(at).map(|wall| &*wall.id);
    let named = match parameter {
        Parameter::Wall(at) => wall(*at).map(|id| format!("wall {id}")),
        Parameter::WallTurn(at) => wall(*at).map(|id| format!("wall {id} turn_deg")),
        Parameter::WallEnd(at, end) => wall(*at).map(|id| format!("wall {id} end {}", end.name())),
        Parameter::Post(at, part) => {
            let cylinder = scene.cylinders.get(*at);
            cylinder.map(|cylinder| format!("cylinder {} {}", cylinder.id, part.name()))
        }
        _ => None,
    };
    named.unwrap_or_else(|| parameter.to_string())
}

/// Priors of all parameters of some groups for a number of sweeps. Standard deviations are those
/// given by [`name`], else the defaults.
///
/// # Errors
/// Prior of a parameter that is not fitted, invalid standard deviation, or a group that does not
/// apply.
pub fn priors(
    groups: &[ParameterGroup],
    given: &[(String, f64)],
    world: &World,
    sweeps: usize,
) -> Result<Vec<Prior>, GroupError> {
    let mut all: Vec<Parameter> = Vec::new();
    for (at, group) in groups.iter().enumerate() {
        if !groups[..at].contains(group) {
            all.extend(of_group(*group, world, sweeps)?);
        }
    }
    let mut names: Vec<String> = all.iter().map(|parameter| name(parameter, world)).collect();
    for (given_name, sigma) in given {
        if !names.contains(given_name) {
            names.sort();
            names.dedup();
            return Err(GroupError::NotFitted { name: given_name.clone(), fitted: names });
        }
        if !(sigma.is_finite() && *sigma > 0.0) {
            return Err(GroupError::Sigma { name: given_name.clone(), sigma: sigma.to_string() });
        }
    }
    let with_prior = |(parameter, title): (Parameter, &String)| {
        let sigma = given.iter().find(|(name, _)| name == title).map(|(_, sigma)| *sigma);
        Prior { sigma: sigma.unwrap_or_else(|| default_sigma(&parameter)), parameter }
    };
    Ok(all.into_iter().zip(&names).map(with_prior).collect())
}

fn of_group(
    group: ParameterGroup,
    world: &World,
    sweeps: usize,
) -> Result<Vec<Parameter>, GroupError> {
    let has_heights = world.scene.floor_z_m.is_some() || world.scene.ceiling_z_m.is_some();
    Ok(match group {
        ParameterGroup::Pose => (0..sweeps)
            .flat_map(|at| [Parameter::X(at), Parameter::Y(at), Parameter::Heading(at)])
            .collect(),
        ParameterGroup::Heading => vec![Parameter::HeadingZero],
        ParameterGroup::Gear => vec![Parameter::Gear],
        ParameterGroup::Mounting => vec![Parameter::Ahead, Parameter::Left],
        ParameterGroup::Height if !has_heights => return Err(GroupError::NoHeight),
        ParameterGroup::Height => vec![Parameter::Height],
        ParameterGroup::Air => vec![Parameter::SoundSpeed],
        ParameterGroup::Delay => vec![Parameter::Delay],
        ParameterGroup::Threshold => vec![Parameter::Threshold],
        ParameterGroup::Rise => vec![Parameter::ThresholdRise],
        ParameterGroup::Beam => vec![Parameter::Aperture],
        ParameterGroup::Pulse => vec![Parameter::Bandwidth],
        ParameterGroup::Skirts => match world.sensor.aperture {
            Aperture::Piston { skirts_db: Some(_), .. } => vec![Parameter::Skirts],
            _ => return Err(GroupError::NoSkirts { sensor: world.sensor.name.clone() }),
        },
        ParameterGroup::Materials => {
            world.scene.materials.keys().cloned().map(Parameter::Reflectance).collect()
        }
        ParameterGroup::Roughness => {
            world.scene.materials.keys().cloned().map(Parameter::Roughness).collect()
        }
        ParameterGroup::Walls => (0..world.scene.walls.len()).map(Parameter::Wall).collect(),
        ParameterGroup::Turns => (0..world.scene.walls.len()).map(Parameter::WallTurn).collect(),
        ParameterGroup::Ends => {
            let free = walls::free_ends(&world.scene).into_iter();
            free.map(|(wall, end)| Parameter::WallEnd(wall, end)).collect()
        }
        ParameterGroup::Posts => {
            let parts = [PostPart::X, PostPart::Y, PostPart::Radius];
            let of = |post| parts.map(|part| Parameter::Post(post, part));
            (0..world.scene.cylinders.len()).flat_map(of).collect()
        }
    })
}
