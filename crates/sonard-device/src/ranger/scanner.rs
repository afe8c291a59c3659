//! Takes a scan: sends the plan to the device and turns what comes back into records.

use firmware_protocol::{
    host::{BoardChange, Command, HostError, HostEvent, LinkStats, Outcome},
    messages::{Capabilities, FaultKind, Identity, Settings, Sweep},
};
use jiff::{SignedDuration, Timestamp};
use sonard_records::{EventKind, PlanError, Record, ScanEnd, ScanStart, Segment, Sink, SinkError};
use std::ops::ControlFlow;
use thiserror::Error;
use tokio::{
    io::{AsyncRead, AsyncWrite},
    sync::watch,
};
use uuid::Uuid;

use super::{
    driver::{DriveError, Driver, Ended},
    job::ScanJob,
    progress::{Finished, Progress},
    timing,
    wall_clock::{as_step, confirmed},
};

/// Restarts of the device without a single new reading after which a scan is given up.
const FRUITLESS_RESTARTS: u32 = 3;
/// Exchanges before a scan that give the clock fit its first points.
const CLOCK_EXCHANGES: u32 = 4;

/// Summary of a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanSummary {
    /// Its last record.
    pub end: ScanEnd,
    /// Whether it was stopped on request.
    pub stopped: bool,
    /// Restarts of the device that it survived.
    pub restarts: u32,
    /// Relative deviation of the device's clock from its nominal rate; `None` until known.
    pub clock_drift: Option<f64>,
    /// Why the device could not go home after it, if so. The scan is whole all the same.
    pub not_home: Option<DriveError>,
}

/// The reason why a scan ended early. Its records up to there are written, `scan_end` included.
#[derive(Debug, Error)]
pub enum ScanError {
    /// The plan does not fit the device's motor.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// The device or the line failed.
    #[error("{0}")]
    Device(#[from] DriveError),
    /// A record could not be kept.
    #[error("{0}")]
    Sink(#[from] SinkError),
}

/// A ranger that has told its identity.
#[derive(Debug)]
pub struct Ranger<L> {
    driver: Driver<L>,
    identity: Identity,
    /// Wall clock at microsecond 0 of the driver.
    wall_epoch: Timestamp,
    clock_steps: u32,
}

/// An unrequested event on an idle line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unasked {
    /// The line was closed.
    Hangup,
    /// The device restarted: identify it anew.
    Restarted,
    /// The device reported a fault.
    Fault(FaultKind),
}

impl<L: AsyncRead + AsyncWrite + Unpin> Ranger<L> {
    /// Meets the device on a line, and stops whatever it still does.
    ///
    /// # Errors
    /// When nothing or something else answers.
    pub async fn meet(mut driver: Driver<L>) -> Result<Self, DriveError> {
        let wall_epoch = wall_epoch(Timestamp::now(), driver.now_us());
        let identity = driver.take_over(ignore).await?;
        Ok(Self { driver, identity, wall_epoch, clock_steps: 0 })
    }

    /// Asks the device again who it is, after it restarted; another one may answer now, which
    /// [`Self::identity`] tells.
    ///
    /// # Errors
    /// When nothing or something else answers.
    pub async fn meet_again(&mut self) -> Result<(), DriveError> {
        self.identity = self.driver.take_over(ignore).await?;
        Ok(())
    }

    /// Makes sure that the board that answers is the one that was met; it may have restarted.
    /// Whatever it still does is stopped.
    ///
    /// # Errors
    /// When another one answers, or none.
    pub async fn recognise(&mut self) -> Result<(), DriveError> {
        let identity = self.driver.take_over(ignore).await?;
        if let Some(change) = BoardChange::between(&self.identity, &identity) {
            return Err(DriveError::OtherBoard(change));
        }
        self.identity = identity;
        Ok(())
    }

