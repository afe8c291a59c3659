//! Numbers as programs and spreadsheets of several countries write them.

use crate::mapping::Decimal;

/// Reads a number of a text cell; `None` of what is none.
pub(crate) fn parse(cell: &str, decimal: Decimal) -> Option<f64> {
    let cell = cell.trim();
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

/// Groups of three digits behind the first.
fn is_grouped(whole: &str, sign: char) -> bool {
    let mut groups = whole.trim_start_matches(['+', '-']).split(sign);
    let is_digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().unwrap_or_default();
    let rest: Vec<&str> = groups.collect();
    (1..=3).contains(&first.len())
        && is_digits(first)
        && !rest.is_empty()
        && rest.iter().all(|group| group.len() == 3 && is_digits(group))
}

/// Evidence of a cell with a comma for the sign before fractions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shows {
    Comma,
    Point,
    /// `1,500` is one and a half or fifteen hundred.
    Either,
    /// No number, or one without a sign.
    Nothing,
}

pub(crate) fn shows(cell: &str) -> Shows {
    let cell = cell.trim();
    let by = |decimal| parse(cell, decimal).is_some();
    if !cell.contains(',') {
        return Shows::Nothing;
    }
    match (by(Decimal::Comma), by(Decimal::Point)) {
        // No number has a group of three behind a zero.
        (true, true) if cell.trim_start_matches(['+', '-']).starts_with("0,") => Shows::Comma,
        (true, true) => Shows::Either,
        (true, false) => Shows::Comma,
        (false, true) => Shows::Point,
        (false, false) => Shows::Nothing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_by_either_sign() {
        for (cell, comma, point) in [
            ("15", Some(15.0), Some(15.0)),
            ("-3.5e2", Some(-350.0), Some(-350.0)),
            ("15,5", Some(15.5), None),
            ("1,500", Some(1.5), Some(1500.0)),
            ("1.500", Some(1500.0), Some(1.5)),
            ("1.234,5", Some(1234.5), None),
            ("1,234.5", None, Some(1234.5)),
            ("-0,25", Some(-0.25), None),
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
    fn cells_show_their_sign_where_it_is_certain() {
        for (cell, shown) in [
            ("15,5", Shows::Comma),
            ("0,250", Shows::Comma),
            ("1.234,5", Shows::Comma),
            ("1,234.5", Shows::Point),
            ("1,234", Shows::Either),
            ("15.5", Shows::Nothing),
            ("2026-01-31 12:00:00,5", Shows::Nothing),
        ] {
            assert_eq!(shows(cell), shown, "{cell}");
        }
    }
}
