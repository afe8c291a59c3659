//! Orders and interrupts from the API, signals, the emergency stop, the thermometer and the log.

mod orders;

use std::{sync::Arc, time::Duration};

use firmware_protocol::messages::Identity;
use sonard_api::{
    AirOrder, ConfigurationReport, SensorOrder, SettingsOrder, Setup,
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
    air::{AirControl, Reading, watch_thermometer},
    journal::Journal,
    order_error::OrderError,
    schedule::{Due, QueuedScans, Schedule},
    settings::Settings,
    state::{ControlSnapshot, DaemonState, ScanSettings, StateEvent},
};

/// Polling interval of the emergency stop.
const STOP_CHECK: Duration = Duration::from_millis(50);

/// An order to the daemon.
#[derive(Debug)]
pub enum Order {
    /// Take scans, or resume those of the mode.
    Start(QueuedScans),
    /// Cancel a request, and end the running scan if it belongs to the request.
    Cancel(Uuid),
    /// Change the mode, and the interval in seconds of the schedule mode.
    Mode(Mode, Option<f64>),
    /// End the running scan and take no more until the next start.
    Stop,
    /// Measure these azimuths from the next scan on.
    Plan(ScanPlan),
    /// Use this pose of the ranger from the next scan on.
    Pose(Pose),
    /// Use this air until the next change by any source.
    Air(AirOrder),
    /// Use the air of the configuration and the thermometer again.
    ResetAir,
    /// Use these settings from the next scan on: all of them, or none if one is rejected.
    Settings(Box<SettingsOrder>),
    /// Use this sensor from the next scan on.
    Sensor(Box<SensorOrder>),
    /// Use the sensor of the configuration again.
    ResetSensor,
    /// Apply the reloaded configuration, or report the error of the reload.
    Reload(Result<Box<Settings>, String>),
}

/// An order with the channel of its result.
#[derive(Debug)]
pub struct OrderRequest {
    /// The order to carry out.
    pub order: Order,
    /// Channel of the result; a closed one is ignored.
    pub reply: oneshot::Sender<Result<(), OrderError>>,
}

/// Event that the device task has to handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Interrupt {
    /// The daemon is stopping.
    Shutdown,
    /// The emergency stop was pressed or released.
    EmergencyStop(bool),
    /// A start was requested.
    Start,
    /// The running scan has to end.
    Stop,
    /// The configured port changed.
    PortChanged,
    /// The log began to fail, or can be written again.
    Log,
    /// The next due scan may have changed.
    ScheduleChanged,
}

/// Current settings, and the receivers of everything that changes them.
pub(super) struct Control {
    pub(super) settings: Settings,
    /// Settings at the start, current for keys marked `(restart)`.
    first_settings: Settings,
    /// Sensor of the configuration; an order may have replaced the one in `settings`.
    configured_sensor: Sensor,
    /// Setup of scans, derived from `settings`.
    pub(super) setup: Arc<Setup>,
    pub(super) plan: ScanPlan,
    pub(super) pose: Pose,
    pub(super) scanning: ScanningKeys,
    pub(super) schedule: Schedule,
    /// Request of the running scan.
    pub(super) serving: Option<Uuid>,
    pub(super) air: AirControl,
    pub(super) gpio: Box<dyn HostGpio>,
    pub(super) configuration: ConfigurationReport,
    pub(super) epoch: Instant,
    /// Connected device, for the check of plans.
    pub(super) identity: Option<Identity>,
    /// Predictions are outdated: scene, model or sensor changed.
    pub(super) stale: bool,
    requests: mpsc::Receiver<OrderRequest>,
    supervisor: Supervisor,
    thermometer: watch::Receiver<Option<Reading>>,
    journal: Journal,
    state: Arc<DaemonState>,
    pressed: bool,
}

impl Control {
    pub(super) fn new(
        settings: Settings,
        gpio: Box<dyn HostGpio>,
        requests: mpsc::Receiver<OrderRequest>,
        (supervisor, state): (Supervisor, Arc<DaemonState>),
        journal: Journal,
    ) -> Self {
        Self {
            configured_sensor: settings.sensor.clone(),
            setup: Arc::new(settings.setup()),
            plan: settings.plan(),
            pose: settings.pose,
            scanning: settings.keys.scanning.clone(),
            schedule: Schedule::new(settings.keys.scanning.mode, settings.every(), Duration::ZERO),
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
            state,
            pressed: false,
            first_settings: settings.clone(),
            settings,
        }
    }

    /// Time since the start, on the monotonic clock.
    pub(super) fn now(&self) -> Duration {
        self.epoch.elapsed()
    }

    /// Settings of the next scan.
    pub(super) fn scan_settings(&self) -> ScanSettings {
        let simulated = self.settings.simulated.as_ref();
        ScanSettings {
            plan: simulated.map_or(self.plan, |simulated| simulated.array.plan(1)),
            pose: self.pose,
            scene: self.settings.scene.clone(),
            setup: Arc::clone(&self.setup),
            array: simulated.map(|simulated| Arc::clone(&simulated.array)),
            air: self.air.clone(),
        }
    }