    /// Sets the device up and finds home; returns by how much the index was off, steps.
    ///
    /// # Errors
    /// The device's and the line's.
    pub async fn home(&mut self, settings: Settings) -> Result<i32, DriveError> {
        self.driver.perform(Command::Configure(settings), ignore).await?;
        match self.driver.perform(Command::Home, ignore).await? {
            Ended::Done(Outcome::Homed { drift_steps }) => Ok(drift_steps),
            _ => Ok(0),
        }
    }

    /// Asks a device without work how it is.
    ///
    /// # Errors
    /// When it does not answer any more.
    pub async fn check(&mut self) -> Result<(), DriveError> {
        self.driver.perform(Command::Status, ignore).await.map(drop)
    }

    /// Waits until the line is closed or the device says something by itself. Cancel-safe.
    pub async fn unasked(&mut self) -> Unasked {
        loop {
            match self.driver.idle().await {
                None => return Unasked::Hangup,
                Some(HostEvent::Rebooted { .. }) => return Unasked::Restarted,
                Some(HostEvent::Fault(kind)) => return Unasked::Fault(kind),
                Some(_) => {}
            }
        }
    }

    /// Takes the computer's wall clock anew, and returns by how much it was set meanwhile (or
    /// drifted away from the clock that never jumps). Done between scans, so that within a scan
    /// times are consistent.
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

    /// How often the computer's wall clock was set; each time is an event of the scan that noticed.
    #[must_use]
    pub const fn clock_steps(&self) -> u32 {
        self.clock_steps
    }

    /// What the device said of itself.
    pub const fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Numbers about the line.
    pub const fn link_stats(&self) -> &LinkStats {
        self.driver.host().stats()
    }

    /// The same for somebody else, also while a scan is under way.
    #[must_use]
    pub fn watch_link(&self) -> watch::Receiver<LinkStats> {
        self.driver.watch_stats()
    }

    /// Takes one scan, from `scan_start` to `scan_end`, handing each record to `sink`.
    ///
    /// Asks first who is there, so that no scan begins with a device that is gone or another one.
    /// Goes home first and, if there is an index sensor, afterwards. A device that restarts
    /// meanwhile is homed and goes on with what is left, if it is the same board. When `stop` is ready, the motor is
    /// stopped and the scan closed, with the words of `stop` as an event.
    ///
    /// # Errors
    /// The device's, the line's and the log's; what was measured is written all the same.
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
        self.recognise().await?;
        let scan = Uuid::new_v4();
        let step = self.reanchor();
        let time = Timestamp::now();
        let ScanJob { pose, plan, air, request, .. } = *job;
        let start = ScanStart { air, request, ..ScanStart::new(scan, time, pose, plan) };
        sink.record(&Record::ScanStart(start))?;
        let mut progress = Progress::new(job, scan, motor, self.wall_epoch, &self.identity, sink);
        if before != self.identity.boot {
            progress.note(
                EventKind::Reboot,
                format!("the device restarted before it (boot {before:04x})"),
            );
        }
        progress.wall_clock_was_set(step);
        let outcome = self.measure(job, motor, &mut progress, stop).await;
        let stopped = matches!(outcome, Ok(Stopped(true)));
        if let Err(ScanError::Device(error)) = &outcome {
            progress.give_up(error);
        }
        let home = match outcome {
            Ok(Stopped(false)) => self.home_check(&mut progress).await,
            _ => Ok(None),
        };
        progress.look_at_wall_clock();
        let (set_by, steps) = progress.wall_clock_steps();
        self.wall_epoch = self.wall_epoch.checked_add(set_by).unwrap_or(self.wall_epoch);
        self.clock_steps += steps + u32::from(as_step(step).is_some());
        let limit_s = timing::limit_s(&job.plan, &job.settings, motor.1);
        let drift = home.as_ref().ok().copied().flatten();
        let Finished { end, restarts, clock_drift } = progress.finish(limit_s, drift)?;
        let not_home = home.err();
        outcome.map(|_| ScanSummary { end, stopped, restarts, clock_drift, not_home })
    }

