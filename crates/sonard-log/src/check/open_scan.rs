//! State of a scan during the check.

use std::collections::HashMap;

use sonard_records::{ScanEnd, ScanPlan};
use uuid::Uuid;

/// Scan that has started and not ended.
#[derive(Debug)]
pub(super) struct OpenScan {
    pub(super) id: Uuid,
    line: u64,
    /// Scan plan; `None` if `scan_start` is missing.
    pub(super) plan: Option<ScanPlan>,
    /// Line number of the reading, and `true` if the reading was received, by beam index.
    pub(super) beams: HashMap<u32, (u64, bool)>,
    /// `true` if an event explains an early end.
    pub(super) interrupted: bool,
    /// `true` if an event reports lost records.
    pub(super) has_gap: bool,
}

impl OpenScan {
    pub(super) fn new(id: Uuid, line: u64, plan: Option<ScanPlan>) -> Self {
        Self { id, line, plan, beams: HashMap::new(), interrupted: false, has_gap: false }
    }

    pub(super) fn not_ended(&self, when: &str) -> String {
        let Self { id, line, beams, .. } = self;
        let planned = self.plan.map_or(String::new(), |plan| format!(" of {}", plan.beams()));
        let count = beams.len();
        format!(
            "scan {id} (line {line}) has no scan_end {when}: {count}{planned} beams are present"
        )
    }

    /// Compares the counts in `scan_end` with the log. A lost reading has a line but no value, so
    /// it may be counted as a beam or as missing.
    pub(super) fn wrong_counts(&self, end: &ScanEnd) -> Vec<String> {
        let logged = self.beams.len() as u32;
        let lost = self.beams.values().filter(|(_, came_through)| !came_through).count() as u32;
        let mut wrong = Vec::new();
        if ![logged, logged - lost].contains(&end.beams) {
            wrong.push(format!("scan_end counts {} beams; the log has {logged}", end.beams));
        }
        let Some(plan) = self.plan else { return wrong };
        let absent: Vec<u32> = (0..plan.beams()).filter(|i| !self.beams.contains_key(i)).collect();
        let missing = absent.len() as u32;
        if ![missing, missing + lost].contains(&end.missing) {
            let counts = end.missing;
            let which = ranges(&absent);
            wrong.push(format!("scan_end counts {counts} missing; absent are {missing}{which}"));
        }
        wrong
    }
}

/// Formats beam numbers as `: 3-7, 12`, truncated after eight runs.
fn ranges(indices: &[u32]) -> String {
    let runs: Vec<String> = indices
        .chunk_by(|a, b| a + 1 == *b)
        .map(|run| match run {
            [first, .., last] => format!("{first}-{last}"),
            run => run.iter().map(ToString::to_string).collect(),
        })
        .collect();
    match runs.len() {
        0 => String::new(),
        1..=8 => format!(": {}", runs.join(", ")),
        more => {
            format!(": {} and {} more runs", runs.get(..8).unwrap_or_default().join(", "), more - 8)
        }
    }
}
