//! Air: speed of sound and absorption from temperature, humidity and pressure.

use thiserror::Error;

/// Assumed mole fraction of carbon dioxide.
const CARBON_DIOXIDE: f64 = 0.0004;
const ZERO_CELSIUS_K: f64 = 273.15;

/// Temperature range of the formulas, degrees Celsius.
const TEMPERATURES_C: (f64, f64) = (-20.0, 50.0);

/// State of the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    temperature_c: f64,
    humidity_percent: f64,
    pressure_kpa: f64,
    sound_speed_override_m_s: Option<f64>,
}

/// State of the air outside the range of the formulas.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{field} is {value}: it must be from {min} to {max}")]
pub struct AirError {
    /// Name of the rejected quantity.
    pub field: &'static str,
    /// Value outside the range.
    pub value: f64,
    /// Lower end of the allowed range.
    pub min: f64,
    /// Upper end of the allowed range.
    pub max: f64,
}

impl Default for Air {
    /// Returns air at 20 degrees Celsius, 50 percent and one standard atmosphere.
    fn default() -> Self {
        Self {
            temperature_c: 20.0,
            humidity_percent: 50.0,
            pressure_kpa: 101.325,
            sound_speed_override_m_s: None,
        }
    }
}

impl Air {
    /// Creates air from temperature (degrees Celsius, -20 to 50), relative humidity (percent, 0 to
    /// 100) and static pressure (kilopascals, 60 to 110).
    ///
    /// Cramer states his fit for 0 to 30 degrees and 75 to 102 kPa; ISO 9613-1 covers -20 to 50
    /// degrees. Outside Cramer's range the speed of sound is an extrapolation.
    ///
    /// # Errors
    /// If an argument is out of range or not a number.
    pub fn new(
        temperature_c: f64,
        humidity_percent: f64,
        pressure_kpa: f64,
    ) -> Result<Self, AirError> {
        check("temperature_c", temperature_c, TEMPERATURES_C.0, TEMPERATURES_C.1)?;
        check("humidity_percent", humidity_percent, 0.0, 100.0)?;
        check("pressure_kpa", pressure_kpa, 60.0, 110.0)?;
        Ok(Self { temperature_c, humidity_percent, pressure_kpa, sound_speed_override_m_s: None })
    }

    /// Replaces the computed speed of sound by a given one (m/s, 200 to 500). Absorption still
    /// follows from the state of the air.
    ///
    /// # Errors
    /// If the speed is out of range or not a number.
    pub fn with_sound_speed(self, sound_speed_m_s: f64) -> Result<Self, AirError> {
        check("sound_speed_m_s", sound_speed_m_s, 200.0, 500.0)?;
        Ok(Self { sound_speed_override_m_s: Some(sound_speed_m_s), ..self })
    }

    /// Sets the temperature at which the air has this speed of sound (m/s), at unchanged humidity
    /// and pressure, so that absorption follows. Air with a given speed of sound keeps its
    /// temperature. A temperature outside the range of [`Air::new`] is clamped and the speed is set
    /// as given.
    ///
    /// # Errors
    /// If the speed is out of range (200 to 500) or not a number.
    pub fn with_temperature_for_sound_speed(self, sound_speed_m_s: f64) -> Result<Self, AirError> {
        let given = self.with_sound_speed(sound_speed_m_s)?;
        if self.sound_speed_override_m_s.is_some() {
            return Ok(given);
        }
        let is_colder =
            |temperature_c: f64| Self { temperature_c, ..self }.sound_speed_m_s() < sound_speed_m_s;
        let (mut low_c, mut high_c) = TEMPERATURES_C;
        if !is_colder(low_c) {
            return Ok(Self { temperature_c: low_c, ..given });
        }
        if is_colder(high_c) {
            return Ok(Self { temperature_c: high_c, ..given });
        }
        // Invariant: the speed, which increases with temperature, is reached between the two.
        // Bisection to machine precision.
        for _ in 0..f64::MANTISSA_DIGITS {
            let middle_c = 0.5 * (low_c + high_c);
            *(if is_colder(middle_c) { &mut low_c } else { &mut high_c }) = middle_c;
        }
        Ok(Self { temperature_c: high_c, ..self })
    }

