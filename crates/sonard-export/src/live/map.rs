//! The map that is told live.

use std::convert::Infallible;

use jiff::Timestamp;
use sonard_interpret::interpret::{
    Extents, Sweep,
    mapping::{GrowingMap, Mapping},
};
use sonard_records::{ScanView, Session};

use crate::{
    LeftOut,
    conversion::{MAP, MAP_TOPIC, MessageSink},
    recording::nanoseconds,
    ros::{
        interface::OCCUPANCY_GRID,
        message::{Header, OccupancyGrid, Stamp},
    },
};

/// Cells that it may have, a byte each in a message: a square of 35 m with cells of 5 cm. Half of what waits for viewers.
const MOST_CELLS: usize = 500_000;

/// A map of all scans so far, as `sonard map` makes it without options.
#[derive(Debug)]
pub(super) enum LiveMap {
    /// There was no scan yet that can be mapped.
    Empty,
    Growing {
        map: Box<GrowingMap>,
        /// When the latest scan began.
        time: Timestamp,
    },
    /// It can't be told any more.
    Over,
}

impl LiveMap {
    pub(super) const fn new() -> Self {
        Self::Empty
    }

    /// Adds a scan and tells the map, at a time. Scans that nothing can be made of are passed over, as by the verb.
    ///
    /// # Errors
    /// When it can't be told from now on; that is said once.
    pub(super) fn add(
        &mut self,
        scan: &ScanView,
        at: Stamp,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), LeftOut> {
        let (Some(start), Some(session)) = (scan.start.as_ref(), scan.session.as_deref()) else {
            return Ok(());
        };
        let Ok(sweep) = Sweep::of(scan) else { return Ok(()) };
        let (mut map, time) = match std::mem::replace(self, Self::Over) {
            Self::Empty => (Box::new(begin(session)?), start.time),
            Self::Growing { map, time } => (map, time.max(start.time)),
            Self::Over => return Ok(()),
        };
        let grid = map.add(sweep).map_err(|error| LeftOut::Map(error.to_string()))?;
        *self = Self::Growing { map, time };
        let header = Header { stamp: Stamp(nanoseconds(time)), frame: MAP };
        let message = OccupancyGrid { header, grid: &grid };
        let Ok(()) = out.message(MAP_TOPIC, OCCUPANCY_GRID, at.max(header.stamp), &message);
        Ok(())
    }
}

/// By the session of the first scan, whatever comes after it.
fn begin(session: &Session) -> Result<GrowingMap, LeftOut> {
    let extents = Extents::of_session(session).map_err(|error| LeftOut::Map(error.to_string()))?;
    Ok(GrowingMap::new(Mapping::default(), extents, session.array.is_some(), MOST_CELLS))
}
