//! The task that owns the port and the ranger: does what the link's state machine says.

use std::{future::pending, sync::Arc, time::Duration};

use firmware_protocol::{
    host::{HostConfig, HostError},
    messages::Identity,
};
use jiff::Timestamp;
use tokio::{
    sync::oneshot,
    time::{Instant, sleep_until},
};
use tokio_serial::SerialStream;

use super::{
    agenda::Due,
    desk::{Desk, Interrupt},
    forecast::{Forecast, listening},
    hub::Hub,
    journal::Journal,
    machine::{Input, LinkMachine, LinkState, Step, Trouble},
    status::{LineTotals, ScanTotals, Shared},
};
use crate::{
    link::{BAUD, LinkError},
    ranger::{
        DriveError, Driver, Ranger, ScanError, ScanJob, ScanSummary, Sink, Unasked, device_record,
        provenance, serial_text,
    },
    scan::{Event, EventKind, Record, Session},
    store::StoreError,
};

/// A wall clock that moved by more than this against the one that never jumps was set.
const CLOCK_STEP_S: f64 = 0.1;

/// Opens the port of a name.
pub type OpenPort = Box<dyn FnMut(&str) -> Result<SerialStream, LinkError> + Send>;

pub(super) struct Operator {
    desk: Desk,
    machine: LinkMachine,
    open_port: OpenPort,
    ranger: Option<Ranger<SerialStream>>,
    line: Option<SerialStream>,
    forecast: Forecast,
    /// The session's record that is in force in the log.
    session: Option<Session>,
    out: Outlet,
    trouble: Option<String>,
    /// Figures of the connections before this one.
    earlier: LineTotals,
    line_totals: LineTotals,
    scans: ScanTotals,
    next_check: Instant,
}

/// Where records and news go.
#[derive(Clone)]
pub(super) struct Outlet {
    pub(super) journal: Journal,
    pub(super) hub: Hub,
    pub(super) shared: Arc<Shared>,
}

impl Outlet {
    fn event(&self, kind: EventKind, detail: String) {
        self.put(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    fn put(&self, record: &Record) {
        let over = self.shared.collect(record);
        self.journal.record(record);
        self.hub.publish(record);
        if let Some(scan) = over {
            self.hub.publish_scan(|| serde_json::to_vec(&*scan).unwrap_or_default());
        }
    }
}

impl Sink for Outlet {
    fn record(&mut self, record: &Record) -> Result<(), StoreError> {
        if let Record::ScanStart(start) = record {
            let begun = (start.scan, start.plan.beams());
            self.shared.view.send_modify(|view| view.scan = Some(begun));
        }
        self.put(record);
        Ok(())
    }
}

impl Operator {
    pub(super) fn new(desk: Desk, open_port: OpenPort, out: Outlet) -> Self {
        let machine = LinkMachine::new(desk.settings.back_off(), desk.now());
        Self {
            desk,
            machine,
            open_port,
            ranger: None,
            line: None,
            forecast: Forecast::default(),
            session: None,
            out,
            trouble: None,
            earlier: LineTotals::default(),
            line_totals: LineTotals::default(),
            scans: ScanTotals::default(),
            next_check: Instant::now(),
        }
    }

    /// Works until the machine has ended.
    pub(super) async fn run(mut self) {
        self.desk.board.set_power(true);
        loop {
            let step = self.machine.poll(self.desk.now());
            self.tell();
            match step {
                Step::Open => self.open(),
                Step::Identify => self.identify().await,
                Step::Home => self.home().await,
                Step::Serve => self.serve().await,
                Step::Wait(until) => {
                    self.close();
                    self.wait(Some(self.desk.epoch + until)).await;
                }
                Step::Rest => {
                    self.close();
                    self.desk.board.set_power(false);
                    self.wait(None).await;
                    self.desk.board.set_power(true);
                }
                Step::End => break,
            }
        }
        self.close();
        self.desk.board.set_light(false);
        self.desk.board.set_power(false);
    }

    fn handle(&mut self, input: Input) {
        self.out.shared.beat();
        self.machine.handle(self.desk.now(), input);
    }

    fn fail(&mut self, trouble: Trouble, why: String) {
        tracing::debug!("{why}");
        self.trouble = Some(why);
        self.handle(Input::Failed(trouble));
    }

    fn open(&mut self) {
        self.close();
        let port = self.desk.settings.keys.device.port.clone().unwrap_or_default();
        match (self.open_port)(&port) {
            Ok(line) => {
                self.line = Some(line);
                self.handle(Input::Opened);
            }
            Err(error) => {
                let trouble = match &error {
                    LinkError::NotFound { .. } => Trouble::Absent,
                    LinkError::Busy(_) => Trouble::Busy,
                    LinkError::Permission(_) | LinkError::NotSerial(_) => Trouble::Forbidden,
                    // A port that is being unplugged says all kinds of things.
                    LinkError::Io { .. } => Trouble::Lost,
                };
                self.fail(trouble, format!("{error}; {}", error.help()));
            }
        }
    }

    async fn identify(&mut self) {
        let attempts = self.desk.settings.keys.link.attempts;
        let met = match (self.line.take(), self.ranger.take()) {
            (Some(line), _) => {
                let config =
                    HostConfig { max_attempts: attempts, ..HostConfig::new(BAUD, rand::random()) };
                attended(&mut self.desk, Ranger::meet(Driver::new(line, config))).await
            }
            (None, Some(mut ranger)) => {
                let again = async {
                    ranger.meet_again().await?;
                    Ok(ranger)
                };
                attended(&mut self.desk, again).await
            }
            (None, None) => return self.fail(Trouble::Lost, "the line is gone".into()),
        };
        match met {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(ranger)) => self.meet(ranger),
        }
    }

    /// Takes the device if it is the right one.
    fn meet(&mut self, ranger: Ranger<SerialStream>) {
        let serial = serial_text(ranger.identity());
        let wanted = self.desk.settings.keys.device.serial.clone();
        if let Some(wanted) = wanted.filter(|wanted| *wanted != serial) {
            let why = format!(
                "the device says it is {serial}, not {wanted}; connect that one, or change \
                 device.serial"
            );
            return self.fail(Trouble::WrongDevice, why);
        }
        self.desk.identity = Some(*ranger.identity());
        self.ranger = Some(ranger);
        self.handle(Input::Identified);
    }

    async fn home(&mut self) {
        let Some(ranger) = &mut self.ranger else { return };
        let air = self.desk.air.settled();
        let settings = self
            .desk
            .settings
            .motion()
            .settings(&listening(&self.desk.settings, &air), ranger.identity());
        match attended(&mut self.desk, ranger.home(settings)).await {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(_drift)) if self.desk.board.at_home() == Some(false) => {
                let why = "the motor says it is home, but the home switch is open".into();
                self.fail(Trouble::Fault, why);
            }
            Ok(Ok(_drift)) => {
                self.next_check = Instant::now() + self.check_interval();
                self.handle(Input::Homed);
            }
        }
    }

