//! Execution of a scan: sends the plan to the device and records its readings.

use firmware_protocol::{
    host::{BoardChange, Command, HostError, HostEvent, LinkStats, Outcome},
    messages::{Capabilities, FaultKind, Identity, Settings, Sweep},
};
use jiff::{SignedDuration, Timestamp};
use sonard_records::{BeamRun, EventKind, PlanError, Record, ScanEnd, ScanStart, Sink, SinkError};
use std::ops::ControlFlow;
use thiserror::Error;
use tokio::{
    io::{AsyncRead, AsyncWrite},
    sync::watch,
};
use uuid::Uuid;

use super::{
    driver::{CommandResult, DriveError, Driver},
    scan_job::ScanJob,
    scan_recorder::{FinishedScan, ScanRecorder},
    timing,
    wall_clock::{as_step, confirmed},
};

/// Maximum number of consecutive device restarts without a new reading; then the scan fails.
const MAX_FRUITLESS_RESTARTS: u32 = 3;
/// Number of exchanges before a scan that initialize the clock fit.
const CLOCK_EXCHANGES: u32 = 4;

/// Summary of a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanSummary {
    /// Final record of the scan.
    pub end: ScanEnd,
    /// `true` if the scan was stopped on request.
    pub stopped: bool,
    /// Number of device restarts during the scan.
    pub restarts: u32,
    /// Relative deviation of the device's clock from its nominal rate; `None` until known.
    pub clock_drift: Option<f64>,
    /// Error of the return home after the scan, if it failed. The scan is complete nevertheless.
    pub not_home: Option<DriveError>,
}

/// Failure that ended a scan early. The records so far are written, `scan_end` included.
#[derive(Debug, Error)]
pub enum ScanError {
    /// The plan does not fit the device's motor.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// The device or the line failed.
    #[error("{0}")]
    Device(#[from] DriveError),
    /// A record could not be written.
    #[error("{0}")]
    Sink(#[from] SinkError),
}

/// Identified ranger on a line.
#[derive(Debug)]
pub struct Ranger<L> {
    driver: Driver<L>,
    identity: Identity,
    /// Wall-clock time at microsecond 0 of the driver.
    wall_epoch: Timestamp,
    clock_steps: u32,
}

/// Unsolicited event on an idle line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceEvent {
    /// The line was closed.
    Hangup,
    /// The device restarted and must be identified again.
    Restarted,
    /// The device reported a fault.
    Fault(FaultKind),
}

impl<L: AsyncRead + AsyncWrite + Unpin> Ranger<L> {
    /// Identifies the device on a line and stops its current activity.
    ///
    /// # Errors
    /// If no ranger responds.
    pub async fn identify(mut driver: Driver<L>) -> Result<Self, DriveError> {
        let wall_epoch = wall_epoch(Timestamp::now(), driver.now_us());
        let identity = driver.identify_and_stop(ignore).await?;
        Ok(Self { driver, identity, wall_epoch, clock_steps: 0 })
    }

    /// Identifies the device again after a restart. A different board is accepted;
    /// [`Self::identity`] returns the new identity.
    ///
    /// # Errors
    /// If no ranger responds.
    pub async fn reidentify(&mut self) -> Result<(), DriveError> {
        self.identity = self.driver.identify_and_stop(ignore).await?;
        Ok(())
    }

    /// Checks that the board is the one identified before, possibly restarted, and stops its
    /// current activity.
    ///
    /// # Errors
    /// If another board or none responds.
    pub async fn verify_identity(&mut self) -> Result<(), DriveError> {
        let identity = self.driver.identify_and_stop(ignore).await?;
        if let Some(change) = BoardChange::between(&self.identity, &identity) {
            return Err(DriveError::OtherBoard(change));
        }
        self.identity = identity;
        Ok(())
    }

    /// Configures the device and homes the motor. Returns the drift found at the index, steps.
    ///
    /// # Errors
    /// Any error of the device or the line.
    pub async fn home(&mut self, settings: Settings) -> Result<i32, DriveError> {
        self.driver.perform(Command::Configure(settings), ignore).await?;
        match self.driver.perform(Command::Home, ignore).await? {
            CommandResult::Done(Outcome::Homed { drift_steps }) => Ok(drift_steps),
            _ => Ok(0),
        }
    }

    /// Polls the status of an idle device.
    ///
    /// # Errors
    /// If the device does not respond.
    pub async fn poll_status(&mut self) -> Result<(), DriveError> {
        self.driver.perform(Command::Status, ignore).await.map(drop)
    }

    /// Waits for a hangup or an unsolicited event of the device. Cancel-safe.
    pub async fn next_event(&mut self) -> DeviceEvent {
        loop {
            match self.driver.idle().await {
                None => return DeviceEvent::Hangup,
                Some(HostEvent::Rebooted { .. }) => return DeviceEvent::Restarted,
                Some(HostEvent::Fault(kind)) => return DeviceEvent::Fault(kind),
                Some(_) => {}
            }
        }
    }

