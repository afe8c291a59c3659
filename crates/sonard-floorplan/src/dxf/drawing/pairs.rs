//! Groups of a DXF file, ASCII or binary, and its records (DXF reference, "Group Codes").
//!
//! The parser of drawings neither reports frozen layers nor accepts every entity, so a file is
//! reduced beforehand to the records that are converted.

use std::{borrow::Cow, ops::Range};

use encoding_rs::{UTF_8, WINDOWS_1252};

/// Beginning of a binary file.
pub(super) const BINARY: &[u8] = b"AutoCAD Binary DXF\r\n\x1a\0";

/// Group: a code and its value as text, with the bytes of both.
#[derive(Debug, Clone, PartialEq)]
struct Pair<'a> {
    code: u16,
    value: Value<'a>,
    bytes: Range<usize>,
}

#[derive(Debug, Clone, PartialEq)]
enum Value<'a> {
    Text(&'a [u8]),
    Integer(i64),
    /// Number or data that no record is selected by.
    Other,
}

/// Entity, table entry or section: a group 0 and the groups up to the next.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct DxfRecord {
    /// Value of group 0.
    pub(super) kind: String,
    /// First value of group 2.
    pub(super) name: Option<String>,
    /// Layer, group 8.
    pub(super) layer: Option<String>,
    /// Flags, the first group 70.
    pub(super) flags: i64,
    /// True if the entity is invisible or in paper space (groups 60 and 67).
    pub(super) is_hidden: bool,
    pub(super) bytes: Range<usize>,
}

/// Returns the records of a file, in order; what follows a malformed group is left out.
pub(super) fn records(bytes: &[u8]) -> impl Iterator<Item = DxfRecord> + '_ {
    let mut pairs = Pairs::new(bytes);
    let mut next: Option<DxfRecord> = None;
    let mut has_flags = false;
    std::iter::from_fn(move || {
        loop {
            let Some(pair) = pairs.next() else { return next.take() };
            if pair.code == 0 {
                let record = DxfRecord {
                    kind: pair.value.text().unwrap_or_default(),
                    bytes: pair.bytes,
                    ..DxfRecord::default()
                };
                has_flags = false;
                match next.replace(record) {
                    Some(complete) => return Some(complete),
                    None => continue,
                }
            }
            let Some(record) = &mut next else { continue };
            record.bytes.end = pair.bytes.end;
            match pair.code {
                2 if record.name.is_none() => record.name = pair.value.text(),
                8 if record.layer.is_none() => record.layer = pair.value.text(),
                60 | 67 => record.is_hidden |= pair.value.integer().is_some_and(|value| value == 1),
                70 if !has_flags => {
                    (record.flags, has_flags) = (pair.value.integer().unwrap_or(0), true);
                }
                _ => {}
            }
        }
    })
}

impl Value<'_> {
    fn text(&self) -> Option<String> {
        let Self::Text(bytes) = self else { return None };
        let (utf_8, is_lossy) = UTF_8.decode_without_bom_handling(bytes);
        Some(match is_lossy {
            false => utf_8.into_owned(),
            true => WINDOWS_1252.decode_without_bom_handling(bytes).0.into_owned(),
        })
    }

    fn integer(&self) -> Option<i64> {
        match self {
            Self::Text(bytes) => std::str::from_utf8(bytes).ok()?.trim().parse().ok(),
            Self::Integer(value) => Some(*value),
            Self::Other => None,
        }
    }
}

/// Iterator over groups.
struct Pairs<'a> {
    bytes: &'a [u8],
    at: usize,
    form: Form,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Ascii,
    /// Binary with codes of two bytes, or of one byte up to version R12.
    Binary {
        has_short_codes: bool,
    },
}

