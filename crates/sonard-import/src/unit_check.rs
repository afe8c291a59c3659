//! Plausibility checks of units, angles, positions and no-echo values of a file.

mod angles;
mod echo_positions;
mod order;
mod sweep;

use angles::AngleStats;
pub(crate) use sweep::SweepStats;

use crate::{
    Assumptions, Field, FieldQuantity, FileLocation, ImportError, Mapping,
    mapping::RangeUnit,
    no_echo_constant::{DirectionKind, RangeHistogram},
};

/// Multiple of the sensor's maximum range beyond which a range is implausible.
const FAR: f64 = 2.0;
/// Minimum plausible range for any sensor, metres: robots do not operate closer to walls.
const MIN_NEAR_M: f64 = 0.04;
/// Multiple of the sensor's maximum range beyond which most ranges are implausible.
const BEYOND: f64 = 1.05;
/// Minimum number of such ranges.
const MIN_BEYOND: u64 = 3;

/// Mapping and column names, from which messages build the option that resolves an implausible
/// value.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UnitContext<'a> {
    pub(crate) mapping: &'a Mapping,
    /// Names of all columns.
    pub(crate) names: &'a [String],
    /// True if fields give the units of columns; false for formats that specify metres.
    pub(crate) has_columns: bool,
    /// True if drivers of the format write 0 for no echo.
    pub(crate) zero_is_no_echo: bool,
}

impl UnitContext<'_> {
    fn field(&self) -> Option<Field> {
        let field = |quantity| self.mapping.field(quantity);
        field(FieldQuantity::Range)
            .or_else(|| field(FieldQuantity::Tof))
            .filter(|_| self.has_columns)
    }

    /// Returns the length in metres of one unit of the file's ranges.
    fn metres(&self, sound_speed_m_s: f64) -> f64 {
        let metres = |field| metres_per_unit(field, sound_speed_m_s);
        self.field().map_or_else(|| self.mapping.metres(), metres)
    }

    /// Returns the options for units with which the median range is measurable and the 98th
    /// percentile is plausible.
    fn unit_options(&self, ranges: &RangeStats, assumptions: &Assumptions) -> Vec<String> {
        let [median, high] =
            [0.5, 0.98].map(|share| ranges.histogram.quantile(share).unwrap_or(0.0));
        let near_m = near_m(assumptions);
        let fits = |metres: f64| {
            (near_m..=assumptions.max_range_m).contains(&(median * metres))
                && high * metres <= FAR * assumptions.max_range_m
        };
        if !self.has_columns {
            let fitting = RangeUnit::ALL.into_iter().filter(|(_, unit)| fits(unit.metres()));
            return fitting.map(|(name, _)| format!("--range-unit {name}")).collect();
        }
        let sound_speed_m_s = assumptions.air.sound_speed_m_s();
        let own = self.field().map_or(FieldQuantity::Range, Field::quantity);
        let other =
            if own == FieldQuantity::Tof { FieldQuantity::Range } else { FieldQuantity::Tof };
        let options = |quantity: FieldQuantity| -> Vec<String> {
            let fields = Field::of_quantity(quantity).filter(|field| field.is_usual());
            let fields = fields.filter(|field| Some(*field) != self.field());
            let fields = fields.filter(|field| fits(metres_per_unit(*field, sound_speed_m_s)));
            fields.map(|field| self.mapping.columns_option_with(field, self.names)).collect()
        };
        // Times of flight are offered for distances only where no unit of length fits.
        Some(options(own)).filter(|options| !options.is_empty()).unwrap_or_else(|| options(other))
    }

    /// Returns the option that reads the column of a quantity in another unit.
    fn option_in(&self, quantity: FieldQuantity, unit: &str) -> String {
        Field::with_unit(quantity, Some(unit))
            .map(|field| self.mapping.columns_option_with(field, self.names))
            .unwrap_or_default()
    }

    /// Builds the error for angles in degrees that are more likely radians.
    fn looks_like_radians(&self, field: Field, angles: &AngleStats) -> ImportError {
        let (low, high) = (angles.low, angles.high);
        implausible(
            format!("{field} spans {low:.3} to {high:.3}, which looks like radians"),
            format!(
                "if these are radians: {}; if they are degrees: --no-unit-check",
                self.option_in(field.quantity(), "rad")
            ),
        )
    }

    /// Describes the unit in which the ranges were read.
    fn unit(&self) -> String {
        let by_format = || {
            let unit = self.mapping.range_unit.unwrap_or(RangeUnit::M);
            let name = RangeUnit::ALL.into_iter().find(|(_, known)| *known == unit);
            format!("in {}", name.map_or("m", |(name, _)| name))
        };
        self.field().map_or_else(by_format, |field| format!("by {field}"))
    }
}

