//! Report of a fit, in the units used in files.

use nalgebra::DMatrix;
use serde::Serialize;
use sonard_model::acoustics::{Aperture, Sensor};
use uuid::Uuid;

use crate::{
    fit::{FitOptions, FitResult, ParameterEstimate, Prior, Search},
    parameter::{Parameter, PostPart},
    parameter_groups::name,
    sweep::FitSweep,
    world::World,
};

/// Estimate in the unit used in files; logarithms and relative changes of the fit are converted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterReport {
    /// Name of the parameter.
    pub name: String,
    /// Scan id, for a parameter of a single sweep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan: Option<Uuid>,
    /// Estimated value in the parameter's unit.
    pub value: f64,
    /// Change from the initial value.
    pub change: f64,
    /// Posterior standard deviation.
    pub sigma: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
    /// Initial value, the prior mean.
    pub prior: f64,
    /// Standard deviation of the prior.
    pub prior_sigma: f64,
    /// Whether the readings constrain the parameter beyond its prior.
    pub identified: bool,
    /// Whether the value is at a physical limit.
    pub at_limit: bool,
}

impl ParameterReport {
    /// Report of an estimate; `world` is the initial one.
    #[must_use]
    pub fn new(
        world: &World,
        sweeps: &[FitSweep],
        prior: &Prior,
        estimate: &ParameterEstimate,
    ) -> Self {
        let parameter = &prior.parameter;
        let value = |by: f64| value(world, sweeps, parameter, by);
        let (min, max) = world.limits(parameter);
        let possible = |by: f64| value(by.clamp(min, max));
        let half_width = HALF_WIDTH * estimate.sigma;
        let per_unit = |sigma: f64| {
            0.5 * (value(estimate.change + sigma) - value(estimate.change - sigma)).abs()
        };
        Self {
            name: name(parameter, world),
            scan: parameter.sweep().and_then(|at| sweeps.get(at)).map(|sweep| sweep.scan),
            value: value(estimate.change),
            change: value(estimate.change) - value(0.0),
            sigma: per_unit(estimate.sigma),
            low: possible(estimate.change - half_width),
            high: possible(estimate.change + half_width),
            prior: value(0.0),
            prior_sigma: per_unit(prior.sigma),
            identified: estimate.identified,
            at_limit: estimate.change < min + ROUNDING || estimate.change > max - ROUNDING,
        }
    }

    /// Remark for a report.
    #[must_use]
    pub const fn remark(&self) -> &'static str {
        match (self.at_limit, self.identified) {
            (true, _) => "at its limit",
            (false, true) => "",
            (false, false) => "left at its prior",
        }
    }

    /// Name, with the beginning of the scan id.
    #[must_use]
    pub fn title(&self) -> String {
        match self.scan {
            Some(scan) => format!("{} of {:08x}", self.name, scan.as_fields().0),
            None => self.name.clone(),
        }
    }
}

impl FitOptions {
    /// Settings for priors and an initial standard deviation of ranges, metres; others are
    /// defaults.
    #[must_use]
    pub const fn with_priors(priors: Vec<Prior>, widest_m: f64) -> Self {
        Self {
            priors,
            initial_sigma_m: widest_m,
            max_turn_deg: WIDEST_TURN_DEG,
            min_sigma_m: 2e-4,
            min_sigma_db: 0.5,
            search: Search::Thorough,
        }
    }
}

/// Maximum initial error of headings, degrees: 1.5 times the default prior.
const WIDEST_TURN_DEG: f64 = 12.0;
/// Half width of the 95 % interval, standard deviations.
const HALF_WIDTH: f64 = 1.959_964;
/// Correlation above which two estimates are hardly separable.
const MAX_CORRELATION: f64 = 0.95;
/// Tolerance for values at a limit.
const ROUNDING: f64 = 1e-9;

impl FitResult {
    /// Reports the estimates in the order of the priors; `world` is the initial one.
    #[must_use]
    pub fn report(
        &self,
        world: &World,
        sweeps: &[FitSweep],
        fit: &FitOptions,
    ) -> Vec<ParameterReport> {
        let pairs = fit.priors.iter().zip(&self.estimates);
        pairs
            .map(|(prior, estimate)| ParameterReport::new(world, sweeps, prior, estimate))
            .collect()
    }

    /// Calibrated sensor, with the sources of changed values.
    #[must_use]
    pub fn sensor(&self, started_from: &Sensor) -> Sensor {
        calibrated_sensor(&self.world.sensor, started_from, "sonard calibrate")
    }

