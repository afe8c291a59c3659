//! Limits of the numbers in a drawing.

use roxmltree::{Attribute, Document, Node};
use svgtypes::{Length, LengthUnit, PathParser, PathSegment};

use crate::PlanError;

/// Greatest coordinate or length in a drawing, units. The outline of a curve is computed in single
/// precision, with steps that depend on its size only: beyond this size neither its digits nor the
/// effort are bounded.
pub(super) const MAX_UNITS: f64 = 1e7;

/// Checks that the numbers of all shapes are within the limit.
///
/// # Errors
/// Returns an error with line, attribute and advice for a greater number, and for a length of a
/// shape in units of a font.
pub(super) fn check_lengths(document: &Document) -> Result<(), PlanError> {
    for node in document.descendants().filter(Node::is_element) {
        for attribute in node.attributes().filter(|attribute| attribute.namespace().is_none()) {
            let at = || {
                let line = document.text_pos_at(attribute.range().start).row;
                format!("line {line}, `{}` of <{}>", attribute.name(), node.tag_name().name())
            };
            let greatest = greatest_length(&attribute);
            if greatest > MAX_UNITS {
                return Err(PlanError::new(
                    format!("{}: {greatest:e} units, more than {MAX_UNITS:e}", at()),
                    "move the drawing to the origin, or scale it down, in a drawing program",
                ));
            }
            if node.tag_name().name() != "svg" && is_in_font_sizes(&attribute) {
                return Err(PlanError::new(
                    format!("{}: a length in font sizes", at()),
                    "convert the shapes to paths in a drawing program",
                ));
            }
        }
    }
    Ok(())
}

/// Returns the greatest magnitude among the lengths of an attribute that describes a shape, units;
/// 0 for any other attribute. Percentages are taken as numbers: their bases have the same limit.
fn greatest_length(attribute: &Attribute) -> f64 {
    match attribute.name() {
        "d" => PathParser::from(attribute.value())
            .map_while(Result::ok)
            .flat_map(lengths)
            .fold(0.0, |greatest, length| greatest.max(length.abs())),
        "points" | "viewBox" => svgtypes::NumberListParser::from(attribute.value())
            .map_while(Result::ok)
            .fold(0.0, |greatest, number| greatest.max(number.abs())),
        _ => length(attribute).map_or(0.0, |length| length.number.abs()),
    }
}

fn is_in_font_sizes(attribute: &Attribute) -> bool {
    length(attribute).is_some_and(|length| matches!(length.unit, LengthUnit::Em | LengthUnit::Ex))
}

/// Returns the value of an attribute that is one length of a shape.
fn length(attribute: &Attribute) -> Option<Length> {
    const NAMES: [&str; 13] =
        ["x", "y", "x1", "y1", "x2", "y2", "cx", "cy", "r", "rx", "ry", "width", "height"];
    NAMES.contains(&attribute.name()).then(|| attribute.value().trim().parse().ok())?
}

/// Returns the numbers of a segment; `NaN` does not occur.
fn lengths(segment: PathSegment) -> Vec<f64> {
    match segment {
        PathSegment::MoveTo { x, y, .. }
        | PathSegment::LineTo { x, y, .. }
        | PathSegment::SmoothQuadratic { x, y, .. } => vec![x, y],
        PathSegment::HorizontalLineTo { x, .. } => vec![x],
        PathSegment::VerticalLineTo { y, .. } => vec![y],
        PathSegment::CurveTo { x1, y1, x2, y2, x, y, .. } => vec![x1, y1, x2, y2, x, y],
        PathSegment::SmoothCurveTo { x2, y2, x, y, .. } => vec![x2, y2, x, y],
        PathSegment::Quadratic { x1, y1, x, y, .. } => vec![x1, y1, x, y],
        PathSegment::EllipticalArc { rx, ry, x, y, .. } => vec![rx, ry, x, y],
        PathSegment::ClosePath { .. } => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(shape: &str) -> Result<(), PlanError> {
        let text = format!("<svg width='1em' viewBox='0 0 9 9'>\n{shape}</svg>");
        check_lengths(&Document::parse(&text).expect("XML"))
    }

    #[test]
    fn great_lengths_are_rejected() {
        for shape in [
            "<path d='M0 0A4 9e9 0 1 1 1 1'/>",
            "<path d='m0 0 1 -2e7'/>",
            "<path d='M0 0H1e30L'/>",
            "<path d='M0 0C1 1 2 2 1e20 3 4'/>",
            "<circle r='1e8'/>",
            "<ellipse rx='100000000mm'/>",
            "<polygon points='0,0 1,1e9'/>",
            "<g><svg viewBox='0 0 1e30 1'/></g>",
        ] {
            let error = check(shape).expect_err(shape);
            assert!(error.to_string().starts_with("line 2, `"), "{error}");
        }
        assert!(check("<rect rx='1em'/>").expect_err("a font").to_string().contains("font"));
    }

    #[test]
    fn others_are_accepted() {
        for shape in [
            // Two flags of an arc in front of a number, without spaces.
            "<path d='M0 0a5 5 0 11150000 5'/>",
            "<path id='1e30' d='M9999999 0V-9999999'/>",
            "<text x='1 2 3' font-size='2em'>1e99</text>",
            "<g transform='scale(1e20)'/>",
        ] {
            check(shape).expect(shape);
        }
    }
}
