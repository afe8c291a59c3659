//! A thermometer behind a file of a Linux driver (1-wire, hwmon).

use std::{fs, path::Path};

use crate::acoustics::Air;

/// The temperature in a file of a 1-wire or hwmon driver, degrees Celsius. A 1-wire conversion takes
/// most of a second.
///
/// # Errors
/// When it can't be read or is no temperature, in words.
pub fn read_thermometer(path: &Path) -> Result<f64, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    parse_thermometer(&text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Either a number of thousandths of a degree, or the two lines of `w1_slave`: a checksum's
/// `YES`, and `t=` with the number.
fn parse_thermometer(text: &str) -> Result<f64, String> {
    let number = match text.split_once("t=") {
        Some((head, tail)) if head.contains("YES") => tail,
        Some(_) => return Err("the sensor's checksum was wrong".into()),
        None => text,
    };
    let thousandths: i32 = number
        .trim()
        .parse()
        .map_err(|_| format!("{:?} is no number of thousandths of a degree", number.trim()))?;
    let temperature_c = f64::from(thousandths) / 1e3;
    // A DS18B20 that never measured says 85 degrees.
    match Air::new(temperature_c, 50.0, 101.325) {
        Ok(_) => Ok(temperature_c),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_and_nonsense_is_not_taken_for_a_temperature() {
        let w1 = "72 01 4b 46 7f ff 0e 10 57 : crc=57 YES\n72 01 4b 46 7f ff 0e 10 57 t=23125\n";
        assert_eq!(parse_thermometer(w1), Ok(23.125));
        assert_eq!(parse_thermometer("-1500\n"), Ok(-1.5));
        for (text, part) in [
            (w1.replace("YES", "NO"), "checksum"),
            ("85000".into(), "-20 to 50"),
            (String::new(), "thousandths"),
            ("warm".into(), "thousandths"),
        ] {
            let error = parse_thermometer(&text).expect_err("it is refused");
            assert!(error.contains(part), "{error}");
        }
    }
}
