//! The task that owns the port and the ranger: does what the link's state machine says.

mod scan;
mod tell;

use std::time::Duration;

use firmware_protocol::{
    host::{BoardChange, HostConfig, HostError},
    messages::{FaultKind, Identity, NakReason},
};
use sonard_api::{ScanTotals, Trouble};
use sonard_device::{
    link::{self, BAUD, Line, LinkError},
    ranger::{DriveError, Driver, Ranger, Unasked, serial_text},
};
use sonard_records::{EventKind, Session};
use tokio::time::{Instant, sleep_until};

use super::{
    agenda::Due,
    control::{Control, Interrupt},
    fan_out::RecordFanOut,
    forecast::{Forecast, listening},
    machine::{Input, LinkMachine, Step},
    shared::LinkFigures,
};

/// What to do after an emergency stop.
const AWAITS_START: &str = "there was an emergency stop: nothing moves until somebody starts it \
                            (POST /v1/start, or a restart of the daemon)";
/// How often an operator that waits shows that it is alive.
const BEAT: Duration = Duration::from_secs(1);

/// Opens the port of a name.
pub type OpenPort = Box<dyn FnMut(&str) -> Result<Box<dyn Line>, LinkError> + Send>;

pub(super) struct Operator {
    control: Control,
    machine: LinkMachine,
    open_port: OpenPort,
    ranger: Option<Ranger<Box<dyn Line>>>,
    line: Option<Box<dyn Line>>,
    forecast: Forecast,
    /// The device that was met last, on whatever connection.
    met: Option<Identity>,
    /// The session's record that is in force in the log.
    session: Option<Session>,
    out: RecordFanOut,
    trouble: Option<String>,
    line_figures: LinkFigures,
    scans: ScanTotals,
    next_check: Instant,
}

impl Operator {
    pub(super) fn new(control: Control, open_port: OpenPort, out: RecordFanOut) -> Self {
        let machine = LinkMachine::new(control.settings.back_off(), control.now());
        Self {
            control,
            machine,
            open_port,
            ranger: None,
            line: None,
            forecast: Forecast::default(),
            met: None,
            session: None,
            out,
            trouble: None,
            line_figures: LinkFigures::default(),
            scans: ScanTotals::default(),
            next_check: Instant::now(),
        }
    }

    /// Works until the machine has ended.
    pub(super) async fn run(mut self) {
        loop {
            let step = self.machine.poll(self.control.now());
            self.tell();
            match step {
                Step::Open => self.open(),
                Step::Identify => self.identify().await,
                Step::Home => self.home().await,
                Step::Serve => self.serve().await,
                Step::Wait(until) => {
                    self.close();
                    self.wait(Some(self.control.epoch + until)).await;
                }
                Step::Rest => {
                    self.close();
                    self.control.gpio.set_power(false);
                    self.wait(None).await;
                }
                Step::End => break,
            }
        }
        self.close();
        self.control.gpio.set_light(false);
        self.control.gpio.set_power(false);
    }

    fn handle(&mut self, input: Input) {
        self.out.shared.beat();
        self.machine.handle(self.control.now(), input);
    }

    fn fail(&mut self, trouble: Trouble, why: String) {
        tracing::debug!("{why}");
        self.trouble = Some(why);
        self.handle(Input::Failed(trouble));
    }

    fn open(&mut self) {
        self.close();
        self.control.gpio.set_power(true);
        let port = self.control.settings.keys.device.port.clone().unwrap_or_default();
        match (self.open_port)(&port) {
            Ok(line) => {
                self.line = Some(line);
                self.handle(Input::Opened);
            }
            Err(error) => {
                let trouble = match &error {
                    LinkError::NotFound { .. }
                    | LinkError::Ambiguous { .. }
                    | LinkError::OtherDevice { .. } => Trouble::Absent,
                    LinkError::Busy { .. } => Trouble::Busy,
                    LinkError::Permission(_)
                    | LinkError::DevicePolicy(_)
                    | LinkError::NotSerial(_) => Trouble::Forbidden,
                    // A port that is being unplugged says all kinds of things.
                    LinkError::NotListed { .. } | LinkError::Io { .. } => Trouble::Lost,
                };
                self.fail(trouble, format!("{error}; {}", error.help()));
            }
        }
    }

