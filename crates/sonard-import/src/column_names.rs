//! Recognition of quantities and units in the column names of a table.

use crate::{Field, FieldQuantity};

/// Meaning of a column name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NameMeaning {
    Field(Field),
    /// Quantity without a unit.
    FieldQuantity(FieldQuantity),
    /// Unit without a quantity.
    Unit(&'static str),
    Unknown,
}

use FieldQuantity::{Azimuth, Bearing, Heading, Range, Scan, Status, Temperature, Time, Tof, X, Y};

/// Words for a quantity, the more specific first. The unit resolves words that several quantities
/// share.
const QUANTITY_WORDS: &[(&str, &[FieldQuantity])] = &[
    ("flight", &[Tof]),
    ("tof", &[Tof]),
    ("laufzeit", &[Tof]),
    ("flugzeit", &[Tof]),
    ("duration", &[Tof]),
    ("dauer", &[Tof]),
    ("duree", &[Tof]),
    ("durée", &[Tof]),
    ("duracion", &[Tof]),
    ("duración", &[Tof]),
    ("durata", &[Tof]),
    ("travel", &[Tof, Range]),
    ("pulse", &[Tof]),
    ("pulsewidth", &[Tof]),
    ("roundtrip", &[Tof]),
    ("ping", &[Tof]),
    ("pulso", &[Tof]),
    ("puls", &[Tof]),
    ("azimuth", &[Azimuth]),
    ("azimut", &[Azimuth]),
    ("pan", &[Azimuth]),
    ("servo", &[Azimuth]),
    ("azimuths", &[Azimuth]),
    ("angle", &[Azimuth]),
    ("angles", &[Azimuth]),
    ("ang", &[Azimuth]),
    ("theta", &[Azimuth]),
    ("phi", &[Azimuth]),
    ("winkel", &[Azimuth]),
    ("drehwinkel", &[Azimuth]),
    ("richtung", &[Azimuth]),
    ("direction", &[Azimuth]),
    ("angulo", &[Azimuth]),
    ("ángulo", &[Azimuth]),
    ("ângulo", &[Azimuth]),
    ("angolo", &[Azimuth]),
    ("hoek", &[Azimuth]),
    ("kąt", &[Azimuth]),
    ("kat", &[Azimuth]),
    ("vinkel", &[Azimuth]),
    ("kulma", &[Azimuth]),
    ("úhel", &[Azimuth]),
    ("uhel", &[Azimuth]),
    ("uhol", &[Azimuth]),
    ("szög", &[Azimuth]),
    ("açı", &[Azimuth]),
    ("aci", &[Azimuth]),
    ("угол", &[Azimuth]),
    ("角度", &[Azimuth]),
    ("方位角", &[Azimuth]),
    ("각도", &[Azimuth]),
    ("rotation", &[Azimuth]),
    ("bearing", &[Bearing]),
    ("bearings", &[Bearing]),
    ("peilung", &[Bearing]),
    ("range", &[Range]),
    ("distance", &[Range]),
    ("distances", &[Range]),
    ("ranges", &[Range]),
    ("dist", &[Range]),
    ("entfernung", &[Range]),
    ("abstand", &[Range]),
    ("distanz", &[Range]),
    ("distancia", &[Range]),
    ("distância", &[Range]),
    ("distanza", &[Range]),
    ("portée", &[Range]),
    ("afstand", &[Range]),
    ("odległość", &[Range]),
    ("odleglosc", &[Range]),
    ("avstånd", &[Range]),
    ("avstand", &[Range]),
    ("etäisyys", &[Range]),
    ("vzdálenost", &[Range]),
    ("vzdialenosť", &[Range]),
    ("távolság", &[Range]),
    ("mesafe", &[Range]),
    ("uzaklık", &[Range]),
    ("расстояние", &[Range]),
    ("дальность", &[Range]),
    ("距离", &[Range]),
    ("距離", &[Range]),
    ("거리", &[Range]),
    ("sonar", &[Range]),
    ("ultrasonic", &[Range]),
    ("echo", &[Tof, Range]),
    ("eco", &[Tof, Range]),
    ("timestamp", &[Time]),
    ("time", &[Time]),
    ("millis", &[Time]),
    ("micros", &[Time]),
    ("zeit", &[Time]),
    ("uhrzeit", &[Time]),
    ("zeitstempel", &[Time]),
    ("datetime", &[Time]),
    ("temps", &[Time]),
    ("tiempo", &[Time]),
    ("tempo", &[Time]),
    ("tijd", &[Time]),
    ("elapsed", &[Time]),
    ("uptime", &[Time]),
    ("t", &[Time]),
    ("scan", &[Scan]),
    ("sweep", &[Scan]),
    ("x", &[X]),
    ("y", &[Y]),
    ("heading", &[Heading]),
    ("yaw", &[Heading]),
    ("temperature", &[Temperature]),
    ("temperatur", &[Temperature]),
    ("temp", &[Temperature]),
    ("status", &[Status]),
];

