//! Reading of text lines with any line ending.

use std::io::{BufRead as _, BufReader, Read};

use crate::{FileLocation, ImportError};

/// Maximum length of a line of a table or a log.
const MAX_LINE: MaxLine = MaxLine { bytes: 1 << 20, help: "give a file with one reading per line" };

/// Limit of the length of lines, with the advice for a longer one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MaxLine {
    pub(crate) bytes: usize,
    pub(crate) help: &'static str,
}

/// Record separator of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum LineEnding {
    /// Line feed, carriage return, or both.
    #[default]
    Lines,
    /// Full stop, as in `angle,distance.` sent by the "radar" sketches for Arduino.
    Stops,
}

/// Numbered record of a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TextLine {
    /// Line number, from 1.
    pub(crate) number: u64,
    /// Text without the line ending.
    pub(crate) text: String,
    /// True if the line is terminated; false at the end of a file without a final line ending.
    pub(crate) is_ended: bool,
}

impl TextLine {
    pub(crate) const fn place(&self) -> FileLocation {
        FileLocation::Line(self.number)
    }
}

/// Iterator over numbered lines, in bounded memory.
pub(crate) struct LineReader<R> {
    source: BufReader<R>,
    ends: LineEnding,
    max: MaxLine,
    count: u64,
    /// True if the last ending was a carriage return, which a line feed may complete.
    is_after_return: bool,
}

impl<R: Read> LineReader<R> {
    pub(crate) fn new(source: R, ends: LineEnding) -> Self {
        Self::with_max(source, ends, MAX_LINE)
    }

    pub(crate) fn with_max(source: R, ends: LineEnding, max: MaxLine) -> Self {
        Self { source: BufReader::new(source), ends, max, count: 0, is_after_return: false }
    }

    fn read(&mut self) -> Result<Option<TextLine>, ImportError> {
        let mut bytes = Vec::new();
        let mut is_begun = false;
        let is_ended = loop {
            let piece = self.source.fill_buf()?;
            if piece.is_empty() {
                break false;
            }
            if std::mem::take(&mut self.is_after_return) && piece[0] == b'\n' {
                self.source.consume(1);
                continue;
            }
            is_begun = true;
            let is_end = |byte: &u8| match self.ends {
                LineEnding::Lines => matches!(byte, b'\n' | b'\r'),
                LineEnding::Stops => matches!(byte, b'\n' | b'\r' | b'.'),
            };
            let end = piece.iter().position(is_end);
            bytes.extend(&piece[..end.unwrap_or(piece.len())]);
            if bytes.len() > self.max.bytes {
                let what = format!("longer than {} MB", self.max.bytes >> 20);
                let place = FileLocation::Line(self.count + 1);
                return Err(ImportError::at(place, what, self.max.help));
            }
            let used = end.map_or(piece.len(), |end| end + 1);
            self.is_after_return = end.is_some_and(|end| piece[end] == b'\r');
            self.source.consume(used);
            if end.is_some() {
                break true;
            }
        };
        if !is_begun {
            return Ok(None);
        }
        self.count += 1;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Ok(Some(TextLine { number: self.count, text, is_ended }))
    }
}

impl<R: Read> Iterator for LineReader<R> {
    type Item = Result<TextLine, ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(text: &str, ends: LineEnding) -> Vec<(u64, String, bool)> {
        let lines = LineReader::new(text.as_bytes(), ends).map(|line| line.expect("short"));
        lines.map(|line| (line.number, line.text, line.is_ended)).collect()
    }

    #[test]
    fn counts_every_line_ending_once() {
        for text in ["a\nb\n\nc", "a\r\nb\r\n\r\nc", "a\rb\r\rc", "a\nb\r\n\rc"] {
            let expected = [(1, "a", true), (2, "b", true), (3, "", true), (4, "c", false)];
            let expected = expected.map(|(number, text, end)| (number, text.to_owned(), end));
            assert_eq!(split(text, LineEnding::Lines), expected, "{text:?}");
        }
        assert_eq!(split("", LineEnding::Lines), []);
        assert_eq!(split("1,2.3,4.5", LineEnding::Stops).len(), 3);
    }

    #[test]
    fn bounds_line_length() {
        let long = std::io::Read::take(std::io::repeat(b'1'), 1 << 30);
        let error =
            LineReader::new(long, LineEnding::Lines).next().expect("a line").expect_err("too long");
        assert!(error.to_string().contains("longer than"), "{error}");
    }

    #[test]
    fn joins_split_crlf() {
        let source = "a\r".as_bytes().chain("\nb".as_bytes());
        let lines: Vec<_> =
            LineReader::new(source, LineEnding::Lines).map(|line| line.expect("short")).collect();
        assert_eq!(lines.len(), 2, "{lines:?}");
    }
}