    async fn identify(&mut self) {
        let attempts = self.control.settings.keys.link.attempts;
        let met = match (self.line.take(), self.ranger.take()) {
            (Some(line), _) => {
                let config =
                    HostConfig { max_attempts: attempts, ..HostConfig::new(BAUD, rand::random()) };
                attended(&mut self.control, Ranger::meet(Driver::new(line, config))).await
            }
            (None, Some(mut ranger)) => {
                let again = async {
                    ranger.meet_again().await?;
                    Ok(ranger)
                };
                attended(&mut self.control, again).await
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
    fn meet(&mut self, ranger: Ranger<Box<dyn Line>>) {
        let serial = serial_text(ranger.identity());
        let wanted = self.control.settings.keys.device.serial.clone();
        if let Some(wanted) = wanted.filter(|wanted| *wanted != serial) {
            let why = format!(
                "the device says it is {serial}, not {wanted}; connect that one, or change \
                 device.serial"
            );
            return self.fail(Trouble::WrongDevice, why);
        }
        let identity = *ranger.identity();
        if let Some(change) = self.met.and_then(|met| BoardChange::between(&met, &identity)) {
            let detail = format!("another device than before: {change}; a new session begins");
            self.out.event(EventKind::Reconnected, detail);
            self.session = None;
        }
        self.met = Some(identity);
        self.control.identity = Some(identity);
        self.line_figures.live = Some(ranger.watch_link());
        self.ranger = Some(ranger);
        self.handle(Input::Identified);
    }

    async fn home(&mut self) {
        let Some(ranger) = &mut self.ranger else { return };
        let air = self.control.air.settled();
        let settings = self
            .control
            .settings
            .motion()
            .settings(&listening(&self.control.settings, &air), ranger.identity());
        match attended(&mut self.control, ranger.home(settings)).await {
            Err(interrupt) => {
                // The motor is turning. A device that does not hear this stops at its index.
                let _ = ranger.stop().await;
                self.react(interrupt);
            }
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(_drift)) if self.control.gpio.at_home() == Some(false) => {
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
        let due = match self.control.agenda.due(self.control.now()) {
            // Nothing is measured that can't be kept.
            Due::Now if self.out.journal.is_well() => return self.scan().await,
            Due::Now | Due::OnRequest => None,
            Due::At(at) => Some(self.control.epoch + at),
        };
        let Some(ranger) = &mut self.ranger else {
            return self.fail(Trouble::Lost, "the line is gone".into());
        };
        self.out.shared.beat();
        let wake = self.next_check.min(Instant::now() + BEAT);
        let wake = due.map_or(wake, |due| due.min(wake));
        tokio::select! {
            unasked = ranger.unasked() => self.unasked(unasked),
            interrupt = self.control.next() => self.react(interrupt),
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
            // Homing again is all that it takes.
            Unasked::Fault(FaultKind::HoldExpired) => self.handle(Input::Restarted),
            Unasked::Fault(FaultKind::EmergencyStop) => {
                self.device_stopped(&DriveError::Host(HostError::EmergencyStop));
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
        match attended(&mut self.control, ranger.check()).await {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(DriveError::Host(HostError::Rebooted))) => self.unasked(Unasked::Restarted),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(())) => {}
        }
    }

    /// The device's own emergency stop was pressed.
    fn device_stopped(&mut self, error: &DriveError) {
        self.out.event(EventKind::Fault, error.to_string());
        let why = if self.resumes() { error.help() } else { AWAITS_START };
        self.trouble = Some(format!("{error}; {why}"));
        self.machine.set_resumes(self.resumes());
        self.handle(Input::DeviceStopped);
    }

    fn device_failed(&mut self, error: &DriveError) {
        use HostError as Host;
        let trouble = match error {
            DriveError::Host(Host::EmergencyStop | Host::Refused(NakReason::EmergencyStop)) => {
                return self.device_stopped(error);
            }
            DriveError::OtherBoard(_) => {
                // Whatever it measures goes under its own name.
                self.session = None;
                Trouble::WrongDevice
            }
            DriveError::Host(Host::NoAnswer { .. } | Host::NotADevice { .. }) => {
                Trouble::NotAnswering
            }
            DriveError::Host(Host::WrongVersion { .. }) => Trouble::WrongFirmware,
            DriveError::Host(Host::Hangup) => Trouble::Lost,
            _ => Trouble::Fault,
        };
        if trouble == Trouble::NotAnswering && self.control.gpio.can_reset() {
            tracing::warn!("the device does not answer: pulling its reset line");
            crate::blocking::block_in_place(|| self.control.gpio.reset());
        }
        let contention = match trouble {
            Trouble::NotAnswering => {
                let port = self.control.settings.keys.device.port.as_deref();
                port.and_then(link::describe_contention)
            }
            _ => None,
        };
        let help = contention.unwrap_or_else(|| error.help().to_owned());
        self.fail(trouble, format!("{error}; {help}"));
    }

    /// Waits until a time or until something happens, and for no longer than a heartbeat.
    async fn wait(&mut self, until: Option<Instant>) {
        self.out.shared.beat();
        let beat = Instant::now() + BEAT;
        tokio::select! {
            () = sleep_until(until.map_or(beat, |until| until.min(beat))) => {}
            interrupt = self.control.next() => self.react(interrupt),
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
                if !pressed && !self.resumes() {
                    self.trouble = Some(AWAITS_START.to_owned());
                }
                self.machine.set_resumes(self.resumes());
                self.handle(Input::EmergencyStop(pressed));
            }
            Interrupt::PortChanged => self.handle(Input::PortChanged),
            Interrupt::Log => match self.out.journal.status().error {
                Some(error) => tracing::error!("no scan until the log can be written: {error}"),
                None => tracing::info!("the log can be written again"),
            },
            Interrupt::Start => self.handle(Input::Start),
            Interrupt::Stop | Interrupt::Agenda => {}
        }
        self.machine.set_back_off(self.control.settings.back_off());
        self.machine.set_resumes(self.resumes());
    }

    const fn resumes(&self) -> bool {
        self.control.settings.keys.safety.resume_after_emergency_stop
    }

    fn close(&mut self) {
        self.line = None;
        self.ranger = None;
        self.line_figures.close();
        self.control.identity = None;
    }

    fn check_interval(&self) -> Duration {
        Duration::from_secs_f64(self.control.settings.keys.link.check_s)
    }
}

/// Waits for something of the device, carrying out orders meanwhile; broken off only by what
/// can't wait.
async fn attended<T>(control: &mut Control, work: impl Future<Output = T>) -> Result<T, Interrupt> {
    tokio::pin!(work);
    loop {
        tokio::select! {
            done = &mut work => return Ok(done),
            interrupt = control.next() => match interrupt {
                Interrupt::Shutdown | Interrupt::EmergencyStop(_) | Interrupt::PortChanged => {
                    return Err(interrupt);
                }
                // The operator looks at the agenda and the log when the device can be used.
                Interrupt::Start | Interrupt::Stop | Interrupt::Log | Interrupt::Agenda => {}
            }
        }
    }
}
