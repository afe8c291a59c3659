//! Echoes that a plan predicts.

use std::sync::Arc;

use rayon::prelude::*;
use sonard_inverse::{FitSweep, World};
use sonard_model::{
    acoustics::{Air, Mounting, Sensor},
    geometry::{Pose, wrap_180},
    model::{Options, Simulator},
    reading::PingStatus,
    scene::Scene,
};

/// Maximum error of a predicted echo, metres.
const NEAR_M: f64 = 0.03;

/// Numbers of echoes predicted and measured.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct EchoCount {
    near: usize,
    all: usize,
}

impl EchoCount {
    /// Share of the echoes that are predicted, percent.
    pub(crate) fn percent(self) -> f64 {
        100.0 * self.near as f64 / self.all.max(1) as f64
    }
}

impl std::iter::Sum for EchoCount {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |sum, of| Self {
            near: sum.near + of.near,
            all: sum.all + of.all,
        })
    }
}

/// Plan with a ranger on the axis of the motor: ranges are measured from there.
pub(crate) struct Predictor {
    simulator: Simulator,
    ahead_m: f64,
    sound_speed_m_s: f64,
}

impl Predictor {
    pub(crate) fn new(scene: Scene, sensor: &Sensor) -> Result<Self, Box<dyn std::error::Error>> {
        let mut on_axis = sensor.clone();
        (on_axis.mounting, on_axis.range_step_m) = (Mounting::default(), 0.0);
        let world = World::new(Arc::new(scene), on_axis, Air::default(), Options::default());
        Ok(Self {
            simulator: world.simulator(&Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 })?,
            ahead_m: sensor.mounting.ahead_m,
            sound_speed_m_s: world.air.sound_speed_m_s(),
        })
    }

    /// Counts the echoes of a sweep that are predicted from a pose within 3 cm.
    pub(crate) fn count(&self, sweep: &FitSweep, pose: &Pose) -> EchoCount {
        let echoes = self.ranges(sweep, pose).filter_map(|[measured_m, predicted_m]| {
            let measured_m = measured_m?;
            Some(predicted_m.is_some_and(|of| (of - measured_m).abs() < NEAR_M))
        });
        echoes.map(|is_near| EchoCount { near: usize::from(is_near), all: 1 }).sum()
    }

    /// Locates a sweep near a pose, within 6 cm and 8 degrees.
    pub(crate) fn locate_near(&self, sweep: &FitSweep, pose: &Pose) -> Pose {
        const SPAN: (f64, f64) = (0.06, 8.0);
        const STEPS: (i32, i32) = (3, 4);
        const LEVELS: [f64; 3] = [1.0, 0.35, 0.12];
        let mut best = *pose;
        for level in LEVELS {
            let center = best;
            let at = |of: i32, steps: i32| level * f64::from(of) / f64::from(steps);
            let places = (-STEPS.0..=STEPS.0)
                .flat_map(|x| (-STEPS.0..=STEPS.0).map(move |y| (x, y)))
                .flat_map(|(x, y)| (-STEPS.1..=STEPS.1).map(move |turn| (x, y, turn)));
            let poses: Vec<Pose> = places
                .map(|(x, y, turn)| Pose {
                    x_m: center.x_m + SPAN.0 * at(x, STEPS.0),
                    y_m: center.y_m + SPAN.0 * at(y, STEPS.0),
                    heading_deg: wrap_180(center.heading_deg + SPAN.1 * at(turn, STEPS.1)),
                })
                .collect();
            let found = poses
                .into_par_iter()
                .map(|pose| (self.log_likelihood(sweep, &pose), pose))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            best = found.map_or(best, |(_, pose)| pose);
        }
        best
    }

    /// Log-likelihood of a sweep, nats, but for a constant: ranges are normal or outliers.
    fn log_likelihood(&self, sweep: &FitSweep, pose: &Pose) -> f64 {
        const SIGMA_M: f64 = 0.012;
        /// Density of outliers relative to that of exact ranges, and probability of a wrong kind.
        const OUTLIER: f64 = 6e-4;
        const WRONG_KIND: f64 = 0.05;
        let of_beam = |ranges: [Option<f64>; 2]| match ranges {
            [Some(measured_m), Some(predicted_m)] => {
                let off = (measured_m - predicted_m) / SIGMA_M;
                ((-0.5 * off * off).exp() + OUTLIER).ln()
            }
            [Some(_), None] => OUTLIER.ln(),
            [None, Some(_)] => WRONG_KIND.ln(),
            [None, None] => 0.0,
        };
        self.ranges(sweep, pose).map(of_beam).sum()
    }

    /// Measured and predicted ranges from the axis, metres; `None` for no echo.
    fn ranges(&self, sweep: &FitSweep, pose: &Pose) -> impl Iterator<Item = [Option<f64>; 2]> {
        let point = self.simulator.at(pose.position());
        sweep.beams.iter().map(move |beam| {
            let predicted = point.ping(pose.direction_rad(beam.azimuth_deg)).ok();
            let echo = predicted.filter(|of| of.status == PingStatus::Echo);
            let measured_m = beam.range_m(self.sound_speed_m_s).map(|of| of + self.ahead_m);
            [measured_m, echo.and_then(|of| of.range_m)]
        })
    }
}
