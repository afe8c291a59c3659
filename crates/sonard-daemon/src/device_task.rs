//! Device task: owns the port and the ranger, and carries out the steps of the link's state
//! machine.

mod publish;
mod scan;

use std::{pin::Pin, sync::Arc, time::Duration};

use firmware_protocol::{
    host::{BoardChange, HostError},
    messages::{FaultKind, Identity, NakReason},
};
use sonard_api::{ScanTotals, Trouble};
use sonard_device::{
    link::{self, Line, LinkError},
    ranger::{DeviceEvent, DriveError, Driver, Ranger, serial_text},
};
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_records::{EventKind, Session};
use tokio::time::{Instant, sleep_until};

use super::{
    control::{Control, Interrupt},
    fan_out::RecordFanOut,
    link_state::{LinkInput, LinkMachine, LinkStep},
    prediction_cache::{PredictionCache, listening},
    schedule::Due,
    state::LinkFigures,
};

/// Message after an emergency stop that requires a manual start.
const AWAITS_START: &str = "there was an emergency stop: nothing moves until POST /v1/start, or a \
restart of the daemon";
/// Failure of a step that needs an open port.
const LINE_CLOSED: &str = "the port is not open any more";
/// Heartbeat interval while the task is waiting.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// Function that opens the serial port with the given name.
pub type OpenPort = Box<dyn FnMut(&str) -> Result<Box<dyn Line>, LinkError> + Send>;

/// Function that moves a simulated device to the scene and pose of the next scan. The future can be
/// dropped; a failure ends the scan with its message.
pub type Relocate = Box<dyn FnMut(Arc<Scene>, Pose) -> Relocating + Send>;

/// Move of a simulated device.
pub type Relocating = Pin<Box<dyn Future<Output = Result<(), String>> + Send>>;

pub(super) struct DeviceTask {
    control: Control,
    machine: LinkMachine,
    open_port: OpenPort,
    relocate: Option<Relocate>,
    ranger: Option<Ranger<Box<dyn Line>>>,
    line: Option<Box<dyn Line>>,
    predictions: PredictionCache,
    /// Last device identified, on this connection or an earlier one.
    last_identity: Option<Identity>,
    /// Current session record of the log.
    session: Option<Session>,
    out: RecordFanOut,
    trouble: Option<String>,
    line_figures: LinkFigures,
    scans: ScanTotals,
    next_check: Instant,
}

impl DeviceTask {
    pub(super) fn new(
        control: Control,
        open_port: OpenPort,
        relocate: Option<Relocate>,
        out: RecordFanOut,
    ) -> Self {
        let machine = LinkMachine::new(control.settings.retry_bounds(), control.now());
        Self {
            control,
            machine,
            open_port,
            relocate,
            ranger: None,
            line: None,
            predictions: PredictionCache::default(),
            last_identity: None,
            session: None,
            out,
            trouble: None,
            line_figures: LinkFigures::default(),
            scans: ScanTotals::default(),
            next_check: Instant::now(),
        }
    }

    /// Runs until the state machine reaches its end.
    pub(super) async fn run(mut self) {
        loop {
            let step = self.machine.poll(self.control.now());
            self.publish_status();
            match step {
                LinkStep::Open => self.open(),
                LinkStep::Identify => self.identify().await,
                LinkStep::Home => self.home().await,
                LinkStep::Serve => self.serve().await,
                LinkStep::Wait(until) => {
                    self.close();
                    self.wait(Some(self.control.epoch + until)).await;
                }
                LinkStep::Rest => {
                    self.close();
                    self.control.gpio.set_power(false);
                    self.wait(None).await;
                }
                LinkStep::End => break,
            }
        }
        self.close();
        self.control.gpio.set_light(false);
        self.control.gpio.set_power(false);
    }

    fn handle(&mut self, input: LinkInput) {
        self.out.state.beat();
        self.machine.handle(self.control.now(), input);
    }

    fn fail(&mut self, trouble: Trouble, why: String) {
        tracing::debug!("{why}");
        self.trouble = Some(why);
        self.handle(LinkInput::Failed(trouble));
    }

