//! Meaning of columns by their names.

use crate::{
    Column, Field, ImportError, Mapping, Quantity,
    mapping::columns_option,
    words::{self, Name},
};

/// Meanings of the columns' names, on the way into a mapping.
#[derive(Debug, Default)]
pub(crate) struct Guess {
    /// Columns whose quantity and unit are certain.
    found: Vec<(Field, String)>,
    /// Columns of a quantity without a unit.
    without_unit: Vec<(Quantity, String)>,
    /// Columns with a unit alone.
    unit_alone: Vec<(&'static str, String)>,
    /// Columns that nothing is taken from.
    unused: Vec<String>,
    is_clockwise: bool,
}

impl Guess {
    fn of(names: &[String]) -> Self {
        let mut guess = Self::default();
        for name in names.iter().filter(|name| !name.is_empty()) {
            guess.is_clockwise |= words::is_clockwise(name);
            match words::meaning(name) {
                Name::Field(field) => guess.found.push((field, name.clone())),
                Name::Quantity(quantity) => guess.without_unit.push((quantity, name.clone())),
                Name::Unit(unit) => guess.unit_alone.push((unit, name.clone())),
                Name::Nothing => guess.unused.push(name.clone()),
            }
        }
        guess.take_yaw_as_azimuth();
        guess
    }

    fn has(&self, quantity: Quantity) -> bool {
        self.found.iter().any(|(field, _)| field.quantity() == quantity)
    }

    fn has_direction(&self) -> bool {
        self.has(Quantity::Azimuth) || self.has(Quantity::Bearing)
    }

    fn has_range(&self) -> bool {
        self.has(Quantity::Range) || self.has(Quantity::Tof)
    }

    /// Takes yaw as the azimuth of the ranger's mount, where nothing else turns and nothing moves.
    fn take_yaw_as_azimuth(&mut self) {
        if self.has_direction() || self.has(Quantity::X) {
            return;
        }
        for (field, _) in &mut self.found {
            if field.quantity() == Quantity::Heading
                && let Some(azimuth) = Field::of(Quantity::Azimuth, field.unit())
            {
                *field = azimuth;
            }
        }
    }

    /// Fields and columns, with some in place of those of their quantity.
    fn option(&self, with: &[(Field, &str)], names: &[String]) -> String {
        let is_replaced =
            |field: &Field| with.iter().any(|(other, _)| other.quantity() == field.quantity());
        let kept = self.found.iter().filter(|(field, _)| !is_replaced(field));
        let with = with.iter().map(|(field, name)| (*field, (*name).to_owned()));
        let mut all: Vec<(Field, String)> = with.chain(kept.cloned()).collect();
        all.sort();
        all.dedup_by_key(|(field, _)| field.quantity());
        columns_option(all.into_iter().map(|(field, name)| (field, Column::Name(name))), names)
    }

    /// The columns of ranges in one unit, if they are many and side by side: those of an array.
    pub(crate) fn of_array(&self, names: &[String]) -> Option<(Field, Vec<usize>)> {
        let ranges = self.found.iter().filter(|(field, _)| field.quantity() == Quantity::Range);
        let ranges: Vec<&(Field, String)> = ranges.collect();
        let (field, _) = ranges.first()?;
        let place = |name: &String| names.iter().position(|known| known == name).map(|at| at + 1);
        let places: Vec<usize> = ranges.iter().filter_map(|(_, name)| place(name)).collect();
        let are_side_by_side = places.windows(2).all(|pair| pair[1] == pair[0] + 1);
        let are_alike = ranges.iter().all(|(other, _)| other == field);
        (places.len() > 2 && places.len() == ranges.len() && are_side_by_side && are_alike)
            .then_some((*field, places))
    }

    /// Two columns of one quantity.
    fn check_twins(&self, names: &[String]) -> Result<(), ImportError> {
        if let Some((field, places)) = self.of_array(names) {
            let columns = columns_option([(field, Column::Several(places.clone()))], names);
            return Err(ImportError::mapping(
                format!("{} columns are ranges: one a ranger of an array?", places.len()),
                format!(
                    "give the places of the rangers: --array NAME {columns}, with an array of `sonard array list` or a file"
                ),
            ));
        }
        for (at, (field, name)) in self.found.iter().enumerate() {
            let twin =
                self.found[..at].iter().find(|(other, _)| other.quantity() == field.quantity());
            if let Some((other, twin)) = twin {
                let [one, two] = [(*other, twin.as_str()), (*field, name.as_str())]
                    .map(|choice| self.option(&[choice], names));
                return Err(ImportError::mapping(
                    format!("`{twin}` and `{name}` may both be the {}", field.quantity().words()),
                    format!("choose: {one} or {two}"),
                ));
            }
        }
        Ok(())
    }

