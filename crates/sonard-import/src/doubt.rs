//! Signs that numbers are not what the mapping says they are.

use crate::{
    Field, ImportError, Location, Mapping, Quantity, Reading, Taken,
    mapping::RangeUnit,
    silence::{Across, Silence},
};

/// Ranges of so many times the sensor's longest are none.
const FAR: f64 = 2.0;
/// No robot lives among walls nearer than this, metres.
const MIN_NEAR_M: f64 = 0.04;
/// Angles of radians end here, with rounding.
const MAX_RAD: f64 = std::f64::consts::TAU + 0.02;
/// Readings that show something of their angles.
const MIN_READINGS: u64 = 3;

/// The options by which a doubt is resolved: those of columns, or those of formats that say metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ways<'a> {
    pub(crate) mapping: &'a Mapping,
    /// Names of the columns.
    pub(crate) names: &'a [String],
    /// True if columns have units by their fields.
    pub(crate) has_columns: bool,
    /// True if 0 is what the format's drivers write for no echo.
    pub(crate) zero_is_no_echo: bool,
}

impl Ways<'_> {
    fn field(&self) -> Option<Field> {
        let field = |quantity| self.mapping.field(quantity);
        field(Quantity::Range).or_else(|| field(Quantity::Tof)).filter(|_| self.has_columns)
    }

    /// Metres of one in the file's unit.
    fn metres(&self, sound_speed_m_s: f64) -> f64 {
        match self.field() {
            Some(field) if field.quantity() == Quantity::Tof => {
                field.scaled(1.0) * 1e-6 * sound_speed_m_s / 2.0
            }
            Some(field) => field.scaled(1.0),
            None => self.mapping.metres(),
        }
    }

    /// The options for other units, by which a usual range is one that the sensor measures, and a great one may be.
    fn units(&self, ranges: &Ranges, taken: &Taken) -> Vec<String> {
        let [middle, great] =
            [0.5, 0.98].map(|share| ranges.silence.quantile(share).unwrap_or(0.0));
        let near_m = taken.least_m.max(MIN_NEAR_M);
        let fits = |metres: f64| {
            (near_m..=taken.longest_m).contains(&(middle * metres))
                && great * metres <= FAR * taken.longest_m
        };
        if !self.has_columns {
            let units = RangeUnit::ALL.into_iter().filter(|(_, unit)| fits(unit.metres()));
            return units.map(|(name, _)| format!("--range-unit {name}")).collect();
        }
        let fields = Field::of_quantity(Quantity::Range).filter(|field| fits(field.scaled(1.0)));
        let fields = fields.filter(|field| Some(*field) != self.field());
        fields.map(|field| self.mapping.columns_option_with(field, self.names)).collect()
    }

    /// The unit that ranges were taken in, by its field or its name.
    fn unit(&self) -> String {
        let by_format = || {
            let unit = self.mapping.range_unit.unwrap_or(RangeUnit::M);
            let name = RangeUnit::ALL.into_iter().find(|(_, known)| *known == unit);
            format!("in {}", name.map_or("m", |(name, _)| name))
        };
        self.field().map_or_else(by_format, |field| format!("by {field}"))
    }
}

/// The ranges of a file, over all of its readings.
#[derive(Debug)]
pub(crate) struct Ranges {
    pub(crate) readings: u64,
    pub(crate) echoes: u64,
    silence: Silence,
    /// Ranges beyond the sensor's reach, and the first of them.
    far: u64,
    first_far: Option<(Location, f64)>,
    /// Ranges nearer than the sensor measures.
    near: u64,
    zeros: u64,
}

impl Ranges {
    pub(crate) const fn new(across: Across) -> Self {
        let silence = Silence::new(across);
        Self { readings: 0, echoes: 0, silence, far: 0, first_far: None, near: 0, zeros: 0 }
    }

    /// Takes in a reading: its range as the file has it, and in metres; `direction` is an angle in degrees or a ranger's
    /// place.
    pub(crate) fn add(
        &mut self,
        place: Location,
        direction: f64,
        raw: Option<f64>,
        range_m: Option<f64>,
        (ways, taken): (&Ways, &Taken),
    ) {
        self.readings += 1;
        let raw = raw.filter(|raw| !ways.mapping.is_no_echo(*raw));
        if raw == Some(0.0) && ways.zero_is_no_echo {
            self.zeros += 1;
        } else if let Some(raw) = raw {
            self.silence.add(place, raw, direction);
        }
        let Some(range_m) = range_m else { return };
        self.echoes += 1;
        if range_m > FAR * taken.longest_m {
            self.far += 1;
            self.first_far = self.first_far.or(Some((place, range_m)));
        }
        self.near += u64::from(range_m < taken.least_m.max(MIN_NEAR_M));
    }

