//! Live map of all scans so far.

use std::convert::Infallible;

use jiff::Timestamp;
use sonard_interpret::interpret::{
    Extents, Sweep,
    mapping::{GrowingMap, MapSettings},
};
use sonard_records::{ScanView, Session};

use crate::{
    SkippedScan,
    conversion::{MAP, MAP_TOPIC, MessageSink},
    recording::nanoseconds,
    ros::{
        interface::OCCUPANCY_GRID,
        message::{Header, OccupancyGrid, Stamp},
    },
};

/// Maximum number of cells, one byte each in a message: a square of 35 m with cells of 5 cm.
const MAX_CELLS: usize = 500_000;

/// Map of all scans so far, identical to that of `sonard map` without options.
#[derive(Debug)]
pub(super) enum LiveMap {
    /// No mappable scan so far.
    Empty,
    Growing {
        map: Box<GrowingMap>,
        /// Start of the latest scan.
        time: Timestamp,
    },
    /// Stopped by an error.
    Stopped,
}

impl LiveMap {
    pub(super) const fn new() -> Self {
        Self::Empty
    }

    /// Adds a scan and writes the map at a time. Scans that cannot be mapped are skipped, as by
    /// `sonard map`.
    ///
    /// # Errors
    /// Returns the reason, once, if the map stops with this scan.
    pub(super) fn add(
        &mut self,
        scan: &ScanView,
        at: Stamp,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), SkippedScan> {
        let (Some(start), Some(session)) = (scan.start.as_ref(), scan.session.as_deref()) else {
            return Ok(());
        };
        let Ok(sweep) = Sweep::from_scan(scan) else { return Ok(()) };
        let (mut map, time) = match std::mem::replace(self, Self::Stopped) {
            Self::Empty => (Box::new(new_map(session)?), start.time),
            Self::Growing { map, time } => (map, time.max(start.time)),
            Self::Stopped => return Ok(()),
        };
        let grid = map.add(sweep).map_err(|error| SkippedScan::Map(error.to_string()))?;
        *self = Self::Growing { map, time };
        let header = Header { stamp: Stamp(nanoseconds(time)), frame: MAP };
        let message = OccupancyGrid { header, grid: &grid };
        let Ok(()) = out.message(MAP_TOPIC, OCCUPANCY_GRID, at.max(header.stamp), &message);
        Ok(())
    }
}

/// Creates the map with the parameters of the first scan's session.
fn new_map(session: &Session) -> Result<GrowingMap, SkippedScan> {
    let extents =
        Extents::from_session(session).map_err(|error| SkippedScan::Map(error.to_string()))?;
    Ok(GrowingMap::new(MapSettings::default(), extents, session.array.is_some(), MAX_CELLS))
}
