//! State of one scan: received beams, clocks, and the records written.

use firmware_protocol::{
    host::{HostError, HostEvent, ReadingFault},
    messages::{Capabilities, FaultKind, Identity, Reading, ReadingStatus},
};
use jiff::{SignedDuration, Timestamp};
use sonard_model::acoustics::classify_tof;
use sonard_records::{
    BeamRun, Event, EventKind, Ping, PingStatus, Record, ScanEnd, Sink, SinkError,
};
use std::ops::ControlFlow;
use uuid::Uuid;

use super::{
    clock::{ClockFit, TickExtender},
    driver::DriveError,
    scan_job::ScanJob,
    wall_clock::{WallClock, as_step},
};

/// Device time from the first firing to the last, within one boot.
#[derive(Debug, Clone, Copy)]
struct FiringSpan {
    first: u64,
    last: u64,
}

/// Results of a finished scan.
pub(super) struct FinishedScan {
    pub(super) end: ScanEnd,
    pub(super) restarts: u32,
    pub(super) clock_drift: Option<f64>,
}

/// Turns the host's events of one scan into records.
pub(super) struct ScanRecorder<'a> {
    job: &'a ScanJob,
    scan: Uuid,
    /// First step and stride of the plan.
    motor: (i32, i32),
    wall_epoch: Timestamp,
    wall_clock: WallClock,
    identity: Identity,
    sink: &'a mut dyn Sink,
    segment: Option<BeamRun>,
    done: Vec<bool>,
    /// Beams with an implausible reading, which are not measured again.
    rejected: Vec<bool>,
    repaired: u32,
    restarts: u32,
    clock: ClockFit,
    extender: TickExtender,
    span: Option<FiringSpan>,
    /// Measuring time of the boots before the current one, ticks.
    earlier_ticks: u64,
    failed: Option<SinkError>,
}

impl<'a> ScanRecorder<'a> {
    pub(super) fn new(
        job: &'a ScanJob,
        scan: Uuid,
        motor: (i32, i32),
        wall_epoch: Timestamp,
        identity: &Identity,
        sink: &'a mut dyn Sink,
    ) -> Self {
        Self {
            job,
            scan,
            motor,
            wall_epoch,
            wall_clock: WallClock::new(),
            identity: *identity,
            sink,
            segment: None,
            done: vec![false; job.plan.beams() as usize],
            rejected: vec![false; job.plan.beams() as usize],
            repaired: 0,
            restarts: 0,
            clock: ClockFit::new(identity.tick_hz),
            extender: TickExtender::default(),
            span: None,
            earlier_ticks: 0,
            failed: None,
        }
    }

    /// Number of beams measured.
    pub(super) fn measured(&self) -> u32 {
        self.done.iter().filter(|&&done| done).count() as u32
    }

    pub(super) fn next_segment(&self) -> Option<BeamRun> {
        let closed =
            self.done.iter().zip(&self.rejected).map(|(done, rejected)| *done || *rejected);
        BeamRun::first_missing(&closed.collect::<Vec<_>>(), self.job.plan.pings_per_stop)
    }

    pub(super) fn begin(&mut self, segment: BeamRun) {
        self.segment = Some(segment);
    }

