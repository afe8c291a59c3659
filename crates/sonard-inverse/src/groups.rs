//! What to fit, by names that people use, and what is believed of it beforehand.

use serde::{Deserialize, Serialize};
use sonard_model::acoustics::Aperture;
use thiserror::Error;

use crate::{fit::Prior, parameter::Parameter, world::World};

/// Parameters that go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Group {
    /// Where the ranger stood and looked, in each scan.
    Pose,
    /// Zero of the stepper.
    Heading,
    /// Gear of the stepper.
    Gear,
    /// Where the face is on the axis.
    Mounting,
    /// How high.
    Height,
    /// Speed of sound.
    Air,
    /// Constant delay.
    Delay,
    /// Threshold of the receiver.
    Threshold,
    /// How the threshold rises with range.
    Rise,
    /// Width of the beam.
    Beam,
    /// How fast a pulse rises: the band of transducer and receiver.
    Pulse,
    /// Skirts of the beam.
    Skirts,
    /// Reflectances.
    Materials,
    /// Roughnesses.
    Roughness,
    /// Places of walls.
    Walls,
}

/// A group of parameters that cannot be fitted.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GroupError {
    /// A height in the plane.
    #[error("height: the scene has neither floor nor ceiling")]
    NoHeight,
    /// Skirts of a beam that has none.
    #[error("skirts: the aperture of {sensor} has none")]
    NoSkirts {
        /// The sensor's name.
        sensor: String,
    },
    /// A prior of what is not fitted.
    #[error("`{name}` is not fitted")]
    NotFitted {
        /// The name given.
        name: String,
        /// Those that are.
        fitted: Vec<String>,
    },
    /// A doubt that is none.
    #[error("the prior of {name} is {sigma}: it must be a number greater than 0")]
    Sigma {
        /// Which parameter.
        name: String,
        /// What was given, as text.
        sigma: String,
    },
}

impl GroupError {
    /// What would be right.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NoHeight => "leave it out, or give the scene floor_z_m".to_owned(),
            Self::NoSkirts { .. } => {
                "give the sensor's file a piston with skirts_db to begin with, such as -12"
                    .to_owned()
            }
            Self::NotFitted { fitted, .. } => format!("these are: {}", fitted.join(", ")),
            Self::Sigma { .. } => {
                "give the standard deviation of what is believed, in the parameter's unit"
                    .to_owned()
            }
        }
    }
}

/// The doubt that is assumed where none is given, in the parameter's unit.
const fn usual_sigma(parameter: &Parameter) -> f64 {
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
        Parameter::Wall(_) => 0.05,
    }
}

/// The name that a parameter has for people: walls by theirs.
#[must_use]
pub fn name(parameter: &Parameter, world: &World) -> String {
    match parameter {
        Parameter::Wall(wall) => match world.scene.walls.get(*wall) {
            Some(wall) => format!("wall {}", wall.id),
            None => parameter.to_string(),
        },
        _ => parameter.to_string(),
    }
}

/// All parameters of some groups for so many sweeps, each with the doubt given for its [`name`], else with the usual
/// one.
///
/// # Errors
/// A prior for what is not fitted or that is none, or what makes no sense in the scene.
pub fn priors(
    groups: &[Group],
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
    for (wanted, sigma) in given {
        if !names.contains(wanted) {
            names.sort();
            names.dedup();
            return Err(GroupError::NotFitted { name: wanted.clone(), fitted: names });
        }
        if !(sigma.is_finite() && *sigma > 0.0) {
            return Err(GroupError::Sigma { name: wanted.clone(), sigma: sigma.to_string() });
        }
    }
    let with_prior = |(parameter, title): (Parameter, &String)| {
        let sigma = given.iter().find(|(name, _)| name == title).map(|(_, sigma)| *sigma);
        Prior { sigma: sigma.unwrap_or_else(|| usual_sigma(&parameter)), parameter }
    };
    Ok(all.into_iter().zip(&names).map(with_prior).collect())
}

fn of_group(group: Group, world: &World, sweeps: usize) -> Result<Vec<Parameter>, GroupError> {
    let has_heights = world.scene.floor_z_m.is_some() || world.scene.ceiling_z_m.is_some();
    Ok(match group {
        Group::Pose => (0..sweeps)
            .flat_map(|at| [Parameter::X(at), Parameter::Y(at), Parameter::Heading(at)])
            .collect(),
        Group::Heading => vec![Parameter::HeadingZero],
        Group::Gear => vec![Parameter::Gear],
        Group::Mounting => vec![Parameter::Ahead, Parameter::Left],
        Group::Height if !has_heights => return Err(GroupError::NoHeight),
        Group::Height => vec![Parameter::Height],
        Group::Air => vec![Parameter::SoundSpeed],
        Group::Delay => vec![Parameter::Delay],
        Group::Threshold => vec![Parameter::Threshold],
        Group::Rise => vec![Parameter::ThresholdRise],
        Group::Beam => vec![Parameter::Aperture],
        Group::Pulse => vec![Parameter::Bandwidth],
        Group::Skirts => match world.sensor.aperture {
            Aperture::Piston { skirts_db: Some(_), .. } => vec![Parameter::Skirts],
            _ => return Err(GroupError::NoSkirts { sensor: world.sensor.name.clone() }),
        },
        Group::Materials => {
            world.scene.materials.keys().cloned().map(Parameter::Reflectance).collect()
        }
        Group::Roughness => {
            world.scene.materials.keys().cloned().map(Parameter::Roughness).collect()
        }
        Group::Walls => (0..world.scene.walls.len()).map(Parameter::Wall).collect(),
    })
}
