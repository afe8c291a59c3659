//! Readings of a log, replayed by motor step.
//!
//! Pure. A firing at a motor step reports the log's reading at that azimuth, echo times included,
//! with the log's noise and without any other.

use std::collections::HashMap;

use firmware_protocol::messages::{ReadingStatus, limits::TICK_HZ};
use smallvec::SmallVec;
use sonard_model::geometry::wrap_360;
use sonard_records::{Ping, PingStatus, ScanView, text::format_count};
use thiserror::Error;

/// Maximum number of readings of a replay, which bounds its memory.
const MAX_READINGS: usize = 4_000_000;
/// Motors tried for a log whose azimuths are on no stepper's known steps, steps per revolution.
const MOTORS: [u16; 12] =
    [400, 200, 360, 720, 800, 1_440, 1_600, 3_200, 3_600, 6_400, 7_200, FINEST_MOTOR];
/// Motor for azimuths on no steps at all.
const FINEST_MOTOR: u16 = 12_800;
/// Deviation below which an azimuth is on a step, degrees: decimals of imported azimuths.
const ON_STEP_DEG: f64 = 0.006;

/// Reason why a log can't be replayed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReplayError {
    /// No scan with readings.
    #[error("the log has no readings")]
    Empty,
    /// Scan by an array of fixed rangers.
    #[error("scan {0} is of an array, and a replay is of one ranger on a stepper")]
    OfArray(usize),
    /// Scan of several poses.
    #[error("the pose changes within scan {0}, and a ranger on a stepper scans from one pose")]
    Moving(usize),
    /// Scan without a session, whose ranges have no speed of sound.
    #[error("scan {0} has no session")]
    NoSession(usize),
    /// More readings than fit into memory.
    #[error("the log has more than {}", format_count(MAX_READINGS, "reading"))]
    TooLong,
}

/// Readings of a scan, by motor step.
type ScanReadings = HashMap<u16, SmallVec<[ReplayedReading; 1]>>;

/// Outcome of a firing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplayedReading {
    /// Status that the board reports.
    pub status: ReadingStatus,
    /// Echo times after firing, ticks.
    pub echo_ticks: SmallVec<[u32; 2]>,
}

impl ReplayedReading {
    /// Module that did not fire: the log has no measurement.
    fn missing() -> Self {
        Self { status: ReadingStatus::ModuleFault, echo_ticks: SmallVec::new() }
    }
}

/// Log that is replayed, scan after scan, and from the start again after the last one.
#[derive(Debug, Clone)]
pub struct Replay {
    steps_per_revolution: u16,
    max_deviation_deg: f64,
    scans: Vec<ScanReadings>,
    /// Number of the current scan.
    current: usize,
    /// Number of firings at each step of the current scan, and the step of the first one.
    fired: HashMap<u16, usize>,
    first: Option<u16>,
    is_homed: bool,
    is_announced: bool,
}

