//! What to fit, and what is believed of it beforehand.

use std::str::FromStr;

use crate::{
    acoustics::Aperture,
    cli::Failure,
    inverse::{Parameter, Prior, World},
};

/// Parameters that go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Group {
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
    /// Skirts of the beam.
    Skirts,
    /// Reflectances.
    Materials,
    /// Places of walls.
    Walls,
}

/// `NAME=SIGMA`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PriorSigma {
    name: String,
    sigma: f64,
}

impl FromStr for PriorSigma {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, sigma) = text.split_once('=').ok_or("write NAME=SIGMA, as in x_m=0.05")?;
        let sigma: f64 = sigma.trim().parse().map_err(|_| format!("`{sigma}` is not a number"))?;
        if !(sigma.is_finite() && sigma > 0.0) {
            return Err(format!("{sigma} must be greater than 0"));
        }
        Ok(Self { name: name.trim().to_owned(), sigma })
    }
}

/// The doubt that is assumed where none is given, in the parameter's unit.
fn usual_sigma(parameter: &Parameter) -> f64 {
    match parameter {
        Parameter::X(_) | Parameter::Y(_) | Parameter::Height => 0.1,
        Parameter::Heading(_) | Parameter::HeadingZero => 8.0,
        Parameter::Gear => 0.02,
        Parameter::Ahead | Parameter::Left | Parameter::Delay => 0.03,
        Parameter::SoundSpeed => 0.015,
        Parameter::Threshold => 6.0,
        Parameter::ThresholdRise => 5.0,
        Parameter::Skirts => 6.0,
        Parameter::Aperture => 0.3,
        Parameter::Reflectance(_) => 0.1,
        Parameter::Wall(_) => 0.05,
    }
}

/// The name that a parameter has for people: walls by theirs.
pub(super) fn name(parameter: &Parameter, world: &World) -> String {
    match parameter {
        Parameter::Wall(wall) => match world.scene.walls.get(*wall) {
            Some(wall) => format!("wall {}", wall.id),
            None => parameter.to_string(),
        },
        _ => parameter.to_string(),
    }
}

/// All parameters of some groups, with priors.
///
/// # Errors
/// A prior for what is not fitted, or nothing that makes sense in the scene.
pub(super) fn parameters(
    groups: &[Group],
    given: &[PriorSigma],
    world: &World,
    sweeps: usize,
) -> Result<Vec<Prior>, Failure> {
    let mut all: Vec<Parameter> = Vec::new();
    for (at, group) in groups.iter().enumerate() {
        if !groups[..at].contains(group) {
            all.extend(of_group(*group, world, sweeps)?);
        }
    }
    for PriorSigma { name: wanted, .. } in given {
        if !all.iter().any(|parameter| name(parameter, world) == *wanted) {
            let mut names: Vec<String> =
                all.iter().map(|parameter| name(parameter, world)).collect();
            names.dedup();
            names.sort();
            names.dedup();
            return Err(Failure::input(
                format!("--prior: `{wanted}` is not fitted"),
                format!("these are: {}", names.join(", ")),
            ));
        }
    }
    let with_prior = |parameter: Parameter| {
        let title = name(&parameter, world);
        let sigma = given.iter().find(|given| given.name == title).map(|given| given.sigma);
        Prior { sigma: sigma.unwrap_or_else(|| usual_sigma(&parameter)), parameter }
    };
    Ok(all.into_iter().map(with_prior).collect())
}

fn of_group(group: Group, world: &World, sweeps: usize) -> Result<Vec<Parameter>, Failure> {
    let has_heights = world.scene.floor_z_m.is_some() || world.scene.ceiling_z_m.is_some();
    Ok(match group {
        Group::Pose => (0..sweeps)
            .flat_map(|at| [Parameter::X(at), Parameter::Y(at), Parameter::Heading(at)])
            .collect(),
        Group::Heading => vec![Parameter::HeadingZero],
        Group::Gear => vec![Parameter::Gear],
        Group::Mounting => vec![Parameter::Ahead, Parameter::Left],
        Group::Height if !has_heights => {
            return Err(Failure::input(
                "--fit height: the scene has neither floor nor ceiling",
                "leave it out, or give the scene floor_z_m",
            ));
        }
        Group::Height => vec![Parameter::Height],
        Group::Air => vec![Parameter::SoundSpeed],
        Group::Delay => vec![Parameter::Delay],
        Group::Threshold => vec![Parameter::Threshold],
        Group::Rise => vec![Parameter::ThresholdRise],
        Group::Beam => vec![Parameter::Aperture],
        Group::Skirts => match world.sensor.aperture {
            Aperture::Piston { skirts_db: Some(_), .. } => vec![Parameter::Skirts],
            _ => {
                return Err(Failure::input(
                    format!("--fit skirts: the aperture of {} has none", world.sensor.name),
                    "give the sensor's file a piston with skirts_db to begin with, such as -12",
                ));
            }
        },
        Group::Materials => {
            world.scene.materials.keys().cloned().map(Parameter::Reflectance).collect()
        }
        Group::Walls => (0..world.scene.walls.len()).map(Parameter::Wall).collect(),
    })
}
