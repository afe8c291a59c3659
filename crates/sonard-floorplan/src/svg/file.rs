//! Preparation of an SVG file: markers and filters are removed, omissions counted.

use std::{collections::BTreeMap, ops::Range};

use roxmltree::{Document, Node};

use super::limits::check_lengths;
use crate::{PlanError, xml};

/// Text of a drawing, with notes on it.
#[derive(Debug)]
pub(super) struct Drawing {
    pub(super) text: String,
    pub(super) notes: Vec<String>,
    /// True if the drawing states the size of its page.
    pub(super) has_size: bool,
}

/// Returns the text of a file, with its markers and filters replaced by spaces. The length is
/// preserved, so that errors refer to the right lines.
///
/// # Errors
/// Returns an error for a file that is not XML, and for lengths beyond the limit.
pub(super) fn prepare(bytes: &[u8], help: &str) -> Result<Drawing, PlanError> {
    let text = xml::text(bytes, help)?.into_owned();
    let document = xml::parse(&text, help)?;
    check_lengths(&document)?;
    let root = document.root_element();
    let is_relative = |width: &str| width.trim().ends_with('%') || width.trim() == "auto";
    let has_size = root.attribute("viewBox").is_some()
        || root.attribute("width").is_some_and(|width| !is_relative(width));
    let mut notes = Vec::new();
    if !has_size {
        notes.push(
            "the drawing has neither width nor viewBox: --width-m is the width of its contents"
                .to_owned(),
        );
    }
    notes.extend(omissions(&document));
    let markers = document.descendants().filter(|node| node.tag_name().name() == "marker");
    let removed: Vec<Range<usize>> =
        markers.map(|node| node.range()).chain(document.descendants().flat_map(filters)).collect();
    drop(document);
    let mut blanked = text.into_bytes();
    for byte in removed.into_iter().flatten() {
        if let Some(byte) = blanked.get_mut(byte).filter(|byte| **byte != b'\n') {
            *byte = b' ';
        }
    }
    let text = String::from_utf8(blanked)
        .map_err(|error| PlanError::new(format!("not UTF-8: {error}"), help))?;
    Ok(Drawing { text, notes, has_size })
}

/// Returns the ranges of the filters of an element. Filters blur and shade; without them the lines
/// are as drawn.
fn filters(node: Node) -> Vec<Range<usize>> {
    let attributes = node.attributes().flat_map(|attribute| {
        let (name, value, at) = (attribute.name(), attribute.value(), attribute.range_value());
        match name {
            "filter" => vec![attribute.range()],
            // Entities in the value would shift the positions.
            "style" if at.len() == value.len() => properties(value, "filter")
                .into_iter()
                .map(|range| at.start + range.start..at.start + range.end)
                .collect(),
            _ => Vec::new(),
        }
    });
    attributes.collect()
}

/// Returns the ranges of the declarations of a property in a style.
fn properties(style: &str, property: &str) -> Vec<Range<usize>> {
    let mut at = 0;
    let mut found = Vec::new();
    for declaration in style.split(';') {
        let name = declaration.split(':').next().unwrap_or_default();
        if name.trim() == property {
            found.push(at..at + declaration.len());
        }
        at += declaration.len() + 1;
    }
    found
}

/// Returns a note for each kind of element that is not converted.
fn omissions(document: &Document) -> Vec<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for node in document.descendants().filter(Node::is_element) {
        let what = match node.tag_name().name() {
            "text" => "texts",
            "image" => "images",
            "foreignObject" => "foreign objects",
            "use" if is_elsewhere(node) => "references to other files (use)",
            _ if has_shape_function(node) => "clip paths by a function of CSS",
            _ => continue,
        };
        *counts.entry(what).or_default() += 1;
    }
    counts.iter().map(|(what, count)| format!("ignored: {count} {what}")).collect()
}

fn is_elsewhere(node: Node) -> bool {
    let mut attributes = node.attributes();
    attributes.any(|attribute| attribute.name() == "href" && !attribute.value().starts_with('#'))
}

/// Returns `true` for a clip path such as `inset(10px)`, which is not a reference to an element.
fn has_shape_function(node: Node) -> bool {
    let style = node.attribute("style").unwrap_or_default();
    let in_style = properties(style, "clip-path").into_iter();
    let in_style =
        in_style.filter_map(|range| style[range].split_once(':')).map(|(_, value)| value);
    let own = node.attribute("clip-path").into_iter();
    own.chain(in_style).map(str::trim).any(|value| value.contains('(') && !value.starts_with("url"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_filters_are_blanked() {
        let svg = "<svg viewBox='0 0 1 1'><defs>\n<marker id='a'><path d='M 0 0 L 1 1'/>\n</marker></defs>\n\
            <path filter='url(#f)' style='stroke:red;filter:url(#f)' d='M 0 0 L 1 0'/></svg>";
        let Drawing { text, notes, has_size } = prepare(svg.as_bytes(), "").expect("a drawing");
        assert!(
            !text.contains("marker") && !text.contains("filter") && !text.contains("L 1 1"),
            "{text}"
        );
        assert!(text.contains("L 1 0") && text.contains("stroke:red;"), "{text}");
        assert_eq!((text.lines().count(), text.len(), notes.len()), (4, svg.len(), 0));
        assert!(has_size);
    }

    #[test]
    fn omissions_are_counted() {
        let svg = "<svg width='100%'><text>a</text><text/><image/><g style='clip-path: inset(1px)'/>\
            <g clip-path='url(#a)'/><use href='b.svg#c'/><use href='#c'/></svg>";
        let Drawing { notes, has_size, .. } = prepare(svg.as_bytes(), "").expect("a drawing");
        let notes = notes.join("\n");
        for part in
            ["neither width nor viewBox", "2 texts", "1 images", "1 clip paths", "1 references"]
        {
            assert!(notes.contains(part), "{part}: {notes}");
        }
        assert!(!has_size);
    }
}
