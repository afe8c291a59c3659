//! Copy of a log's newest lines, which are written again if the log is removed or truncated.

use std::collections::HashSet;

use sonard_records::Record;

const SCAN_START: &[u8] = b"{\"type\":\"scan_start\"";
/// Maximum size of the retained lines, bytes. Above it, the lines of the current scan before the
/// last check are discarded first.
const MAX_RETAINED_BYTES: usize = 16 << 20;

/// Lines of the current scan, and all lines appended since the last check of the log's file.
/// Session lines are excluded, because every file begins with the current session.
#[derive(Debug)]
pub(super) struct RetainedLines {
    max_bytes: usize,
    lines: Vec<u8>,
    /// First line of the current scan; empty between scans.
    scan_start: Vec<u8>,
    /// Offset of the current scan in `lines`, bytes.
    scan_at: usize,
    /// Offset of the first line after the last check, bytes.
    unchecked_at: usize,
    /// Number of lines since the last check that were discarded.
    discarded: u64,
}

impl Default for RetainedLines {
    fn default() -> Self {
        Self::with_limit(MAX_RETAINED_BYTES)
    }
}

impl RetainedLines {
    /// Creates an empty copy for up to `max_bytes` bytes.
    pub(super) const fn with_limit(max_bytes: usize) -> Self {
        Self {
            max_bytes,
            lines: Vec::new(),
            scan_start: Vec::new(),
            scan_at: 0,
            unchecked_at: 0,
            discarded: 0,
        }
    }

    /// Adds the line of an appended record, with its newline.
    pub(super) fn push(&mut self, line: &[u8], record: &Record) {
        match record {
            Record::Session(_) => return self.restart(),
            Record::ScanStart(_) => {
                self.scan_start = line.into();
                self.scan_at = self.lines.len();
            }
            Record::ScanEnd(_) => self.scan_start.clear(),
            Record::Ping(_) | Record::Event(_) => {}
        }
        self.lines.extend_from_slice(line);
        if self.lines.len() > self.max_bytes {
            self.shorten();
        }
    }

    /// Discards the lines of earlier scans after a check that found the file intact.
    pub(super) fn confirm(&mut self) {
        let at = if self.is_in_scan() { self.scan_at } else { self.lines.len() };
        self.lines.drain(..at);
        (self.scan_at, self.unchecked_at, self.discarded) = (0, self.lines.len(), 0);
    }

    /// Discards all lines but the first one of the current scan, with which the next file begins.
    pub(super) fn restart(&mut self) {
        self.restart_with(&[], &[]);
    }

    /// Discards all lines but the given ones, the first line of their scans, which is followed by
    /// `note`, and the first line of the current scan.
    pub(super) fn restart_with(&mut self, kept: &[u8], note: &[u8]) {
        let kept: HashSet<&[u8]> = split_lines(kept).collect();
        let lines: Vec<&[u8]> = split_lines(&self.lines).collect();
        let (mut remaining, mut scan_at) = (Vec::new(), 0);
        for scan in lines.chunk_by(|_, line| !line.starts_with(SCAN_START)) {
            let is_current = self.is_in_scan() && scan.first() == Some(&&*self.scan_start);
            if is_current {
                scan_at = remaining.len();
            }
            if scan.iter().any(|line| kept.contains(line)) {
                for line in scan {
                    if line.starts_with(SCAN_START) {
                        remaining.extend([line, note].concat());
                    } else if kept.contains(line) {
                        remaining.extend_from_slice(line);
                    }
                }
            } else if is_current {
                remaining.extend_from_slice(&self.scan_start);
            }
        }
        (self.lines, self.scan_at) = (remaining, scan_at);
        (self.unchecked_at, self.discarded) = (0, 0);
    }

    /// Returns `true` between the first and the last record of a scan.
    pub(super) const fn is_in_scan(&self) -> bool {
        !self.scan_start.is_empty()
    }

    /// Retained lines with their newlines, oldest first.
    pub(super) fn lines(&self) -> &[u8] {
        &self.lines
    }

    /// Number of retained lines.
    pub(super) fn count(&self) -> u64 {
        count_lines(&self.lines)
    }

