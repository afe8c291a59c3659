//! A single scan, with the orders and interrupts that arrive meanwhile.

use std::future::pending;

use firmware_protocol::{host::HostError, messages::Identity};
use sonard_api::Trouble;
use sonard_device::link::Line;
use sonard_device::ranger::{DriveError, Ranger, ScanError, ScanJob, ScanSummary};
use sonard_records::{EventKind, Record, STOPPED_ON_REQUEST, Session};
use tokio::{sync::oneshot, time::Instant};
use uuid::Uuid;

use super::{
    super::{
        control::Interrupt, link_state::LinkInput, prediction_cache::predict,
        schedule::QueuedScans, state::StateEvent,
    },
    DeviceTask, with_orders,
};

impl DeviceTask {
    pub(super) async fn scan(&mut self) {
        let Some(identity) = self.verify_identity().await else { return };
        let (request, before) = (self.control.schedule.next(), self.control.scan_settings());
        let Some(job) = self.prepare(&identity, request).await else { return };
        let now = self.control.scan_settings();
        if self.control.schedule.next() != request || !now.same_scan_as(&before) {
            // An order changed the next scan while the model was computing.
            return;
        }
        let Some(mut ranger) = self.ranger.take() else { return };
        self.control.schedule.begun(self.control.now());
        self.control.serving = job.request;
        self.handle(LinkInput::ScanBegun);
        self.publish_status();
        let previous = self.out.state.latest_scan();
        let clock_steps = ranger.clock_steps();
        let (outcome, interrupts) = self.run_scan(&mut ranger, &job).await;
        self.count_clock_steps(ranger.clock_steps() - clock_steps);
        self.control.serving = None;
        self.control.identity = Some(*ranger.identity());
        self.ranger = Some(ranger);
        self.next_check = Instant::now() + self.check_interval();
        self.out.state.apply([StateEvent::ScanEnded]);
        self.finish_scan(previous, outcome);
        interrupts.into_iter().for_each(|interrupt| self.react(interrupt));
    }