    /// Publishes the settings of the next scan, also during a scan.
    fn publish(&self) {
        // A simulated robot moves immediately.
        let in_force = self.settings.simulated.as_ref().map(|_| StateEvent::SettingsInForce);
        self.state.apply([self.snapshot()].into_iter().chain(in_force));
    }

    /// Settings of the next scan, schedule and configuration, as an event.
    pub(super) fn snapshot(&self) -> StateEvent {
        StateEvent::Control(Box::new(ControlSnapshot {
            next: self.scan_settings(),
            scanning: self.scanning.clone(),
            paused: self.schedule.is_paused(),
            requested: self.schedule.requested(),
            configuration: self.configuration.clone(),
        }))
    }

    /// Time of the next scheduled scan, as an event.
    pub(super) fn next_scan_at(&self) -> StateEvent {
        StateEvent::NextScanAt(match self.schedule.due(self.now()) {
            Due::At(at) => Some(self.epoch + at),
            Due::Now | Due::OnRequest => None,
        })
    }

    /// Carries out orders until an interrupt for the device task. Cancel-safe.
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
                        self.air.update(&reading, Instant::now());
                        self.publish();
                        return Interrupt::ScheduleChanged;
                    }
                }
                () = self.journal.changed() => return Interrupt::Log,
            }
        }
    }

    fn carry_out(&mut self, OrderRequest { order, reply }: OrderRequest) -> Option<Interrupt> {
        let (result, interrupt) = match order {
            Order::Start(request) => {
                let result = self.start(request);
                let interrupt =
                    if result.is_ok() { Interrupt::Start } else { Interrupt::ScheduleChanged };
                (result, Some(interrupt))
            }
            Order::Cancel(request) => self.cancel(request),
            Order::Mode(mode, every_s) => {
                (self.set_mode(mode, every_s), Some(Interrupt::ScheduleChanged))
            }
            Order::Stop => {
                self.schedule.stop();
                (Ok(()), Some(Interrupt::Stop))
            }
            Order::Plan(plan) => (self.set_plan(plan), Some(Interrupt::ScheduleChanged)),
            Order::Pose(pose) => (self.set_pose(pose), Some(Interrupt::ScheduleChanged)),
            Order::Air(order) => {
                (self.air.order(&order, Instant::now()), Some(Interrupt::ScheduleChanged))
            }
            Order::ResetAir => {
                self.reset_air();
                (Ok(()), Some(Interrupt::ScheduleChanged))
            }
            Order::Sensor(order) => (self.set_sensor(&order), Some(Interrupt::ScheduleChanged)),
            Order::Settings(order) => (self.set_settings(*order), Some(Interrupt::ScheduleChanged)),
            Order::ResetSensor => {
                self.use_sensor(self.configured_sensor.clone());
                (Ok(()), Some(Interrupt::ScheduleChanged))
            }
            Order::Reload(Ok(settings)) => (Ok(()), Some(self.reload(*settings))),
            Order::Reload(Err(error)) => {
                self.configuration.error = Some(error);
                (Ok(()), Some(Interrupt::ScheduleChanged))
            }
        };
        // A status requested after the reply must contain the change.
        self.publish();
        // The client may have disconnected.
        drop(reply.send(result));
        interrupt
    }

    /// Discards the air set by orders.
    fn reset_air(&mut self) {
        self.air = AirControl::new(self.settings.keys.air.clone());
        self.thermometer = watch_thermometer(&self.settings.keys.air, &self.supervisor);
    }

    /// Applies a new configuration. Its changes override earlier orders.
    fn reload(&mut self, mut settings: Settings) -> Interrupt {
        let configured = std::mem::replace(&mut self.configured_sensor, settings.sensor.clone());
        if configured == settings.sensor && settings.is_valid_with(&self.settings.sensor) {
            settings.sensor = self.settings.sensor.clone();
        }
        let before = std::mem::replace(&mut self.settings, settings);
        let now = self.now();
        let (keys, then) = (&self.settings.keys, &before.keys);
        if keys.plan != then.plan {
            self.plan = self.settings.plan();
        }
        let scene_changed = self.settings.scene.as_ref().map(|scene| &scene.sha256)
            != before.scene.as_ref().map(|scene| &scene.sha256);
        if self.settings.pose != before.pose || scene_changed {
            self.pose = self.settings.pose;
        }
        self.stale |=
            scene_changed || keys.model != then.model || self.settings.sensor != before.sensor;
        self.stale |= keys.simulate != then.simulate || self.settings.simulated != before.simulated;
        self.setup = Arc::new(self.settings.setup());
        if keys.air != then.air {
            self.air = AirControl::new(keys.air.clone());
            self.thermometer = watch_thermometer(&keys.air, &self.supervisor);
        }
        if keys.scanning != then.scanning {
            self.scanning = keys.scanning.clone();
            self.schedule.set_mode(keys.scanning.mode, self.settings.every(), now);
        }
        self.journal.set_rotation(self.settings.rotation());
        self.configuration = ConfigurationReport {
            error: None,
            needs_restart: self.settings.needs_restart(&self.first_settings),
        };
        if keys.device == then.device { Interrupt::ScheduleChanged } else { Interrupt::PortChanged }
    }
}