/// Builds the error for values that are implausible in their unit.
fn implausible(what: String, help: String) -> ImportError {
    ImportError::Implausible { what, help }
}

/// Returns the range below which a reading is implausible, metres.
const fn near_m(assumptions: &Assumptions) -> f64 {
    assumptions.min_range_m.max(MIN_NEAR_M)
}

/// Returns the length in metres of one unit of a range or a time of flight.
fn metres_per_unit(field: Field, sound_speed_m_s: f64) -> f64 {
    match field.quantity() {
        FieldQuantity::Tof => field.scaled(1.0) * 1e-6 * sound_speed_m_s / 2.0,
        _ => field.scaled(1.0),
    }
}

/// Statistics of all ranges of a file.
#[derive(Debug)]
pub(crate) struct RangeStats {
    pub(crate) readings: u64,
    pub(crate) echoes: u64,
    histogram: RangeHistogram,
    /// Number and first of the ranges beyond [`FAR`] times the sensor's maximum range.
    far: u64,
    first_far: Option<(FileLocation, f64)>,
    /// Number of ranges beyond [`BEYOND`] times the sensor's maximum range.
    beyond: u64,
    /// Number of ranges below the sensor's minimum range.
    near: u64,
    zeros: u64,
}

impl RangeStats {
    pub(crate) const fn new(kind: DirectionKind) -> Self {
        let histogram = RangeHistogram::new(kind);
        Self {
            readings: 0,
            echoes: 0,
            histogram,
            far: 0,
            first_far: None,
            beyond: 0,
            near: 0,
            zeros: 0,
        }
    }

    /// Adds a reading with its range in the unit of the file and in metres; `direction` is an angle
    /// in degrees or the index of a ranger.
    pub(crate) fn add(
        &mut self,
        place: FileLocation,
        direction: f64,
        raw: Option<f64>,
        range_m: Option<f64>,
        (units, assumptions): (&UnitContext, &Assumptions),
    ) {
        self.readings += 1;
        let raw = raw.filter(|raw| !units.mapping.is_no_echo(*raw));
        if raw == Some(0.0) && units.zero_is_no_echo {
            self.zeros += 1;
        } else if let Some(raw) = raw {
            self.histogram.add(place, raw, direction);
        }
        let Some(range_m) = range_m else { return };
        self.echoes += 1;
        if range_m > FAR * assumptions.max_range_m {
            self.far += 1;
            self.first_far = self.first_far.or(Some((place, range_m)));
        }
        self.beyond += u64::from(range_m > BEYOND * assumptions.max_range_m);
        self.near += u64::from(range_m < near_m(assumptions));
    }