    /// Re-identifies the device: a scan never starts on a disconnected or different board. A
    /// restart since the last scan is the same device, but starts a session.
    async fn verify_identity(&mut self) -> Option<Identity> {
        let ranger = self.ranger.as_mut()?;
        match with_orders(&mut self.control, ranger.verify_identity()).await {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(())) => {
                self.control.identity = Some(*ranger.identity());
                return self.control.identity;
            }
        }
        None
    }

    /// Prepares the next scan and writes its session to the log. Returns `None` if the scan can't
    /// be taken now.
    async fn prepare(
        &mut self,
        identity: &Identity,
        requested: Option<QueuedScans>,
    ) -> Option<ScanJob> {
        if std::mem::take(&mut self.control.stale) {
            self.predictions.clear();
        }
        let air = self.control.air.settled();
        let pose = requested.and_then(|request| request.pose).unwrap_or(self.control.pose);
        let plan = requested.and_then(|request| request.plan).unwrap_or(self.control.plan);
        let key = (pose, plan, air);
        if let Err(error) = plan.motor_steps(identity.steps_per_revolution.into()) {
            return self.abandon_scans(&error.to_string(), requested);
        }
        if !self.predictions.contains(key) {
            let predicting = predict(&self.control.settings, key);
            match with_orders(&mut self.control, predicting).await {
                Err(interrupt) => {
                    self.react(interrupt);
                    return None;
                }
                Ok(Err(why)) => return self.abandon_scans(&why, requested),
                Ok(Ok(predicted)) => {
                    if let Some(why) = &predicted.refusal {
                        tracing::warn!("scans have no predictions: {why}");
                        self.out.event(EventKind::NoPrediction, why.to_string());
                    }
                    self.predictions.store(key, predicted);
                }
            }
        }
        if let Some((relocate, scene)) =
            self.relocate.as_mut().zip(self.control.settings.scene.clone())
        {
            let moving = relocate(scene, pose);
            match with_orders(&mut self.control, moving).await {
                Err(interrupt) => {
                    self.react(interrupt);
                    return None;
                }
                Ok(Err(why)) => return self.abandon_scans(&why, requested),
                Ok(Ok(())) => {}
            }
        }
        let session = self.predictions.session(&self.control.settings, &air, identity);
        self.publish_session(session);
        let scan_air = self.control.air.scan_air(&air, Instant::now());
        let job = self.predictions.job(&self.control.settings, key, scan_air, identity);
        Some(ScanJob { request: requested.map(|request| request.request), ..job })
    }

    /// Pauses scanning, or cancels only the request if the failure comes from its own plan or pose.
    /// A retry would fail again until an order or the configuration changes the scan.
    fn abandon_scans(&mut self, why: &str, request: Option<QueuedScans>) -> Option<ScanJob> {
        match request.filter(|request| request.plan.is_some() || request.pose.is_some()) {
            Some(request) => drop(self.control.schedule.cancel(request.request)),
            None => self.control.schedule.stop(),
        }
        tracing::error!("scanning stopped: {why}");
        self.out.event(EventKind::Stopped, format!("scanning stopped: {why}"));
        None
    }

    /// Publishes a session record if it differs from the current one in more than the time.
    fn publish_session(&mut self, session: Session) {
        let session = self.out.with_robot_name(session);
        let same = self.session.as_ref().is_some_and(|before| {
            *before == Session { started: before.started, ..session.clone() }
        });
        if !same {
            self.out.publish(&Record::Session(Box::new(session.clone())));
            self.session = Some(session);
        }
    }

    fn count_clock_steps(&self, steps: u32) {
        if steps > 0 {
            tracing::warn!("the computer's clock was stepped; the log contains the offset");
            self.out.state.apply([StateEvent::ClockStepped(steps)]);
        }
    }

    /// Runs the scan while orders are carried out. Returns its outcome, and the interrupts that the
    /// state machine has to handle afterwards.
    async fn run_scan(
        &mut self,
        ranger: &mut Ranger<Box<dyn Line>>,
        job: &ScanJob,
    ) -> (Result<ScanSummary, ScanError>, Vec<Interrupt>) {
        let mut out = self.out.clone();
        let (halt, halted) = oneshot::channel::<String>();
        let mut halt = Some(halt);
        let stop = async {
            match halted.await {
                Ok(why) => why,
                Err(_) => pending().await,
            }
        };
        let scan = ranger.scan(job, &mut out, stop);
        tokio::pin!(scan);
        let mut interrupts = Vec::new();
        let outcome = loop {
            let interrupt = tokio::select! {
                outcome = &mut scan => break outcome,
                // A shutdown is final: no interrupt after it matters.
                interrupt = self.control.next(), if !interrupts.contains(&Interrupt::Shutdown) => interrupt,
            };
            let why = match interrupt {
                Interrupt::Shutdown => "the daemon is stopping",
                Interrupt::Stop => STOPPED_ON_REQUEST,
                Interrupt::EmergencyStop(true) => "the emergency stop was pressed",
                Interrupt::PortChanged => "the configured port changed",
                Interrupt::Log if !self.out.journal.is_writable() => "the log can't be written",
                Interrupt::Log
                | Interrupt::Start
                | Interrupt::ScheduleChanged
                | Interrupt::EmergencyStop(false) => {
                    if let Interrupt::EmergencyStop(_) = interrupt {
                        interrupts.push(interrupt);
                    }
                    continue;
                }
            };
            interrupts.push(interrupt);
            if let Some(halt) = halt.take() {
                // A scan that has just ended needs no halt.
                drop(halt.send(why.to_owned()));
            }
        };
        drop(halt);
        (outcome, interrupts)
    }

    fn finish_scan(&mut self, previous: Option<Uuid>, outcome: Result<ScanSummary, ScanError>) {
        if let Some((end, _)) = self.out.state.latest_end()
            && outcome.is_err()
            && Some(end.scan) != previous
        {
            self.scans.beams += u64::from(end.beams);
            self.scans.missing += u64::from(end.missing);
        }
        match outcome {
            Ok(summary) => {
                self.count(&summary);
                self.handle(LinkInput::ScanEnded);
                match summary.not_home {
                    None => {}
                    Some(DriveError::Host(HostError::Rebooted)) => {
                        self.handle(LinkInput::Restarted);
                    }
                    Some(error) => self.device_failed(&error),
                }
            }
            Err(ScanError::Device(error)) => {
                self.scans.failed += 1;
                self.device_failed(&error);
            }
            Err(error) => {
                self.scans.failed += 1;
                self.fail(Trouble::Fault, error.to_string());
            }
        }
    }

    fn count(&mut self, summary: &ScanSummary) {
        let end = &summary.end;
        *if summary.stopped { &mut self.scans.stopped } else { &mut self.scans.completed } += 1;
        self.scans.beams += u64::from(end.beams);
        self.scans.missing += u64::from(end.missing);
        self.scans.restarts += u64::from(summary.restarts);
        let drift_ppm = summary.clock_drift.map(|drift| drift * 1e6);
        let sigma_us = self.out.state.latest_end().and_then(|(_, sigma_us)| sigma_us);
        self.out.state.apply([StateEvent::ClockMeasured { drift_ppm, sigma_us }]);
    }
}