    /// Checks the readings against the mapping; notes on what was taken as no echo.
    pub(crate) fn check(&self, ways: &Ways, taken: &Taken) -> Result<Vec<String>, ImportError> {
        self.check_below(ways)?;
        if !taken.as_said {
            self.check_constant(ways, taken)?;
            self.check_far(ways, taken)?;
            self.check_near(ways, taken)?;
        }
        Ok(match self.zeros {
            0 => Vec::new(),
            zeros => vec![format!(
                "{zeros} of {} ranges are 0, which is no distance: taken as no echo",
                self.readings
            )],
        })
    }

    fn check_below(&self, ways: &Ways) -> Result<(), ImportError> {
        let below = self.silence.below();
        let Some(first) = below.first() else { return Ok(()) };
        let values: Vec<f64> = below.iter().map(|below| below.value).collect();
        let what = match ways.field() {
            Some(field) => field.quantity().words(),
            None => "range",
        };
        let column = ways.field().and_then(|field| {
            let column = ways.mapping.columns.get(&field)?;
            Some(format!("{field} ({column})"))
        });
        Err(ImportError::At {
            place: first.first,
            column,
            what: format!(
                "a {what} of {} is no distance ({} of {} are)",
                first.value, first.count, self.readings
            ),
            help: format!("if that stands for no echo: {}", ways.mapping.none_option(&values)),
        })
    }

    fn check_constant(&self, ways: &Ways, taken: &Taken) -> Result<(), ImportError> {
        let longest = taken.longest_m / ways.metres(taken.air.sound_speed_m_s());
        let Some(constant) = self.silence.constant(longest) else { return Ok(()) };
        // Where most ranges are beyond reach, and not by this constant, the unit is wrong.
        if 2 * self.far >= self.echoes && 2 * constant.count < self.far {
            return Ok(());
        }
        let (value, count, of) = (constant.value, constant.count, constant.of);
        let first = constant.first.map(|first| format!(" (first at {first})")).unwrap_or_default();
        let unit = ways.unit();
        Err(if constant.is_cluster {
            ImportError::Doubtful {
                what: format!(
                    "{count} of {of} ranges are {value} or more {unit}: {}",
                    constant.why
                ),
                help: format!(
                    "if they stand for no echo: --no-echo-from={value}; if they are distances: --no-unit-check"
                ),
            }
        } else {
            ImportError::Doubtful {
                what: format!("{count} of {of} ranges are {value} {unit}{first}: {}", constant.why),
                help: format!(
                    "if that stands for no echo: {}; if it is a distance: --no-unit-check",
                    ways.mapping.none_option(&[value])
                ),
            }
        })
    }

    fn check_far(&self, ways: &Ways, taken: &Taken) -> Result<(), ImportError> {
        let Some((place, range_m)) = self.first_far else { return Ok(()) };
        let (far, echoes) = (self.far, self.echoes);
        let all = if far == echoes { "all".to_owned() } else { far.to_string() };
        let what = format!(
            "{all} of {echoes} ranges are beyond {:.1} m, twice the longest range of the sensor {} (first at {place}: \
             {range_m:.2} m {})",
            FAR * taken.longest_m,
            taken.sensor,
            ways.unit(),
        );
        let metres = ways.metres(taken.air.sound_speed_m_s());
        let units = ways.units(self, taken);
        let none_from = 2.0 * taken.longest_m / metres;
        let help = if 2 * far >= echoes && !units.is_empty() {
            format!("is the unit right? {}; --no-unit-check takes it as it is", units.join(" | "))
        } else if 2 * far >= echoes {
            "is the unit right, and the sensor? --sensor NAME; --no-unit-check takes them as they are"
                .to_owned()
        } else {
            format!(
                "mixed units? If they stand for no echo: --no-echo-from={none_from:.3}; --no-unit-check takes them as they are"
            )
        };
        Err(ImportError::Doubtful { what, help })
    }

    fn check_near(&self, ways: &Ways, taken: &Taken) -> Result<(), ImportError> {
        if self.near == 0 || 2 * self.near < self.echoes {
            return Ok(());
        }
        let near_m = taken.least_m.max(MIN_NEAR_M);
        let what = format!(
            "{} of {} ranges are below {:.0} mm {}, nearer than the sensor {} measures",
            self.near,
            self.echoes,
            1e3 * near_m,
            ways.unit(),
            taken.sensor,
        );
        let units = ways.units(self, taken);
        let help = match units.is_empty() {
            true => {
                "is the unit right, and the sensor? --sensor NAME; --no-unit-check takes them as they are"
                    .to_owned()
            }
            false => {
                format!("is the unit right? {}; --no-unit-check takes it as it is", units.join(" | "))
            }
        };
        Err(ImportError::Doubtful { what, help })
    }
}

/// The readings of one ranger that turns, over a whole file.
#[derive(Debug)]
pub(crate) struct Doubts {
    pub(crate) ranges: Ranges,
    /// Directions as the file has them.
    low: f64,
    high: f64,
    are_whole: bool,
    places: EchoPlaces,
}