    /// Temperature of the air, degrees Celsius.
    #[must_use]
    pub const fn temperature_c(&self) -> f64 {
        self.temperature_c
    }

    /// Relative humidity of the air, percent.
    #[must_use]
    pub const fn humidity_percent(&self) -> f64 {
        self.humidity_percent
    }

    /// Static pressure of the air, kilopascals.
    #[must_use]
    pub const fn pressure_kpa(&self) -> f64 {
        self.pressure_kpa
    }

    /// Speed of sound, m/s: the given value or Cramer's equation.
    #[must_use]
    pub fn sound_speed_m_s(&self) -> f64 {
        self.sound_speed_override_m_s.unwrap_or_else(|| {
            cramer_m_s(self.temperature_c, self.humidity_percent / 100.0, self.pressure_kpa * 1e3)
        })
    }

    /// Pure-tone absorption, dB/m, at a frequency in hertz.
    ///
    /// ISO 9613-1:1993, equations (3) to (5) and annex B; stated accuracy 10 percent for -20 to
    /// 50 degrees Celsius and frequency over pressure up to 10 MHz/atm at usual humidities.
    #[must_use]
    pub fn absorption_db_per_m(&self, frequency_hz: f64) -> f64 {
        let pressure = self.pressure_kpa / 101.325;
        let temperature_k = self.temperature_c + ZERO_CELSIUS_K;
        let relative_k = temperature_k / 293.15;
        let saturation = 10f64.powf(-6.8346 * (273.16 / temperature_k).powf(1.261) + 4.6151);
        let vapour_percent = self.humidity_percent * saturation / pressure;
        let oxygen_hz = pressure
            * (24.0 + 4.04e4 * vapour_percent * (0.02 + vapour_percent) / (0.391 + vapour_percent));
        let nitrogen_hz = pressure / relative_k.sqrt()
            * (9.0 + 280.0 * vapour_percent * (-4.170 * (relative_k.powf(-1.0 / 3.0) - 1.0)).exp());
        let square = frequency_hz * frequency_hz;
        let classical = 1.84e-11 / pressure * relative_k.sqrt();
        let relaxation = 0.01275 * (-2239.1 / temperature_k).exp()
            / (oxygen_hz + square / oxygen_hz)
            + 0.1068 * (-3352.0 / temperature_k).exp() / (nitrogen_hz + square / nitrogen_hz);
        8.686 * square * (classical + relaxation * relative_k.powf(-2.5))
    }
}

fn check(field: &'static str, value: f64, min: f64, max: f64) -> Result<(), AirError> {
    if (min..=max).contains(&value) { Ok(()) } else { Err(AirError { field, value, min, max }) }
}

