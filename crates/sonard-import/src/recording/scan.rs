//! Readings of a recording gathered into scans.

use sonard_model::geometry::wrap_180;
use sonard_records::Record;

use super::{Heard, message::moment};
use crate::{
    Location, Reading, Taken,
    reading::Raw,
    scans::{self, Firing, MOST_FIRINGS},
    turning::Turning,
};

/// Readings that come one by one, cut into scans: of a ranger that turns where it is back where it began, of an
/// array where a ranger comes again.
pub(super) struct Gathered<'a> {
    taken: &'a Taken,
    /// What ranges were computed with, if that is to be mended, metres a second.
    assumed_m_s: Option<f64>,
    /// The rangers of an array.
    ids: Vec<String>,
    heard: Vec<(usize, Heard)>,
    /// True if it has turned away from where it began.
    is_away: bool,
    turning: Turning,
    scans: u64,
}

/// Directions closer than this are one, degrees.
const SAME_DEG: f64 = 1e-3;

impl<'a> Gathered<'a> {
    pub(super) fn new(taken: &'a Taken, assumed_m_s: Option<f64>, ids: Vec<String>) -> Self {
        let (heard, is_away, turning, scans) = (Vec::new(), false, Turning::default(), 0);
        Self { taken, assumed_m_s, ids, heard, is_away, turning, scans }
    }

    /// Takes a reading of a ranger, by its number; the scan before it, if that ended.
    pub(super) fn add(&mut self, ranger: usize, heard: Heard) -> Option<Vec<Record>> {
        let ended = match self.ids.is_empty() {
            true => self.is_swept(&heard),
            false => self.heard.iter().any(|(other, _)| *other == ranger),
        };
        let scan = if ended || self.heard.len() == MOST_FIRINGS { self.finish() } else { None };
        if scan.is_some() {
            self.turning.restart(heard.direction_deg);
        }
        self.heard.push((ranger, heard));
        scan
    }

    /// A whole scan.
    pub(super) fn whole(&mut self, heard: Vec<Heard>) -> Option<Vec<Record>> {
        self.heard = heard.into_iter().map(|heard| (0, heard)).collect();
        self.finish()
    }

    /// The last scan.
    pub(super) fn finish(&mut self) -> Option<Vec<Record>> {
        self.is_away = false;
        let heard = std::mem::take(&mut self.heard);
        if heard.is_empty() {
            return None;
        }
        self.scans += 1;
        let firings = heard.into_iter().map(|(ranger, heard)| (ranger, self.reading(&heard)));
        if self.ids.is_empty() {
            let readings: Vec<_> = firings.map(|(_, reading)| reading).collect();
            return Some(scans::records(self.taken, self.scans, &readings));
        }
        let firings =
            firings.map(|(ranger, reading)| Firing { ranger: &self.ids[ranger], reading });
        Some(scans::firings_of_array(self.taken, self.scans, &firings.collect::<Vec<_>>()))
    }

    /// Checks whether a reading is the first of another sweep: where the motion turns round, or is back where it began.
    fn is_swept(&mut self, next: &Heard) -> bool {
        let is_swept = self.turning.is_next(next.direction_deg);
        let Some((_, first)) = self.heard.first() else { return false };
        let is_back = wrap_180(next.direction_deg - first.direction_deg).abs() <= SAME_DEG;
        self.is_away |= !is_back;
        self.is_away && (is_back || is_swept)
    }

    fn reading(&self, heard: &Heard) -> Reading {
        let sound_m_s = self.taken.air.sound_speed_m_s();
        let tof_us = heard.range_m.map(|m| 2e6 * m / self.assumed_m_s.unwrap_or(sound_m_s));
        let mended_m = |tof_us: f64| tof_us * 1e-6 * sound_m_s / 2.0;
        Reading {
            // A recording's messages have no lines: what is wrong with one is told before.
            place: Location::Line(self.scans),
            direction_deg: heard.direction_deg,
            is_bearing: false,
            status: heard.status,
            range_m: if self.assumed_m_s.is_some() { tof_us.map(mended_m) } else { heard.range_m },
            tof_us,
            time: Some(moment(heard.time_ns)),
            scan: None,
            place_m: heard.pose.map(|pose| [pose.x_m, pose.y_m]),
            heading_deg: heard.pose.map(|pose| pose.heading_deg),
            air: None,
            raw: Raw::default(),
        }
    }
}
