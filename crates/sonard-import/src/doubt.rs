//! Signs that numbers are not what the mapping says they are.

use crate::{ImportError, Mapping, Quantity, Reading};

/// What is looked at, over all readings of a file.
#[derive(Debug, Default)]
pub(crate) struct Doubts {
    pub(crate) readings: u64,
    /// Of directions, degrees.
    low_deg: f64,
    high_deg: f64,
    whole_degrees: bool,
    pub(crate) echoes: u64,
    /// Ranges beyond what the sensor can hear, and where the first of them stands.
    far: u64,
    first_far: Option<(crate::Location, f64)>,
    /// Ranges below a tenth of its least.
    near: u64,
}

impl Doubts {
    pub(crate) fn new() -> Self {
        Self {
            low_deg: f64::INFINITY,
            high_deg: f64::NEG_INFINITY,
            whole_degrees: true,
            ..Self::default()
        }
    }

    /// Takes in a reading by a sensor that hears so far, metres.
    pub(crate) fn add(&mut self, reading: &Reading, zero_deg: f64, longest_m: f64) {
        self.readings += 1;
        let file_deg = (reading.direction_deg - zero_deg).abs();
        self.low_deg = self.low_deg.min(file_deg);
        self.high_deg = self.high_deg.max(file_deg);
        self.whole_degrees &= (file_deg - file_deg.round()).abs() < 1e-9;
        let Some(range_m) = reading.range_m else { return };
        self.echoes += 1;
        if range_m > FAR * longest_m {
            self.far += 1;
            self.first_far = self.first_far.or(Some((reading.place, range_m)));
        }
        self.near += u64::from(range_m < NEAR_M);
    }

    /// What speaks against the mapping, if anything.
    pub(crate) fn check(&self, mapping: &Mapping, longest_m: f64) -> Result<(), ImportError> {
        if self.readings == 0 {
            return Err(ImportError::mapping(
                "there is no reading in it",
                "give a file with readings",
            ));
        }
        self.check_angles(mapping)?;
        self.check_ranges(mapping, longest_m)
    }

    fn check_angles(&self, mapping: &Mapping) -> Result<(), ImportError> {
        let field = mapping.field(Quantity::Azimuth).or_else(|| mapping.field(Quantity::Bearing));
        let Some(field) = field.filter(|_| self.readings >= FEW) else { return Ok(()) };
        let (low, high, words) = (self.low_deg, self.high_deg, field.quantity().words());
        if field.is_radians() && high > 4.0 * 360.0 {
            return Err(ImportError::Doubtful {
                what: format!(
                    "{field} goes to {:.1} rad, {:.0} turns",
                    high.to_radians(),
                    high / 360.0
                ),
                help: format!("if these are degrees, name the column {words}_deg"),
            });
        }
        // A full turn in radians, taken for degrees, with angles that are no whole degrees.
        let is_turn = (5.5..6.3).contains(&high) && low < 0.5 && !self.whole_degrees;
        if !field.is_radians() && is_turn {
            return Err(ImportError::Doubtful {
                what: format!("{field} goes from {low:.3} to {high:.3}, as radians would"),
                help: format!("name the column {words}_rad, or --as-said if these are degrees"),
            });
        }
        Ok(())
    }

    fn check_ranges(&self, mapping: &Mapping, longest_m: f64) -> Result<(), ImportError> {
        let field = mapping.field(Quantity::Range).or_else(|| mapping.field(Quantity::Tof));
        let Some(field) = field else { return Ok(()) };
        if let Some((place, range_m)) = self.first_far {
            let (far, echoes) = (self.far, self.echoes);
            let all = if far == echoes { "all".to_owned() } else { far.to_string() };
            return Err(ImportError::Doubtful {
                what: format!(
                    "{all} of {echoes} ranges are beyond {:.1} m, which the sensor can't hear \
                     (first at {place}: {range_m:.2} m by {field})",
                    FAR * longest_m
                ),
                help: if far == echoes {
                    "is the unit right? range_mm, range_cm, range_m, range_in, range_ft; --as-said takes \
                     them all the same"
                } else {
                    "mixed units? Or do these stand for silence: --none=VALUE or --none-from=VALUE; --as-said \
                     takes them all the same"
                }
                .to_owned(),
            });
        }
        if self.near > 0 && 2 * self.near >= self.echoes {
            return Err(ImportError::Doubtful {
                what: format!(
                    "{} of {} ranges are below {:.0} mm by {field}",
                    self.near,
                    self.echoes,
                    1e3 * NEAR_M
                ),
                help: "is the unit right? range_mm, range_cm, range_m, range_in, range_ft; --as-said takes \
                       them all the same"
                    .to_owned(),
            });
        }
        Ok(())
    }
}

/// Ranges of so many times the sensor's longest are none.
const FAR: f64 = 2.0;
/// No ranger of this kind measures less, metres.
const NEAR_M: f64 = 0.01;
/// So many readings tell something of their angles.
const FEW: u64 = 20;
