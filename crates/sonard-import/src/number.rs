//! Parsing of numbers with decimal points or commas and with thousands separators.

use crate::mapping::Decimal;

/// Parses the number of a text cell; `None` if the text is not a number.
pub(crate) fn parse(cell: &str, decimal: Decimal) -> Option<f64> {
    let cell = cell.trim();
    // Word processors and some spreadsheets write the typographic minus sign.
    let minus = cell.strip_prefix('\u{2212}').map(|digits| format!("-{digits}"));
    let cell = minus.as_deref().unwrap_or(cell);
    if !cell.contains(',') && (decimal == Decimal::Point || !is_grouped(cell, '.')) {
        return cell.parse().ok();
    }
    match decimal {
        Decimal::Point => {
            let whole = cell.split('.').next().unwrap_or(cell);
            is_grouped(whole, ',').then(|| cell.replace(',', "").parse().ok()).flatten()
        }
        Decimal::Comma => {
            let (whole, fraction) = cell.split_once(',').unwrap_or((cell, ""));
            let is_whole = !whole.contains('.') || is_grouped(whole, '.');
            let text = format!("{}.{fraction}", whole.replace('.', ""));
            (is_whole && !fraction.contains(['.', ','])).then(|| text.parse().ok()).flatten()
        }
    }
}

/// Returns `true` for groups of three digits after the first.
fn is_grouped(whole: &str, separator: char) -> bool {
    let mut groups = whole.trim_start_matches(['+', '-']).split(separator);
    let is_digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().unwrap_or_default();
    let rest: Vec<&str> = groups.collect();
    (1..=3).contains(&first.len())
        && is_digits(first)
        && !rest.is_empty()
        && rest.iter().all(|group| group.len() == 3 && is_digits(group))
}

/// Evidence of one cell for the decimal separator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DecimalEvidence {
    Comma,
    Point,
    /// Ambiguous: `1,500` is one and a half or fifteen hundred.
    Either,
    /// Not a number, or a number without a separator.
    Unknown,
}

pub(crate) fn decimal_evidence(cell: &str) -> DecimalEvidence {
    let cell = cell.trim();
    let by = |decimal| parse(cell, decimal).is_some();
    if !cell.contains(',') {
        return DecimalEvidence::Unknown;
    }
    match (by(Decimal::Comma), by(Decimal::Point)) {
        // A number with thousands separators does not start with a zero.
        (true, true) if cell.trim_start_matches(['+', '-']).starts_with("0,") => {
            DecimalEvidence::Comma
        }
        (true, true) => DecimalEvidence::Either,
        (true, false) => DecimalEvidence::Comma,
        (false, true) => DecimalEvidence::Point,
        (false, false) => DecimalEvidence::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_both_separators() {
        for (cell, comma, point) in [
            ("15", Some(15.0), Some(15.0)),
            ("-3.5e2", Some(-350.0), Some(-350.0)),
            ("15,5", Some(15.5), None),
            ("1,500", Some(1.5), Some(1500.0)),
            ("1.500", Some(1500.0), Some(1.5)),
            ("1.234,5", Some(1234.5), None),
            ("1,234.5", None, Some(1234.5)),
            ("-0,25", Some(-0.25), None),
            ("\u{2212}15", Some(-15.0), Some(-15.0)),
            ("1,2,3", None, None),
            ("12:00", None, None),
            ("", None, None),
            (",5", Some(0.5), None),
        ] {
            assert_eq!(parse(cell, Decimal::Comma), comma, "{cell}");
            assert_eq!(parse(cell, Decimal::Point), point, "{cell}");
        }
    }

    #[test]
    fn finds_separator_evidence() {
        for (cell, expected) in [
            ("15,5", DecimalEvidence::Comma),
            ("0,250", DecimalEvidence::Comma),
            ("1.234,5", DecimalEvidence::Comma),
            ("1,234.5", DecimalEvidence::Point),
            ("1,234", DecimalEvidence::Either),
            ("15.5", DecimalEvidence::Unknown),
            ("2026-01-31 12:00:00,5", DecimalEvidence::Unknown),
        ] {
            assert_eq!(decimal_evidence(cell), expected, "{cell}");
        }
    }
}
