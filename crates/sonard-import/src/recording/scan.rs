//! Collection of the readings of a recording into scans.

use sonard_model::geometry::wrap_180;
use sonard_records::Record;

use super::{PlacedReading, message::timestamp};
use crate::{
    Assumptions, FileLocation, ImportedReading,
    reading::RawReading,
    scans::{self, ArrayFiring, MAX_FIRINGS},
    sweep_end::{SAME_DEG, SweepDetector},
};

/// Splits a stream of readings into scans: for a rotating ranger where it returns to its first
/// direction, for an array where a ranger fires again.
pub(super) struct ScanCollector<'a> {
    assumptions: &'a Assumptions,
    /// Sound speed with which the ranges were computed, if they are to be corrected, m/s.
    assumed_m_s: Option<f64>,
    /// Names of the rangers of an array; empty for a rotating ranger.
    ids: Vec<String>,
    readings: Vec<(usize, PlacedReading)>,
    /// True if the ranger has left its first direction.
    is_away: bool,
    sweep: SweepDetector,
    scans: u64,
}

impl<'a> ScanCollector<'a> {
    pub(super) fn new(
        assumptions: &'a Assumptions,
        assumed_m_s: Option<f64>,
        ids: Vec<String>,
    ) -> Self {
        let (readings, is_away, sweep, scans) = (Vec::new(), false, SweepDetector::default(), 0);
        Self { assumptions, assumed_m_s, ids, readings, is_away, sweep, scans }
    }

    /// Adds a reading of a ranger, by its index, and returns the previous scan if that is complete.
    pub(super) fn add(&mut self, ranger: usize, readings: PlacedReading) -> Option<Vec<Record>> {
        let ended = match self.ids.is_empty() {
            true => self.is_swept(&readings),
            false => self.readings.iter().any(|(other, _)| *other == ranger),
        };
        let scan = if ended || self.readings.len() == MAX_FIRINGS { self.finish() } else { None };
        if scan.is_some() {
            self.sweep.restart(readings.direction_deg);
        }
        self.readings.push((ranger, readings));
        scan
    }

    /// Converts the readings of a complete scan.
    pub(super) fn complete_scan(&mut self, readings: Vec<PlacedReading>) -> Option<Vec<Record>> {
        self.readings = readings.into_iter().map(|readings| (0, readings)).collect();
        self.finish()
    }

    /// Returns the last scan.
    pub(super) fn finish(&mut self) -> Option<Vec<Record>> {
        self.is_away = false;
        let readings = std::mem::take(&mut self.readings);
        if readings.is_empty() {
            return None;
        }
        self.scans += 1;
        let firings =
            readings.into_iter().map(|(ranger, readings)| (ranger, self.reading(&readings)));
        if self.ids.is_empty() {
            let readings: Vec<_> = firings.map(|(_, reading)| reading).collect();
            return Some(scans::records(self.assumptions, self.scans, &readings));
        }
        let firings =
            firings.map(|(ranger, reading)| ArrayFiring { ranger: &self.ids[ranger], reading });
        Some(scans::array_round_records(self.assumptions, self.scans, &firings.collect::<Vec<_>>()))
    }

    /// Returns `true` for the first reading of another sweep: at a reversal, or back at the first
    /// direction.
    fn is_swept(&mut self, next: &PlacedReading) -> bool {
        let is_swept = self.sweep.is_next(next.direction_deg);
        let Some((_, first)) = self.readings.first() else { return false };
        let is_back = wrap_180(next.direction_deg - first.direction_deg).abs() <= SAME_DEG;
        self.is_away |= !is_back;
        self.is_away && (is_back || is_swept)
    }

    fn reading(&self, readings: &PlacedReading) -> ImportedReading {
        let sound_m_s = self.assumptions.air.sound_speed_m_s();
        let tof_us = readings.range_m.map(|m| 2e6 * m / self.assumed_m_s.unwrap_or(sound_m_s));
        let corrected_m = |tof_us: f64| tof_us * 1e-6 * sound_m_s / 2.0;
        ImportedReading {
            // Messages have no line numbers; their errors were reported by the examination.
            location: FileLocation::Line(self.scans),
            direction_deg: readings.direction_deg,
            is_bearing: false,
            status: readings.status,
            range_m: if self.assumed_m_s.is_some() {
                tof_us.map(corrected_m)
            } else {
                readings.range_m
            },
            tof_us,
            time: Some(timestamp(readings.time_ns)),
            scan: None,
            position_m: readings.pose.map(|pose| [pose.x_m, pose.y_m]),
            heading_deg: readings.pose.map(|pose| pose.heading_deg),
            air: None,
            raw: RawReading::default(),
        }
    }
}
