//! Inference of a mapping from column names.

use std::collections::BTreeMap;

use crate::{
    Column, Field, FieldQuantity, ImportError, Mapping,
    column_names::{self, NameMeaning},
    mapping::columns_option,
};

/// Columns of a table, sorted by the meaning of their names.
#[derive(Debug, Default)]
pub(crate) struct ColumnCandidates {
    /// Columns with known quantity and unit.
    found: Vec<(Field, String)>,
    /// Columns of a quantity without a unit.
    without_unit: Vec<(FieldQuantity, String)>,
    /// Columns with only a unit.
    unit_alone: Vec<(&'static str, String)>,
    /// Columns that are not used.
    unused: Vec<String>,
    is_clockwise: bool,
}

impl ColumnCandidates {
    fn from_names(names: &[String]) -> Self {
        let mut candidates = Self::default();
        for name in names.iter().filter(|name| !name.is_empty()) {
            candidates.is_clockwise |= column_names::is_clockwise(name);
            match column_names::meaning(name) {
                NameMeaning::Field(field) => candidates.found.push((field, name.clone())),
                NameMeaning::FieldQuantity(quantity) => {
                    candidates.without_unit.push((quantity, name.clone()));
                }
                NameMeaning::Unit(unit) => candidates.unit_alone.push((unit, name.clone())),
                NameMeaning::Unknown => candidates.unused.push(name.clone()),
            }
        }
        candidates.take_yaw_as_azimuth();
        candidates
    }

    fn has(&self, quantity: FieldQuantity) -> bool {
        self.found.iter().any(|(field, _)| field.quantity() == quantity)
    }

    fn has_direction(&self) -> bool {
        self.has(FieldQuantity::Azimuth) || self.has(FieldQuantity::Bearing)
    }

    fn has_range(&self) -> bool {
        self.has(FieldQuantity::Range) || self.has(FieldQuantity::Tof)
    }

    /// Interprets yaw as the azimuth of the ranger's mount, if there is no other direction and no
    /// position.
    fn take_yaw_as_azimuth(&mut self) {
        let is_direction = |quantity: FieldQuantity| quantity.role() == FieldQuantity::Azimuth;
        let has_other = self.without_unit.iter().any(|(quantity, _)| is_direction(*quantity));
        if self.has_direction() || has_other || self.has(FieldQuantity::X) {
            return;
        }
        for (quantity, _) in &mut self.without_unit {
            if *quantity == FieldQuantity::Heading {
                *quantity = FieldQuantity::Azimuth;
            }
        }
        for (field, _) in &mut self.found {
            if field.quantity() == FieldQuantity::Heading
                && let Some(azimuth) = Field::with_unit(FieldQuantity::Azimuth, field.unit())
            {
                *field = azimuth;
            }
        }
    }

    /// Formats `--columns` for all found columns, with `with` in place of those with the same role.
    fn option(&self, with: &[(Field, &str)], names: &[String]) -> String {
        let role = |field: &Field| field.quantity().role();
        let is_replaced = |field: &Field| with.iter().any(|(other, _)| role(other) == role(field));
        let is_used = |name: &String| with.iter().any(|(_, used)| used == name);
        let kept = self.found.iter().filter(|(field, name)| !is_replaced(field) && !is_used(name));
        let with = with.iter().map(|(field, name)| (*field, (*name).to_owned()));
        let mut all: Vec<(Field, String)> = with.chain(kept.cloned()).collect();
        all.sort();
        all.dedup_by_key(|(field, _)| field.quantity());
        columns_option(all.into_iter().map(|(field, name)| (field, Column::Name(name))), names)
    }

    /// Returns the range columns of an array: more than two, adjacent and in one unit.
    pub(crate) fn array_columns(&self, names: &[String]) -> Option<(Field, Vec<usize>)> {
        let ranges =
            self.found.iter().filter(|(field, _)| field.quantity() == FieldQuantity::Range);
        let ranges: Vec<(Field, &String)> = ranges.map(|(field, name)| (*field, name)).collect();
        if !ranges.is_empty() {
            return adjacent(&ranges, names);
        }
        // Columns that are named after the rangers, with the unit only: `s0 [cm]`.
        let by_unit = self.unit_alone.iter().filter_map(|(unit, name)| {
            Field::with_unit(FieldQuantity::Range, Some(unit)).map(|field| (field, name))
        });
        adjacent(&by_unit.collect::<Vec<_>>(), names)
    }

