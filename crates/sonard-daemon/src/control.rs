//! Takes orders: from the API, from signals, from the emergency stop, at any time.

mod orders;

use std::{sync::Arc, time::Duration};

use firmware_protocol::messages::Identity;
use sonard_api::{
    AirOrder, ConfigurationReport, SensorOrder, Setup,
    config::{Mode, ScanningKeys},
};
use sonard_device::host_gpio::HostGpio;
use sonard_model::{acoustics::Sensor, geometry::Pose};
use sonard_records::ScanPlan;
use sonard_runtime::supervisor::Supervisor;
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::{Instant, sleep},
};
use uuid::Uuid;

use super::{
    agenda::{Agenda, Asked},
    air::{AirControl, Reading, watch_thermometer},
    journal::Journal,
    refusal::Refusal,
    settings::Settings,
    shared::{Shared, Terms},
};

/// How often the emergency stop is looked at.
const STOP_CHECK: Duration = Duration::from_millis(50);

/// An order to the daemon.
#[derive(Debug)]
pub enum Order {
    /// Take scans, or go on with those of the mode.
    Start(Asked),
    /// Take no more scans of a request, and end the one under way if it is one of them.
    Cancel(Uuid),
    /// Take scans in this way from now on.
    Mode(Mode, Option<f64>),
    /// End the scan under way and take no more until the next start.
    Stop,
    /// Measure these azimuths from the next scan on.
    Plan(ScanPlan),
    /// The ranger stands here from the next scan on.
    Pose(Pose),
    /// The air is like this.
    Air(AirOrder),
    /// The air is again what the configuration and the thermometer say.
    OwnAir,
    /// The sensor is like this from the next scan on.
    Sensor(Box<SensorOrder>),
    /// The sensor is again what the configuration says.
    OwnSensor,
    /// The configuration was read again.
    Reload(Result<Box<Settings>, String>),
}

/// An order and the way for its answer.
#[derive(Debug)]
pub struct Request {
    /// The order.
    pub order: Order,
    /// Where the answer goes; a program that left needs none.
    pub reply: oneshot::Sender<Result<(), Refusal>>,
}

/// What the operator has to react to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Interrupt {
    /// The end.
    Shutdown,
    /// The emergency stop was pressed or released.
    EmergencyStop(bool),
    /// Somebody wants scans.
    Start,
    /// The scan under way is to end.
    Stop,
    /// Another port is to be used.
    PortChanged,
    /// The log began or ceased to be in trouble.
    Log,
    /// What is due may have changed.
    Agenda,
}

/// What is in force, and the ends of everything that may change it.
pub(super) struct Control {
    pub(super) settings: Settings,
    /// Those of the start, which keys marked `(restart)` still have.
    first_settings: Settings,
    /// The configuration's sensor, in whose place `settings` has one that a program wants.
    own_sensor: Sensor,
    /// What of them the configuration decides.
    pub(super) setup: Arc<Setup>,
    pub(super) plan: ScanPlan,
    pub(super) pose: Pose,
    pub(super) scanning: ScanningKeys,
    pub(super) agenda: Agenda,
    /// The request that the scan under way was asked for by.
    pub(super) serving: Option<Uuid>,
    pub(super) air: AirControl,
    pub(super) gpio: Box<dyn HostGpio>,
    pub(super) configuration: ConfigurationReport,
    pub(super) epoch: Instant,
    /// The device, for the check of plans.
    pub(super) identity: Option<Identity>,
    /// Scene or sensor changed: predictions are out of date.
    pub(super) stale: bool,
    requests: mpsc::Receiver<Request>,
    supervisor: Supervisor,
    thermometer: watch::Receiver<Option<Reading>>,
    journal: Journal,
    shared: Arc<Shared>,
    pressed: bool,
}

impl Control {
    pub(super) fn new(
        settings: Settings,
        gpio: Box<dyn HostGpio>,
        requests: mpsc::Receiver<Request>,
        (supervisor, shared): (Supervisor, Arc<Shared>),
        journal: Journal,
    ) -> Self {
        Self {
            own_sensor: settings.sensor.clone(),
            setup: Arc::new(settings.setup()),
            plan: settings.plan(),
            pose: settings.pose,
            scanning: settings.keys.scanning.clone(),
            agenda: Agenda::new(settings.keys.scanning.mode, settings.every(), Duration::ZERO),
            serving: None,
            air: AirControl::new(settings.keys.air.clone()),
            thermometer: watch_thermometer(&settings.keys.air, &supervisor),
            gpio,
            configuration: ConfigurationReport::default(),
            epoch: Instant::now(),
            identity: None,
            stale: false,
            requests,
            supervisor,
            journal,
            shared,
            pressed: false,
            first_settings: settings.clone(),
            settings,
        }
    }

    /// Time since the start, on a clock that does not jump.
    pub(super) fn now(&self) -> Duration {
        self.epoch.elapsed()
    }

    /// What the next scan is taken by.
    pub(super) fn terms(&self) -> Terms {
        let simulated = self.settings.simulated.as_ref();
        Terms {
            plan: simulated.map_or(self.plan, |simulated| simulated.array.plan(1)),
            pose: self.pose,
            scene: self.settings.scene.clone(),
            setup: Arc::clone(&self.setup),
            array: simulated.map(|simulated| Arc::clone(&simulated.array)),
            air: self.air.clone(),
        }
    }

