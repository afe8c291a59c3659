//! What a fit found, as figures that people and files have.

use nalgebra::DMatrix;
use serde::Serialize;
use sonard_model::acoustics::{Aperture, Sensor};
use uuid::Uuid;

use crate::{
    fit::{Estimate, Fit, Fitted, Prior, Search},
    groups::name,
    parameter::Parameter,
    sweep::Sweep,
    world::World,
};

/// An estimate as the value of a figure: what is a logarithm or a share in a fit is told as what it makes of the
/// figure that files have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Told {
    /// What it is.
    pub name: String,
    /// Of which scan, if it is of one alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan: Option<Uuid>,
    /// The value found.
    pub value: f64,
    /// Less what it was.
    pub change: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// 95 % lie from here
    pub low: f64,
    /// to here.
    pub high: f64,
    /// What it was.
    pub prior: f64,
    /// How sure that was.
    pub prior_sigma: f64,
    /// Whether the readings say more than was believed.
    pub identified: bool,
    /// Whether it would go on if it could: the value is the least or the largest there is.
    pub at_limit: bool,
}

impl Told {
    /// What besides its figures has to be said of it.
    #[must_use]
    pub const fn remark(&self) -> &'static str {
        match (self.at_limit, self.identified) {
            (true, _) => "at its limit",
            (false, true) => "",
            (false, false) => "left at its prior",
        }
    }

    /// Its name, with the beginning of the scan's.
    #[must_use]
    pub fn title(&self) -> String {
        match self.scan {
            Some(scan) => format!("{} of {:08x}", self.name, scan.as_fields().0),
            None => self.name.clone(),
        }
    }
}

impl Fit {
    /// With these priors, from predictions that may be off by so much at first, metres; the rest as usual.
    #[must_use]
    pub const fn usual(priors: Vec<Prior>, widest_m: f64) -> Self {
        Self {
            priors,
            widest_m,
            widest_turn_deg: WIDEST_TURN_DEG,
            least_sigma_m: 2e-4,
            least_sigma_db: 0.5,
            search: Search::Thorough,
        }
    }
}

/// How far off headings may be, degrees: one and a half times what is assumed of them.
const WIDEST_TURN_DEG: f64 = 12.0;
/// Standard deviations to both sides that hold 95 %.
const HALF_WIDTH: f64 = 1.959_964;
/// Correlation from which on two estimates can hardly be told apart.
const HARDLY_TOLD_APART: f64 = 0.95;
/// What sums of changes are off by, beside a limit.
const ROUNDING: f64 = 1e-9;

impl Fitted {
    /// The estimates as figures, in the order of the priors; `world` is the one that was started from.
    #[must_use]
    pub fn told(&self, world: &World, sweeps: &[Sweep], fit: &Fit) -> Vec<Told> {
        let of = |(prior, estimate): (&Prior, &Estimate)| {
            let parameter = &prior.parameter;
            let value = |by: f64| value(world, sweeps, parameter, by);
            let (least, most) = world.limits(parameter);
            let possible = |by: f64| value(by.clamp(least, most));
            let half_width = HALF_WIDTH * estimate.sigma;
            let per_unit = |sigma: f64| {
                0.5 * (value(estimate.change + sigma) - value(estimate.change - sigma)).abs()
            };
            Told {
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
                at_limit: estimate.change < least + ROUNDING || estimate.change > most - ROUNDING,
            }
        };
        fit.priors.iter().zip(&self.estimates).map(of).collect()
    }

    /// Whether a good part of the readings is not explained.
    #[must_use]
    pub const fn is_doubtful(&self) -> bool {
        self.errors.explained() < 0.7
    }

    /// Correlations of the estimates, in the order of the priors, -1 to 1.
    #[must_use]
    pub fn correlations(&self) -> DMatrix<f64> {
        let sigma = self.covariance.diagonal().map(f64::sqrt);
        self.covariance.component_div(&(&sigma * sigma.transpose()))
    }

    /// Pairs of estimates, by their places, that can hardly be told apart, with their correlation; the closest first.
    #[must_use]
    pub fn hardly_told_apart(&self) -> Vec<(usize, usize, f64)> {
        let all = self.correlations();
        let pairs = (0..all.nrows()).flat_map(|one| (0..one).map(move |other| (other, one)));
        let told = pairs.map(|(other, one)| (other, one, all[(one, other)]));
        let mut found: Vec<_> = told.filter(|(.., of)| of.abs() > HARDLY_TOLD_APART).collect();
        found.sort_by(|one, other| other.2.abs().total_cmp(&one.2.abs()));
        found
    }

    /// The sensor that was found, under a name of its own where it differs from the one that was started from, with
    /// the source of each figure that does.
    #[must_use]
    pub fn sensor(&self, started_from: &Sensor) -> Sensor {
        let mut sensor = self.world.sensor.clone();
        let before = started_from;
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
                let source = "fitted by `sonard calibrate`: see report.md";
                sensor.sources.insert(field.to_owned(), source.to_owned());
            }
        }
        sensor
    }
}

/// What a parameter's figure is after a change.
fn value(world: &World, sweeps: &[Sweep], parameter: &Parameter, by: f64) -> f64 {
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
        Parameter::Wall(_) => by,
    }
}
