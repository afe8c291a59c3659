//! Plausibility checks of units, angles, positions and no-echo values of a file.

use crate::{
    Assumptions, Field, FieldQuantity, FileLocation, ImportError, ImportedReading, Mapping,
    mapping::RangeUnit,
    no_echo_constant::{DirectionKind, RangeHistogram},
};

/// Multiple of the sensor's maximum range beyond which a range is implausible.
const FAR: f64 = 2.0;
/// Minimum plausible range for any sensor, metres: robots do not operate closer to walls.
const MIN_NEAR_M: f64 = 0.04;
/// Maximum magnitude of an angle in radians, with rounding.
const MAX_RAD: f64 = std::f64::consts::TAU + 0.02;
/// Minimum number of readings for the check of angles.
const MIN_READINGS: u64 = 3;

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
        match self.field() {
            Some(field) if field.quantity() == FieldQuantity::Tof => {
                field.scaled(1.0) * 1e-6 * sound_speed_m_s / 2.0
            }
            Some(field) => field.scaled(1.0),
            None => self.mapping.metres(),
        }
    }

    /// Returns the options for units with which the median range is measurable and the 98th
    /// percentile is plausible.
    fn unit_options(&self, ranges: &RangeStats, assumptions: &Assumptions) -> Vec<String> {
        let [median, high] =
            [0.5, 0.98].map(|share| ranges.histogram.quantile(share).unwrap_or(0.0));
        let near_m = assumptions.min_range_m.max(MIN_NEAR_M);
        let fits = |metres: f64| {
            (near_m..=assumptions.max_range_m).contains(&(median * metres))
                && high * metres <= FAR * assumptions.max_range_m
        };
        if !self.has_columns {
            let fitting = RangeUnit::ALL.into_iter().filter(|(_, unit)| fits(unit.metres()));
            return fitting.map(|(name, _)| format!("--range-unit {name}")).collect();
        }
        let fields =
            Field::of_quantity(FieldQuantity::Range).filter(|field| fits(field.scaled(1.0)));
        let fields = fields.filter(|field| Some(*field) != self.field());
        fields.map(|field| self.mapping.columns_option_with(field, self.names)).collect()
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

/// Statistics of all ranges of a file.
#[derive(Debug)]
pub(crate) struct RangeStats {
    pub(crate) readings: u64,
    pub(crate) echoes: u64,
    histogram: RangeHistogram,
    /// Number and first of the ranges beyond [`FAR`] times the sensor's maximum range.
    far: u64,
    first_far: Option<(FileLocation, f64)>,
    /// Number of ranges below the sensor's minimum range.
    near: u64,
    zeros: u64,
}

impl RangeStats {
    pub(crate) const fn new(kind: DirectionKind) -> Self {
        let histogram = RangeHistogram::new(kind);
        Self { readings: 0, echoes: 0, histogram, far: 0, first_far: None, near: 0, zeros: 0 }
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
        self.near += u64::from(range_m < assumptions.min_range_m.max(MIN_NEAR_M));
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
        Ok(match self.zeros {
            0 => Vec::new(),
            zeros => vec![format!("{zeros} of {} ranges are 0: read as no echo", self.readings)],
        })
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
            ImportError::Implausible {
                what: format!(
                    "{count} of {of} ranges are {value} or more {unit}: {}",
                    constant.why
                ),
                help: format!(
                    "if they mean no echo: --no-echo-from={value}; if they are distances: --no-unit-check"
                ),
            }
        } else {
            ImportError::Implausible {
                what: format!("{count} of {of} ranges are {value} {unit}{first}: {}", constant.why),
                help: format!(
                    "if it means no echo: {}; if it is a distance: --no-unit-check",
                    units.mapping.none_option(&[value])
                ),
            }
        })
    }

    fn check_far(&self, units: &UnitContext, assumptions: &Assumptions) -> Result<(), ImportError> {
        let Some((place, range_m)) = self.first_far else { return Ok(()) };
        let (far, echoes) = (self.far, self.echoes);
        let all = if far == echoes { "all".to_owned() } else { far.to_string() };
        let what = format!(
            "{all} of {echoes} ranges are beyond {:.1} m, twice the maximum range of the sensor {} (first at {place}: \
                          {range_m:.2} m {})",
            FAR * assumptions.max_range_m,
            assumptions.sensor,
            units.unit(),
        );
        let metres = units.metres(assumptions.air.sound_speed_m_s());
        let options = units.unit_options(self, assumptions);
        let none_from = 2.0 * assumptions.max_range_m / metres;
        let help = if 2 * far >= echoes && !options.is_empty() {
            format!("is the unit right? {}; --no-unit-check skips this check", options.join(" | "))
        } else if 2 * far >= echoes {
            "is the unit right, and the sensor? --sensor NAME; --no-unit-check skips this check"
                .to_owned()
        } else {
            format!(
                "mixed units? If they mean no echo: --no-echo-from={none_from:.3}; --no-unit-check skips this check"
            )
        };
        Err(ImportError::Implausible { what, help })
    }

    fn check_near(
        &self,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> Result<(), ImportError> {
        if self.near == 0 || 2 * self.near < self.echoes {
            return Ok(());
        }
        let near_m = assumptions.min_range_m.max(MIN_NEAR_M);
        let what = format!(
            "{} of {} ranges are below {:.0} mm {}, implausibly short for the sensor {}",
            self.near,
            self.echoes,
            1e3 * near_m,
            units.unit(),
            assumptions.sensor,
        );
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
        Err(ImportError::Implausible { what, help })
    }
}