    /// Publishes what changed for scans to come, while one may be under way.
    fn publish(&self) {
        self.shared.view.send_modify(|view| {
            view.next = self.terms();
            if self.settings.simulated.is_some() {
                // What is simulated moves at once.
                view.now = self.terms();
            }
            view.scanning = self.scanning.clone();
            (view.paused, view.requested) = (self.agenda.is_paused(), self.agenda.requested());
            view.configuration = self.configuration.clone();
        });
    }

    /// Carries out orders until one needs the operator. Cancel-safe.
    pub(super) async fn next(&mut self) -> Interrupt {
        loop {
            let watches_stop = self.gpio.emergency_stop().is_some();
            tokio::select! {
                biased;
                () = self.supervisor.stopping().cancelled() => return Interrupt::Shutdown,
                () = sleep(STOP_CHECK), if watches_stop => {
                    let pressed = self.gpio.emergency_stop() == Some(true);
                    if std::mem::replace(&mut self.pressed, pressed) != pressed {
                        return Interrupt::EmergencyStop(pressed);
                    }
                }
                Some(request) = self.requests.recv() => {
                    if let Some(interrupt) = self.carry_out(request) {
                        return interrupt;
                    }
                }
                Ok(()) = self.thermometer.changed() => {
                    let reading = self.thermometer.borrow_and_update().clone();
                    if let Some(reading) = reading {
                        self.air.read(&reading, Instant::now());
                        self.publish();
                        return Interrupt::Agenda;
                    }
                }
                () = self.journal.changed() => return Interrupt::Log,
            }
        }
    }

    fn carry_out(&mut self, Request { order, reply }: Request) -> Option<Interrupt> {
        let (answer, interrupt) = match order {
            Order::Start(asked) => {
                let answer = self.start(asked);
                let begun = if answer.is_ok() { Interrupt::Start } else { Interrupt::Agenda };
                (answer, Some(begun))
            }
            Order::Cancel(request) => self.cancel(request),
            Order::Mode(mode, every_s) => (self.set_mode(mode, every_s), Some(Interrupt::Agenda)),
            Order::Stop => {
                self.agenda.stop();
                (Ok(()), Some(Interrupt::Stop))
            }
            Order::Plan(plan) => (self.set_plan(plan), Some(Interrupt::Agenda)),
            Order::Pose(pose) => (self.set_pose(pose), Some(Interrupt::Agenda)),
            Order::Air(order) => (self.air.order(&order, Instant::now()), Some(Interrupt::Agenda)),
            Order::OwnAir => {
                self.take_own_air();
                (Ok(()), Some(Interrupt::Agenda))
            }
            Order::Sensor(order) => (self.set_sensor(&order), Some(Interrupt::Agenda)),
            Order::OwnSensor => {
                self.use_sensor(self.own_sensor.clone());
                (Ok(()), Some(Interrupt::Agenda))
            }
            Order::Reload(Ok(settings)) => (Ok(()), Some(self.reload(*settings))),
            Order::Reload(Err(error)) => {
                self.configuration.error = Some(error);
                (Ok(()), Some(Interrupt::Agenda))
            }
        };
        // Whoever asks after the answer finds what was ordered.
        self.publish();
        // A program that did not wait for its answer does not want it.
        drop(reply.send(answer));
        interrupt
    }

    /// Forgets what programs said about the air.
    fn take_own_air(&mut self) {
        self.air = AirControl::new(self.settings.keys.air.clone());
        self.thermometer = watch_thermometer(&self.settings.keys.air, &self.supervisor);
    }

    /// Takes a new configuration in: what changed in it goes before what programs said.
    fn reload(&mut self, mut settings: Settings) -> Interrupt {
        let own_sensor = std::mem::replace(&mut self.own_sensor, settings.sensor.clone());
        if own_sensor == settings.sensor && settings.goes_with(&self.settings.sensor) {
            settings.sensor = self.settings.sensor.clone();
        }
        let before = std::mem::replace(&mut self.settings, settings);
        let now = self.now();
        let (keys, then) = (&self.settings.keys, &before.keys);
        if keys.plan != then.plan {
            self.plan = self.settings.plan();
        }
        let moved = self.settings.scene.as_ref().map(|scene| &scene.sha256)
            != before.scene.as_ref().map(|scene| &scene.sha256);
        if self.settings.pose != before.pose || moved {
            self.pose = self.settings.pose;
        }
        self.stale |= moved || keys.model != then.model || self.settings.sensor != before.sensor;
        self.stale |= keys.simulate != then.simulate || self.settings.simulated != before.simulated;
        self.setup = Arc::new(self.settings.setup());
        if keys.air != then.air {
            self.air = AirControl::new(keys.air.clone());
            self.thermometer = watch_thermometer(&keys.air, &self.supervisor);
        }
        if keys.scanning != then.scanning {
            self.scanning = keys.scanning.clone();
            self.agenda.set_mode(keys.scanning.mode, self.settings.every(), now);
        }
        self.journal.set_rotation(self.settings.rotation());
        self.configuration = ConfigurationReport {
            error: None,
            needs_restart: self.settings.needs_restart(&self.first_settings),
        };
        if keys.device == then.device { Interrupt::Agenda } else { Interrupt::PortChanged }
    }
}