impl<'a> Pairs<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        if !bytes.starts_with(BINARY) {
            return Self { bytes, at: 0, form: Form::Ascii };
        }
        let at = BINARY.len();
        // The first group is 0, SECTION.
        let has_short_codes = bytes.get(at + 1).is_some_and(|byte| *byte != 0);
        Self { bytes, at, form: Form::Binary { has_short_codes } }
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    /// Next line, without its ending.
    fn line(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|byte| *byte == b'\n');
        self.at += end.map_or(rest.len(), |end| end + 1);
        let line = &rest[..end.unwrap_or(rest.len())];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    fn ascii(&mut self) -> Option<(u16, Value<'a>)> {
        let code = std::str::from_utf8(self.line()?).ok()?.trim().parse().ok()?;
        let value = self.line()?;
        Some((code, Value::Text(value.trim_ascii())))
    }

    fn binary(&mut self, has_short_codes: bool) -> Option<(u16, Value<'a>)> {
        let code = match has_short_codes {
            true => match self.take(1)?[0] {
                255 => u16::from_le_bytes(self.take(2)?.try_into().ok()?),
                code => u16::from(code),
            },
            false => u16::from_le_bytes(self.take(2)?.try_into().ok()?),
        };
        let value = match code {
            10..=59 | 110..=149 | 210..=239 | 460..=469 | 1010..=1059 => {
                self.take(8)?;
                Value::Other
            }
            60..=79 | 170..=179 | 270..=289 | 370..=389 | 400..=409 | 1060..=1070 => {
                Value::Integer(i16::from_le_bytes(self.take(2)?.try_into().ok()?).into())
            }
            90..=99 | 420..=429 | 440..=459 | 1071 => {
                Value::Integer(i32::from_le_bytes(self.take(4)?.try_into().ok()?).into())
            }
            160..=169 => Value::Integer(i64::from_le_bytes(self.take(8)?.try_into().ok()?)),
            290..=299 => Value::Integer(self.take(1)?[0].into()),
            310..=319 | 1004 => {
                let length = self.take(1)?[0];
                self.take(length.into())?;
                Value::Other
            }
            _ => {
                let rest = self.bytes.get(self.at..)?;
                let end = rest.iter().position(|byte| *byte == 0)?;
                self.at += end + 1;
                Value::Text(&rest[..end])
            }
        };
        Some((code, value))
    }
}

impl<'a> Iterator for Pairs<'a> {
    type Item = Pair<'a>;

    fn next(&mut self) -> Option<Pair<'a>> {
        let begin = self.at;
        let (code, value) = match self.form {
            Form::Ascii => self.ascii()?,
            Form::Binary { has_short_codes } => self.binary(has_short_codes)?,
        };
        Some(Pair { code, value, bytes: begin..self.at })
    }
}

/// Replaces the line endings of a text with carriage returns alone.
pub(super) fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    if bytes.starts_with(BINARY) || bytes.contains(&b'\n') || !bytes.contains(&b'\r') {
        return Cow::Borrowed(bytes);
    }
    Cow::Owned(bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodes groups as ASCII, and as binary with long and with short codes.
    fn encoded(groups: &[(u16, &str)]) -> [Vec<u8>; 3] {
        let ascii: String =
            groups.iter().map(|(code, value)| format!("{code:3}\r\n{value}\r\n")).collect();
        let binary = |is_short: bool| {
            let mut bytes = BINARY.to_vec();
            for (code, value) in groups {
                match is_short {
                    true if *code < 255 => bytes.push(*code as u8),
                    true => bytes.extend([&[255][..], &code.to_le_bytes()].concat()),
                    false => bytes.extend(code.to_le_bytes()),
                }
                match code {
                    10..=59 => bytes.extend(value.parse::<f64>().expect("a number").to_le_bytes()),
                    60..=79 => bytes.extend(value.parse::<i16>().expect("a number").to_le_bytes()),
                    310 => bytes.extend([&[value.len() as u8][..], value.as_bytes()].concat()),
                    _ => bytes.extend([value.as_bytes(), &[0]].concat()),
                }
            }
            bytes
        };
        [ascii.into_bytes(), binary(false), binary(true)]
    }

    #[test]
    fn records_in_every_encoding() {
        let groups = [
            (0, "SECTION"),
            (2, "ENTITIES"),
            (0, "LINE"),
            (8, "M\u{d6}BEL"),
            (10, "1.5"),
            (67, "1"),
            (310, "abc"),
            (0, "LAYER"),
            (2, "a"),
            (70, "5"),
            (70, "0"),
        ];
        for bytes in encoded(&groups) {
            let found: Vec<DxfRecord> = records(&bytes).collect();
            let kinds: Vec<&str> = found.iter().map(|record| record.kind.as_str()).collect();
            assert_eq!(kinds, ["SECTION", "LINE", "LAYER"]);
            assert_eq!(found[0].name.as_deref(), Some("ENTITIES"));
            assert_eq!((found[1].layer.as_deref(), found[1].is_hidden), (Some("M\u{d6}BEL"), true));
            assert_eq!((found[2].flags, found[2].bytes.end), (5, bytes.len()));
            assert_eq!(found[0].bytes.end, found[1].bytes.start);
        }
        let latin = b"0\nLAYER\n2\nM\xd6BEL\n";
        assert_eq!(records(latin).next().expect("a record").name.as_deref(), Some("M\u{d6}BEL"));
        assert_eq!(with_line_feeds(b"0\rLAYER\r").as_ref(), b"0\nLAYER\n");
    }
}