    /// Number of lines since the last check that exceeded the limit.
    pub(super) const fn discarded(&self) -> u64 {
        self.discarded
    }

    /// Reduces the lines to those of the current scan since the last check, or to none.
    fn shorten(&mut self) {
        let kept_at =
            if self.is_in_scan() { self.scan_at.max(self.unchecked_at) } else { self.lines.len() };
        let mut kept = self.lines.split_off(kept_at);
        let begun = if kept_at > self.scan_at { self.scan_start.clone() } else { Vec::new() };
        self.discarded += count_lines(self.lines.get(self.unchecked_at..).unwrap_or_default());
        (self.lines, self.scan_at, self.unchecked_at) = (begun, 0, 0);
        if self.lines.len() + kept.len() > self.max_bytes {
            self.discarded += count_lines(&kept);
            self.lines.clone_from(&self.scan_start);
        } else {
            self.unchecked_at = self.lines.len();
            self.lines.append(&mut kept);
        }
    }
}

fn split_lines(lines: &[u8]) -> impl Iterator<Item = &[u8]> {
    lines.split_inclusive(|&byte| byte == b'\n')
}

fn count_lines(lines: &[u8]) -> u64 {
    lines.iter().filter(|&&byte| byte == b'\n').count() as u64
}

#[cfg(test)]
mod tests {
    use sonard_records::{Record, decode_line};

    use super::RetainedLines;

    const LOG: &str = include_str!("../../../../tests/fixtures/small.jsonl");

    fn push(retained: &mut RetainedLines, lines: &[&str]) {
        for line in lines {
            let record = decode_line(line.as_bytes()).expect("the fixture is clean");
            retained.push(format!("{line}\n").as_bytes(), &record);
        }
    }

    fn kinds(retained: &RetainedLines) -> String {
        let lines = retained.lines().split_inclusive(|&byte| byte == b'\n');
        lines
            .map(|line| match decode_line(line.trim_ascii_end()).expect("a record") {
                Record::Session(_) => 'S',
                Record::ScanStart(_) => '(',
                Record::Ping(_) => '.',
                Record::ScanEnd(_) => ')',
                Record::Event(_) => 'e',
            })
            .collect()
    }

    #[test]
    fn lines_since_the_last_check() {
        let lines: Vec<&str> = LOG.lines().collect();
        let mut retained = RetainedLines::default();
        push(&mut retained, &lines[..4]);
        assert_eq!((kinds(&retained).as_str(), retained.is_in_scan()), ("(..", true));
        retained.confirm();
        push(&mut retained, &lines[4..11]);
        // The scan ended after the check, so all of it is kept.
        assert_eq!((kinds(&retained).as_str(), retained.is_in_scan()), ("(.......)e", false));
        push(&mut retained, &lines[1..3]);
        assert_eq!(kinds(&retained), "(.......)e(.");
        retained.confirm();
        assert_eq!((kinds(&retained).as_str(), retained.count()), ("(.", 2));
        push(&mut retained, &lines[3..4]);
        retained.restart();
        assert_eq!((kinds(&retained).as_str(), retained.is_in_scan()), ("(", true));
    }

    #[test]
    fn limit_keeps_the_newest() {
        let lines: Vec<&str> = LOG.lines().collect();
        let bytes = |lines: &[&str]| lines.iter().map(|line| line.len() + 1).sum::<usize>();
        // Room for all but the last two pings.
        let mut retained = RetainedLines::with_limit(bytes(&lines[1..7]));
        push(&mut retained, &lines[..5]);
        retained.confirm();
        push(&mut retained, &lines[5..8]);
        assert_eq!((kinds(&retained).as_str(), retained.discarded()), ("(...", 0));
        // Without a check all lines are needed, and those above the limit are counted.
        let mut retained = RetainedLines::with_limit(bytes(&lines[1..7]));
        push(&mut retained, &lines[..8]);
        assert_eq!((kinds(&retained).as_str(), retained.discarded()), ("(", 7));
        push(&mut retained, &lines[8..10]);
        assert_eq!(kinds(&retained), "(.)");
        retained.confirm();
        assert_eq!((retained.count(), retained.discarded()), (0, 0));
    }
}
