//! Text of XML files in any encoding.

use std::{borrow::Cow, io::Read as _};

use encoding_rs::{Encoding, UTF_8};
use flate2::read::GzDecoder;
use roxmltree::{Document, ParsingOptions};

use crate::{MAX_FILE_BYTES, PlanError, check_size};

/// Decodes an XML file, plain or compressed by gzip: its encoding is that of the byte order mark,
/// else of the XML declaration, else UTF-8.
///
/// # Errors
/// Returns an error for damaged compressed data, a file above the size limit, an unknown encoding,
/// or bytes that are no text.
pub(crate) fn text<'a>(bytes: &'a [u8], help: &str) -> Result<Cow<'a, str>, PlanError> {
    let plain = match bytes.starts_with(b"\x1f\x8b") {
        true => Cow::Owned(decompress(bytes, help)?),
        false => Cow::Borrowed(bytes),
    };
    check_size(&plain)?;
    if let Some(what) = other_kind(&plain) {
        return Err(PlanError::new(format!("the file is {what}"), help));
    }
    let encoding = match Encoding::for_bom(&plain) {
        Some((encoding, _)) => encoding,
        None => declared(&plain).map_err(|label| {
            PlanError::new(format!("unknown encoding `{label}`"), "save it as UTF-8")
        })?,
    };
    let (text, is_lossy) = match &plain {
        Cow::Borrowed(bytes) => {
            let (text, _, is_lossy) = encoding.decode(bytes);
            (text, is_lossy)
        }
        Cow::Owned(bytes) => {
            let (text, _, is_lossy) = encoding.decode(bytes);
            (Cow::Owned(text.into_owned()), is_lossy)
        }
    };
    match is_lossy {
        true => Err(PlanError::new(format!("the file is not {} text", encoding.name()), help)),
        false => Ok(text),
    }
}

/// Parses a document; a document type declaration is accepted and its entities are replaced.
///
/// # Errors
/// Returns an error for malformed XML.
pub(crate) fn parse<'a>(text: &'a str, help: &str) -> Result<Document<'a>, PlanError> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
        .map_err(|error| PlanError::new(format!("invalid XML: {error}"), help))
}

/// Returns the encoding of the XML declaration, or its unknown label.
fn declared(bytes: &[u8]) -> Result<&'static Encoding, String> {
    let head = &bytes[..bytes.len().min(200)];
    let head = String::from_utf8_lossy(head);
    let declaration = head.strip_prefix("<?xml").and_then(|rest| rest.split_once("?>"));
    let label = declaration.and_then(|(declaration, _)| {
        let (_, value) = declaration.split_once("encoding")?;
        let value = value.trim_start().strip_prefix('=')?.trim_start();
        let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        value[1..].split_once(quote).map(|(label, _)| label.to_owned())
    });
    // A text of single bytes cannot be UTF-16, whatever it declares.
    let label = label.filter(|label| !label.to_lowercase().starts_with("utf-16"));
    match label {
        Some(label) => Encoding::for_label(label.as_bytes()).ok_or(label),
        None => Ok(UTF_8),
    }
}

/// Describes a file that is no XML, by its first bytes.
fn other_kind(bytes: &[u8]) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 6] = [
        (b"%PDF", "a PDF document: export it as SVG"),
        (b"\x89PNG", "a picture (PNG)"),
        (b"\xff\xd8\xff", "a picture (JPEG)"),
        (b"PK\x03\x04", "a ZIP archive: unpack it first"),
        (b"%!PS", "a PostScript document: export it as SVG"),
        (b"AC10", "a DWG drawing: export it as DXF"),
    ];
    KINDS.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, what)| *what)
}

fn decompress(bytes: &[u8], help: &str) -> Result<Vec<u8>, PlanError> {
    let mut plain = Vec::new();
    // A byte above the limit suffices to reject the file.
    let limit = MAX_FILE_BYTES as u64 + 1;
    let read = GzDecoder::new(bytes).take(limit).read_to_end(&mut plain);
    read.map_err(|error| PlanError::new(format!("invalid gzip data: {error}"), help))?;
    Ok(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decodes_by_mark_or_declaration() {
        let body = "<a>\u{e4}</a>";
        let utf_16: Vec<u8> =
            format!("\u{feff}{body}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        let latin: Vec<u8> = format!("<?xml version='1.0' encoding='ISO-8859-1'?>{body}")
            .chars()
            .map(|c| c as u8)
            .collect();
        let mislabelled = format!("<?xml version='1.0' encoding='UTF-16'?>{body}");
        for bytes in [body.as_bytes(), &utf_16, &latin, mislabelled.as_bytes()] {
            let text = text(bytes, "").expect("text");
            assert_eq!(parse(&text, "").expect("XML").root_element().text(), Some("\u{e4}"));
        }
        for bytes in
            [&b"\xff\xffa"[..], b"\x1f\x8b\x08zz", b"<?xml encoding='klingon'?><a/>", b"%PDF-1.4"]
        {
            text(bytes, "").expect_err("no text");
        }
    }

    #[test]
    fn document_types_are_accepted() {
        let text = "<!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.1//EN\" \"svg11.dtd\" [<!ENTITY n \"5\">]><svg>&n;</svg>";
        assert_eq!(parse(text, "").expect("XML").root_element().text(), Some("5"));
    }
}