    /// Sweeps until nothing is left of the plan.
    async fn measure(
        &mut self,
        job: &ScanJob,
        motor: (i32, i32),
        progress: &mut Progress<'_>,
        mut stop: std::pin::Pin<&mut impl Future<Output = String>>,
    ) -> Result<Stopped, ScanError> {
        let mut fruitless = 0;
        loop {
            let before = progress.measured();
            let outcome = tokio::select! {
                biased;
                why = &mut stop => Err(why),
                outcome = self.sweep_rest(job, motor, progress) => Ok(outcome),
            };
            match outcome {
                Err(why) => {
                    self.halt(progress).await?;
                    progress.note(EventKind::Stopped, why);
                    return Ok(Stopped(true));
                }
                Ok(Err(ScanError::Device(DriveError::Abandoned))) => {
                    self.halt(progress).await?;
                    return progress.check_sink().map(|()| Stopped(true)).map_err(ScanError::Sink);
                }
                Ok(Err(ScanError::Device(DriveError::Host(HostError::Rebooted)))) => {
                    fruitless = if progress.measured() > before { 0 } else { fruitless + 1 };
                    if fruitless >= FRUITLESS_RESTARTS {
                        return Err(DriveError::Host(HostError::Rebooted).into());
                    }
                    self.recognise().await?;
                    progress.restarted(&self.identity);
                }
                Ok(done) => {
                    done?;
                    progress.check_sink()?;
                    return Ok(Stopped(false));
                }
            }
        }
    }

    async fn sweep_rest(
        &mut self,
        job: &ScanJob,
        (from_step, stride): (i32, i32),
        progress: &mut Progress<'_>,
    ) -> Result<(), ScanError> {
        // A sweep that an earlier program left behind would go on for as long as anybody talks.
        self.halt(progress).await?;
        self.command(Command::Configure(job.settings), progress).await?;
        self.command(Command::Home, progress).await?;
        for _ in 0..CLOCK_EXCHANGES {
            self.command(Command::Status, progress).await?;
        }
        while let Some(segment) = progress.next_segment() {
            let sweep = sweep_of(&segment, from_step, stride, &job.settings);
            progress.begin(segment);
            self.command(Command::Sweep(sweep), progress).await?;
            progress.check_sink()?;
        }
        Ok(())
    }

    /// Brings the motor to a stand, whatever is under way.
    ///
    /// # Errors
    /// The device's and the line's.
    pub async fn stop(&mut self) -> Result<(), DriveError> {
        self.driver.stop(ignore).await
    }

    /// The same, and takes in what was measured until then.
    async fn halt(&mut self, progress: &mut Progress<'_>) -> Result<(), DriveError> {
        self.driver.stop(|event| progress.handle(event)).await
    }

    /// Goes home and reports by how much the index was off.
    async fn home_check(&mut self, progress: &mut Progress<'_>) -> Result<Option<i32>, DriveError> {
        if !self.identity.capabilities.has(Capabilities::INDEX_SENSOR) {
            return Ok(None);
        }
        match self.command(Command::Home, progress).await {
            Ok(Ended::Done(Outcome::Homed { drift_steps })) => Ok(Some(drift_steps)),
            Ok(_) => Ok(None),
            Err(error) => {
                progress.could_not_go_home(&error);
                Err(error)
            }
        }
    }

    async fn command(
        &mut self,
        command: Command,
        progress: &mut Progress<'_>,
    ) -> Result<Ended, DriveError> {
        self.driver.perform(command, |event| progress.handle(event)).await
    }
}

struct Stopped(bool);

/// The wall clock when the driver's clock began, from both read now.
fn wall_epoch(wall: Timestamp, driver_us: u64) -> Timestamp {
    let since = SignedDuration::from_micros(i64::try_from(driver_us).unwrap_or(0));
    wall.checked_sub(since).unwrap_or(wall)
}

fn ignore(_event: HostEvent) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn sweep_of(segment: &Segment, from_step: i32, stride: i32, settings: &Settings) -> Sweep {
    let first_stop = i32::try_from(segment.first_stop).unwrap_or(i32::MAX);
    Sweep {
        // The machine fills in a number of its own.
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
    fn a_clock_that_is_set_moves_the_epoch_by_just_that() {
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