    /// Returns the numbers of the range columns of an array that lack a unit.
    fn array_columns_without_unit(&self, names: &[String]) -> Option<Vec<usize>> {
        let any = Field::of_quantity(FieldQuantity::Range).next()?;
        let ranges =
            self.without_unit.iter().filter(|(quantity, _)| *quantity == FieldQuantity::Range);
        let ranges: Vec<(Field, &String)> = ranges.map(|(_, name)| (any, name)).collect();
        adjacent(&ranges, names).map(|(_, places)| places)
    }

    /// Rejects two columns of one quantity.
    fn check_duplicates(&self, names: &[String]) -> Result<(), ImportError> {
        if let Some((field, places)) = self.array_columns(names) {
            let columns = columns_option([(field, Column::Several(places.clone()))], names);
            return Err(ImportError::mapping(
                format!("{} columns are ranges: one per ranger of an array?", places.len()),
                format!(
                    "give the array: --array NAME {columns}, with a name from `sonard array list` or a file"
                ),
            ));
        }
        for (at, (field, name)) in self.found.iter().enumerate() {
            let is_same_role =
                |(other, _): &&(Field, String)| other.quantity().role() == field.quantity().role();
            let duplicate = self.found[..at].iter().find(is_same_role);
            if let Some((other, duplicate)) = duplicate.filter(|(_, other)| other == name) {
                let numbers = (1..).zip(names).filter(|(_, known)| *known == name);
                let options = numbers.take(2).map(|(number, _)| {
                    let others = self.found.iter().filter(|(_, known)| known != name);
                    let others = others.map(|(field, name)| (*field, Column::Name(name.clone())));
                    let all = others.chain([(*other, Column::Number(number))]);
                    columns_option(all.collect::<BTreeMap<_, _>>(), names)
                });
                return Err(ImportError::mapping(
                    format!("two columns are named `{duplicate}`"),
                    format!("choose: {}", options.collect::<Vec<_>>().join(" or ")),
                ));
            }
            if let Some((other, duplicate)) = duplicate {
                let [first, second] = [(*other, duplicate.as_str()), (*field, name.as_str())]
                    .map(|choice| self.option(&[choice], names));
                let words = match other.quantity() == field.quantity() {
                    true => field.quantity().label(),
                    false => "measured quantity",
                };
                return Err(ImportError::mapping(
                    format!("`{duplicate}` and `{name}` may both be the {words}"),
                    format!("choose: {first} or {second}"),
                ));
            }
        }
        Ok(())
    }

    /// Returns the columns that may hold one of the quantities, with a field for each possible
    /// unit.
    fn offers(&self, quantities: [FieldQuantity; 2]) -> Vec<(Field, &str)> {
        let fields = |(unit, name): &(&'static str, String)| {
            let fields = quantities.map(|quantity| Field::with_unit(quantity, Some(unit)));
            fields.into_iter().flatten().next().map(|field| (field, name.clone()))
        };
        let with_unit = self.unit_alone.iter().filter_map(fields);
        let names = |offer: &(Field, String)| {
            let found = self.unit_alone.iter().find(|(_, name)| *name == offer.1);
            found.map(|(_, name)| (offer.0, name.as_str()))
        };
        let with_unit: Vec<_> = with_unit.collect();
        let mut offers: Vec<(Field, &str)> = with_unit.iter().filter_map(names).collect();
        let without =
            self.without_unit.iter().filter(|(quantity, _)| quantities.contains(quantity));
        for (quantity, name) in without {
            let fields = Field::of_quantity(*quantity).filter(|field| field.is_usual());
            offers.extend(fields.map(|field| (field, name.as_str())));
        }
        offers
    }