/// Speed of sound, m/s, for a temperature in degrees Celsius, a relative humidity from 0 to 1 and a
/// pressure in pascals.
///
/// Cramer, "The variation of the specific heat ratio and the speed of sound in air with
/// temperature, pressure, humidity, and CO2 concentration", JASA 93 (1993), equation (15), with
/// the saturation pressure of Giacomo (1981).
fn cramer_m_s(t: f64, humidity: f64, p: f64) -> f64 {
    let kelvin = t + ZERO_CELSIUS_K;
    let enhancement = 1.00062 + 3.14e-8 * p + 5.6e-7 * t * t;
    let saturation = (1.2811805e-5 * kelvin * kelvin - 1.9509874e-2 * kelvin + 34.04926034
        - 6.3536311e3 / kelvin)
        .exp();
    let water = humidity * enhancement * saturation / p;
    let dioxide = CARBON_DIOXIDE;
    331.5024 + 0.603055 * t - 0.000528 * t * t
        + (51.471935 + 0.1495874 * t - 0.000782 * t * t) * water
        + (-1.82e-7 + 3.73e-8 * t - 2.93e-10 * t * t) * p
        + (-85.20931 - 0.228525 * t + 5.91e-5 * t * t) * dioxide
        - 2.835149 * water * water
        - 2.15e-13 * p * p
        + 29.179762 * dioxide * dioxide
        + 0.000486 * water * p * dioxide
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dry_to_moist_matches_cramer() {
        for (humidity_percent, expected) in [(0.0, 343.36), (50.0, 343.99), (100.0, 344.61)] {
            let air = Air::new(20.0, humidity_percent, 101.325).expect("in range");
            assert!((air.sound_speed_m_s() - expected).abs() < 0.005, "{humidity_percent} %");
        }
    }

    /// Equation (15) evaluated independently of this code, for saturated air. At 30 degrees and
    /// 101.325 kPa the saturation pressure is 4,245.19 Pa and the enhancement factor 1.0043056, so
    /// the mole fraction of water is 4.2077 %; at 50 degrees it is 11.284 and 20.655 %.
    #[test]
    fn saturated_air_matches_equation_15() {
        for (temperature_c, pressure_kpa, expected) in
            [(30.0, 101.325, 351.46888), (50.0, 110.0, 366.79618), (50.0, 60.0, 372.00668)]
        {
            let air = Air::new(temperature_c, 100.0, pressure_kpa).expect("in range");
            let speed_m_s = air.sound_speed_m_s();
            assert!((speed_m_s - expected).abs() < 1e-4, "{temperature_c} C: {speed_m_s}");
        }
    }

    #[test]
    fn temperature_from_sound_speed() {
        for (humidity_percent, pressure_kpa) in [(0.0, 110.0), (50.0, 101.325), (100.0, 60.0)] {
            for temperature_c in [-19.0, 3.0, 20.0, 49.0] {
                let expected = Air::new(temperature_c, humidity_percent, pressure_kpa);
                let expected = expected.expect("in range");
                let air = Air::new(20.0, humidity_percent, pressure_kpa).expect("in range");
                let speed_m_s = expected.sound_speed_m_s();
                let warmed = air.with_temperature_for_sound_speed(speed_m_s).expect("in range");
                assert!((warmed.temperature_c() - temperature_c).abs() < 1e-9, "{warmed:?}");
                assert!((warmed.sound_speed_m_s() - speed_m_s).abs() < 1e-10, "{warmed:?}");
            }
        }
        for (speed_m_s, temperature_c) in [(250.0, -20.0), (450.0, 50.0)] {
            let air = Air::default().with_temperature_for_sound_speed(speed_m_s).expect("in range");
            assert_eq!((air.sound_speed_m_s(), air.temperature_c()), (speed_m_s, temperature_c));
        }
        let given = Air::default().with_sound_speed(340.0).expect("in range");
        let other = given.with_temperature_for_sound_speed(341.0).expect("in range");
        assert_eq!((other.sound_speed_m_s(), other.temperature_c()), (341.0, 20.0));
        assert!(given.with_temperature_for_sound_speed(f64::NAN).is_err());
    }

    #[test]
    fn absorption_matches_iso_9613() {
        for (frequency_hz, expected) in [(49.4e3, 1.641), (50e3, 1.661), (60e3, 1.980)] {
            let absorption = Air::default().absorption_db_per_m(frequency_hz);
            assert!((absorption - expected).abs() < 5e-4, "{frequency_hz} Hz: {absorption}");
        }
    }

    #[test]
    fn rejects_values_out_of_range() {
        for (air, field) in [
            (Air::new(51.0, 50.0, 101.0), "temperature_c"),
            (Air::new(20.0, f64::NAN, 101.0), "humidity_percent"),
            (Air::new(20.0, 50.0, 101_325.0), "pressure_kpa"),
            (Air::default().with_sound_speed(0.0), "sound_speed_m_s"),
        ] {
            assert_eq!(air.map_err(|error| error.field), Err(field));
        }
    }

    #[test]
    fn keeps_its_parameters() {
        let air = Air::new(-7.5, 35.0, 98.2).expect("in range");
        let parameters = [air.temperature_c(), air.humidity_percent(), air.pressure_kpa()];
        assert_eq!(parameters, [-7.5, 35.0, 98.2]);
        let slower = air.with_sound_speed(300.0).expect("in range");
        assert_eq!((slower.sound_speed_m_s(), slower.pressure_kpa()), (300.0, 98.2));
    }
}