    /// The device can be used: scans if that is due, else listens until it is.
    async fn serve(&mut self) {
        let due = match self.desk.agenda.due(self.desk.now()) {
            // Nothing is measured that can't be kept.
            Due::Now if self.out.journal.is_well() => return self.scan().await,
            Due::Now | Due::OnRequest => None,
            Due::At(at) => Some(self.desk.epoch + at),
        };
        let Some(ranger) = &mut self.ranger else {
            return self.fail(Trouble::Lost, "the line is gone".into());
        };
        let wake = due.map_or(self.next_check, |due| due.min(self.next_check));
        tokio::select! {
            unasked = ranger.unasked() => self.unasked(unasked),
            interrupt = self.desk.next() => self.react(interrupt),
            () = sleep_until(wake) => self.check_if_due().await,
        }
    }

    fn unasked(&mut self, unasked: Unasked) {
        match unasked {
            Unasked::Hangup => {
                self.fail(Trouble::Lost, "the line was closed: the cable was pulled?".into());
            }
            Unasked::Restarted => {
                let detail = "the device restarted without work: homing again".to_owned();
                self.out.event(EventKind::Reboot, detail);
                self.handle(Input::Restarted);
            }
            Unasked::Fault(kind) => {
                self.fail(Trouble::Fault, format!("the device stopped by itself: {kind}"));
            }
        }
    }