    /// Returns `true` if more than 30 % of the readings are not explained.
    #[must_use]
    pub const fn is_poorly_explained(&self) -> bool {
        self.errors.explained() < 0.7
    }

    /// Correlation matrix of the estimates, in the order of the priors.
    #[must_use]
    pub fn correlations(&self) -> DMatrix<f64> {
        correlations(&self.covariance)
    }

    /// Index pairs of strongly correlated estimates with their correlation, strongest first.
    #[must_use]
    pub fn strongly_correlated(&self) -> Vec<(usize, usize, f64)> {
        strongly_correlated(&self.covariance)
    }
}

fn correlations(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let sigma = covariance.diagonal().map(f64::sqrt);
    covariance.component_div(&(&sigma * sigma.transpose()))
}

/// Index pairs of strongly correlated numbers with their correlation, strongest first.
#[must_use]
pub fn strongly_correlated(covariance: &DMatrix<f64>) -> Vec<(usize, usize, f64)> {
    let all = correlations(covariance);
    let pairs = (0..all.nrows()).flat_map(|row| (0..row).map(move |column| (column, row)));
    let correlated = pairs.map(|(column, row)| (column, row, all[(row, column)]));
    let mut found: Vec<_> = correlated.filter(|(.., of)| of.abs() > MAX_CORRELATION).collect();
    found.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    found
}

/// Sensor fitted by a command. If it differs from the initial one, it has a name of its own and a
/// source for each changed value.
#[must_use]
pub fn calibrated_sensor(fitted: &Sensor, before: &Sensor, command: &str) -> Sensor {
    let mut sensor = fitted.clone();
    if sensor == *before {
        return sensor;
    }
    sensor.name = format!("{}-calibrated", sensor.name);
    let rise = sensor.threshold_rise_db_per_m != before.threshold_rise_db_per_m;
    for (field, is_changed) in [
        ("aperture", sensor.aperture != before.aperture),
        ("threshold", sensor.threshold != before.threshold),
        ("threshold_rise_db_per_m", rise),
        ("mounting", sensor.mounting != before.mounting),
        ("pulse", sensor.pulse != before.pulse),
    ] {
        if is_changed {
            let source = format!("fitted by `{command}`: see report.md");
            sensor.sources.insert(field.to_owned(), source);
        }
    }
    sensor
}

/// Value of a parameter after a change, in the unit used in files.
fn value(world: &World, sweeps: &[FitSweep], parameter: &Parameter, by: f64) -> f64 {
    let pose = |at: usize| sweeps.get(at).map(|sweep| sweep.pose);
    let mounting = &world.sensor.mounting;
    match parameter {
        Parameter::X(at) => pose(*at).map_or(by, |pose| pose.x_m + by),
        Parameter::Y(at) => pose(*at).map_or(by, |pose| pose.y_m + by),
        Parameter::Heading(at) => pose(*at).map_or(by, |pose| pose.heading_deg + by),
        Parameter::HeadingZero => world.heading_zero_deg + by,
        Parameter::Gear => world.gear * (1.0 + by),
        Parameter::Ahead => mounting.ahead_m + by,
        Parameter::Left => mounting.left_m + by,
        Parameter::Height => world.sensor_z_m().map_or(by, |z_m| z_m + by),
        Parameter::SoundSpeed => world.air.sound_speed_m_s() * (1.0 + by),
        Parameter::Delay => world.delay_m + by,
        Parameter::Threshold => 20.0 * world.sensor.threshold.log10() + by,
        Parameter::ThresholdRise => world.sensor.threshold_rise_db_per_m + by,
        Parameter::Skirts => match world.sensor.aperture {
            Aperture::Piston { skirts_db: Some(db), .. } => db + by,
            _ => by,
        },
        Parameter::Aperture => world.sensor.half_width_m() * by.exp(),
        Parameter::Bandwidth => world.sensor.pulse.bandwidth_hz() * by.exp(),
        Parameter::Reflectance(name) => {
            world.scene.materials.get(name).map_or(1.0, |material| material.reflectance) * by.exp()
        }
        Parameter::Roughness(name) => {
            world.scene.materials.get(name).map_or(by, |material| material.roughness + by)
        }
        Parameter::Wall(_) | Parameter::WallTurn(_) | Parameter::WallEnd(..) => by,
        Parameter::Post(post, part) => {
            let known = world.scene.cylinders.get(*post);
            by + known.map_or(0.0, |cylinder| match part {
                PostPart::X => cylinder.center.x,
                PostPart::Y => cylinder.center.y,
                PostPart::Radius => cylinder.radius_m,
            })
        }
    }
}
