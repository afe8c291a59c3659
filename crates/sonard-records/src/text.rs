//! Counts and lengths as text, for messages and pictures.

/// Formats a count with its noun: `1 scan`, `2,054 scans`.
#[must_use]
pub fn format_count(count: impl TryInto<u64>, noun: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    let with_es = ["s", "x", "ch", "sh", "o"];
    let ending = match count {
        1 => "",
        _ if with_es.iter().any(|end| noun.ends_with(end)) => "es",
        _ => "s",
    };
    format!("{} {noun}{ending}", group_digits(count))
}

/// Formats an integer with commas between groups of three digits.
#[must_use]
pub fn group_digits(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (place, digit) in (0..digits.len()).rev().zip(digits.chars()) {
        text.push(digit);
        if place > 0 && place % 3 == 0 {
            text.push(',');
        }
    }
    text
}

/// Formats a length, metres, in a unit that keeps its leading digit: `0.04 mm`, `123.4 mm`, `1.50
/// m`.
#[must_use]
pub fn format_length(length_m: f64) -> String {
    match length_m.abs() {
        0.0 => "0 mm".to_owned(),
        // Below this, one decimal of a millimetre would be "0.0 mm".
        m if m < 0.05e-3 => format!("{:.2} mm", 1e3 * length_m),
        m if m < 1.0 => format!("{:.1} mm", 1e3 * length_m),
        m if m < 1e4 => format!("{length_m:.2} m"),
        _ => format!("{length_m:.1e} m"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_plurals() {
        for (count, noun, expected) in [
            (0_u64, "scan", "0 scans"),
            (1, "scan", "1 scan"),
            (999, "byte", "999 bytes"),
            (2_054, "path", "2,054 paths"),
            (1_234_567, "search", "1,234,567 searches"),
            (2, "echo", "2 echoes"),
        ] {
            assert_eq!(format_count(count, noun), expected);
        }
    }

    #[test]
    fn lengths_keep_a_digit() {
        for (length_m, expected) in [
            (0.0, "0 mm"),
            (0.00004, "0.04 mm"),
            (0.0004, "0.4 mm"),
            (-0.0123, "-12.3 mm"),
            (0.15, "150.0 mm"),
            (1.5, "1.50 m"),
            (2e5, "2.0e5 m"),
        ] {
            assert_eq!(format_length(length_m), expected);
        }
    }
}
