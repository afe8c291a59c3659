//! From the bytes of a log to its records, with what can't be true left out. Pure.

use std::collections::HashSet;

use uuid::Uuid;

use crate::{
    scan::{MAX_LINE_BYTES, Record, ScanStart, decode_line},
    store::Mark,
};

/// Scans of a log that are remembered, so that none begins twice.
const MOST_SCANS: usize = 100_000;

/// Takes a log's bytes piece by piece and gives its records; needs memory for a line and a piece.
#[derive(Debug, Default)]
pub struct Sieve {
    bytes: Vec<u8>,
    /// Where the line begins that is looked at, and up to where it has no newline.
    begins: usize,
    seen: usize,
    /// What is passed over of a line that is too long for a record, bytes.
    passed: u64,
    /// Bytes of the log up to the last whole line that was looked at, and the last of them.
    taken: u64,
    mark: Mark,
    /// The mark with what is passed over.
    mark_ahead: Mark,
    refused_bytes: u64,
    /// The scan under way, and how many beams it has.
    scan: Option<(Uuid, u32)>,
    scans: HashSet<Uuid>,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq)]
pub enum Sifted {
    /// A record, and its line as it stands, without the newline.
    Record(Box<Record>, Vec<u8>),
    /// What is not taken.
    Refused(Refusal),
}

/// A line that is not taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Where it begins in the log, bytes.
    pub at: u64,
    /// The scan that it says it is of, or else the one under way.
    pub scan: Option<Uuid>,
    /// Why.
    pub why: String,
}

impl Sieve {
    /// Tells it of a record that was let pass already.
    pub fn learn(&mut self, record: &Record) {
        drop(self.judge(record));
    }

    /// Goes on behind so many bytes of the log, the last of which are given; what came of a line without its end
    /// comes again.
    pub(super) fn go_on(&mut self, taken: u64, last: &[u8]) {
        self.bytes.clear();
        (self.begins, self.seen, self.passed, self.taken) = (0, 0, 0, taken);
        self.mark = Mark::default();
        self.mark.push(last);
    }

    /// Takes the following bytes of the log.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.begins);
        self.seen -= self.begins;
        self.begins = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// Bytes of the log up to the last whole line that it gave.
    #[must_use]
    pub const fn taken(&self) -> u64 {
        self.taken
    }

    /// SHA-256 of the last of these bytes.
    pub(super) fn sha256(&self) -> String {
        self.mark.sha256()
    }

    /// Bytes that it let not pass, those of a line without an end included.
    #[must_use]
    pub const fn refused_bytes(&self) -> u64 {
        self.refused_bytes + self.passed
    }

    /// The next whole line, if there is one.
    pub fn next_line(&mut self) -> Option<Sifted> {
        let Some(end) = self.bytes[self.seen..].iter().position(|&byte| byte == b'\n') else {
            self.seen = self.bytes.len();
            if self.seen - self.begins > MAX_LINE_BYTES + 1 {
                if self.passed == 0 {
                    self.mark_ahead = self.mark.clone();
                }
                self.mark_ahead.push(&self.bytes[self.begins..]);
                self.passed += (self.seen - self.begins) as u64;
                self.begins = self.seen;
            }
            return None;
        };
        let line = self.bytes[self.begins..self.seen + end].to_vec();
        let at = self.taken;
        let passed = std::mem::take(&mut self.passed);
        if passed > 0 {
            self.mark = std::mem::take(&mut self.mark_ahead);
        }
        self.mark.push(&self.bytes[self.begins..=self.seen + end]);
        self.begins = self.seen + end + 1;
        self.seen = self.begins;
        let length = passed + line.len() as u64;
        self.taken += length + 1;
        let refused = |scan, why| Refusal { at, scan, why };
        let under_way = self.scan.map(|(scan, _)| scan);
        let judged = if passed > 0 || line.len() > MAX_LINE_BYTES + 1 {
            let why = format!("{length} bytes long; a record has at most {MAX_LINE_BYTES}");
            Err(refused(under_way, why))
        } else {
            match decode_line(&line) {
                Ok(record) => match self.judge(&record) {
                    Ok(()) => Ok(Sifted::Record(Box::new(record), line)),
                    Err(why) => Err(refused(scan_of(&record).or(under_way), why)),
                },
                Err(error) => Err(refused(under_way, error.to_string())),
            }
        };
        Some(judged.unwrap_or_else(|refusal| {
            self.refused_bytes += length + 1;
            Sifted::Refused(refusal)
        }))
    }

    /// Whether a record can be where it stands.
    fn judge(&mut self, record: &Record) -> Result<(), String> {
        match record {
            Record::Session(_) => self.scan = None,
            Record::ScanStart(start) => return self.begin(start),
            Record::Ping(ping) => match self.scan {
                Some((scan, beams)) if scan == ping.scan => {
                    if ping.index >= beams {
                        return Err(format!("beam {}: the plan has {beams}", ping.index));
                    }
                }
                _ => return Err("a reading of a scan that is not under way".into()),
            },
            Record::ScanEnd(end) => match self.scan.take_if(|(scan, _)| *scan == end.scan) {
                Some(_) => {}
                None => return Err("the end of a scan that is not under way".into()),
            },
            Record::Event(_) => {}
        }
        Ok(())
    }