impl Replay {
    /// Collects the readings of scans.
    ///
    /// # Errors
    /// Scans that no ranger on a stepper could have taken, or no readings at all.
    pub fn from_scans(scans: &[ScanView]) -> Result<Self, ReplayError> {
        if scans.iter().map(|scan| scan.pings.len()).sum::<usize>() > MAX_READINGS {
            return Err(ReplayError::TooLong);
        }
        let azimuths = || scans.iter().flat_map(|scan| &scan.pings).map(|ping| ping.azimuth_deg);
        let known = scans.iter().find_map(|scan| {
            let steps = scan.session.as_ref()?.device.as_ref()?.steps_per_revolution;
            u16::try_from(steps).ok().filter(|steps| (4..=FINEST_MOTOR).contains(steps))
        });
        let planned = scans.iter().find_map(|scan| {
            let steps = 360.0 / scan.start.as_ref()?.plan.step_deg;
            let is_whole = (steps - steps.round()).abs() < 1e-6 * steps;
            let range = 4.0..=f64::from(FINEST_MOTOR);
            (is_whole && range.contains(&steps)).then_some(steps.round() as u16)
        });
        let mut candidates = known.into_iter().chain(planned).chain(MOTORS);
        let deviation_deg = |steps| max_deviation_deg(azimuths(), steps);
        let fits = |steps: &u16| deviation_deg(*steps) <= ON_STEP_DEG;
        let steps_per_revolution = candidates.find(fits).unwrap_or(FINEST_MOTOR);
        let max_deviation_deg = deviation_deg(steps_per_revolution);
        let mut all = Vec::new();
        for (number, scan) in (1..).zip(scans).filter(|(_, scan)| !scan.pings.is_empty()) {
            all.push(readings(number, scan, steps_per_revolution)?);
        }
        if all.is_empty() {
            return Err(ReplayError::Empty);
        }
        Ok(Self {
            steps_per_revolution,
            max_deviation_deg,
            scans: all,
            current: 0,
            fired: HashMap::new(),
            first: None,
            is_homed: false,
            is_announced: false,
        })
    }

    /// Motor steps per revolution, on which the azimuths of the log are.
    #[must_use]
    pub const fn steps_per_revolution(&self) -> u16 {
        self.steps_per_revolution
    }

    /// Largest difference between an azimuth of the log and the step that replays it, degrees.
    #[must_use]
    pub const fn max_deviation_deg(&self) -> f64 {
        self.max_deviation_deg
    }

    /// Number of replayed scans.
    #[must_use]
    pub const fn scans(&self) -> usize {
        self.scans.len()
    }

    /// Registers that the motor is at the index: the next firing may begin a scan.
    pub(super) const fn home(&mut self) {
        self.is_homed = true;
    }

    /// Returns the reading at a motor step.
    ///
    /// A scan begins with the first firing after homing, if it is at the first step of the scan
    /// before. A host that reconnects and resumes a scan homes, too, but fires at later steps.
    pub(super) fn fire(&mut self, step: i32) -> ReplayedReading {
        let step = step.rem_euclid(i32::from(self.steps_per_revolution)) as u16;
        let is_resumed = self.fired.len() == 1 && self.scans[self.current].len() > 1;
        if std::mem::take(&mut self.is_homed) && self.first == Some(step) && !is_resumed {
            self.current = (self.current + 1) % self.scans.len();
            self.fired.clear();
            self.first = None;
        }
        if self.first.is_none() {
            self.first = Some(step);
            self.is_announced = false;
        }
        let count = self.fired.entry(step).or_default();
        let readings = self.scans[self.current].get(&step).map_or(&[][..], |found| found);
        // A repeated request gets the last reading of its step again.
        let reading = readings.get(*count).or(readings.last()).cloned();
        *count += 1;
        reading.unwrap_or_else(ReplayedReading::missing)
    }

    /// Takes the number of a scan that has begun, from 1.
    pub(super) fn take_begun(&mut self) -> Option<usize> {
        let is_new = self.first.is_some() && !std::mem::replace(&mut self.is_announced, true);
        is_new.then_some(self.current + 1)
    }
}

fn max_deviation_deg(azimuths_deg: impl Iterator<Item = f64>, steps: u16) -> f64 {
    let step_deg = 360.0 / f64::from(steps);
    let deviation = |azimuth_deg: f64| {
        let place = azimuth_deg / step_deg;
        (place - place.round()).abs() * step_deg
    };
    azimuths_deg.map(deviation).fold(0.0, f64::max)
}