impl Doubts {
    pub(crate) fn new() -> Self {
        Self {
            ranges: Ranges::new(Across::Angles),
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            are_whole: true,
            places: EchoPlaces::default(),
        }
    }

    pub(crate) fn add(&mut self, reading: &Reading, ways: (&Ways, &Taken)) {
        let direction = reading.raw.direction;
        self.ranges.add(
            reading.place,
            reading.direction_deg,
            reading.raw.range,
            reading.range_m,
            ways,
        );
        self.low = self.low.min(direction);
        self.high = self.high.max(direction);
        self.are_whole &= (direction - direction.round()).abs() < 1e-9;
        if let Some((place_m, range_m)) = reading.place_m.zip(reading.range_m) {
            self.places.add(place_m, range_m, reading.direction_deg);
        }
    }

    /// Checks the readings against the mapping; notes on what was taken as no echo.
    pub(crate) fn check(&self, ways: &Ways, taken: &Taken) -> Result<Vec<String>, ImportError> {
        if self.ranges.readings == 0 {
            return Err(ImportError::mapping(
                "there is no reading in it",
                "give a file with readings",
            ));
        }
        if !taken.as_said {
            self.check_angles(ways)?;
            self.check_places(ways)?;
        }
        self.ranges.check(ways, taken)
    }

    fn check_angles(&self, ways: &Ways) -> Result<(), ImportError> {
        let field = |quantity| ways.mapping.field(quantity);
        let field = field(Quantity::Azimuth).or_else(|| field(Quantity::Bearing));
        let Some(field) = field.filter(|_| self.ranges.readings >= MIN_READINGS) else {
            return Ok(());
        };
        let (low, high) = (self.low, self.high);
        let most = low.abs().max(high.abs());
        let other = if field.is_radians() { "deg" } else { "rad" };
        let option = Field::of(field.quantity(), Some(other))
            .map(|field| ways.mapping.columns_option_with(field, ways.names))
            .unwrap_or_default();
        if field.is_radians() && most > 4.0 * std::f64::consts::TAU {
            return Err(ImportError::Doubtful {
                what: format!(
                    "{field} goes from {low:.1} to {high:.1} rad, {:.0} turns",
                    most / std::f64::consts::TAU
                ),
                help: format!(
                    "if these are degrees: {option}; --no-unit-check takes them as they are"
                ),
            });
        }
        let is_like_radians = most <= MAX_RAD && !self.are_whole && high - low > 0.3;
        if field.unit() == Some("deg") && is_like_radians {
            return Err(ImportError::Doubtful {
                what: format!("{field} goes from {low:.3} to {high:.3}, as radians would"),
                help: format!(
                    "if these are radians: {option}; if they are degrees: --no-unit-check"
                ),
            });
        }
        Ok(())
    }

    fn check_places(&self, ways: &Ways) -> Result<(), ImportError> {
        if !self.places.are_of_echoes() {
            return Ok(());
        }
        let columns = ways.mapping.columns.iter();
        let columns: Vec<_> = columns
            .filter(|(field, _)| !matches!(field.quantity(), Quantity::X | Quantity::Y))
            .map(|(field, column)| (*field, column.clone()))
            .collect();
        let named: Vec<String> = [Quantity::X, Quantity::Y]
            .iter()
            .filter_map(|quantity| ways.mapping.columns.get(&ways.mapping.field(*quantity)?))
            .map(ToString::to_string)
            .collect();
        Err(ImportError::Doubtful {
            what: format!(
                "{} follow direction and range: the place of the echo, not of the robot",
                named.join(" and ")
            ),
            help: format!(
                "leave them out: {}; --no-unit-check takes them as the place of the robot",
                crate::mapping::columns_option(columns, ways.names)
            ),
        })
    }
}

/// Positions that come with the readings, tested for being those of the echoes: the difference to range times (cos, sin)
/// of the direction is then the same everywhere.
#[derive(Debug, Default)]
struct EchoPlaces {
    count: u64,
    own: Extent,
    /// By the ways in which people plot: x and y by cosine and sine, or exchanged, or mirrored.
    off: [Extent; 4],
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

impl EchoPlaces {
    fn add(&mut self, [x, y]: [f64; 2], range_m: f64, direction_deg: f64) {
        self.count += 1;
        self.own.add([x, y]);
        let (sin, cos) = direction_deg.to_radians().sin_cos();
        let (a, b) = (range_m * cos, range_m * sin);
        for (off, [u, v]) in self.off.iter_mut().zip([[a, b], [b, a], [a, -b], [-a, b]]) {
            off.add([x - u, y - v]);
        }
    }

    fn are_of_echoes(&self) -> bool {
        let size_m = self.own.size();
        self.count >= 4 && size_m > 0.05 && self.off.iter().any(|off| off.size() < 0.05 * size_m)
    }
}