    /// The columns that a direction or a range may be taken from, by their units.
    fn offers(&self, quantities: [Quantity; 2]) -> Vec<(Field, &str)> {
        let fields = |(unit, name): &(&'static str, String)| {
            let fields = quantities.map(|quantity| Field::of(quantity, Some(unit)));
            fields.into_iter().flatten().next().map(|field| (field, name.clone()))
        };
        let with_unit = self.unit_alone.iter().filter_map(fields);
        let names = |wanted: &(Field, String)| {
            let found = self.unit_alone.iter().find(|(_, name)| *name == wanted.1);
            found.map(|(_, name)| (wanted.0, name.as_str()))
        };
        let with_unit: Vec<_> = with_unit.collect();
        let mut offers: Vec<(Field, &str)> = with_unit.iter().filter_map(names).collect();
        let without =
            self.without_unit.iter().filter(|(quantity, _)| quantities.contains(quantity));
        for (quantity, name) in without {
            offers.extend(Field::of_quantity(*quantity).map(|field| (field, name.as_str())));
        }
        offers
    }

    /// Checks that a direction and a range are named; offers the options that name them with the file's own columns.
    fn check_missing(&self, mapping: &Mapping, names: &[String]) -> Result<(), ImportError> {
        let needs_direction = !self.has_direction() && mapping.azimuth_deg.is_none();
        let needs_range = !self.has_range();
        if !needs_direction && !needs_range {
            return Ok(());
        }
        let directions = self.offers([Quantity::Azimuth, Quantity::Bearing]);
        let ranges = self.offers([Quantity::Range, Quantity::Tof]);
        let lacks = match (needs_direction, needs_range) {
            (true, true) => "no column is named as a direction or a range",
            (true, false) => "no column has the azimuth or the bearing",
            _ => "no column has the range or the time of flight",
        };
        let without_unit = self.without_unit.iter().find(|(quantity, _)| match quantity {
            Quantity::Azimuth | Quantity::Bearing => needs_direction,
            Quantity::Range | Quantity::Tof => needs_range,
            _ => false,
        });
        let what = match without_unit {
            Some((_, name)) => format!("`{name}` does not say its unit"),
            None => format!("{lacks}; the columns are `{}`", names.join("`, `")),
        };
        // One choice of each at a time: the first of the directions with every range, then the others.
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
            [one] => format!("if that is meant: {one}"),
            all => format!("choose: {}", all.join(" | ")),
        };
        if needs_direction && !needs_range && options.is_empty() {
            help = "give the direction of the ranger, if it is fixed: --azimuth-deg DEG".to_owned();
        } else if needs_direction && options.is_empty() && ranges.len() == 1 {
            let with = self.option(&ranges[..1], names);
            help = format!(
                "give the direction of the ranger, if it is fixed: --azimuth-deg DEG {with}"
            );
        } else if needs_direction && options.is_empty() && !ranges.is_empty() {
            let with: Vec<String> =
                ranges.iter().take(MAX_OFFERS).map(|range| self.option(&[*range], names)).collect();
            help = format!(
                "give the direction of the ranger, if it is fixed, and choose a unit: --azimuth-deg DEG {}",
                with.join(" | --azimuth-deg DEG ")
            );
        } else if options.is_empty() {
            let place = if needs_range { "range_cm" } else { "azimuth_deg" };
            help = format!(
                "name the columns, by name or number, and their units: --columns azimuth_deg=1,{place}=2, or any \
                 other fields of `sonard import --help`"
            );
        }
        Err(ImportError::mapping(what, help))
    }
}

/// Options offered at most.
const MAX_OFFERS: usize = 6;

impl Mapping {
    /// Takes the ranges of an array's rangers, and what else the names say, if there is a column for each of them.
    pub(crate) fn guess_array(&mut self, names: &[String], rangers: usize) -> bool {
        let mut guess = Guess::of(names);
        let Some((field, places)) =
            guess.of_array(names).filter(|(_, places)| places.len() == rangers)
        else {
            return false;
        };
        guess.found.retain(|(field, _)| {
            !matches!(
                field.quantity(),
                Quantity::Range | Quantity::Tof | Quantity::Azimuth | Quantity::Bearing
            )
        });
        self.columns =
            guess.found.into_iter().map(|(field, name)| (field, Column::Name(name))).collect();
        self.columns.insert(field, Column::Several(places));
        true
    }

    /// Takes the columns from their names; what was assumed, a line each.
    ///
    /// # Errors
    /// Two columns may have the same, or a name does not say the unit.
    pub fn guess(&mut self, names: &[String]) -> Result<Vec<String>, ImportError> {
        let guess = Guess::of(names);
        guess.check_twins(names)?;
        guess.check_missing(self, names)?;
        let mut notes = Vec::new();
        let yaw = guess
            .found
            .iter()
            .find(|(field, name)| field.quantity() == Quantity::Azimuth && words::is_yaw(name));
        if let Some((_, name)) = yaw {
            notes.push(format!("`{name}` is taken as the azimuth: no other column is a direction"));
        }
        if guess.is_clockwise && !self.clockwise {
            self.clockwise = true;
            notes.push("directions count clockwise, as their column's name says".to_owned());
        }
        let more = guess.without_unit.iter().map(|(_, name)| name);
        let more = more.chain(guess.unit_alone.iter().map(|(_, name)| name)).chain(&guess.unused);
        let unused: Vec<&str> = more.map(String::as_str).collect();
        if !unused.is_empty() {
            notes.push(format!("columns not used: `{}`", unused.join("`, `")));
        }
        self.columns =
            guess.found.into_iter().map(|(field, name)| (field, Column::Name(name))).collect();
        Ok(notes)
    }
}
