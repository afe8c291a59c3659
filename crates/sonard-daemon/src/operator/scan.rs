//! One scan, with whatever happens meanwhile.

use std::future::pending;

use firmware_protocol::{host::HostError, messages::Identity};
use sonard_api::Trouble;
use sonard_device::link::Line;
use sonard_device::ranger::{DriveError, Ranger, ScanError, ScanJob, ScanSummary};
use sonard_records::{EventKind, Record, STOPPED_ON_REQUEST, Session};
use tokio::{sync::oneshot, time::Instant};
use uuid::Uuid;

use super::{
    super::{agenda::Asked, control::Interrupt, forecast::predict, machine::Input},
    Operator, attended,
};

impl Operator {
    pub(super) async fn scan(&mut self) {
        let Some(identity) = self.recognise().await else { return };
        let (asked, terms) = (self.control.agenda.next(), self.control.terms());
        let Some(job) = self.prepare(&identity, asked).await else { return };
        let now = self.control.terms();
        if self.control.agenda.next() != asked || !now.measures_as(&terms) {
            // While the model was asked, somebody wanted something else.
            return;
        }
        let Some(mut ranger) = self.ranger.take() else { return };
        self.control.agenda.begun(self.control.now());
        self.control.serving = job.request;
        self.handle(Input::ScanBegun);
        self.tell();
        let before = self.out.shared.latest_scan();
        let clock_steps = ranger.clock_steps();
        let (outcome, interrupts) = self.scan_attended(&mut ranger, &job).await;
        self.count_clock_steps(ranger.clock_steps() - clock_steps);
        self.control.serving = None;
        self.control.identity = Some(*ranger.identity());
        self.ranger = Some(ranger);
        self.next_check = Instant::now() + self.check_interval();
        self.out.shared.view.send_modify(|view| view.scan = None);
        self.scan_ended(before, outcome);
        interrupts.into_iter().for_each(|interrupt| self.react(interrupt));
    }

    /// Makes sure that the device is there, before a scan is begun that nobody would take. A restart
    /// since the last one is no other device, but begins a session.
    async fn recognise(&mut self) -> Option<Identity> {
        let ranger = self.ranger.as_mut()?;
        match attended(&mut self.control, ranger.recognise()).await {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(())) => {
                self.control.identity = Some(*ranger.identity());
                return self.control.identity;
            }
        }
        None
    }

    /// The next scan, and a session in the log that it fits; `None` if it can't be taken now.
    async fn prepare(&mut self, identity: &Identity, asked: Option<Asked>) -> Option<ScanJob> {
        if std::mem::take(&mut self.control.stale) {
            self.forecast.forget();
        }
        let air = self.control.air.settled();
        let pose = asked.and_then(|asked| asked.pose).unwrap_or(self.control.pose);
        let plan = asked.and_then(|asked| asked.plan).unwrap_or(self.control.plan);
        let what = (pose, plan, air);
        if let Err(error) = what.1.motor_steps(identity.steps_per_revolution.into()) {
            return self.give_up_scans(&error.to_string(), asked);
        }
        if !self.forecast.knows(what) {
            let predicting = predict(&self.control.settings, what);
            match attended(&mut self.control, predicting).await {
                Err(interrupt) => {
                    self.react(interrupt);
                    return None;
                }
                Ok(Err(why)) => return self.give_up_scans(&why, asked),
                Ok(Ok(predicted)) => {
                    if let Some(why) = &predicted.refusal {
                        tracing::warn!("scans are taken without predictions: {why}");
                        self.out.event(EventKind::NoPrediction, why.to_string());
                    }
                    self.forecast.learn(what, predicted);
                }
            }
        }
        let session = self.forecast.session(&self.control.settings, &air, identity);
        self.put_session(session);
        let scan_air = self.control.air.scan_air(&air, Instant::now());
        let job = self.forecast.job(&self.control.settings, what, scan_air, identity);
        Some(ScanJob { request: asked.map(|asked| asked.request), ..job })
    }

    /// Takes no more scans (of a request with its own plan: no more of those): trying again would
    /// fail again, until somebody changes something.
    fn give_up_scans(&mut self, why: &str, asked: Option<Asked>) -> Option<ScanJob> {
        match asked.filter(|asked| asked.plan.is_some() || asked.pose.is_some()) {
            Some(asked) => drop(self.control.agenda.cancel(asked.request)),
            None => self.control.agenda.stop(),
        }
        tracing::error!("no scan is taken: {why}");
        self.out.event(EventKind::Stopped, format!("no scan is taken: {why}"));
        None
    }

    /// Writes a session's record if the one in force says something else.
    fn put_session(&mut self, session: Session) {
        let session = self.out.named(session);
        let same = self.session.as_ref().is_some_and(|before| {
            *before == Session { started: before.started, ..session.clone() }
        });
        if !same {
            self.out.put(&Record::Session(Box::new(session.clone())));
            self.session = Some(session);
        }
    }

    fn count_clock_steps(&self, steps: u32) {
        if steps > 0 {
            tracing::warn!("the computer's clock was set; the log says by how much");
            self.out.shared.view.send_modify(|view| view.clock.steps += u64::from(steps));
        }
    }

    /// Takes the scan, and carries out orders meanwhile. What happened that the machine has to
    /// know comes back with the outcome.
    async fn scan_attended(
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
                // After the end there is nothing more to be told.
                interrupt = self.control.next(), if !interrupts.contains(&Interrupt::Shutdown) => interrupt,
            };
            let why = match interrupt {
                Interrupt::Shutdown => "the daemon is stopping",
                Interrupt::Stop => STOPPED_ON_REQUEST,
                Interrupt::EmergencyStop(true) => "the emergency stop was pressed",
                Interrupt::PortChanged => "another port is to be used",
                Interrupt::Log if !self.out.journal.is_well() => "the log can't be written",
                Interrupt::Log
                | Interrupt::Start
                | Interrupt::Agenda
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

    fn scan_ended(&mut self, before: Option<Uuid>, outcome: Result<ScanSummary, ScanError>) {
        if let Some((end, _)) = self.out.shared.latest_end()
            && outcome.is_err()
            && Some(end.scan) != before
        {
            self.scans.beams += u64::from(end.beams);
            self.scans.missing += u64::from(end.missing);
        }
        match outcome {
            Ok(summary) => {
                self.count(&summary);
                self.handle(Input::ScanEnded);
                match summary.not_home {
                    None => {}
                    Some(DriveError::Host(HostError::Rebooted)) => self.handle(Input::Restarted),
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
        let sigma_us = self.out.shared.latest_end().and_then(|(_, sigma_us)| sigma_us);
        self.out.shared.view.send_modify(|view| {
            (view.clock.drift_ppm, view.clock.sigma_us) = (drift_ppm, sigma_us);
        });
    }
}
