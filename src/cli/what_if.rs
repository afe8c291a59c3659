//! Assumed pose, sensor or air, instead of the log's.

use std::sync::Arc;

use super::{Failure, options::load_sensor};
use crate::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::Options,
    scan::{Ping, ScanStart, ScanView, Session},
    scene::{PoseError, Scene, parse_pose},
};

/// Options that override values of the log.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "What if")]
pub(super) struct WhatIfArgs {
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene given by
    /// --scene; assumed for all scans
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// Assumed heading, degrees counter-clockwise from the x axis
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with = "pose")]
    heading: Option<f64>,
    #[command(flatten)]
    instead: InsteadArgs,
}

/// Options that override sensor and air of the log.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "What if")]
pub(super) struct InsteadArgs {
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data; assumed instead of the
    /// log's
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,
    /// Air temperature, degrees Celsius; assumed instead of the log's, and measured ranges change
    /// with the speed of sound
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    temperature_c: Option<f64>,
    /// Relative humidity, percent; assumed instead of the log's
    #[arg(long, value_name = "PERCENT")]
    humidity_percent: Option<f64>,
    /// Static pressure, kilopascals; assumed instead of the log's
    #[arg(long, value_name = "KPA")]
    pressure_kpa: Option<f64>,
    /// Speed of sound, metres per second; assumed instead of the log's
    #[arg(long, value_name = "M/S")]
    sound_speed: Option<f64>,
}

#[derive(Debug, Clone, Default)]
pub(super) struct WhatIf {
    pose: Option<Pose>,
    heading_deg: Option<f64>,
    sensor: Option<Sensor>,
    temperature_c: Option<f64>,
    humidity_percent: Option<f64>,
    pressure_kpa: Option<f64>,
    sound_speed_m_s: Option<f64>,
    /// Model used for predictions.
    options: Option<Options>,
}

impl WhatIfArgs {
    /// Loads and validates the assumptions.
    ///
    /// # Errors
    ///
    /// Unknown sensor or pose, or invalid values.
    pub(super) fn load(&self, scene: Option<&Scene>) -> Result<WhatIf, Failure> {
        let parse = |pose: &String| match scene {
            Some(scene) => scene.pose(pose),
            None => parse_pose(pose),
        };
        let pose = self.pose.as_ref().map(parse).transpose();
        let pose = pose.map_err(|error| {
            let names = matches!(error, PoseError::Malformed(_)) && scene.is_none();
            let without = "give X,Y,DEG (metres, degrees), or --scene for the names of its poses";
            let help = if names { without.to_owned() } else { error.help() };
            Failure::input(&error, help)
        })?;
        Ok(WhatIf { pose, heading_deg: self.heading, ..self.instead.load()? })
    }
}

impl InsteadArgs {
    /// Loads and validates the assumptions.
    ///
    /// # Errors
    ///
    /// Unknown sensor, or invalid values.
    pub(super) fn load(&self) -> Result<WhatIf, Failure> {
        let what_if = WhatIf {
            sensor: self.sensor.as_deref().map(load_sensor).transpose()?,
            temperature_c: self.temperature_c,
            humidity_percent: self.humidity_percent,
            pressure_kpa: self.pressure_kpa,
            sound_speed_m_s: self.sound_speed,
            ..WhatIf::default()
        };
        // Invalid air is rejected now rather than at the first scan.
        what_if.air(&Air::default())?;
        Ok(what_if)
    }
}

impl WhatIf {
    /// Sets the model used for predictions.
    pub(super) fn with_options(self, options: Options) -> Self {
        Self { options: Some(options), ..self }
    }

    /// Returns `true` if nothing differs from the log.
    pub(super) const fn is_empty(&self) -> bool {
        self.pose.is_none()
            && self.heading_deg.is_none()
            && self.sensor.is_none()
            && self.options.is_none()
            && !self.has_air()
    }

    const fn has_air(&self) -> bool {
        self.temperature_c.is_some()
            || self.humidity_percent.is_some()
            || self.pressure_kpa.is_some()
            || self.sound_speed_m_s.is_some()
    }

    fn air(&self, logged: &Air) -> Result<Air, Failure> {
        let air = Air::new(
            self.temperature_c.unwrap_or(logged.temperature_c()),
            self.humidity_percent.unwrap_or(logged.humidity_percent()),
            self.pressure_kpa.unwrap_or(logged.pressure_kpa()),
        );
        air.and_then(|air| {
            self.sound_speed_m_s.map_or(Ok(air), |speed| air.with_sound_speed(speed))
        })
        .map_err(|error| Failure::input(error, "give plausible properties of air"))
    }

    /// Replaces sensor, air and model of a session.
    pub(super) fn change_session(&self, session: &mut Session) {
        if let Some(sensor) = &self.sensor {
            session.sensor = sensor.clone();
        }
        if let Some(options) = &self.options {
            session.model = Some(options.into());
        }
        if self.has_air()
            && let Some(air) = Air::try_from(&session.air).ok().and_then(|air| self.air(&air).ok())
        {
            session.air = (&air).into();
        }
    }

    /// Replaces pose and air of a scan's start.
    pub(super) fn change_start(&self, start: &mut ScanStart) {
        start.pose = self.assumed_pose(start.pose);
        if self.has_air() {
            start.air = None;
        }
    }

    fn assumed_pose(&self, logged: Pose) -> Pose {
        let pose = self.pose.unwrap_or(logged);
        Pose { heading_deg: self.heading_deg.unwrap_or(pose.heading_deg), ..pose }
    }

    /// Adapts a reading to the assumed pose, and recomputes its range for the assumed air of its
    /// session.
    fn change_ping(&self, ping: &mut Ping, session: &Session) {
        if self.pose.is_some() {
            ping.pose = None;
        }
        if self.has_air()
            && ping.status.has_range()
            && let Some(tof_us) = ping.tof_us
        {
            ping.range_m = Some(tof_us * 1e-6 * session.air.sound_speed_m_s / 2.0);
        }
    }
}

/// Applies assumptions to scans; scans of one session share the modified session.
pub(super) struct AssumptionFilter<'a> {
    what_if: &'a WhatIf,
    /// Session of the previous scan, and its modified copy.
    known: Option<(Arc<Session>, Arc<Session>)>,
}

impl<'a> AssumptionFilter<'a> {
    pub(super) const fn new(what_if: &'a WhatIf) -> Self {
        Self { what_if, known: None }
    }

    pub(super) fn apply(&mut self, scan: &mut ScanView) {
        if self.what_if.is_empty() {
            return;
        }
        if let Some(session) = &scan.session {
            let known = self.known.take().filter(|(of, _)| Arc::ptr_eq(of, session));
            let (_, assumed) = self.known.insert(known.unwrap_or_else(|| {
                let mut assumed = Session::clone(session);
                self.what_if.change_session(&mut assumed);
                (Arc::clone(session), Arc::new(assumed))
            }));
            for ping in &mut scan.pings {
                self.what_if.change_ping(ping, assumed);
            }
            scan.session = Some(Arc::clone(assumed));
        }
        if let Some(start) = &mut scan.start {
            self.what_if.change_start(start);
        }
    }
}