    fn open(&mut self) {
        self.close();
        self.control.gpio.set_power(true);
        let port = self.control.settings.keys.device.port.clone().unwrap_or_default();
        match (self.open_port)(&port) {
            Ok(line) => {
                self.line = Some(line);
                self.handle(LinkInput::Opened);
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
                    // A port that is being unplugged returns various I/O errors.
                    LinkError::NotListed { .. } | LinkError::Io { .. } => Trouble::Lost,
                };
                self.fail(trouble, format!("{error}; {}", error.help()));
            }
        }
    }

    async fn identify(&mut self) {
        let attempts = self.control.settings.keys.link.attempts;
        let identified = match (self.line.take(), self.ranger.take()) {
            (Some(line), _) => {
                let driver = Driver::new(line, link::host_config(attempts));
                with_orders(&mut self.control, Ranger::identify(driver)).await
            }
            (None, Some(mut ranger)) => {
                let again = async {
                    ranger.reidentify().await?;
                    Ok(ranger)
                };
                with_orders(&mut self.control, again).await
            }
            (None, None) => return self.fail(Trouble::Lost, LINE_CLOSED.into()),
        };
        match identified {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(ranger)) => self.accept(ranger),
        }
    }

    /// Accepts the device if its serial number matches `device.serial`; a different board than
    /// before starts a new session.
    fn accept(&mut self, ranger: Ranger<Box<dyn Line>>) {
        let serial = serial_text(ranger.identity());
        let expected = self.control.settings.keys.device.serial.clone();
        if let Some(expected) = expected.filter(|expected| *expected != serial) {
            let why = format!(
                "the connected device has serial number {serial}, expected {expected}; connect \
    {expected}, or change device.serial"
            );
            return self.fail(Trouble::WrongDevice, why);
        }
        let identity = *ranger.identity();
        if let Some(change) =
            self.last_identity.and_then(|last| BoardChange::between(&last, &identity))
        {
            let detail = format!("the device was replaced: {change}; a new session begins");
            self.out.event(EventKind::Reconnected, detail);
            self.session = None;
        }
        self.last_identity = Some(identity);
        self.control.identity = Some(identity);
        self.line_figures.live = Some(ranger.subscribe_link_stats());
        self.ranger = Some(ranger);
        self.handle(LinkInput::Identified);
    }

    async fn home(&mut self) {
        let Some(ranger) = &mut self.ranger else { return };
        let air = self.control.air.settled();
        let settings = self
            .control
            .settings
            .motion()
            .settings(&listening(&self.control.settings, &air), ranger.identity());
        match with_orders(&mut self.control, ranger.home(settings)).await {
            Err(interrupt) => {
                // The motor is turning. A device that misses this request stops at its index.
                let _ = ranger.stop().await;
                self.react(interrupt);
            }
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(_drift)) if self.control.gpio.at_home() == Some(false) => {
                let why =
                    "the device reports the home position, but the home switch is open".into();
                self.fail(Trouble::Fault, why);
            }
            Ok(Ok(_drift)) => {
                self.next_check = Instant::now() + self.check_interval();
                self.handle(LinkInput::Homed);
            }
        }
    }

    /// Takes a scan if one is due; otherwise waits for device events, orders or the next due time.
    async fn serve(&mut self) {
        let due = match self.control.schedule.due(self.control.now()) {
            // No scan starts unless its readings can be logged.
            Due::Now if self.out.journal.is_writable() => return self.scan().await,
            Due::Now | Due::OnRequest => None,
            Due::At(at) => Some(self.control.epoch + at),
        };
        let Some(ranger) = &mut self.ranger else {
            return self.fail(Trouble::Lost, LINE_CLOSED.into());
        };
        self.out.state.beat();
        let wake = self.next_check.min(Instant::now() + HEARTBEAT);
        let wake = due.map_or(wake, |due| due.min(wake));
        tokio::select! {
            event = ranger.next_event() => self.handle_device_event(event),
            interrupt = self.control.next() => self.react(interrupt),
            () = sleep_until(wake) => self.check_if_due().await,
        }
    }

    fn handle_device_event(&mut self, event: DeviceEvent) {
        match event {
            DeviceEvent::Hangup => {
                self.fail(Trouble::Lost, "the port was closed: check the cable".into());
            }
            DeviceEvent::Restarted => {
                let detail = "the device restarted while idle: homing again".to_owned();
                self.out.event(EventKind::Reboot, detail);
                self.handle(LinkInput::Restarted);
            }
            // Homing clears an expired hold.
            DeviceEvent::Fault(FaultKind::HoldExpired) => self.handle(LinkInput::Restarted),
            DeviceEvent::Fault(FaultKind::EmergencyStop) => {
                self.handle_device_stop(&DriveError::Host(HostError::EmergencyStop));
            }
            DeviceEvent::Fault(kind) => {
                self.fail(Trouble::Fault, format!("the device stopped: {kind}"));
            }
        }
    }

    async fn check_if_due(&mut self) {
        if Instant::now() < self.next_check {
            return;
        }
        self.next_check = Instant::now() + self.check_interval();
        self.out.state.beat();
        let Some(ranger) = &mut self.ranger else { return };
        match with_orders(&mut self.control, ranger.poll_status()).await {
            Err(interrupt) => self.react(interrupt),
            Ok(Err(DriveError::Host(HostError::Rebooted))) => {
                self.handle_device_event(DeviceEvent::Restarted);
            }
            Ok(Err(error)) => self.device_failed(&error),
            Ok(Ok(())) => {}
        }
    }

    /// Handles a press of the device's own emergency stop.
    fn handle_device_stop(&mut self, error: &DriveError) {
        self.out.event(EventKind::Fault, error.to_string());
        let why = if self.resumes() { error.help() } else { AWAITS_START };
        self.trouble = Some(format!("{error}; {why}"));
        self.machine.set_resumes(self.resumes());
        self.handle(LinkInput::DeviceStopped);
    }

    fn device_failed(&mut self, error: &DriveError) {
        use HostError as Host;
        let trouble = match error {
            DriveError::Host(Host::EmergencyStop | Host::Rejected(NakReason::EmergencyStop)) => {
                return self.handle_device_stop(error);
            }
            DriveError::OtherBoard(_) => {
                // Readings of another board belong to a session of their own.
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
            tracing::warn!("the device does not answer: resetting it by its reset line");
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

    /// Waits until a time or an interrupt, for at most a heartbeat interval.
    async fn wait(&mut self, until: Option<Instant>) {
        self.out.state.beat();
        let heartbeat = Instant::now() + HEARTBEAT;
        tokio::select! {
        () = sleep_until(until.map_or(heartbeat, |until| until.min(heartbeat))) => {}
                interrupt = self.control.next() => self.react(interrupt),
            }
    }

    fn react(&mut self, interrupt: Interrupt) {
        match interrupt {
            Interrupt::Shutdown => self.handle(LinkInput::Shutdown),
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
                self.handle(LinkInput::EmergencyStop(pressed));
            }
            Interrupt::PortChanged => self.handle(LinkInput::PortChanged),
            Interrupt::Log => match self.out.journal.status().error {
                Some(error) => {
                    tracing::error!("scanning is paused: the log can't be written: {error}");
                }
                None => tracing::info!("the log can be written again"),
            },
            Interrupt::Start => self.handle(LinkInput::Start),
            Interrupt::Stop | Interrupt::ScheduleChanged => {}
        }
        self.machine.set_retry_bounds(self.control.settings.retry_bounds());
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
        Duration::from_secs_f64(self.control.settings.keys.link.status_interval_s)
    }
}

/// Runs `work` on the device while orders are carried out. Returns early only with a shutdown, an
/// emergency stop or a change of port.
async fn with_orders<T>(
    control: &mut Control,
    work: impl Future<Output = T>,
) -> Result<T, Interrupt> {
    tokio::pin!(work);
    loop {
        tokio::select! {
            done = &mut work => return Ok(done),
            interrupt = control.next() => match interrupt {
                Interrupt::Shutdown | Interrupt::EmergencyStop(_) | Interrupt::PortChanged => {
                    return Err(interrupt);
                }
                // Schedule and log are examined once the device is ready.
                Interrupt::Start | Interrupt::Stop | Interrupt::Log | Interrupt::ScheduleChanged => {}
            }
        }
    }
}