    /// Checks the ranges for implausible values and returns notes on values that were read as no
    /// echo.
    pub(crate) fn check(
        &self,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> Result<Vec<String>, ImportError> {
        self.check_non_positive(units)?;
        if !assumptions.skip_checks {
            self.check_constant(units, assumptions)?;
            self.check_far(units, assumptions)?;
            self.check_near(units, assumptions)?;
        }
        Ok(self.notes(assumptions))
    }

    /// Returns one line for each kind of range that the sensor cannot measure.
    fn notes(&self, assumptions: &Assumptions) -> Vec<String> {
        let Assumptions { sensor, max_range_m, .. } = assumptions;
        let mut notes = Vec::new();
        if self.zeros > 0 {
            notes
                .push(format!("{} of {} ranges are 0: read as no echo", self.zeros, self.readings));
        }
        if self.beyond > 0 {
            notes.push(format!(
                "{} of {} ranges are beyond {max_range_m} m, the maximum range of the sensor {sensor}",
                self.beyond, self.echoes
            ));
        }
        if self.near > 0 {
            notes.push(format!(
                "{} of {} ranges are below {:.0} mm, too near for the sensor {sensor}",
                self.near,
                self.echoes,
                1e3 * near_m(assumptions)
            ));
        }
        notes
    }

    fn check_non_positive(&self, units: &UnitContext) -> Result<(), ImportError> {
        let non_positive = self.histogram.non_positive();
        let Some(first) = non_positive.first() else { return Ok(()) };
        let values: Vec<f64> = non_positive.iter().map(|non_positive| non_positive.value).collect();
        let what = match units.field() {
            Some(field) => field.quantity().label(),
            None => "range",
        };
        let column = units.field().and_then(|field| {
            let column = units.mapping.columns.get(&field)?;
            Some(format!("{field} ({column})"))
        });
        Err(ImportError::At {
            place: first.first,
            column,
            what: format!(
                "a {what} of {} is not a distance ({} of {} readings)",
                first.value, first.count, self.readings
            ),
            help: format!("if it means no echo: {}", units.mapping.none_option(&values)),
        })
    }

    fn check_constant(
        &self,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> Result<(), ImportError> {
        let longest = assumptions.max_range_m / units.metres(assumptions.air.sound_speed_m_s());
        let Some(constant) = self.histogram.constant(longest) else { return Ok(()) };
        // If most ranges are beyond the sensor's range for another reason than this constant, the
        // unit is wrong.
        if 2 * self.far >= self.echoes && 2 * constant.count < self.far {
            return Ok(());
        }
        let (value, count, of) = (constant.value, constant.count, constant.of);
        let first = constant.first.map(|first| format!(" (first at {first})")).unwrap_or_default();
        let unit = units.unit();
        Err(if constant.is_cluster {
            implausible(
                format!("{count} of {of} ranges are {value} or more {unit}: {}", constant.why),
                format!(
                    "if they mean no echo: --no-echo-from={value}; if they are distances: --no-unit-check"
                ),
            )
        } else {
            implausible(
                format!("{count} of {of} ranges are {value} {unit}{first}: {}", constant.why),
                format!(
                    "if it means no echo: {}; if it is a distance: --no-unit-check",
                    units.mapping.none_option(&[value])
                ),
            )
        })
    }

    fn check_far(&self, units: &UnitContext, assumptions: &Assumptions) -> Result<(), ImportError> {
        let Some((place, range_m)) = self.first_far else {
            return self.check_beyond(units, assumptions);
        };
        let (far, echoes) = (self.far, self.echoes);
        let all = if far == echoes { "all".to_owned() } else { far.to_string() };
        let what = format!(
            "{all} of {echoes} ranges are beyond {:.1} m, twice the maximum range of the sensor {} (first at {place}: \
             {range_m:.2} m {})",
            FAR * assumptions.max_range_m,
            assumptions.sensor,
            units.unit(),
        );
        if 2 * far >= echoes {
            return Err(self.implausible_unit(what, units, assumptions));
        }
        let metres = units.metres(assumptions.air.sound_speed_m_s());
        let none_from = FAR * assumptions.max_range_m / metres;
        Err(implausible(
            what,
            format!(
                "mixed units? If they mean no echo: --no-echo-from={none_from:.3}; --no-unit-check skips this check"
            ),
        ))
    }

    /// Rejects ranges of which most are beyond the sensor's maximum range.
    fn check_beyond(
        &self,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> Result<(), ImportError> {
        if self.beyond < MIN_BEYOND || 2 * self.beyond <= self.echoes {
            return Ok(());
        }
        let Assumptions { sensor, max_range_m, .. } = assumptions;
        let what = format!(
            "{} of {} ranges are beyond {max_range_m} m {}, the maximum range of the sensor {sensor}",
            self.beyond,
            self.echoes,
            units.unit(),
        );
        Err(self.implausible_unit(what, units, assumptions))
    }

    fn check_near(
        &self,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> Result<(), ImportError> {
        if self.near == 0 || 2 * self.near < self.echoes {
            return Ok(());
        }
        let near_m = near_m(assumptions);
        let what = format!(
            "{} of {} ranges are below {:.0} mm {}, implausibly short for the sensor {}",
            self.near,
            self.echoes,
            1e3 * near_m,
            units.unit(),
            assumptions.sensor,
        );
        Err(self.implausible_unit(what, units, assumptions))
    }

    /// Builds the error for ranges that are implausible in their unit, with the units that fit.
    fn implausible_unit(
        &self,
        what: String,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> ImportError {
        let options = units.unit_options(self, assumptions);
        let help = match options.is_empty() {
            true => {
                "is the unit right, and the sensor? --sensor NAME; --no-unit-check skips this check"
                    .to_owned()
            }
            false => {
                format!(
                    "is the unit right? {}; --no-unit-check skips this check",
                    options.join(" | ")
                )
            }
        };
        implausible(what, help)
    }
}