fn readings(number: usize, scan: &ScanView, steps: u16) -> Result<ScanReadings, ReplayError> {
    if scan.is_array_scan() {
        return Err(ReplayError::OfArray(number));
    }
    let session = scan.session.as_deref().ok_or(ReplayError::NoSession(number))?;
    let pose = scan.pose();
    if scan.pings.iter().any(|ping| ping.pose.is_some() && ping.pose != pose) {
        return Err(ReplayError::Moving(number));
    }
    let air = scan.start.as_ref().and_then(|start| start.air.as_ref());
    let sound_speed_m_s = air.map_or(session.air.sound_speed_m_s, |air| air.sound_speed_m_s);
    let tick_hz = session.device.as_ref().map_or(TICK_HZ, |device| device.tick_hz);
    let mut by_step = ScanReadings::new();
    let mut pings: Vec<&Ping> = scan.pings.iter().collect();
    pings.sort_by_key(|ping| ping.index);
    for ping in pings {
        let place = wrap_360(ping.azimuth_deg) / 360.0 * f64::from(steps);
        let step = (place.round() as u32 % u32::from(steps)) as u16;
        let reading = reading(ping, tick_hz, sound_speed_m_s, session.sensor.blanking_us);
        by_step.entry(step).or_default().push(reading);
    }
    Ok(by_step)
}