    /// Synchronizes with the computer's wall clock. Returns how far it was set since the last
    /// time, or drifted from the monotonic clock. Called between scans only, so that times within
    /// a scan are consistent.
    fn reanchor(&mut self) -> SignedDuration {
        let epoch = || wall_epoch(Timestamp::now(), self.driver.now_us());
        let moved = || epoch().duration_since(self.wall_epoch);
        let drift = moved();
        let moved = match as_step(drift) {
            None => drift,
            Some(_) => confirmed(moved).unwrap_or(SignedDuration::ZERO),
        };
        self.wall_epoch = self.wall_epoch.checked_add(moved).unwrap_or(self.wall_epoch);
        moved
    }

    /// Wall-clock time by the epoch that the readings of a scan refer to. The wall clock itself may
    /// be set at any moment.
    fn wall_time(&self) -> Timestamp {
        let since = driver_time(self.driver.now_us());
        self.wall_epoch.checked_add(since).unwrap_or(self.wall_epoch)
    }

    /// Number of steps of the computer's wall clock. Each is an event of the scan that detected it.
    #[must_use]
    pub const fn clock_steps(&self) -> u32 {
        self.clock_steps
    }

    /// Identity that the device reported last.
    pub const fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Counters of the serial link.
    pub const fn link_stats(&self) -> &LinkStats {
        self.driver.host().stats()
    }

    /// Subscribes to the counters of the serial link, which are updated also during a scan.
    #[must_use]
    pub fn subscribe_link_stats(&self) -> watch::Receiver<LinkStats> {
        self.driver.subscribe_stats()
    }

    /// Takes one scan, from `scan_start` to `scan_end`, writing each record to `sink`.
    ///
    /// Re-identifies the device first: a scan never starts on a disconnected or different board.
    /// Homes the motor before the scan and, with an index sensor, afterwards. If the same board
    /// restarts meanwhile, it is homed and the remaining beams are measured. When `stop` is ready,
    /// the motor is stopped and the scan closed, with the text from `stop` as an event.
    ///
    /// # Errors
    /// Any error of the device, the line or the log. Beams measured so far are recorded.
    pub async fn scan(
        &mut self,
        job: &ScanJob,
        sink: &mut dyn Sink,
        stop: impl Future<Output = String>,
    ) -> Result<ScanSummary, ScanError> {
        tokio::pin!(stop);
        job.plan.check()?;
        let steps_per_revolution = u32::from(self.identity.steps_per_revolution);
        let motor = job.plan.motor_steps(steps_per_revolution)?;
        let before = self.identity.boot;
        self.verify_identity().await?;
        let scan = Uuid::new_v4();
        let step = self.reanchor();
        let time = self.wall_time();
        let ScanJob { pose, plan, air, request, .. } = *job;
        let start = ScanStart { air, request, ..ScanStart::new(scan, time, pose, plan) };
        sink.record(&Record::ScanStart(start))?;
        let mut recorder =
            ScanRecorder::new(job, scan, motor, self.wall_epoch, &self.identity, sink);
        if before != self.identity.boot {
            recorder.note(
                EventKind::Reboot,
                format!("the device restarted before the scan (boot {before:04x})"),
            );
        }
        recorder.note_earlier_clock_step(step);
        let outcome = self.measure(job, motor, &mut recorder, stop).await;
        let stopped = matches!(outcome, Ok(Stopped(true)));
        if let Err(ScanError::Device(error)) = &outcome {
            recorder.abort(error);
        }
        let home = match outcome {
            Ok(Stopped(false)) => self.home_check(&mut recorder).await,
            _ => Ok(None),
        };
        recorder.check_wall_clock();
        let (set_by, steps) = recorder.wall_clock_steps();
        self.wall_epoch = self.wall_epoch.checked_add(set_by).unwrap_or(self.wall_epoch);
        self.clock_steps += steps + u32::from(as_step(step).is_some());
        let limit_s = timing::min_duration_s(&job.plan, &job.settings, motor.1);
        let drift = home.as_ref().ok().copied().flatten();
        let FinishedScan { end, restarts, clock_drift } = recorder.finish(limit_s, drift)?;
        let not_home = home.err();
        outcome.map(|_| ScanSummary { end, stopped, restarts, clock_drift, not_home })
    }