/// Words for a unit, and the suffix that fields use.
const UNIT_WORDS: &[(&str, &str)] = &[
    ("deg", "deg"),
    ("degs", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("grados", "deg"),
    ("gradi", "deg"),
    ("graden", "deg"),
    ("graus", "deg"),
    ("degré", "deg"),
    ("degrés", "deg"),
    ("grader", "deg"),
    ("aste", "deg"),
    ("astetta", "deg"),
    ("stopnie", "deg"),
    ("stupně", "deg"),
    ("stupňů", "deg"),
    ("fok", "deg"),
    ("derece", "deg"),
    ("град", "deg"),
    ("градусы", "deg"),
    ("度", "deg"),
    ("도", "deg"),
    ("rad", "rad"),
    ("rads", "rad"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("radiant", "rad"),
    ("gon", "grad"),
    ("m", "m"),
    ("м", "m"),
    ("米", "m"),
    ("meter", "m"),
    ("meters", "m"),
    ("metre", "m"),
    ("metres", "m"),
    ("cm", "cm"),
    ("centimeter", "cm"),
    ("centimeters", "cm"),
    ("centimetres", "cm"),
    ("zentimeter", "cm"),
    ("см", "cm"),
    ("厘米", "cm"),
    ("センチ", "cm"),
    ("mm", "mm"),
    ("millimeter", "mm"),
    ("millimeters", "mm"),
    ("millimetres", "mm"),
    ("мм", "mm"),
    ("毫米", "mm"),
    ("dm", "dm"),
    ("um", "um"),
    ("micron", "um"),
    ("microns", "um"),
    ("km", "km"),
    ("in", "in"),
    ("inch", "in"),
    ("inches", "in"),
    ("zoll", "in"),
    ("ft", "ft"),
    ("feet", "ft"),
    ("foot", "ft"),
    ("yd", "yd"),
    ("yard", "yd"),
    ("yards", "yd"),
    ("us", "us"),
    ("usec", "us"),
    ("micros", "us"),
    ("microsecond", "us"),
    ("microseconds", "us"),
    ("mikrosekunden", "us"),
    ("ms", "ms"),
    ("msec", "ms"),
    ("millis", "ms"),
    ("millisecond", "ms"),
    ("milliseconds", "ms"),
    ("millisekunden", "ms"),
    ("s", "s"),
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("sekunden", "s"),
    ("ns", "ns"),
    ("nsec", "ns"),
    ("nanoseconds", "ns"),
    ("c", "c"),
    ("celsius", "c"),
    ("k", "k"),
    ("kelvin", "k"),
    ("f", "f"),
    ("fahrenheit", "f"),
];

/// Words of columns without readings: limits, steps, standard deviations, and pitch or roll angles.
const NON_READING_WORDS: [&str; 42] = [
    "min",
    "minimum",
    "max",
    "maximum",
    "limit",
    "least",
    "greatest",
    "longest",
    "shortest",
    "lowest",
    "highest",
    "threshold",
    "cutoff",
    "blanking",
    "oneway",
    "increment",
    "inc",
    "step",
    "std",
    "stddev",
    "sigma",
    "error",
    "err",
    "variance",
    "var",
    "accuracy",
    "confidence",
    "quality",
    "intensity",
    "amplitude",
    "tilt",
    "pitch",
    "roll",
    "elevation",
    "inclination",
    "neigung",
    "fov",
    "view",
    "width",
    "resolution",
    "seq",
    "covariance",
];

/// Words that mark the position of an echo, as opposed to that of the robot.
const ECHO_POSITION_WORDS: [&str; 8] =
    ["echo", "point", "hit", "target", "obstacle", "plot", "px", "py"];

/// German words for a direction; next to one of them, `Grad` means degrees instead of gradians.
const GERMAN_DIRECTION_WORDS: [&str; 5] = ["winkel", "drehwinkel", "richtung", "azimut", "peilung"];

/// Splits a name into lower-case words, at punctuation, digits and capitals after small letters.
fn words(name: &str) -> Vec<String> {
    let name = name.replace(['\u{b5}', '\u{3bc}'], "u").replace(['\u{b0}', '\u{ba}'], " deg ");
    let mut parted = String::new();
    let mut last = ' ';
    for c in name.chars() {
        if (last.is_lowercase() && c.is_uppercase()) || last.is_numeric() != c.is_numeric() {
            parted.push(' ');
        }
        parted.push(c);
        last = c;
    }
    let lower = parted.to_lowercase();
    lower
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

pub(crate) fn is_yaw(name: &str) -> bool {
    words(name).iter().any(|word| word == "yaw" || word == "heading")
}

pub(crate) fn is_clockwise(name: &str) -> bool {
    words(name).iter().any(|word| word == "cw" || word == "clockwise")
}

/// Returns `true` for the name of a unit.
pub(crate) fn is_unit(word: &str) -> bool {
    let words = words(word);
    let is_known =
        |word: &String| word == "grad" || UNIT_WORDS.iter().any(|(known, _)| known == word);
    !words.is_empty() && words.iter().all(is_known)
}

/// Returns `true` for a time of one way, from which the range is computed in another way.
fn is_one_way(words: &[String]) -> bool {
    words.windows(2).any(|pair| pair[0] == "one" && pair[1] == "way")
}

/// Returns `true` for a name that rules out readings: a limit, a step, a quality.
pub(crate) fn is_no_reading(name: &str) -> bool {
    let words = words(name);
    let has = |word: &str| words.iter().any(|known| known == word);
    is_one_way(&words)
        || NON_READING_WORDS.iter().any(|word| has(word))
        || ECHO_POSITION_WORDS.iter().any(|word| has(word))
}

/// Returns the meaning of a column name.
pub(crate) fn meaning(name: &str) -> NameMeaning {
    let words = words(name);
    let has = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
    if let Some(field) = Field::from_name(&name.trim().to_lowercase()) {
        return NameMeaning::Field(field);
    }
    // A pulse has a width and a travel time.
    let is_pulse = has(&["pulse"]) && has(&["width"]);
    if is_one_way(&words) || (has(&NON_READING_WORDS) && !is_pulse) {
        return NameMeaning::Unknown;
    }
    let is_german_degree = has(&["grad"]) && has(&GERMAN_DIRECTION_WORDS);
    let unit = words.iter().rev().find_map(|word| {
        let unit = UNIT_WORDS.iter().find(|(known, _)| known == word).map(|(_, unit)| *unit);
        unit.or_else(|| (word == "grad" && is_german_degree).then_some("deg"))
    });
    // A lone `t` may be a time or a temperature.
    if unit.is_none() && words == ["t"] {
        return NameMeaning::Unknown;
    }
    let quantities = || {
        let named =
            QUANTITY_WORDS.iter().filter(|(known, _)| words.iter().any(|word| word == known));
        named.flat_map(|(_, quantities)| quantities.iter().copied())
    };
    let is_of_echo =
        has(&ECHO_POSITION_WORDS) && quantities().any(|quantity| matches!(quantity, X | Y));
    if is_of_echo {
        return NameMeaning::Unknown;
    }
    if let Some(field) = quantities().find_map(|quantity| Field::with_unit(quantity, unit)) {
        return NameMeaning::Field(field);
    }
    match (quantities().next(), unit) {
        // Text columns that carry a unit.
        (Some(Scan | Status), _) => {
            let field = quantities().find_map(|quantity| Field::with_unit(quantity, None));
            field.map_or(NameMeaning::Unknown, NameMeaning::Field)
        }
        (_, Some(unit)) => NameMeaning::Unit(unit),
        (Some(quantity), None) => NameMeaning::FieldQuantity(quantity),
        (None, None) => NameMeaning::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn understands_languages_and_spellings() {
        for (name, field) in [
            ("Angle (deg)", "azimuth_deg"),
            ("angleDeg", "azimuth_deg"),
            ("pan_deg", "azimuth_deg"),
            ("servo [\u{b0}]", "azimuth_deg"),
            ("Winkel [Grad]", "azimuth_deg"),
            ("Winkel_deg", "azimuth_deg"),
            ("theta_rad", "azimuth_rad"),
            ("ángulo (grados)", "azimuth_deg"),
            ("Distance [cm]", "range_cm"),
            ("distanceCm", "range_cm"),
            ("echo_distance_cm", "range_cm"),
            ("echo_cm", "range_cm"),
            ("Entfernung_cm", "range_cm"),
            ("Abstand [mm]", "range_mm"),
            ("distancia (cm)", "range_cm"),
            ("sonar1_cm", "range_cm"),
            ("bearings_rad", "bearing_rad"),
            ("echo_us", "tof_us"),
            ("echo [\u{b5}s]", "tof_us"),
            ("time_of_flight_us", "tof_us"),
            ("pulse_duration_us", "tof_us"),
            ("duration_us", "tof_us"),
            ("Laufzeit [us]", "tof_us"),
            ("timestamp", "time"),
            ("time_ms", "time_ms"),
            ("millis", "time_ms"),
            ("Zeit [s]", "time_s"),
            ("x [m]", "x_m"),
            ("temp_c", "temperature_c"),
            ("scan_id", "scan"),
            ("yaw_deg", "heading_deg"),
            ("vinkel (grader)", "azimuth_deg"),
            ("úhel_stupně", "azimuth_deg"),
            ("açı_derece", "azimuth_deg"),
            ("угол_град", "azimuth_deg"),
            ("расстояние_см", "range_cm"),
            ("角度(度)", "azimuth_deg"),
            ("距離(cm)", "range_cm"),
            ("pulse_width_us", "tof_us"),
            ("roundtrip_us", "tof_us"),
            ("range_yd", "range_yd"),
            ("distance_um", "range_um"),
            ("temperature_f", "temperature_f"),
            ("uptime_ms", "time_ms"),
            ("t_s", "time_s"),
        ] {
            assert_eq!(
                meaning(name),
                NameMeaning::Field(Field::from_name(field).expect("a field")),
                "{name}"
            );
        }
    }

    #[test]
    fn rejects_limits_and_tilts() {
        for name in [
            "min_range_m",
            "max_range",
            "rangeMax_m",
            "field.min_range",
            "angle_increment",
            "tilt_deg",
            "pitch_rad",
            "elevation_deg",
            "echo_x_cm",
            "target_y_m",
            "range_std_m",
            "longest_range_m",
            "one_way_tof_us",
            "foo",
            "class",
        ] {
            assert_eq!(meaning(name), NameMeaning::Unknown, "{name}");
        }
        assert_eq!(meaning("angle"), NameMeaning::FieldQuantity(Azimuth));
        assert_eq!(meaning("angle_grad"), NameMeaning::FieldQuantity(Azimuth));
        assert_eq!(meaning("Messwert_cm"), NameMeaning::Unit("cm"));
        assert_eq!(meaning("angle_cm"), NameMeaning::Unit("cm"));
        assert!(is_clockwise("angle_cw_deg") && !is_clockwise("angle_ccw_deg"));
    }
}
