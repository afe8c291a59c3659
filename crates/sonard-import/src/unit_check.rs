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
const MIN_READINGS: u64 = 2;
/// Minimum span of directions that are checked for radians; a resting ranger has none.
const MIN_SPAN: f64 = 0.05;
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
        let near_m = assumptions.min_range_m.max(MIN_NEAR_M);
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
        Ok(self.notes(assumptions))
    }

    /// Returns one line for each kind of range that the sensor cannot measure.
    fn notes(&self, assumptions: &Assumptions) -> Vec<String> {
        let Assumptions { sensor, max_range_m, min_range_m, .. } = assumptions;
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
                1e3 * min_range_m.max(MIN_NEAR_M)
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
        Err(implausible(what, help))
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
        let near_m = assumptions.min_range_m.max(MIN_NEAR_M);
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

/// Statistics of the angles of a column, in its unit.
#[derive(Debug)]
struct AngleStats {
    count: u64,
    low: f64,
    high: f64,
    all_integers: bool,
    /// True if all angles are multiples of pi / 4.
    all_eighths: bool,
    last: f64,
    changes: u64,
    /// First step between angles, and number and sum of the steps that are close to it.
    first_step: f64,
    usual_steps: u64,
    usual_sum: f64,
}

impl Default for AngleStats {
    fn default() -> Self {
        Self {
            count: 0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            all_integers: true,
            all_eighths: true,
            last: 0.0,
            changes: 0,
            first_step: 0.0,
            usual_steps: 0,
            usual_sum: 0.0,
        }
    }
}

impl AngleStats {
    fn add(&mut self, angle: f64) {
        let step = angle - self.last;
        if self.count > 0 && step.abs() > 1e-9 {
            self.changes += 1;
            if self.first_step == 0.0 {
                self.first_step = step;
            }
            if (step - self.first_step).abs() <= 0.2 * self.first_step.abs() {
                self.usual_steps += 1;
                self.usual_sum += step;
            }
        }
        self.count += 1;
        self.last = angle;
        self.low = self.low.min(angle);
        self.high = self.high.max(angle);
        self.all_integers &= is_multiple(angle, 1.0, 1e-9);
        self.all_eighths &= is_multiple(angle, std::f64::consts::FRAC_PI_4, 6e-4);
    }

    fn max(&self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    fn span(&self) -> f64 {
        self.high - self.low
    }

    /// Mean step of a regular sweep.
    fn usual_step(&self) -> Option<f64> {
        let is_regular = self.usual_steps >= 8 && 5 * self.usual_steps >= 4 * self.changes;
        is_regular.then(|| (self.usual_sum / self.usual_steps as f64).abs())
    }

    /// Returns `true` if directions of more than a revolution are steps of a round angle in
    /// radians, and of none in degrees.
    fn turns_in_radians(&self) -> bool {
        let is_round = |step_deg: f64| {
            is_multiple(step_deg, 0.05, 0.004)
                || (step_deg > 0.09 && is_multiple(360.0 / step_deg, 1.0, 0.01))
        };
        !self.all_integers
            && self.usual_step().is_some_and(|step| !is_round(step) && is_round(step.to_degrees()))
    }

    /// Returns `true` if angles in degrees are more likely radians: decimals within a revolution.
    fn directions_look_like_radians(&self) -> bool {
        let is_within = self.max() <= MAX_RAD && !self.all_integers && self.span() > MIN_SPAN;
        is_within || (self.max() > MAX_RAD && self.turns_in_radians())
    }

    /// Returns `true` if headings in degrees are more likely radians: they turn far, or are
    /// fractions of pi. A robot that drives straight has small headings in degrees.
    fn headings_look_like_radians(&self) -> bool {
        let is_turning = self.changes >= 2 && self.span() > 1.0;
        let is_fraction = self.all_eighths && self.max() > 0.5;
        self.max() <= MAX_RAD && !self.all_integers && (is_turning || is_fraction)
    }
}

/// Returns `true` if a number is a multiple of a unit, within a tolerance.
fn is_multiple(number: f64, unit: f64, tolerance: f64) -> bool {
    (number - (number / unit).round() * unit).abs() < tolerance
}

/// Statistics of all readings of one rotating ranger.
#[derive(Debug)]
pub(crate) struct SweepStats {
    pub(crate) ranges: RangeStats,
    /// Directions, in the unit of the file.
    directions: AngleStats,
    /// Headings, in degrees.
    headings: AngleStats,
    places: EchoPositions,
    /// The same, with directions from the x axis for a robot with a heading.
    turned_places: EchoPositions,
}

impl SweepStats {
    pub(crate) fn new() -> Self {
        Self {
            ranges: RangeStats::new(DirectionKind::Angles),
            directions: AngleStats::default(),
            headings: AngleStats::default(),
            places: EchoPositions::default(),
            turned_places: EchoPositions::default(),
        }
    }

    pub(crate) fn add(&mut self, reading: &ImportedReading, units: (&UnitContext, &Assumptions)) {
        self.ranges.add(
            reading.location,
            reading.direction_deg,
            reading.raw.range,
            reading.range_m,
            units,
        );
        self.directions.add(reading.raw.direction);
        if let Some(heading_deg) = reading.heading_deg {
            self.headings.add(heading_deg);
        }
        if let Some((position_m, range_m)) = reading.position_m.zip(reading.range_m) {
            self.places.add(position_m, range_m, reading.direction_deg);
            let heading_deg = reading.heading_deg.unwrap_or(0.0);
            self.turned_places.add(position_m, range_m, reading.direction_deg + heading_deg);
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
            self.check_headings(units)?;
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
        let AngleStats { low, high, .. } = self.directions;
        let max_angle = self.directions.max();
        let other_unit = if field.is_radians() { "deg" } else { "rad" };
        let option = Field::with_unit(field.quantity(), Some(other_unit))
            .map(|field| units.mapping.columns_option_with(field, units.names))
            .unwrap_or_default();
        let are_degrees = max_angle > 4.0 * std::f64::consts::TAU
            || (max_angle > MAX_RAD && self.directions.all_integers);
        if field.is_radians() && are_degrees {
            return Err(implausible(
                format!(
                    "{field} spans {low:.1} to {high:.1} rad, {:.1} revolutions",
                    max_angle / std::f64::consts::TAU
                ),
                format!("if these are degrees: {option}; --no-unit-check skips this check"),
            ));
        }
        if field.unit() == Some("deg") && self.directions.directions_look_like_radians() {
            return Err(implausible(
                format!("{field} spans {low:.3} to {high:.3}, which looks like radians"),
                format!("if these are radians: {option}; if they are degrees: --no-unit-check"),
            ));
        }
        let step = self.directions.usual_step().unwrap_or(0.0);
        if field.unit() == Some("deg") && step >= 360.0 {
            return Err(implausible(
                format!("{field} changes by {step:.0} degrees from reading to reading"),
                "check the column and its unit; --no-unit-check skips this check".to_owned(),
            ));
        }
        Ok(())
    }

    fn check_headings(&self, units: &UnitContext) -> Result<(), ImportError> {
        let field = units.mapping.field(FieldQuantity::Heading);
        let Some(field) = field.filter(|field| field.unit() == Some("deg")) else { return Ok(()) };
        if !self.headings.headings_look_like_radians() {
            return Ok(());
        }
        let AngleStats { low, high, .. } = self.headings;
        let option = Field::with_unit(FieldQuantity::Heading, Some("rad"))
            .map(|field| units.mapping.columns_option_with(field, units.names))
            .unwrap_or_default();
        Err(implausible(
            format!("{field} spans {low:.3} to {high:.3}, which looks like radians"),
            format!("if these are radians: {option}; if they are degrees: --no-unit-check"),
        ))
    }

    fn check_places(&self, units: &UnitContext) -> Result<(), ImportError> {
        if !self.places.follow_readings() && !self.turned_places.follow_readings() {
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
        Err(implausible(
            format!(
                "{} follow from direction and range: they are the position of the echo, not of the robot",
                named.join(" and ")
            ),
            format!(
                "leave them out: {}; --no-unit-check takes them as the position of the robot",
                crate::mapping::columns_option(columns, units.names)
            ),
        ))
    }
}

/// Evidence that positions in the file are those of echoes: they are then an affine function of
/// range times (cos, sin) of the direction, which covers axes exchanged, mirrored, scaled and
/// turned for plotting.
#[derive(Debug, Default)]
struct EchoPositions {
    count: u64,
    own: Extent,
    /// Extent of the unit vectors of the directions.
    directions: Extent,
    /// Extent of the difference for the usual plotting conventions, for few readings.
    offsets: [Extent; 8],
    fit: AffineFit,
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
        self.directions.add([cos, sin]);
        let (a, b) = (range_m * cos, range_m * sin);
        let signs = [(a, b), (a, -b), (-a, b), (-a, -b)];
        let axes = signs.into_iter().flat_map(|(u, v)| [[u, v], [v, u]]);
        for (offset, [u, v]) in self.offsets.iter_mut().zip(axes) {
            offset.add([x - u, y - v]);
        }
        self.fit.add([a, b], [x, y]);
    }

    fn follow_readings(&self) -> bool {
        let (size_m, spread) = (self.own.size(), self.directions.size());
        // Without a turn, a robot that approaches a wall moves as its range falls.
        if self.count < 4 || size_m <= 0.05 || spread < 0.1 {
            return false;
        }
        self.offsets.iter().any(|offset| offset.size() < 0.05 * size_m)
            || (self.count >= 8
                && spread > 0.8
                && self.fit.residual().is_some_and(|residual_m| residual_m < 0.004 * size_m))
    }
}

/// Least-squares fit of positions by an affine function of two numbers.
#[derive(Debug, Default)]
struct AffineFit {
    /// Sums of the products of (1, a, b).
    normal: [[f64; 3]; 3],
    /// Sums of (1, a, b) times x and y, and of the squares of x and y, from the first position.
    products: [[f64; 3]; 2],
    squares: [f64; 2],
    first: Option<[f64; 2]>,
}

impl AffineFit {
    fn add(&mut self, [a, b]: [f64; 2], place: [f64; 2]) {
        let first = *self.first.get_or_insert(place);
        let row = [1.0, a, b];
        for (sums, u) in self.normal.iter_mut().zip(row) {
            for (sum, v) in sums.iter_mut().zip(row) {
                *sum += u * v;
            }
        }
        for axis in 0..2 {
            let coordinate = place[axis] - first[axis];
            self.squares[axis] += coordinate * coordinate;
            for (sum, u) in self.products[axis].iter_mut().zip(row) {
                *sum += u * coordinate;
            }
        }
    }

    /// Root of the mean squared residual of the worse axis; `None` if the directions or ranges do
    /// not determine the function.
    fn residual(&self) -> Option<f64> {
        let [p, q, r] = self.normal;
        let determinant = |p: [f64; 3], q: [f64; 3], r: [f64; 3]| {
            p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0])
                + p[2] * (q[0] * r[1] - q[1] * r[0])
        };
        let whole = determinant(p, q, r);
        if whole <= 1e-9 * p[0] * q[1] * r[2] {
            return None;
        }
        let squared = (0..2).map(|axis| {
            // The matrix is symmetric, so rows replace columns.
            let right = self.products[axis];
            let factors = [
                determinant(right, q, r) / whole,
                determinant(p, right, r) / whole,
                determinant(p, q, right) / whole,
            ];
            let explained: f64 = factors.iter().zip(right).map(|(factor, sum)| factor * sum).sum();
            ((self.squares[axis] - explained) / p[0]).max(0.0)
        });
        squared.reduce(f64::max).map(f64::sqrt)
    }
}
