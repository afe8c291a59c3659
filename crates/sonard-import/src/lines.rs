//! Lines of a text, whatever ends them.

use std::io::{BufRead as _, BufReader, Read};

use crate::{ImportError, Location};

/// A line longer than this is no row of readings, bytes.
const MAX_LINE_BYTES: usize = 1 << 20;

/// End of a record of text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Ends {
    /// A line feed, a carriage return, or both.
    #[default]
    Lines,
    /// A full stop, as the "radar" sketches for Arduino send `angle,distance.`
    Stops,
}

/// One record of a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Line {
    /// Its number, from 1.
    pub(crate) number: u64,
    /// Its text, without its end.
    pub(crate) text: String,
    /// True if it has an end, or the file stopped within it.
    pub(crate) is_ended: bool,
}

impl Line {
    pub(crate) const fn place(&self) -> Location {
        Location::Line(self.number)
    }
}

/// Lines of a text with their numbers, in bounded memory.
pub(crate) struct Lines<R> {
    source: BufReader<R>,
    ends: Ends,
    count: u64,
    /// The last end was a carriage return, so that a line feed may belong to it.
    is_after_return: bool,
}

impl<R: Read> Lines<R> {
    pub(crate) fn of(source: R, ends: Ends) -> Self {
        Self { source: BufReader::new(source), ends, count: 0, is_after_return: false }
    }

    fn read(&mut self) -> Result<Option<Line>, ImportError> {
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
                Ends::Lines => matches!(byte, b'\n' | b'\r'),
                Ends::Stops => matches!(byte, b'\n' | b'\r' | b'.'),
            };
            let end = piece.iter().position(is_end);
            bytes.extend(&piece[..end.unwrap_or(piece.len())]);
            if bytes.len() > MAX_LINE_BYTES {
                let what = format!("longer than {MAX_LINE_BYTES} bytes");
                let help = "give a file with a reading a line";
                return Err(ImportError::at(Location::Line(self.count + 1), what, help));
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
        Ok(Some(Line { number: self.count, text, is_ended }))
    }
}

impl<R: Read> Iterator for Lines<R> {
    type Item = Result<Line, ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(text: &str, ends: Ends) -> Vec<(u64, String, bool)> {
        let lines = Lines::of(text.as_bytes(), ends).map(|line| line.expect("short"));
        lines.map(|line| (line.number, line.text, line.is_ended)).collect()
    }

    #[test]
    fn every_kind_of_line_end_counts_one_line() {
        for text in ["a\nb\n\nc", "a\r\nb\r\n\r\nc", "a\rb\r\rc", "a\nb\r\n\rc"] {
            let expected = [(1, "a", true), (2, "b", true), (3, "", true), (4, "c", false)];
            let expected = expected.map(|(number, text, end)| (number, text.to_owned(), end));
            assert_eq!(split(text, Ends::Lines), expected, "{text:?}");
        }
        assert_eq!(split("", Ends::Lines), []);
        assert_eq!(split("1,2.3,4.5", Ends::Stops).len(), 3);
    }

    #[test]
    fn lines_without_end_are_bounded() {
        let long = std::io::Read::take(std::io::repeat(b'1'), 1 << 30);
        let error = Lines::of(long, Ends::Lines).next().expect("a line").expect_err("too long");
        assert!(error.to_string().contains("longer than"), "{error}");
    }

    #[test]
    fn a_return_and_feed_split_between_reads_is_one_end() {
        let source = "a\r".as_bytes().chain("\nb".as_bytes());
        let lines: Vec<_> =
            Lines::of(source, Ends::Lines).map(|line| line.expect("short")).collect();
        assert_eq!(lines.len(), 2, "{lines:?}");
    }
}