fn reading(ping: &Ping, tick_hz: u32, sound_speed_m_s: f64, blanking_us: f64) -> ReplayedReading {
    let ticks = |us: f64| (us * f64::from(TICK_HZ) / 1e6).round().max(1.0) as u32;
    let status = match ping.status {
        PingStatus::Echo | PingStatus::MinRange => ReadingStatus::Echo,
        PingStatus::NoEcho => {
            return ReplayedReading { status: ReadingStatus::NoEcho, echo_ticks: SmallVec::new() };
        }
        PingStatus::StepUncertain => ReadingStatus::StepUncertain,
        PingStatus::LinkLost | PingStatus::ModuleFault => return ReplayedReading::missing(),
    };
    let logged = ping.echo_ticks.iter();
    let mut echo_ticks: SmallVec<[u32; 2]> =
        logged.map(|&at| ticks(f64::from(at) / f64::from(tick_hz) * 1e6)).collect();
    if echo_ticks.is_empty() {
        let from_range = ping.range_m.map(|range_m| 2e6 * range_m / sound_speed_m_s);
        let at_blanking = (ping.status == PingStatus::MinRange).then_some(blanking_us);
        echo_ticks.extend(ping.tof_us.or(from_range).or(at_blanking).map(ticks));
    }
    // Echo times of a board increase.
    echo_ticks.dedup();
    match echo_ticks.is_empty() && status == ReadingStatus::Echo {
        true => ReplayedReading::missing(),
        false => ReplayedReading { status, echo_ticks },
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sonard_model::{
        acoustics::{Air, Sensor},
        geometry::Pose,
    };
    use sonard_records::{Provenance, ScanPlan, ScanStart, Session};

    use super::*;

    /// Scan of four readings, at ranges of `base_m` and 0.1 m more each.
    fn scan(base_m: f64, azimuths_deg: [f64; 4]) -> ScanView {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let now = jiff::Timestamp::UNIX_EPOCH;
        let session = Session::new(now, Provenance::Imported, sensor, &Air::default());
        let id = uuid::Uuid::from_u128(1);
        let plan = ScanPlan { step_deg: 90.0, ..ScanPlan::default() };
        let pings = (0..).zip(azimuths_deg).map(|(index, azimuth_deg)| Ping {
            range_m: Some(base_m + 0.1 * f64::from(index)),
            ..Ping::new(id, index, azimuth_deg, PingStatus::Echo)
        });
        ScanView {
            scan: id,
            session: Some(Arc::new(session)),
            start: Some(ScanStart::new(id, now, POSE, plan)),
            pings: pings.collect(),
            events: Vec::new(),
            end: None,
        }
    }

    const POSE: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
    const QUARTERS_DEG: [f64; 4] = [0.0, 90.0, 180.0, 270.0];

    fn range_m(reading: &ReplayedReading) -> f64 {
        let ticks = f64::from(*reading.echo_ticks.first().expect("an echo"));
        ticks / f64::from(TICK_HZ) * Air::default().sound_speed_m_s() / 2.0
    }

    fn fired(replay: &mut Replay, steps: impl IntoIterator<Item = i32>) -> Vec<f64> {
        let to_mm = |range_m: f64| (1e3 * range_m).round() / 1e3;
        steps.into_iter().map(|step| to_mm(range_m(&replay.fire(step)))).collect()
    }

    #[test]
    fn scans_follow_each_other() {
        let scans = [scan(1.0, QUARTERS_DEG), scan(2.0, QUARTERS_DEG)];
        let mut replay = Replay::from_scans(&scans).expect("it can be replayed");
        assert_eq!((replay.steps_per_revolution(), replay.scans()), (4, 2));
        for (number, base_m) in [(1, 1.0), (2, 2.0), (1, 1.0)] {
            replay.home();
            let expected: Vec<f64> = [0.0, 0.1, 0.2, 0.3].iter().map(|m| base_m + m).collect();
            assert_eq!(fired(&mut replay, 0..4), expected);
            assert_eq!((replay.take_begun(), replay.take_begun()), (Some(number), None));
            replay.home();
        }
    }

    #[test]
    fn resumed_scan_continues() {
        let scans = [scan(1.0, QUARTERS_DEG), scan(2.0, QUARTERS_DEG)];
        let mut replay = Replay::from_scans(&scans).expect("it can be replayed");
        replay.home();
        assert_eq!(fired(&mut replay, 0..2), [1.0, 1.1]);
        // After a hangup the host homes, and requests the second beam again.
        replay.home();
        assert_eq!(fired(&mut replay, 1..4), [1.1, 1.2, 1.3]);
        replay.home();
        assert_eq!(fired(&mut replay, 0..1), [2.0]);
    }

    #[test]
    fn readings_without_an_echo() {
        let mut missing = scan(1.0, QUARTERS_DEG);
        missing.pings[0].status = PingStatus::NoEcho;
        missing.pings[1].status = PingStatus::LinkLost;
        missing.pings[2] = Ping { range_m: None, ..missing.pings[2].clone() };
        missing.pings[3] =
            Ping { status: PingStatus::MinRange, range_m: None, ..missing.pings[3].clone() };
        let mut replay = Replay::from_scans(&[missing]).expect("it can be replayed");
        let statuses: Vec<_> = (0..3).map(|step| replay.fire(step).status).collect();
        use ReadingStatus::{ModuleFault, NoEcho};
        assert_eq!(statuses, [NoEcho, ModuleFault, ModuleFault]);
        assert_eq!(replay.fire(3).echo_ticks[..], [4_760], "the end of the blanking");
    }

    #[test]
    fn motor_for_irregular_azimuths() {
        let steps = |azimuths_deg| {
            let replay = Replay::from_scans(&[scan(1.0, azimuths_deg)]).expect("it can be");
            (replay.steps_per_revolution(), replay.max_deviation_deg() > ON_STEP_DEG)
        };
        assert_eq!(steps([0.0, 0.9, 1.8, 359.1]), (400, false));
        assert_eq!(steps([0.0, 0.5, 1.0, 1.5]), (720, false));
        assert_eq!(steps([0.01, 0.5, 1.02, 1.51]), (FINEST_MOTOR, true));
    }

    #[test]
    fn rejected_logs() {
        let empty = ScanView { pings: Vec::new(), ..scan(1.0, QUARTERS_DEG) };
        assert_eq!(Replay::from_scans(&[empty]).err(), Some(ReplayError::Empty));
        let mut moving = scan(1.0, QUARTERS_DEG);
        moving.pings[2].pose = Some(Pose { x_m: 1.0, ..POSE });
        assert_eq!(Replay::from_scans(&[moving]).err(), Some(ReplayError::Moving(1)));
        let lost = ScanView { session: None, ..scan(1.0, QUARTERS_DEG) };
        assert_eq!(Replay::from_scans(&[lost]).err(), Some(ReplayError::NoSession(1)));
    }
}
