//! Readings with what explains them.

use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    compare::{NotCompared, Verdict, judge},
    scan::Ping,
};

/// What explains a reading, or why it can't be compared with a prediction.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Word {
    /// Compared with the prediction.
    Compared(Verdict),
    /// Not compared, and why.
    NotCompared(NotCompared),
}

impl Word {
    /// What explains this reading.
    #[must_use]
    pub fn of(ping: &Ping) -> Self {
        judge(ping).verdict.map_or_else(Self::NotCompared, Self::Compared)
    }
}

/// A reading's line, an object with or without a newline, with what explains it as its last field.
#[must_use]
pub fn judged_line(line: &[u8], ping: &Ping) -> Vec<u8> {
    let (object, newline) = match line.strip_suffix(b"\n") {
        Some(object) => (object, &b"\n"[..]),
        None => (line, &b""[..]),
    };
    let (Some(open), Ok(verdict)) =
        (object.strip_suffix(b"}"), serde_json::to_string(&Word::of(ping)))
    else {
        return line.to_vec();
    };
    [open, b",\"verdict\":", verdict.as_bytes(), b"}", newline].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::{Record, decode_line};

    #[test]
    fn a_reading_gets_its_verdict_and_nothing_else() {
        let log = include_str!("../../tests/fixtures/small.jsonl");
        let mut verdicts = Vec::new();
        for line in log.lines() {
            let Ok(Record::Ping(ping)) = decode_line(line.as_bytes()) else { continue };
            let judged = judged_line(format!("{line}\n").as_bytes(), &ping);
            assert!(
                judged.ends_with(b"}\n") && !judged_line(line.as_bytes(), &ping).ends_with(b"\n")
            );
            let mut judged: serde_json::Value = serde_json::from_slice(&judged).expect("JSON");
            let verdict = judged.as_object_mut().expect("an object").remove("verdict");
            verdicts.push(verdict.expect("a verdict").as_str().expect("a word").to_owned());
            let before: serde_json::Value = serde_json::from_str(line).expect("JSON");
            assert_eq!(judged, before);
        }
        let expected =
            ["direct", "multiple", "edge", "min_range", "silent", "unexplained", "link_lost"];
        assert_eq!(verdicts, expected);
    }
}
