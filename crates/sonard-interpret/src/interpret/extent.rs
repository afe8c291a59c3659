//! Angular extents of the arcs of planes, corners and edges.

use std::f64::consts::FRAC_PI_2;

use thiserror::Error;

use sonard_model::acoustics::{Air, AirError, BeamPattern, Sensor, SensorError, edge::bozma_kuc};
use sonard_records::Session;

/// Angular extents that a sensor produces for planes, corners and edges (Bozma and Kuc, equations
/// (7) and (15) to (17)).
///
/// The paper's sensor has a Gaussian beam and a gain that compensates absorption. Here the beam is
/// the sensor's own pattern, and uncompensated absorption is included. With the preset
/// `bozma-kuc-60khz` and no absorption the values are those of the paper.
#[derive(Debug, Clone)]
pub struct Extents {
    beam: BeamPattern,
    threshold: f64,
    far_field_m: f64,
    half_width_m: f64,
    half_beam_rad: f64,
    absorption_db_per_m: f64,
    threshold_rise_db_per_m: f64,
    /// Range at the end of blanking, metres.
    pub min_range_m: f64,
    /// Maximum range, metres.
    pub max_range_m: f64,
}

/// Invalid sensor or air data of a session.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ExtentError {
    /// Invalid sensor data.
    #[error("sensor: {0}")]
    Sensor(#[from] SensorError),
    /// Invalid air data.
    #[error("air: {0}")]
    Air(#[from] AirError),
}

impl Extents {
    /// Extents for a sensor in given air; `compensated` assumes that absorption is compensated
    /// even if the sensor's gain does not.
    ///
    /// # Errors
    /// Invalid sensor data.
    pub fn new(sensor: &Sensor, air: &Air, compensated: bool) -> Result<Self, ExtentError> {
        sensor.check()?;
        let speed_m_s = air.sound_speed_m_s();
        let wavelength_m = speed_m_s / sensor.frequency_hz;
        let half_width_m = sensor.half_width_m();
        let absorption = if compensated || sensor.gain.compensates_absorption() {
            0.0
        } else {
            air.absorption_db_per_m(sensor.frequency_hz)
        };
        Ok(Self {
            beam: BeamPattern::new(sensor, speed_m_s),
            threshold: sensor.threshold,
            far_field_m: half_width_m.powi(2) / wavelength_m,
            half_width_m,
            half_beam_rad: (0.61 * wavelength_m / half_width_m).min(1.0).asin(),
            absorption_db_per_m: absorption,
            threshold_rise_db_per_m: sensor.threshold_rise_db_per_m,
            min_range_m: speed_m_s * sensor.blanking_us * 1e-6 / 2.0,
            max_range_m: sensor.max_range_m,
        })
    }

    /// Extents for the sensor and air of a logged session, with the threshold and losslessness of
    /// the model where the session has them (a simulated log is all model).
    ///
    /// # Errors
    /// Invalid sensor or air data.
    pub fn from_session(session: &Session) -> Result<Self, ExtentError> {
        let setting =
            |name: &str| session.model.as_ref().and_then(|model| model.settings.get(name));
        let number = |name: &str| setting(name).and_then(serde_json::Value::as_f64);
        let lossless = setting("lossless").and_then(serde_json::Value::as_bool).unwrap_or(false);
        let mut sensor = session.sensor.clone();
        sensor.threshold = number("threshold").unwrap_or(sensor.threshold);
        sensor.blanking_us = number("blanking_us").unwrap_or(sensor.blanking_us);
        sensor.max_range_m = number("max_range_m").unwrap_or(sensor.max_range_m);
        Self::new(&sensor, &Air::try_from(&session.air)?, lossless)
    }

    /// Extent of a plane or corner of the given reflectance at a range, degrees (15).
    #[must_use]
    pub fn plane_corner_deg(&self, range_m: f64, reflectance: f64) -> f64 {
        self.extent_at_level_deg(self.relative_level(range_m, reflectance))
    }

    /// Extent of an edge of scattering strength `sigma_e` at a range, degrees; 0 where it is not
    /// detected (16).
    #[must_use]
    pub fn edge_deg(&self, range_m: f64, sigma_e: f64) -> f64 {
        self.extent_at_level_deg(self.relative_level(range_m, self.edge_level(range_m, sigma_e)))
    }

    /// Echo amplitude of an edge relative to a perfect wall (5).
    pub(super) fn edge_level(&self, range_m: f64, sigma_e: f64) -> f64 {
        bozma_kuc(range_m, sigma_e, self.far_field_m)
    }

    /// Minimum detectable echo amplitude at a range, relative to a perfect wall.
    pub(super) fn min_detected(&self, range_m: f64) -> f64 {
        self.threshold / self.relative_level(range_m, 1.0)
    }

    /// Boundary between the extents of edges and those of planes and corners, degrees (17).
    #[must_use]
    pub fn boundary_deg(&self, range_m: f64, sigma_e: f64) -> f64 {
        (self.edge_deg(range_m, sigma_e) + self.plane_corner_deg(range_m, 1.0)) / 2.0
    }

    /// Maximum range at which an edge is detected without absorption, metres (7).
    #[must_use]
    pub fn edge_max_range_m(&self, sigma_e: f64) -> f64 {
        (sigma_e / self.threshold).powi(2) * self.far_field_m
    }

    /// Largest step that separates edges from planes and corners without error, degrees (20).
    #[must_use]
    pub fn largest_step_deg(&self, range_m: f64, sigma_e: f64) -> f64 {
        (self.plane_corner_deg(range_m, 1.0) - self.edge_deg(range_m, sigma_e)) / 2.0
    }

    /// Standard deviation of a border of an arc of this extent, degrees, for amplitude noise of
    /// standard deviation `noise` relative to a head-on perfect wall: the noise divided by the
    /// slope of the amplitude at the threshold crossing.
    #[must_use]
    pub fn border_sigma_deg(&self, extent_deg: f64, noise: f64) -> f64 {
        let half_rad = (extent_deg / 2.0).to_radians();
        if noise <= 0.0 || half_rad <= 0.0 {
            return 0.0;
        }
        let step_rad = 1e-3_f64.min(half_rad / 2.0);
        let log_at = |theta: f64| 2.0 * self.beam.one_way(theta).max(f64::MIN_POSITIVE).ln();
        let slope = (log_at(half_rad - step_rad) - log_at(half_rad + step_rad)) / (2.0 * step_rad);
        let sigma_rad = noise / self.threshold / slope.max(f64::MIN_POSITIVE);
        // The error of a border is limited by the width of the arc.
        sigma_rad.min(half_rad).to_degrees()
    }

    /// Beam pattern of the sensor.
    #[must_use]
    pub const fn beam(&self) -> &BeamPattern {
        &self.beam
    }

    /// Half width of the transducer's face, metres.
    #[must_use]
    pub const fn half_width_m(&self) -> f64 {
        self.half_width_m
    }

    /// Half beam angle `theta_o = asin(0.61 lambda / a)`, degrees (2).
    #[must_use]
    pub fn half_beam_deg(&self) -> f64 {
        self.half_beam_rad.to_degrees()
    }

    /// Start of the far field `a^2 / lambda`, metres.
    #[must_use]
    pub const fn far_field_m(&self) -> f64 {
        self.far_field_m
    }

    /// Amplitude `level` (relative to a perfect wall) reduced by absorption and by the rise of the
    /// threshold over a range, for comparison with the threshold at zero range.
    fn relative_level(&self, range_m: f64, level: f64) -> f64 {
        let loss_db_per_m = 2.0 * self.absorption_db_per_m + self.threshold_rise_db_per_m;
        level * 10_f64.powf(-loss_db_per_m * range_m / 20.0)
    }

    /// Extent within which the two-way beam pattern keeps `level` above the threshold, degrees.
    fn extent_at_level_deg(&self, level: f64) -> f64 {
        if level <= self.threshold || !level.is_finite() {
            return 0.0;
        }
        let half_rad = self.beam.angle_at((self.threshold / level).sqrt());
        2.0 * half_rad.min(FRAC_PI_2).to_degrees()
    }
}
