//! Readings of one scan, prepared for fits.

use sonard_model::geometry::Pose;
use sonard_records::{Ping, PingStatus, ScanView};
use thiserror::Error;
use uuid::Uuid;

/// Readings of a ranger on a stepper from one position.
#[derive(Debug, Clone, PartialEq)]
pub struct FitSweep {
    /// Scan of the readings.
    pub scan: Uuid,
    /// Initial pose of the ranger.
    pub pose: Pose,
    /// Firings with a valid outcome.
    pub beams: Vec<SweepFiring>,
}

/// Firing with its outcome.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepFiring {
    /// Azimuth of the stepper, degrees counter-clockwise from the heading.
    pub azimuth_deg: f64,
    /// Outcome of the firing.
    pub outcome: FiringOutcome,
}

impl SweepFiring {
    /// Range of an echo for a speed of sound, metres.
    #[must_use]
    pub fn range_m(&self, sound_speed_m_s: f64) -> Option<f64> {
        self.outcome.range_m(sound_speed_m_s)
    }

    pub(crate) fn is_echo(&self) -> bool {
        self.range_m(1.0).is_some()
    }
}

/// Outcome of a firing with its time of flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FiringOutcome {
    /// First echo after firing.
    Echo {
        /// Time of flight, microseconds.
        tof_us: f64,
    },
    /// No echo within the measurement window.
    NoEcho,
    /// Target below the minimum range: signal present at the end of blanking.
    BelowMinRange,
}

impl FiringOutcome {
    /// Outcome of a logged reading; `None` for one without a valid outcome. `tof_us_per_m` is the
    /// time of flight per metre of range.
    pub(crate) fn of_ping(ping: &Ping, tof_us_per_m: f64) -> Option<Self> {
        match ping.status {
            PingStatus::Echo => {
                let of_range = || ping.range_m.map(|range_m| range_m * tof_us_per_m);
                Some(Self::Echo { tof_us: ping.tof_us.or_else(of_range)? })
            }
            PingStatus::NoEcho => Some(Self::NoEcho),
            PingStatus::MinRange => Some(Self::BelowMinRange),
            PingStatus::LinkLost | PingStatus::StepUncertain | PingStatus::ModuleFault => None,
        }
    }

    /// Range of an echo for a speed of sound, metres.
    #[must_use]
    pub fn range_m(&self, sound_speed_m_s: f64) -> Option<f64> {
        match self {
            Self::Echo { tof_us } => Some(0.5e-6 * sound_speed_m_s * tof_us),
            Self::NoEcho | Self::BelowMinRange => None,
        }
    }

    pub(crate) fn outcome(&self, sound_speed_m_s: f64) -> RangeOutcome {
        match (self, self.range_m(sound_speed_m_s)) {
            (_, Some(range_m)) => RangeOutcome::Echo { range_m },
            (Self::BelowMinRange, None) => RangeOutcome::BelowMinRange,
            (_, None) => RangeOutcome::NoEcho,
        }
    }
}

/// Measured or predicted outcome, with ranges at the reference speed of sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RangeOutcome {
    /// Echo with a range.
    Echo {
        /// Range, metres.
        range_m: f64,
    },
    /// No echo, as [`SweepOutcome::Silence`].
    NoEcho,
    /// Target below the minimum range, as [`SweepOutcome::Near`].
    BelowMinRange,
}

impl RangeOutcome {
    /// Range of an echo, metres.
    pub(crate) const fn range_m(&self) -> Option<f64> {
        match *self {
            Self::Echo { range_m } => Some(range_m),
            Self::NoEcho | Self::BelowMinRange => None,
        }
    }
}

/// Reason why a scan can't be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FitSweepError {
    /// Missing start or session record.
    #[error("scan {0}: the log lacks its start or its session")]
    Incomplete(Uuid),
    /// Scan of an array.
    #[error("scan {0} is of an array: only sweeps of one ranger on a stepper can be used")]
    OfArray(Uuid),
    /// Scan of a ranger on a stepper.
    #[error("scan {0} is of a ranger on a stepper, not of an array")]
    NotOfArray(Uuid),
    /// Robot moved during the scan.
    #[error("scan {0}: the ranger was moved during the scan")]
    Moved(Uuid),
    /// Too few valid readings.
    #[error("scan {scan}: {beams} valid readings, but at least {MIN_BEAMS} are needed")]
    TooFew {
        /// Id of the scan.
        scan: Uuid,
        /// Number of valid readings.
        beams: usize,
    },
}

/// Minimum number of readings for the three parameters of a pose.
const MIN_BEAMS: usize = 8;
/// Fraction of echoes below which echoes are few.
const FEW_ECHOES: f64 = 0.12;

impl FitSweep {
    /// Readings of a logged scan.
    ///
    /// # Errors
    /// Scan of an array, of a moving robot, or incomplete.
    pub fn from_scan(scan: &ScanView) -> Result<Self, FitSweepError> {
        let id = scan.scan;
        let (Some(pose), Some(session)) = (scan.pose(), &scan.session) else {
            return Err(FitSweepError::Incomplete(id));
        };
        if session.array.is_some() {
            return Err(FitSweepError::OfArray(id));
        }
        if scan.pings.iter().any(|ping| ping.pose.is_some_and(|own| own != pose)) {
            return Err(FitSweepError::Moved(id));
        }
        let tof_us_per_m = 2e6 / session.air.sound_speed_m_s;
        let beams: Vec<SweepFiring> = scan
            .pings
            .iter()
            .filter_map(|ping| {
                let outcome = FiringOutcome::of_ping(ping, tof_us_per_m)?;
                Some(SweepFiring { azimuth_deg: ping.azimuth_deg, outcome })
            })
            .collect();
        if beams.len() < MIN_BEAMS {
            return Err(FitSweepError::TooFew { scan: id, beams: beams.len() });
        }
        Ok(Self { scan: id, pose, beams })
    }

    /// Returns `true` if the sweep has so few echoes, as of one wall or edge, that it fits many
    /// poses.
    pub(crate) fn has_few_echoes(&self) -> bool {
        let echoes = self.beams.iter().filter(|beam| beam.is_echo()).count() as f64;
        echoes < FEW_ECHOES * self.beams.len() as f64
    }
}