    /// Processes an event; breaks off once a record could not be written.
    pub(super) fn handle(&mut self, event: HostEvent) -> ControlFlow<()> {
        self.process(event);
        if self.failed.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn process(&mut self, event: HostEvent) {
        self.check_wall_clock();
        match event {
            HostEvent::Reading { reading, repaired } => self.record_reading(&reading, repaired),
            HostEvent::ClockSample { sent_us, received_us, device_ticks, retried } => {
                let ticks = self.extender.extend(device_ticks);
                if !retried {
                    self.clock.push(sent_us, received_us, ticks);
                }
            }
            HostEvent::ReadingRejected { reading, fault } => self.reject(&reading, fault),
            // A late report: the coils were released before this scan, which homed first.
            HostEvent::Fault(FaultKind::HoldExpired) => {}
            HostEvent::Fault(kind) => self.note(EventKind::Fault, fault_text(kind)),
            HostEvent::Rebooted { old, new } => self.note(
                EventKind::Reboot,
                format!(
                    "the device restarted (boot {old:04x}, now {new:04x}); position lost after \
                     {} of {} beams",
                    self.measured(),
                    self.done.len()
                ),
            ),
            HostEvent::Identified(_)
            | HostEvent::Done(_)
            | HostEvent::SweepDone { .. }
            | HostEvent::Failed(_) => {}
        }
    }

    /// Continues with a device that restarted and was identified again. The clock fit starts over.
    pub(super) fn resume_after_restart(&mut self, identity: &Identity) {
        self.restarts += 1;
        self.identity = *identity;
        self.clock = ClockFit::new(identity.tick_hz);
        self.extender = TickExtender::default();
        self.earlier_ticks += self.span_ticks();
        self.span = None;
        let detail = format!(
            "boot {:04x} ({:?}): homing, then the remaining {} beams",
            identity.boot,
            identity.reset_cause,
            self.done.len() as u32 - self.measured()
        );
        self.note(EventKind::Reconnected, detail);
    }

    /// Records a step of the wall clock before the scan.
    pub(super) fn note_earlier_clock_step(&mut self, step: SignedDuration) {
        if let Some(step) = as_step(step) {
            let step_s = step.as_secs_f64();
            let detail =
                format!("the computer's clock was set by {step_s:+.3} s since the previous check");
            self.note(EventKind::ClockStep, detail);
        }
    }

    /// Records a step of the wall clock during the scan. Times within a scan keep the clock of its
    /// start.
    pub(super) fn check_wall_clock(&mut self) {
        if let Some(step) = self.wall_clock.step() {
            let step_s = step.as_secs_f64();
            let detail = format!(
                "the computer's clock was set by {step_s:+.3} s during the scan: the times of its \
                 readings continue on the clock of the scan's start"
            );
            self.note(EventKind::ClockStep, detail);
        }
    }

    /// Total step of the wall clock during the scan, and the number of steps.
    pub(super) const fn wall_clock_steps(&self) -> (SignedDuration, u32) {
        self.wall_clock.total_step()
    }

    pub(super) fn note(&mut self, kind: EventKind, detail: String) {
        self.write(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    /// Records the failure of the scan, and every open beam as lost.
    pub(super) fn abort(&mut self, error: &DriveError) {
        self.note(event_kind(error), format!("scan failed: {error}"));
        for index in 0..self.done.len() {
            if self.is_open(index) {
                self.write_lost(index as u32);
            }
        }
    }

    /// Returns `true` if no ping of the beam was written yet.
    fn is_open(&self, index: usize) -> bool {
        self.done.get(index) == Some(&false) && self.rejected.get(index) == Some(&false)
    }

    fn write_lost(&mut self, index: u32) {
        let ping = self.blank_ping(index, PingStatus::LinkLost);
        self.write(&Record::Ping(Box::new(ping)));
    }

    /// Logs an implausible reading and records the beam as lost.
    fn reject(&mut self, reading: &Reading, fault: ReadingFault) {
        let Some(segment) = self.segment else { return };
        let index = segment.index(u32::from(reading.index), self.job.plan.pings_per_stop);
        if !self.is_open(index as usize) {
            return;
        }
        self.note(EventKind::Fault, format!("the reading of beam {index} was rejected: {fault}"));
        if let Some(rejected) = self.rejected.get_mut(index as usize) {
            *rejected = true;
        }
        self.write_lost(index);
    }

    /// Records that the motor did not return home after a complete scan.
    pub(super) fn note_home_failure(&mut self, error: &DriveError) {
        self.note(event_kind(error), format!("could not go home after the scan: {error}"));
    }

    /// Returns the first write error, if any.
    pub(super) fn check_sink(&mut self) -> Result<(), SinkError> {
        self.failed.take().map_or(Ok(()), Err)
    }

    pub(super) fn finish(
        mut self,
        acoustic_limit_s: f64,
        home_drift_steps: Option<i32>,
    ) -> Result<FinishedScan, SinkError> {
        if let Some(drift) = home_drift_steps.filter(|&drift| drift != 0) {
            let detail = format!(
                "the index was found {drift} steps off after the scan: its azimuths are uncertain"
            );
            self.note(EventKind::Fault, detail);
        }
        let ticks = self.earlier_ticks + self.span_ticks();
        let end = ScanEnd {
            scan: self.scan,
            time: Timestamp::now(),
            beams: self.measured(),
            missing: self.done.len() as u32 - self.measured(),
            repaired: self.repaired,
            duration_s: ticks as f64 / f64::from(self.identity.tick_hz),
            acoustic_limit_s,
            home_drift_steps,
            provenance: None,
        };
        self.write(&Record::ScanEnd(end.clone()));
        self.check_sink()?;
        Ok(FinishedScan { end, restarts: self.restarts, clock_drift: self.clock.drift() })
    }

    fn record_reading(&mut self, reading: &Reading, repaired: bool) {
        let Some(segment) = self.segment else { return };
        let index = segment.index(u32::from(reading.index), self.job.plan.pings_per_stop);
        if !self.is_open(index as usize) {
            return;
        }
        let fired = self.extender.extend(reading.fired_ticks);
        let span = self.span.get_or_insert(FiringSpan { first: fired, last: fired });
        *span = FiringSpan { first: span.first.min(fired), last: span.last.max(fired) };
        let ping = self.ping(index, reading, fired, repaired);
        self.write(&Record::Ping(Box::new(ping)));
        // A reading that could not be logged counts as missing.
        if let Some(done) = self.done.get_mut(index as usize).filter(|_| self.failed.is_none()) {
            *done = true;
            self.repaired += u32::from(repaired);
        }
    }

    fn ping(&self, index: u32, reading: &Reading, fired: u64, repaired: bool) -> Ping {
        let tick_us = 1e6 / f64::from(self.identity.tick_hz);
        let tof_us = reading.echoes.first().map(|&ticks| f64::from(ticks) * tick_us);
        let status = match (reading.status, tof_us) {
            (ReadingStatus::ModuleFault, _) => PingStatus::ModuleFault,
            (ReadingStatus::StepUncertain, _) => PingStatus::StepUncertain,
            (_, tof_us) => classify_tof(tof_us, self.job.blanking_us),
        };
        let range_m = tof_us
            .filter(|_| status.has_range())
            .map(|tof_us| tof_us * 1e-6 * self.job.sound_speed_m_s / 2.0);
        let (time, time_sigma_us) = self.wall_time(fired);
        let blank = self.blank_ping(index, status);
        let predicted = blank.sim.as_ref().and_then(|sim| sim.range_m);
        Ping {
            step: reading.step,
            time,
            time_sigma_us,
            fired_ticks: Some(fired),
            echo_ticks: reading.echoes.to_vec(),
            tof_us,
            range_m,
            repaired,
            residual_m: range_m.zip(predicted).map(|(measured, predicted)| measured - predicted),
            ..blank
        }
    }

    /// Ping of a planned beam without a reading.
    fn blank_ping(&self, index: u32, status: PingStatus) -> Ping {
        let stop = index / self.job.plan.pings_per_stop.max(1);
        let (from, stride) = self.motor;
        Ping {
            step: from + stop as i32 * stride,
            sim: self.job.predictions.get(stop as usize).cloned(),
            ..Ping::new(self.scan, index, self.job.plan.azimuth_deg(stop), status)
        }
    }

    /// Wall-clock time of a device time, and the standard deviation in microseconds.
    fn wall_time(&self, ticks: u64) -> (Option<Timestamp>, Option<f64>) {
        // A virtual clock jumps and can't be fitted: only the present time is known.
        if self.identity.capabilities.has(Capabilities::VIRTUAL_CLOCK) {
            return (Some(Timestamp::now()), None);
        }
        let Some(at) = self.clock.host_time(ticks) else { return (None, None) };
        let since = SignedDuration::from_micros(at.us.round() as i64);
        (self.wall_epoch.checked_add(since).ok(), Some(at.sigma_us))
    }

    fn span_ticks(&self) -> u64 {
        self.span
            .map_or(0, |span| span.last - span.first + u64::from(self.job.settings.window_ticks))
    }

    fn write(&mut self, record: &Record) {
        if self.failed.is_none() {
            self.failed = self.sink.record(record).err();
        }
    }
}

fn event_kind(error: &DriveError) -> EventKind {
    match error {
        DriveError::Host(HostError::NoAnswer { .. } | HostError::Hangup) => EventKind::LinkLost,
        _ => EventKind::Fault,
    }
}

fn fault_text(kind: FaultKind) -> String {
    format!("the device stopped by itself: {kind}")
}
