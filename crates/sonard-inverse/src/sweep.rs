//! Readings of one scan, as far as they say something about the world.

use sonard_model::geometry::Pose;
use sonard_records::{PingStatus, ScanView};
use thiserror::Error;
use uuid::Uuid;

/// The readings of a ranger on a stepper, taken from one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// The scan that they are of.
    pub scan: Uuid,
    /// Where the ranger is believed to have stood.
    pub pose: Pose,
    /// Its firings; those that say nothing are left out.
    pub beams: Vec<Beam>,
}

/// A firing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Where the stepper pointed, degrees counter-clockwise from the heading.
    pub azimuth_deg: f64,
    /// What came back.
    pub heard: Heard,
}

impl Beam {
    pub(crate) const fn is_echo(&self) -> bool {
        matches!(self.heard, Heard::Echo { .. })
    }
}

/// The outcome of a firing, as fits use it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard {
    /// The first echo so long after firing, microseconds.
    Echo {
        /// Time of flight.
        tof_us: f64,
    },
    /// Nothing within the listening window.
    Silence,
    /// Something sounded already when the receiver began to listen: it is nearer than the least range.
    Near,
}

impl Heard {
    /// The range of an echo where sound is so fast, metres.
    #[must_use]
    pub fn range_m(&self, sound_speed_m_s: f64) -> Option<f64> {
        match self {
            Self::Echo { tof_us } => Some(0.5e-6 * sound_speed_m_s * tof_us),
            Self::Silence | Self::Near => None,
        }
    }

    pub(crate) fn outcome(&self, sound_speed_m_s: f64) -> Outcome {
        match (self, self.range_m(sound_speed_m_s)) {
            (_, Some(range_m)) => Outcome::Echo { range_m },
            (Self::Near, None) => Outcome::Near,
            (_, None) => Outcome::Silence,
        }
    }
}

/// What a firing came to or could have come to, with an echo's range at the reference speed of sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// An echo
    Echo {
        /// from there, metres.
        range_m: f64,
    },
    /// As [`Heard::Silence`].
    Silence,
    /// As [`Heard::Near`].
    Near,
}

impl Outcome {
    /// Of an echo.
    pub(crate) const fn range_m(&self) -> Option<f64> {
        match *self {
            Self::Echo { range_m } => Some(range_m),
            Self::Silence | Self::Near => None,
        }
    }
}

/// Why a scan can't be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SweepError {
    /// The log lacks what says where and how it was taken.
    #[error("scan {0}: the log lacks its beginning or its session")]
    Incomplete(Uuid),
    /// Rangers at fixed bearings.
    #[error("scan {0} is of an array: only the sweeps of one ranger on a stepper can be used")]
    OfArray(Uuid),
    /// The robot moved.
    #[error("scan {0}: the ranger was moved while it was taken")]
    Moved(Uuid),
    /// Not enough of it.
    #[error(
        "scan {scan}: {beams} of its readings say something: at least {LEAST_BEAMS} are needed"
    )]
    TooFew {
        /// Which scan.
        scan: Uuid,
        /// How many do.
        beams: usize,
    },
}

/// Fewer say too little about three values of a pose.
const LEAST_BEAMS: usize = 8;
/// Less than this share of echoes is little.
const FEW_ECHOES: f64 = 0.12;

impl Sweep {
    /// The readings of a logged scan.
    ///
    /// # Errors
    /// When it is not of one ranger at one place.
    pub fn of(scan: &ScanView) -> Result<Self, SweepError> {
        let id = scan.scan;
        let (Some(pose), Some(session)) = (scan.pose(), &scan.session) else {
            return Err(SweepError::Incomplete(id));
        };
        if session.array.is_some() {
            return Err(SweepError::OfArray(id));
        }
        if scan.pings.iter().any(|ping| ping.pose.is_some_and(|own| own != pose)) {
            return Err(SweepError::Moved(id));
        }
        let tof_us_per_m = 2e6 / session.air.sound_speed_m_s;
        let beams: Vec<Beam> = scan
            .pings
            .iter()
            .filter_map(|ping| {
                let heard = match ping.status {
                    PingStatus::Echo => {
                        let of_range = || ping.range_m.map(|range_m| range_m * tof_us_per_m);
                        Heard::Echo { tof_us: ping.tof_us.or_else(of_range)? }
                    }
                    PingStatus::NoEcho => Heard::Silence,
                    PingStatus::MinRange => Heard::Near,
                    PingStatus::LinkLost | PingStatus::StepDoubtful | PingStatus::ModuleFault => {
                        return None;
                    }
                };
                Some(Beam { azimuth_deg: ping.azimuth_deg, heard })
            })
            .collect();
        if beams.len() < LEAST_BEAMS {
            return Err(SweepError::TooFew { scan: id, beams: beams.len() });
        }
        Ok(Self { scan: id, pose, beams })
    }

    /// Whether it heard so little, as of one wall or edge, that it may have been taken from many places.
    pub(crate) fn hears_little(&self) -> bool {
        let echoes = self.beams.iter().filter(|beam| beam.is_echo()).count() as f64;
        echoes < FEW_ECHOES * self.beams.len() as f64
    }
}