/// Statistics of all readings of one rotating ranger.
#[derive(Debug)]
pub(crate) struct SweepStats {
    pub(crate) ranges: RangeStats,
    /// Extremes of the directions, in the unit of the file.
    low: f64,
    high: f64,
    all_integers: bool,
    places: EchoPositions,
}

impl SweepStats {
    pub(crate) fn new() -> Self {
        Self {
            ranges: RangeStats::new(DirectionKind::Angles),
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            all_integers: true,
            places: EchoPositions::default(),
        }
    }

    pub(crate) fn add(&mut self, reading: &ImportedReading, units: (&UnitContext, &Assumptions)) {
        let direction = reading.raw.direction;
        self.ranges.add(
            reading.location,
            reading.direction_deg,
            reading.raw.range,
            reading.range_m,
            units,
        );
        self.low = self.low.min(direction);
        self.high = self.high.max(direction);
        self.all_integers &= (direction - direction.round()).abs() < 1e-9;
        if let Some((place_m, range_m)) = reading.position_m.zip(reading.range_m) {
            self.places.add(place_m, range_m, reading.direction_deg);
        }
    }

    /// Checks ranges, angles and positions and returns notes on values that were read as no echo.
    pub(crate) fn check(
        &self,
        units: &UnitContext,
        assumptions: &Assumptions,
    ) -> Result<Vec<String>, ImportError> {
        if self.ranges.readings == 0 {
            return Err(ImportError::mapping(
                "the file has no readings",
                "give a file with readings",
            ));
        }
        if !assumptions.skip_checks {
            self.check_angles(units)?;
            self.check_places(units)?;
        }
        self.ranges.check(units, assumptions)
    }

    fn check_angles(&self, units: &UnitContext) -> Result<(), ImportError> {
        let field = |quantity| units.mapping.field(quantity);
        let field = field(FieldQuantity::Azimuth).or_else(|| field(FieldQuantity::Bearing));
        let Some(field) = field.filter(|_| self.ranges.readings >= MIN_READINGS) else {
            return Ok(());
        };
        let (low, high) = (self.low, self.high);
        let max_angle = low.abs().max(high.abs());
        let other_unit = if field.is_radians() { "deg" } else { "rad" };
        let option = Field::with_unit(field.quantity(), Some(other_unit))
            .map(|field| units.mapping.columns_option_with(field, units.names))
            .unwrap_or_default();
        if field.is_radians() && max_angle > 4.0 * std::f64::consts::TAU {
            return Err(ImportError::Implausible {
                what: format!(
                    "{field} spans {low:.1} to {high:.1} rad, {:.0} revolutions",
                    max_angle / std::f64::consts::TAU
                ),
                help: format!("if these are degrees: {option}; --no-unit-check skips this check"),
            });
        }
        let is_like_radians = max_angle <= MAX_RAD && !self.all_integers && high - low > 0.3;
        if field.unit() == Some("deg") && is_like_radians {
            return Err(ImportError::Implausible {
                what: format!("{field} spans {low:.3} to {high:.3}, which looks like radians"),
                help: format!(
                    "if these are radians: {option}; if they are degrees: --no-unit-check"
                ),
            });
        }
        Ok(())
    }

    fn check_places(&self, units: &UnitContext) -> Result<(), ImportError> {
        if !self.places.follow_readings() {
            return Ok(());
        }
        let columns = units.mapping.columns.iter();
        let columns: Vec<_> = columns
            .filter(|(field, _)| !matches!(field.quantity(), FieldQuantity::X | FieldQuantity::Y))
            .map(|(field, column)| (*field, column.clone()))
            .collect();
        let named: Vec<String> = [FieldQuantity::X, FieldQuantity::Y]
            .iter()
            .filter_map(|quantity| units.mapping.columns.get(&units.mapping.field(*quantity)?))
            .map(ToString::to_string)
            .collect();
        Err(ImportError::Implausible {
            what: format!(
                "{} follow from direction and range: they are the position of the echo, not of the robot",
                named.join(" and ")
            ),
            help: format!(
                "leave them out: {}; --no-unit-check takes them as the position of the robot",
                crate::mapping::columns_option(columns, units.names)
            ),
        })
    }
}

/// Test whether positions in the file are those of echoes: their difference to range times (cos,
/// sin) of the direction is then constant.
#[derive(Debug, Default)]
struct EchoPositions {
    count: u64,
    own: Extent,
    /// Extent of the difference for the usual plotting conventions: x and y by cosine and sine,
    /// exchanged, or mirrored.
    offsets: [Extent; 4],
}

#[derive(Debug, Clone, Copy)]
struct Extent {
    low: [f64; 2],
    high: [f64; 2],
}

impl Default for Extent {
    fn default() -> Self {
        Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] }
    }
}

impl Extent {
    fn add(&mut self, [x, y]: [f64; 2]) {
        self.low = [self.low[0].min(x), self.low[1].min(y)];
        self.high = [self.high[0].max(x), self.high[1].max(y)];
    }

    fn size(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1])
    }
}

impl EchoPositions {
    fn add(&mut self, [x, y]: [f64; 2], range_m: f64, direction_deg: f64) {
        self.count += 1;
        self.own.add([x, y]);
        let (sin, cos) = direction_deg.to_radians().sin_cos();
        let (a, b) = (range_m * cos, range_m * sin);
        for (offset, [u, v]) in self.offsets.iter_mut().zip([[a, b], [b, a], [a, -b], [-a, b]]) {
            offset.add([x - u, y - v]);
        }
    }

    fn follow_readings(&self) -> bool {
        let size_m = self.own.size();
        self.count >= 4
            && size_m > 0.05
            && self.offsets.iter().any(|offset| offset.size() < 0.05 * size_m)
    }
}