    /// Sweeps until every beam of the plan is measured or rejected.
    async fn measure(
        &mut self,
        job: &ScanJob,
        motor: (i32, i32),
        recorder: &mut ScanRecorder<'_>,
        mut stop: std::pin::Pin<&mut impl Future<Output = String>>,
    ) -> Result<Stopped, ScanError> {
        let mut fruitless = 0;
        loop {
            let before = recorder.measured();
            let outcome = tokio::select! {
                biased;
                reason = &mut stop => Err(reason),
                outcome = self.sweep_rest(job, motor, recorder) => Ok(outcome),
            };
            match outcome {
                Err(reason) => {
                    self.halt(recorder).await?;
                    recorder.note(EventKind::Stopped, reason);
                    return Ok(Stopped(true));
                }
                Ok(Err(ScanError::Device(DriveError::Abandoned))) => {
                    self.halt(recorder).await?;
                    return recorder.check_sink().map(|()| Stopped(true)).map_err(ScanError::Sink);
                }
                Ok(Err(ScanError::Device(DriveError::Host(HostError::Rebooted)))) => {
                    fruitless = if recorder.measured() > before { 0 } else { fruitless + 1 };
                    if fruitless >= MAX_FRUITLESS_RESTARTS {
                        return Err(DriveError::Host(HostError::Rebooted).into());
                    }
                    self.verify_identity().await?;
                    recorder.resume_after_restart(&self.identity);
                }
                Ok(done) => {
                    done?;
                    recorder.check_sink()?;
                    return Ok(Stopped(false));
                }
            }
        }
    }

    async fn sweep_rest(
        &mut self,
        job: &ScanJob,
        (from_step, stride): (i32, i32),
        recorder: &mut ScanRecorder<'_>,
    ) -> Result<(), ScanError> {
        // A sweep left behind by an earlier program would continue as long as a host communicates.
        self.halt(recorder).await?;
        self.command(Command::Configure(job.settings), recorder).await?;
        self.command(Command::Home, recorder).await?;
        for _ in 0..CLOCK_EXCHANGES {
            self.command(Command::Status, recorder).await?;
        }
        while let Some(segment) = recorder.next_segment() {
            let sweep = sweep_of(&segment, from_step, stride, &job.settings);
            recorder.begin(segment);
            self.command(Command::Sweep(sweep), recorder).await?;
            recorder.check_sink()?;
        }
        Ok(())
    }

    /// Stops the motor, whatever is running.
    ///
    /// # Errors
    /// Any error of the device or the line.
    pub async fn stop(&mut self) -> Result<(), DriveError> {
        self.driver.stop(ignore).await
    }

    /// Stops the device and records the readings received until then.
    async fn halt(&mut self, recorder: &mut ScanRecorder<'_>) -> Result<(), DriveError> {
        self.driver.stop(|event| recorder.handle(event)).await
    }

    /// Homes the motor after a scan. Returns the drift found at the index, steps.
    async fn home_check(
        &mut self,
        recorder: &mut ScanRecorder<'_>,
    ) -> Result<Option<i32>, DriveError> {
        if !self.identity.capabilities.has(Capabilities::INDEX_SENSOR) {
            return Ok(None);
        }
        match self.command(Command::Home, recorder).await {
            Ok(CommandResult::Done(Outcome::Homed { drift_steps })) => Ok(Some(drift_steps)),
            Ok(_) => Ok(None),
            Err(error) => {
                recorder.note_home_failure(&error);
                Err(error)
            }
        }
    }

    async fn command(
        &mut self,
        command: Command,
        recorder: &mut ScanRecorder<'_>,
    ) -> Result<CommandResult, DriveError> {
        self.driver.perform(command, |event| recorder.handle(event)).await
    }
}

struct Stopped(bool);

/// Wall-clock time at the start of the driver's clock, from simultaneous readings of both.
fn wall_epoch(wall: Timestamp, driver_us: u64) -> Timestamp {
    wall.checked_sub(driver_time(driver_us)).unwrap_or(wall)
}

fn driver_time(us: u64) -> SignedDuration {
    SignedDuration::from_micros(i64::try_from(us).unwrap_or(0))
}

fn ignore(_event: HostEvent) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn sweep_of(segment: &BeamRun, from_step: i32, stride: i32, settings: &Settings) -> Sweep {
    let first_stop = i32::try_from(segment.first_stop).unwrap_or(i32::MAX);
    Sweep {
        // The host state machine assigns the number.
        sweep: 0,
        first_step: from_step.saturating_add(first_stop.saturating_mul(stride)),
        stride: i16::try_from(stride).unwrap_or(i16::MAX),
        stops: u16::try_from(segment.stops).unwrap_or(u16::MAX),
        pings_per_stop: u8::try_from(segment.pings).unwrap_or(u8::MAX),
        lease_ms: timing::lease_ms(settings),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_step_moves_the_epoch() {
        let start: Timestamp = "2026-03-01T10:00:00Z".parse().expect("a time");
        let at = |since_us: i64, set_s: i64| {
            let wall =
                start + SignedDuration::from_micros(since_us) + SignedDuration::from_secs(set_s);
            wall_epoch(wall, u64::try_from(since_us).expect("after the start"))
        };
        assert_eq!(at(0, 0), start);
        assert_eq!(at(90_000_000, 0), start, "time that passes is no step");
        let set = at(100_000_000, 3600).duration_since(at(90_000_000, 0));
        assert_eq!(set, SignedDuration::from_secs(3600));
        let set_back = at(100_000_000, -5).duration_since(start);
        assert_eq!(set_back, SignedDuration::from_secs(-5));
    }
}
