//! Another pose, sensor or air than a log says.

use std::sync::Arc;

use super::{Failure, options::load_sensor};
use crate::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::Options,
    scan::{Ping, ScanStart, ScanView, Session},
    scene::parse_pose,
};

/// What to suppose in place of what the log says.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "What if")]
pub(super) struct WhatIfArgs {
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene;
    /// assumed for all scans, and only X,Y,DEG here
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// Assume this heading, degrees counter-clockwise from the x axis
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with = "pose")]
    heading: Option<f64>,
    #[command(flatten)]
    instead: InsteadArgs,
}

/// What to suppose in place of the sensor and the air that the log says.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "What if")]
pub(super) struct InsteadArgs {
    /// Sensor preset (`sonard sensor list`), or a file with a sensor's data; assumed instead of the log's
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,
    /// Air temperature, degrees Celsius; assumed: measured ranges change with the speed of sound
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    temperature_c: Option<f64>,
    /// Relative humidity, percent; assumed instead of the log's
    #[arg(long, value_name = "PERCENT")]
    humidity_percent: Option<f64>,
    /// Static pressure, kilopascals; assumed instead of the log's
    #[arg(long, value_name = "KPA")]
    pressure_kpa: Option<f64>,
    /// Speed of sound, metres a second; assumed instead of the log's
    #[arg(long, value_name = "M/S")]
    sound_speed: Option<f64>,
}

/// The same, checked and read.
#[derive(Debug, Clone, Default)]
pub(super) struct WhatIf {
    pose: Option<Pose>,
    heading_deg: Option<f64>,
    sensor: Option<Sensor>,
    temperature_c: Option<f64>,
    humidity_percent: Option<f64>,
    pressure_kpa: Option<f64>,
    sound_speed_m_s: Option<f64>,
    /// The model to predict with.
    options: Option<Options>,
}

impl WhatIfArgs {
    /// Reads what is named.
    ///
    /// # Errors
    /// No such sensor, or figures that make no sense.
    pub(super) fn load(&self) -> Result<WhatIf, Failure> {
        let pose = match &self.pose {
            Some(pose) => {
                Some(parse_pose(pose).map_err(|error| Failure::input(&error, error.help()))?)
            }
            None => None,
        };
        Ok(WhatIf { pose, heading_deg: self.heading, ..self.instead.load()? })
    }
}

impl InsteadArgs {
    /// Reads what is named.
    ///
    /// # Errors
    /// No such sensor, or figures that make no sense.
    pub(super) fn load(&self) -> Result<WhatIf, Failure> {
        let what_if = WhatIf {
            sensor: self.sensor.as_deref().map(load_sensor).transpose()?,
            temperature_c: self.temperature_c,
            humidity_percent: self.humidity_percent,
            pressure_kpa: self.pressure_kpa,
            sound_speed_m_s: self.sound_speed,
            ..WhatIf::default()
        };
        // Said now rather than at the first scan.
        what_if.air(&Air::default())?;
        Ok(what_if)
    }
}

impl WhatIf {
    /// The same, predicted by a model of one's own choice.
    pub(super) fn with_options(self, options: Options) -> Self {
        Self { options: Some(options), ..self }
    }

    /// Whether nothing else is supposed than what the log says.
    pub(super) const fn is_nothing(&self) -> bool {
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
        .map_err(|error| Failure::input(error, "give air that there is"))
    }

    /// Puts sensor, air and model into a session.
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

    /// Puts the pose and the air into a scan's start.
    pub(super) fn change_start(&self, start: &mut ScanStart) {
        start.pose = self.posed(start.pose);
        if self.has_air() {
            start.air = None;
        }
    }

    fn posed(&self, logged: Pose) -> Pose {
        let pose = self.pose.unwrap_or(logged);
        Pose { heading_deg: self.heading_deg.unwrap_or(pose.heading_deg), ..pose }
    }

    /// Takes a reading for one of the supposed pose, and computes its range again for the supposed air of its
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

/// Takes scans for what they are supposed to be; those of a session get one supposed session.
pub(super) struct Supposer<'a> {
    what_if: &'a WhatIf,
    /// The session of the scan before, and what it would be.
    known: Option<(Arc<Session>, Arc<Session>)>,
}

impl<'a> Supposer<'a> {
    pub(super) const fn new(what_if: &'a WhatIf) -> Self {
        Self { what_if, known: None }
    }

    pub(super) fn suppose(&mut self, scan: &mut ScanView) {
        if self.what_if.is_nothing() {
            return;
        }
        if let Some(session) = &scan.session {
            let known = self.known.take().filter(|(of, _)| Arc::ptr_eq(of, session));
            let (_, supposed) = self.known.insert(known.unwrap_or_else(|| {
                let mut supposed = Session::clone(session);
                self.what_if.change_session(&mut supposed);
                (Arc::clone(session), Arc::new(supposed))
            }));
            for ping in &mut scan.pings {
                self.what_if.change_ping(ping, supposed);
            }
            scan.session = Some(Arc::clone(supposed));
        }
        if let Some(start) = &mut scan.start {
            self.what_if.change_start(start);
        }
    }
}
