//! Checks of the angles and positions of a rotating ranger.

use super::{
    RangeStats, UnitContext,
    angles::{AngleStats, MAX_RAD},
    echo_positions::EchoPositions,
    implausible,
    order::SweepOrder,
};
use crate::{
    Assumptions, FieldQuantity, ImportError, ImportedReading, mapping::columns_option,
    no_echo_constant::DirectionKind,
};

/// Minimum number of readings for the check of angles.
const MIN_READINGS: u64 = 2;

/// Statistics of all readings of one rotating ranger.
#[derive(Debug)]
pub(crate) struct SweepStats {
    pub(crate) ranges: RangeStats,
    /// Directions, in the unit of the file.
    directions: AngleStats,
    /// Headings, in degrees.
    headings: AngleStats,
    places: EchoPositions,
    /// Positions with directions from the x axis, for a robot with a heading.
    turned_places: EchoPositions,
    order: SweepOrder,
}

impl SweepStats {
    pub(crate) fn new() -> Self {
        Self {
            ranges: RangeStats::new(DirectionKind::Angles),
            directions: AngleStats::default(),
            headings: AngleStats::default(),
            places: EchoPositions::default(),
            turned_places: EchoPositions::default(),
            order: SweepOrder::default(),
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
        self.order.add(reading);
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
            self.order.check(units)?;
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
        let are_degrees = max_angle > 4.0 * std::f64::consts::TAU
            || (max_angle > MAX_RAD && self.directions.all_integers);
        if field.is_radians() && are_degrees {
            return Err(implausible(
                format!(
                    "{field} spans {low:.1} to {high:.1} rad, {:.1} revolutions",
                    max_angle / std::f64::consts::TAU
                ),
                format!(
                    "if these are degrees: {}; --no-unit-check skips this check",
                    units.option_in(field.quantity(), "deg")
                ),
            ));
        }
        if field.unit() == Some("deg") && self.directions.directions_look_like_radians() {
            return Err(units.looks_like_radians(field, &self.directions));
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
        Err(units.looks_like_radians(field, &self.headings))
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
                columns_option(columns, units.names)
            ),
        ))
    }
}
