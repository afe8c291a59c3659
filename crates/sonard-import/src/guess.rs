//! What a header says of its columns.

use crate::{Column, Field, ImportError, Mapping, Quantity};

/// Words by which people name a quantity.
const WORDS: [(&str, Quantity); 22] = [
    ("azimuth", Quantity::Azimuth),
    ("angle", Quantity::Azimuth),
    ("theta", Quantity::Azimuth),
    ("tilt", Quantity::Azimuth),
    ("bearing", Quantity::Bearing),
    ("range", Quantity::Range),
    ("distance", Quantity::Range),
    ("dist", Quantity::Range),
    ("tof", Quantity::Tof),
    ("flight", Quantity::Tof),
    ("echo", Quantity::Tof),
    ("pulse", Quantity::Tof),
    ("time", Quantity::Time),
    ("timestamp", Quantity::Time),
    ("scan", Quantity::Scan),
    ("sweep", Quantity::Scan),
    ("x", Quantity::X),
    ("y", Quantity::Y),
    ("heading", Quantity::Heading),
    ("yaw", Quantity::Heading),
    ("temperature", Quantity::Temperature),
    ("status", Quantity::Status),
];

/// Words by which they name its unit, and how fields do.
const UNITS: [(&str, &str); 26] = [
    ("deg", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("rad", "rad"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("grad", "grad"),
    ("gon", "grad"),
    ("m", "m"),
    ("meter", "m"),
    ("meters", "m"),
    ("metres", "m"),
    ("cm", "cm"),
    ("mm", "mm"),
    ("in", "in"),
    ("inch", "in"),
    ("inches", "in"),
    ("ft", "ft"),
    ("feet", "ft"),
    ("us", "us"),
    ("microseconds", "us"),
    ("ms", "ms"),
    ("s", "s"),
    ("ns", "ns"),
    ("c", "c"),
    ("k", "k"),
];

/// What one name says.
enum Said {
    Field(Field),
    /// Of which quantity, but not in which unit.
    Quantity(Quantity),
    Nothing,
}

fn said(name: &str) -> Said {
    let lower = name.to_lowercase().replace('\u{b5}', "u").replace('\u{b0}', "deg");
    if let Some(field) = Field::named(&lower) {
        return Said::Field(field);
    }
    let words: Vec<_> =
        lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let of_word = |word: &&str| WORDS.iter().find(|(known, _)| known == word).map(|(_, is)| *is);
    let Some(quantity) = words.iter().find_map(of_word) else { return Said::Nothing };
    let unit = words
        .iter()
        .rev()
        .find_map(|word| UNITS.iter().find(|(known, _)| known == word).map(|(_, unit)| *unit));
    let matching = |field: &Field| {
        field.quantity() == quantity && field.name().rsplit_once('_').map(|(_, is)| is) == unit
    };
    match Field::all().find(matching) {
        Some(field) => Said::Field(field),
        None => Said::Quantity(quantity),
    }
}

impl Mapping {
    /// Takes the columns from their names.
    ///
    /// # Errors
    /// Two columns may have the same, or a name does not say the unit.
    pub fn guess(&mut self, names: &[String]) -> Result<(), ImportError> {
        let mut found: Vec<(Quantity, Field, &String)> = Vec::new();
        let mut without_unit = None;
        for name in names {
            match said(name) {
                Said::Field(field) => found.push((field.quantity(), field, name)),
                Said::Quantity(quantity) => without_unit = without_unit.or(Some((quantity, name))),
                Said::Nothing => {}
            }
        }
        for (at, (quantity, field, name)) in found.iter().enumerate() {
            let twin = found[..at].iter().find(|(other, ..)| other == quantity);
            if let Some((_, _, other)) = twin {
                return Err(ImportError::mapping(
                    format!("`{other}` and `{name}` may both be the {}", quantity.words()),
                    format!("name the columns: --columns {field}={name},..."),
                ));
            }
        }
        self.columns =
            found.into_iter().map(|(_, field, name)| (field, Column::Name(name.clone()))).collect();
        match without_unit {
            Some((quantity, name)) if self.field(quantity).is_none() && self.check().is_err() => {
                let units: Vec<_> = Field::all()
                    .filter(|field| field.quantity() == quantity)
                    .map(|field| format!("{field}={name}"))
                    .collect();
                Err(ImportError::mapping(
                    format!("`{name}` does not say its unit"),
                    format!("say which of these it is: --columns {}", units.join(" | ")),
                ))
            }
            _ => Ok(()),
        }
    }
}