    /// Returns the columns of unknown meaning that may be the range: a time whose unit is also one
    /// of times of flight, or else any unused column, in the usual units.
    fn unnamed_ranges(&self) -> Vec<(Field, &str)> {
        let times = self.found.iter().filter(|(field, _)| field.quantity() == FieldQuantity::Time);
        let times = times.filter_map(|(field, name)| {
            Field::with_unit(FieldQuantity::Tof, Some(field.unit()?))
                .map(|field| (field, name.as_str()))
        });
        let has_word = |name: &&String| name.contains(char::is_alphabetic);
        let unused = self.unused.iter().filter(has_word);
        let unused = unused.filter(|name| !column_names::is_no_reading(name));
        let unused = unused.flat_map(|name| {
            let quantities = [FieldQuantity::Range, FieldQuantity::Tof];
            let fields =
                quantities.into_iter().flat_map(|quantity| Field::of_quantity(quantity).take(3));
            fields.map(|field| (field, name.as_str()))
        });
        times.chain(unused).collect()
    }

    /// Checks that a direction and a range are mapped; the error offers complete options with the
    /// file's own columns.
    fn check_missing(&self, mapping: &Mapping, names: &[String]) -> Result<(), ImportError> {
        let needs_direction = !self.has_direction() && mapping.azimuth_deg.is_none();
        let needs_range = !self.has_range();
        if !needs_direction && !needs_range {
            return Ok(());
        }
        let directions = self.offers([FieldQuantity::Azimuth, FieldQuantity::Bearing]);
        let ranges = self.offers([FieldQuantity::Range, FieldQuantity::Tof]);
        if let Some(places) = self.array_columns_without_unit(names) {
            return Err(missing_array_unit(&places, names));
        }
        let lacks = match (needs_direction, needs_range) {
            (true, true) => "no column is recognized as a direction or a range",
            (true, false) => "no column is mapped to azimuth or bearing",
            _ => "no column is mapped to range or time of flight",
        };
        let without_unit = self.without_unit.iter().find(|(quantity, _)| match quantity {
            FieldQuantity::Azimuth | FieldQuantity::Bearing => needs_direction,
            FieldQuantity::Range | FieldQuantity::Tof => needs_range,
            _ => false,
        });
        let what = match without_unit {
            Some((_, name)) => format!("the unit of column `{name}` is unknown"),
            None => format!("{lacks}; the columns are `{}`", names.join("`, `")),
        };
        // A single name is more likely a line of text.
        let ranges = match ranges.is_empty() && names.len() > 1 {
            true => self.unnamed_ranges(),
            false => ranges,
        };
        // Every combination of a direction and a range, if both are missing.
        let directions = if needs_direction { directions } else { Vec::new() };
        let ranges = if needs_range { ranges } else { Vec::new() };
        let complete: Vec<Vec<(Field, &str)>> = match (needs_direction, needs_range) {
            (true, true) => directions
                .iter()
                .flat_map(|direction| ranges.iter().map(move |range| vec![*direction, *range]))
                .collect(),
            (true, false) => directions.iter().map(|direction| vec![*direction]).collect(),
            _ => ranges.iter().map(|range| vec![*range]).collect(),
        };
        let options: Vec<String> =
            complete.iter().take(MAX_OFFERS).map(|with| self.option(with, names)).collect();
        let mut help = match &options[..] {
            [] => String::new(),
            [option] => format!("if that is right: {option}"),
            all => format!("choose: {}", all.join(" | ")),
        };
        if needs_direction && !needs_range && options.is_empty() {
            help = "if the ranger is fixed, give its direction: --azimuth-deg DEG".to_owned();
        } else if needs_direction && options.is_empty() && ranges.len() == 1 {
            let with = self.option(&ranges[..1], names);
            help = format!("if the ranger is fixed, give its direction: --azimuth-deg DEG {with}");
        } else if needs_direction && options.is_empty() && !ranges.is_empty() {
            let with: Vec<String> =
                ranges.iter().take(MAX_OFFERS).map(|range| self.option(&[*range], names)).collect();
            help = format!(
                "if the ranger is fixed, give its direction and choose a unit: --azimuth-deg DEG {}",
                with.join(" | --azimuth-deg DEG ")
            );
        } else if options.is_empty() && needs_range {
            help = "give a file with ranges or times of flight; fields are listed by `sonard import --help`"
                .to_owned();
        }
        Err(ImportError::mapping(what, help))
    }
}

/// Maximum number of options in a message.
const MAX_OFFERS: usize = 6;

/// Returns the common field and the numbers of columns that may be the ranges of an array: more
/// than two, adjacent and of one field.
fn adjacent(ranges: &[(Field, &String)], names: &[String]) -> Option<(Field, Vec<usize>)> {
    let (field, _) = ranges.first()?;
    let place = |name: &String| names.iter().position(|known| known == name).map(|at| at + 1);
    let places: Vec<usize> = ranges.iter().filter_map(|(_, name)| place(name)).collect();
    let are_side_by_side = places.windows(2).all(|pair| pair[1] == pair[0] + 1);
    let are_alike = ranges.iter().all(|(other, _)| other == field);
    (places.len() > 2 && places.len() == ranges.len() && are_side_by_side && are_alike)
        .then_some((*field, places))
}

/// Rejects a LaserScan in columns, in which the beams have no angles of their own.
fn check_laser_columns(names: &[String]) -> Result<(), ImportError> {
    let has = |word: &str| names.iter().any(|name| name.contains(word));
    if !(has("angle_min") && has("angle_increment")) {
        return Ok(());
    }
    Err(ImportError::mapping(
        "the table is a LaserScan in columns, as printed by `rostopic echo -p`",
        "print it as YAML, without -p: `rostopic echo /scan > scan.yaml`, and import that",
    ))
}

impl Mapping {
    /// Maps the ranges of an array and the other named columns; returns `false` unless there is one
    /// range column per ranger.
    pub(crate) fn infer_array(&mut self, names: &[String], rangers: usize) -> bool {
        let mut candidates = ColumnCandidates::from_names(names);
        let Some((field, places)) =
            candidates.array_columns(names).filter(|(_, places)| places.len() == rangers)
        else {
            return false;
        };
        candidates.found.retain(|(field, _)| {
            !matches!(
                field.quantity(),
                FieldQuantity::Range
                    | FieldQuantity::Tof
                    | FieldQuantity::Azimuth
                    | FieldQuantity::Bearing
            )
        });
        self.columns =
            candidates.found.into_iter().map(|(field, name)| (field, Column::Name(name))).collect();
        self.columns.insert(field, Column::Several(places));
        true
    }

