//! Text of an SVG file, without markers.

use std::io::Read as _;

use flate2::read::GzDecoder;
use usvg::roxmltree::{Document, Node};

/// Text of a drawing, with notes on it.
pub(super) struct Drawing {
    pub(super) text: String,
    pub(super) notes: Vec<String>,
}

/// Maximum size of a decompressed drawing, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// Returns the text of a file, plain or compressed, with its markers replaced by spaces.
///
/// # Errors
///
/// The file is not UTF-8 or not XML.
pub(super) fn text(bytes: Vec<u8>) -> Result<Drawing, String> {
    let bytes = if bytes.starts_with(b"\x1f\x8b") { decompress(&bytes)? } else { bytes };
    let text = String::from_utf8(bytes).map_err(|error| format!("not UTF-8: {error}"))?;
    let document = Document::parse(&text).map_err(|error| format!("invalid SVG: {error}"))?;
    let root = document.root_element();
    let mut notes = Vec::new();
    if ["width", "viewBox"].iter().all(|name| root.attribute(*name).is_none()) {
        notes.push(
            "the drawing has neither width nor viewBox: --width-m is the width of its contents"
                .to_owned(),
        );
    }
    let is_marker = |node: &Node| node.tag_name().name() == "marker";
    let ranges = document.descendants().filter(is_marker).map(|node| node.range());
    let ranges: Vec<_> = ranges.collect();
    drop(document);
    let mut blanked = text.into_bytes();
    // The length is preserved, so that errors refer to the right lines.
    for byte in ranges.into_iter().flat_map(|range| range.start..range.end) {
        if blanked[byte] != b'\n' {
            blanked[byte] = b' ';
        }
    }
    let text = String::from_utf8(blanked).map_err(|error| error.to_string())?;
    Ok(Drawing { text, notes })
}

fn decompress(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut plain = Vec::new();
    let read = GzDecoder::new(bytes).take(MAX_BYTES + 1).read_to_end(&mut plain);
    let length = read.map_err(|error| format!("invalid gzip data: {error}"))?;
    match length as u64 > MAX_BYTES {
        true => Err(format!("the decompressed drawing is larger than {} MB", MAX_BYTES >> 20)),
        false => Ok(plain),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_are_blanked() {
        let svg = "<svg viewBox='0 0 1 1'><defs>\n<marker id='a'><path d='M 0 0 L 1 1'/>\n</marker></defs>\n<path d='M 0 0 L 1 0'/></svg>";
        let Drawing { text, notes } = text(svg.as_bytes().to_vec()).expect("a drawing");
        assert!(
            !text.contains("marker") && text.contains("L 1 0") && !text.contains("L 1 1"),
            "{text}"
        );
        assert_eq!((text.lines().count(), text.len(), notes.len()), (4, svg.len(), 0));
    }
}