    fn begin(&mut self, start: &ScanStart) -> Result<(), String> {
        self.scan = None;
        start.plan.check().map_err(|error| format!("its plan can't be: {error}"))?;
        if self.scans.len() == MOST_SCANS {
            self.scans.clear();
        }
        if !self.scans.insert(start.scan) {
            return Err("a scan that was there already begins again".into());
        }
        self.scan = Some((start.scan, start.plan.beams()));
        Ok(())
    }
}

const fn scan_of(record: &Record) -> Option<Uuid> {
    match record {
        Record::ScanStart(start) => Some(start.scan),
        Record::Ping(ping) => Some(ping.scan),
        Record::ScanEnd(end) => Some(end.scan),
        Record::Session(_) | Record::Event(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = include_str!("../../tests/fixtures/small.jsonl");

    /// What comes of a log that comes in pieces of so many bytes.
    fn sift(log: &[u8], piece: usize) -> (Vec<Vec<u8>>, Vec<Refusal>, Sieve) {
        let (mut sieve, mut kept, mut refused) = (Sieve::default(), Vec::new(), Vec::new());
        for piece in log.chunks(piece) {
            sieve.push(piece);
            while let Some(line) = sieve.next_line() {
                match line {
                    Sifted::Record(_, line) => kept.push(line),
                    Sifted::Refused(refusal) => refused.push(refusal),
                }
            }
            assert!(sieve.bytes.len() <= MAX_LINE_BYTES + 2 + piece.len());
        }
        (kept, refused, sieve)
    }

    #[test]
    fn a_log_comes_through_as_it_stands_in_pieces_of_any_size() {
        let lines: Vec<_> = LOG.lines().map(|line| line.as_bytes().to_vec()).collect();
        for piece in [1, 7, 100, 4096, 1 << 20] {
            let (kept, refused, sieve) = sift(LOG.as_bytes(), piece);
            assert_eq!((&kept, refused.len()), (&lines, 0), "{piece}");
            assert_eq!(sieve.taken(), LOG.len() as u64);
        }
        let torn = &LOG.as_bytes()[..LOG.len() - 3];
        let (kept, _, sieve) = sift(torn, 50);
        assert_eq!(kept.len(), lines.len() - 1, "a line without its newline is still written");
        assert!(sieve.taken() < torn.len() as u64);
    }

    #[test]
    fn what_lies_is_left_out_with_its_scan_and_reason_and_the_rest_comes() {
        let ping = LOG.lines().find(|line| line.contains("\"ping\"")).expect("a reading");
        let start = LOG.lines().find(|line| line.contains("\"scan_start\"")).expect("a scan");
        let scan = decode_line(start.as_bytes()).ok().as_ref().and_then(scan_of).expect("one");
        let other = Uuid::from_u128(7);
        let of_other = ping.replace(&scan.to_string(), &other.to_string());
        let long = format!("{{\"type\":\"event\",\"detail\":\"{}\"}}", "x".repeat(MAX_LINE_BYTES));
        let beyond = ping.replacen("\"index\":0", "\"index\":4000000000", 1);
        let lies = [
            ("{}", None),
            ("no JSON", Some(scan)),
            (&*of_other, Some(other)),
            (&*long, Some(scan)),
            (&*beyond, Some(scan)),
            (start, Some(scan)),
        ];
        for (lie, of) in lies {
            let mut log = String::new();
            for line in LOG.lines() {
                log += &format!("{line}\n");
                if line == start && of.is_some() {
                    log += &format!("{lie}\n");
                }
            }
            if of.is_none() {
                log = format!("{lie}\n{LOG}");
            }
            let (kept, refused, _) = sift(log.as_bytes(), 1000);
            let first = refused.first().expect("it is refused");
            assert_eq!(first.scan, of, "{first:?}");
            let whole = if lie == start { 2 } else { LOG.lines().count() };
            assert!(kept.len() >= whole, "{lie:.60}: {} lines", kept.len());
        }
    }

    #[test]
    fn the_mark_is_of_what_was_taken_also_behind_a_line_too_long() {
        let long = "y".repeat(3 << 20);
        let log = format!("{LOG}{long}\n{LOG}");
        let (_, refused, sieve) = sift(log.as_bytes(), 5000);
        assert!(refused[0].why.contains("bytes long"), "{refused:?}");
        let of = |bytes: &[u8]| {
            let mut mark = Mark::default();
            mark.push(bytes);
            mark.sha256()
        };
        assert_eq!((sieve.taken(), sieve.sha256()), (log.len() as u64, of(log.as_bytes())));
        let (_, _, sieve) = sift(format!("{LOG}{long}").as_bytes(), 5000);
        assert_eq!((sieve.taken(), sieve.sha256()), (LOG.len() as u64, of(LOG.as_bytes())));
        let (_, _, sieve) = sift(format!("{LOG}{long}\n").as_bytes(), 5000);
        assert_eq!(sieve.sha256(), of(format!("{LOG}{long}\n").as_bytes()));
    }

    #[test]
    fn a_line_without_an_end_costs_no_memory_and_is_counted() {
        let (kept, refused, sieve) = sift(&vec![b'x'; 5 << 20], 1 << 16);
        assert_eq!((kept.len(), refused.len(), sieve.taken()), (0, 0, 0));
        assert!(sieve.refused_bytes() > 3 << 20);
    }
}