    /// Infers the columns from their names and returns one note for each assumption.
    ///
    /// # Errors
    /// Returns an error for two columns of one quantity, or for a name without a unit.
    pub(crate) fn infer_columns(&mut self, names: &[String]) -> Result<Vec<String>, ImportError> {
        check_laser_columns(names)?;
        let candidates = ColumnCandidates::from_names(names);
        candidates.check_duplicates(names)?;
        candidates.check_missing(self, names)?;
        let mut notes = Vec::new();
        let yaw = candidates.found.iter().find(|(field, name)| {
            field.quantity() == FieldQuantity::Azimuth && column_names::is_yaw(name)
        });
        if let Some((_, name)) = yaw {
            notes.push(format!("`{name}` taken as the azimuth: no other column is a direction"));
        }
        if candidates.is_clockwise && !self.clockwise {
            self.clockwise = true;
            notes.push("azimuths taken as clockwise, by the name of their column".to_owned());
        }
        let more = candidates.without_unit.iter().map(|(_, name)| name);
        let more = more
            .chain(candidates.unit_alone.iter().map(|(_, name)| name))
            .chain(&candidates.unused);
        let unused: Vec<&str> = more.map(String::as_str).collect();
        if !unused.is_empty() {
            notes.push(format!("columns not used: `{}`", unused.join("`, `")));
        }
        self.columns =
            candidates.found.into_iter().map(|(field, name)| (field, Column::Name(name))).collect();
        Ok(notes)
    }
}

/// Builds the error that requests the unit of the range columns of an array.
fn missing_array_unit(places: &[usize], names: &[String]) -> ImportError {
    let options = Field::of_quantity(FieldQuantity::Range)
        .take(3)
        .map(|field| columns_option([(field, Column::Several(places.to_vec()))], names));
    let options: Vec<String> = options.map(|option| format!("--array NAME {option}")).collect();
    ImportError::mapping(
        format!("{} columns are ranges without a unit: one per ranger of an array?", places.len()),
        format!("give the array and select the unit: {}", options.join(" | ")),
    )
}