    async fn check_if_due(&mut self) {
        if Instant::now() < self.next_check {
            return;
        }
        self.next_check = Instant::now() + self.check_interval();
        self.out.shared.beat();
        let Some(ranger) = &mut self.ranger else { return };
        match attended(&mut self.desk, ranger.check()).await {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(DriveError::Host(HostError::Rebooted))) => self.unasked(Unasked::Restarted),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(())) => {}
        }
    }

    async fn scan(&mut self) {
        let Some(identity) = self.desk.identity else { return };
        let Some(job) = self.prepare(&identity).await else { return };
        let Some(mut ranger) = self.ranger.take() else { return };
        self.note_clock_step(&mut ranger);
        self.desk.agenda.begun(self.desk.now());
        self.handle(Input::ScanBegun);
        self.tell();
        let (outcome, interrupts) = self.scan_attended(&mut ranger, &job).await;
        self.desk.identity = Some(*ranger.identity());
        self.ranger = Some(ranger);
        self.next_check = Instant::now() + self.check_interval();
        self.out.shared.view.send_modify(|view| view.scan = None);
        self.scan_ended(outcome);
        interrupts.into_iter().for_each(|interrupt| self.react(interrupt));
    }

    /// The next scan, and a session in the log that it fits; `None` if it can't be taken.
    async fn prepare(&mut self, identity: &Identity) -> Option<ScanJob> {
        if std::mem::take(&mut self.desk.stale) {
            self.forecast.forget();
        }
        let (air, now) = (self.desk.air.settled(), Instant::now());
        let what = (self.desk.pose, self.desk.plan, air);
        let scan_air = self.desk.air.scan_air(&air, now);
        let steps_per_revolution = u32::from(identity.steps_per_revolution);
        let job = match what.1.motor_steps(steps_per_revolution) {
            Err(error) => Err(error.to_string()),
            Ok(_) => self.forecast.job(&self.desk.settings, what, scan_air, identity).await,
        };
        match job {
            Ok(job) => {
                let session = self.forecast.session(&self.desk.settings, &air, identity);
                self.put_session(session);
                Some(job)
            }
            Err(why) => {
                // Trying again would fail again: somebody has to change something first.
                self.desk.agenda.stop();
                tracing::error!("no scan is taken: {why}");
                self.out.event(EventKind::Stopped, format!("no scan is taken: {why}"));
                None
            }
        }
    }

    /// Writes a session's record if the one in force says something else.
    fn put_session(&mut self, session: Session) {
        let same = self.session.as_ref().is_some_and(|before| {
            *before == Session { started: before.started, ..session.clone() }
        });
        if !same {
            self.out.put(&Record::Session(Box::new(session.clone())));
            self.session = Some(session);
        }
    }

    fn note_clock_step(&mut self, ranger: &mut Ranger<SerialStream>) {
        let step_s = ranger.reanchor().as_secs_f64();
        if step_s.abs() > CLOCK_STEP_S {
            let detail = format!(
                "the computer's clock was set by {step_s:+.3} s since it was looked at last"
            );
            tracing::warn!("{detail}");
            self.out.shared.view.send_modify(|view| view.clock.steps += 1);
            self.out.event(EventKind::ClockStep, detail);
        }
    }

    /// Takes the scan, and carries out orders meanwhile. What happened that the machine has to
    /// know comes back with the outcome.
    async fn scan_attended(
        &mut self,
        ranger: &mut Ranger<SerialStream>,
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
                interrupt = self.desk.next(), if !interrupts.contains(&Interrupt::Shutdown) => interrupt,
            };
            let why = match interrupt {
                Interrupt::Shutdown => "the daemon is stopping",
                Interrupt::Stop => "stopped on request",
                Interrupt::EmergencyStop(true) => "the emergency stop was pressed",
                Interrupt::PortChanged => "another port is to be used",
                Interrupt::Log if !self.out.journal.is_well() => "the log can't be written",
                Interrupt::Log | Interrupt::Agenda | Interrupt::EmergencyStop(false) => {
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

    fn scan_ended(&mut self, outcome: Result<ScanSummary, ScanError>) {
        if let Some(latest) = self.out.shared.latest_scan()
            && let Some(end) = &latest.end
            && outcome.is_err()
        {
            self.scans.beams += u64::from(end.beams);
            self.scans.missing += u64::from(end.missing);
        }
        match outcome {
            Ok(summary) => {
                self.count(&summary);
                self.handle(Input::ScanEnded);
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
        let latest = self.out.shared.latest_scan();
        let sigma_us =
            latest.and_then(|scan| scan.pings.last().and_then(|ping| ping.time_sigma_us));
        self.out.shared.view.send_modify(|view| {
            (view.clock.drift_ppm, view.clock.sigma_us) = (drift_ppm, sigma_us);
        });
    }

    fn device_failed(&mut self, error: &DriveError) {
        use HostError as Host;
        let trouble = match error {
            DriveError::Host(Host::NoAnswer { .. } | Host::NotADevice { .. }) => {
                Trouble::NotAnswering
            }
            DriveError::Host(Host::WrongVersion { .. }) => Trouble::WrongFirmware,
            DriveError::Host(Host::Hangup) => Trouble::Lost,
            _ => Trouble::Fault,
        };
        if trouble == Trouble::NotAnswering && self.desk.board.can_reset() {
            tracing::warn!("the device does not answer: pulling its reset line");
            tokio::task::block_in_place(|| self.desk.board.reset());
        }
        self.fail(trouble, format!("{error}; {}", error.help()));
    }

    /// Waits until a time or until something happens.
    async fn wait(&mut self, until: Option<Instant>) {
        let timer = async {
            match until {
                Some(until) => sleep_until(until).await,
                None => pending().await,
            }
        };
        tokio::select! {
            () = timer => self.out.shared.beat(),
            interrupt = self.desk.next() => self.react(interrupt),
        }
    }

    fn react(&mut self, interrupt: Interrupt) {
        match interrupt {
            Interrupt::Shutdown => self.handle(Input::Shutdown),
            Interrupt::EmergencyStop(pressed) => {
                let (kind, what) = match pressed {
                    true => (EventKind::Fault, "the emergency stop was pressed"),
                    false => (EventKind::Reconnected, "the emergency stop was released"),
                };
                self.out.event(kind, what.to_owned());
                self.handle(Input::EmergencyStop(pressed));
            }
            Interrupt::PortChanged => self.handle(Input::PortChanged),
            Interrupt::Log => match self.out.journal.status().error {
                Some(error) => tracing::error!("no scan until the log can be written: {error}"),
                None => tracing::info!("the log can be written again"),
            },
            Interrupt::Stop | Interrupt::Agenda => {}
        }
        self.machine.set_back_off(self.desk.settings.back_off());
    }

    fn close(&mut self) {
        self.line = None;
        if let Some(ranger) = self.ranger.take() {
            self.earlier = self.earlier.with(ranger.link_stats());
        }
        self.desk.identity = None;
    }

    fn check_interval(&self) -> Duration {
        Duration::from_secs_f64(self.desk.settings.keys.link.check_s)
    }

    /// Tells of a change of state, once, and publishes what is in force.
    fn tell(&mut self) {
        if let Some(transition) = self.machine.poll_transition() {
            self.tell_transition(transition.from, transition.to);
        }
        if self.machine.state().is_up() {
            self.trouble = None;
        }
        if let Some(ranger) = &self.ranger {
            let losses = self.line_totals.losses;
            self.line_totals = LineTotals { losses, ..self.earlier.with(ranger.link_stats()) };
        }
        let since = Timestamp::now()
            - jiff::SignedDuration::try_from(self.desk.now().saturating_sub(self.machine.since()))
                .unwrap_or_default();
        let next_at = match self.desk.agenda.due(self.desk.now()) {
            Due::At(at) => Some(self.desk.epoch + at),
            Due::Now | Due::OnRequest => None,
        };
        let retry_at = self.machine.retry_at().map(|at| self.desk.epoch + at);
        let (desk, machine) = (&self.desk, &self.machine);
        self.out.shared.view.send_modify(|view| {
            if view.state != machine.state() {
                view.since = since;
            }
            view.state = machine.state();
            view.port = desk.settings.keys.device.port.clone().unwrap_or_default();
            view.trouble.clone_from(&self.trouble);
            (view.failures, view.retry_at) = (machine.failures(), retry_at);
            view.device = desk.identity.as_ref().map(device_record);
            view.provenance = desk.identity.as_ref().map(provenance);
            view.mode = desk.settings.keys.scanning.mode;
            (view.paused, view.requested) = (desk.agenda.is_paused(), desk.agenda.requested());
            (view.next_at, view.plan, view.pose) = (next_at, desk.plan, desk.pose);
            view.air = desk.air.clone();
            view.configuration = desk.configuration.clone();
            (view.line, view.scans) = (self.line_totals, self.scans);
        });
        self.desk.board.set_light(self.machine.state().is_up());
    }

    fn tell_transition(&mut self, from: Option<LinkState>, to: LinkState) {
        let trouble = self.trouble.clone().unwrap_or_default();
        let was_up = from.is_some_and(LinkState::is_up);
        match to {
            LinkState::Ready => {
                tracing::info!("the ranger is ready");
                if from.is_some() {
                    let detail = "the ranger is ready again: identified and homed".to_owned();
                    self.out.event(EventKind::Reconnected, detail);
                }
            }
            LinkState::Stopped => tracing::info!("stopped"),
            LinkState::EmergencyStop => tracing::warn!("the emergency stop is pressed"),
            state => {
                tracing::warn!("{}: {trouble}", state.name());
                self.line_totals.losses += u64::from(was_up);
                let kind =
                    if state == LinkState::Fault { EventKind::Fault } else { EventKind::LinkLost };
                self.out.event(kind, format!("{}: {trouble}", state.name()));
            }
        }
    }
}

/// Waits for something of the device, carrying out orders meanwhile; broken off only by what
/// can't wait.
async fn attended<T>(desk: &mut Desk, work: impl Future<Output = T>) -> Result<T, Interrupt> {
    tokio::pin!(work);
    loop {
        tokio::select! {
            done = &mut work => return Ok(done),
            interrupt = desk.next() => match interrupt {
                Interrupt::Shutdown | Interrupt::EmergencyStop(_) | Interrupt::PortChanged => {
                    return Err(interrupt);
                }
                // The operator looks at the agenda and the log when the device can be used.
                Interrupt::Stop | Interrupt::Log | Interrupt::Agenda => {}
            }
        }
    }
}
