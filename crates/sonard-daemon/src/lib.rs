//! The daemon: one task per resource, an explicit state machine for the link, orders at any time.
//!
//! ```text
//!  API, signals ──orders─> Control ┐                        ┌──> Journal (thread: log folder)
//!  emergency stop, thermometer ────┤   DeviceTask (port,    ├──> Hub ──> subscribers
//!                                  └─> Ranger) ──records──> ┤
//!                      LinkMachine, Schedule: decisions     └──> DaemonState: status, latest scan
//! ```
//!
//! [`LinkMachine`] and [`Schedule`] are pure and decide. The device task carries out their
//! decisions and reports the outcome to them. [`prepare`] wires the tasks, and [`Daemon::run`]
//! returns when all have ended.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod air;
mod annotate;
mod blocking;
mod broadcast;
mod control;
mod device_task;
mod fan_out;
mod fit;
mod journal;
mod limits;
mod link_state;
mod live_messages;
mod notify;
mod order_error;
mod platform;
mod prediction_cache;
mod schedule;
pub mod secret;
mod sensor;
pub mod server;
mod settings;
mod simulated_array;
mod state;

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use sonard_api::{
    ConfigurationReport, Health, InForce, LinkState, MqttReport, RosReport, ScanRequest,
    ServerReport, Setup, SimulationReport, Started, Status, SubscriberReport,
};
use sonard_device::host_gpio::{HostGpio, NoHostGpio};
use sonard_model::scene::Scene;
use sonard_records::{Event, EventKind, Record, Session};
use sonard_runtime::supervisor::{Supervisor, Task, TaskFailure};
use tokio::{
    sync::{mpsc, oneshot},
    time::Instant,
};
use uuid::Uuid;

pub use annotate::annotated_line;
pub(crate) use broadcast::Ring;
pub use broadcast::{
    ClientGuard, DeadbandFilter, Hub, ScanSubscription, StreamLine, Subscription,
    SubscriptionFilter,
};
pub use control::{Order, OrderRequest};
pub use device_task::{OpenPort, Relocate, Relocating};
pub use journal::{Journal, JournalThread};
pub use limits::{air_from_order, check_device, check_plan, check_pose};
pub use link_state::{LinkInput, LinkMachine, LinkStep, RetryBounds, Transition};
pub use live_messages::{LiveMessageSink, MessageConverter};
pub use order_error::{OrderError, OrderErrorKind};
pub use schedule::{Due, QueuedScans, Schedule};
pub use sensor::sensor_from_order;
pub use settings::{ArraySimulation, OptionalOutputs, Settings, SettingsConflict};
pub use state::NextScan;

use air::AirControl;
use control::Control;
use device_task::DeviceTask;
use fan_out::RecordFanOut;
use simulated_array::SimulatedArray;
use state::{ControlSnapshot, DaemonState, LinkSnapshot, PublishedStatus, ScanSettings};

/// Maximum number of queued orders while one is carried out.
const MAX_QUEUED_ORDERS: usize = 64;

/// Resources owned by the daemon.
pub struct Resources {
    /// Opens the serial port by its name.
    pub open_port: OpenPort,
    /// Moves a simulated device; `None` for a device that the robot carries.
    pub relocate: Option<Relocate>,
    /// GPIO pins of the host computer.
    pub gpio: Box<dyn HostGpio>,
    /// Access to the log's writer thread.
    pub journal: Journal,
    /// Supervisor of the daemon's long-lived tasks.
    pub supervisor: Supervisor,
}

/// Interface of the running daemon for its clients: orders, status, live records. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Handle {
    orders: mpsc::Sender<OrderRequest>,
    state: Arc<DaemonState>,
    hub: Hub,
    journal: Journal,
    supervisor: Supervisor,
}

/// The daemon's tasks, not yet running.
pub struct Daemon {
    worker: Worker,
    state: Arc<DaemonState>,
    hub: Hub,
    supervisor: Supervisor,
}

/// Source of the readings: a ranger on a port, or the model.
enum Worker {
    Ranger(Box<DeviceTask>),
    Array(Box<SimulatedArray>),
}

/// Creates a daemon that owns `resources` and follows `settings`, with its handle. Must be called
/// within a multi-threaded tokio runtime.
#[must_use]
pub fn prepare(resources: Resources, settings: Settings) -> (Daemon, Handle) {
    let Resources { open_port, relocate, gpio, journal, supervisor } = resources;
    wire(gpio, journal, supervisor, settings, |control, out| {
        Worker::Ranger(Box::new(DeviceTask::new(control, open_port, relocate, out)))
    })
}

/// Creates a daemon that simulates the array named by `settings` with the model, with its handle.
/// No port and no pin is opened. Must be called within a multi-threaded tokio runtime.
#[must_use]
pub fn prepare_simulated(
    journal: Journal,
    supervisor: Supervisor,
    settings: Settings,
) -> (Daemon, Handle) {
    wire(Box::new(NoHostGpio), journal, supervisor, settings, |control, out| {
        Worker::Array(Box::new(SimulatedArray::new(control, out)))
    })
}

fn wire(
    gpio: Box<dyn HostGpio>,
    journal: Journal,
    supervisor: Supervisor,
    settings: Settings,
    create_worker: impl FnOnce(Control, RecordFanOut) -> Worker,
) -> (Daemon, Handle) {
    let (orders, requests) = mpsc::channel(MAX_QUEUED_ORDERS);
    let hub = Hub::new(settings.keys.server.queue as usize);
    let state =
        Arc::new(DaemonState::new(first_status(&settings), settings.keys.fleet.robot.clone()));
    let gate = (supervisor.clone(), Arc::clone(&state));
    let control = Control::new(settings, gpio, requests, gate, journal.clone());
    let out = RecordFanOut::new(journal.clone(), hub.clone(), Arc::clone(&state));
    let worker = create_worker(control, out);
    let handle = Handle {
        orders,
        state: Arc::clone(&state),
        hub: hub.clone(),
        journal,
        supervisor: supervisor.clone(),
    };
    (Daemon { worker, state, hub, supervisor }, handle)
}

impl Daemon {
    /// Runs until `stop` completes or a task fails. Then the motor is stopped, the scan closed, and
    /// every live stream ended.
    ///
    /// # Errors
    /// The first failure of a task.
    pub async fn run(self, stop: impl Future<Output = ()>) -> Result<(), TaskFailure> {
        let Self { worker, state, hub, supervisor } = self;
        let stopping = supervisor.stopping().clone();
        let notifier = supervisor.spawn(Task::Notifications, notify::run(state, stopping.clone()));
        let device = supervisor.spawn(Task::Device, async {
            match worker {
                Worker::Ranger(task) => task.run().await,
                Worker::Array(array) => array.run().await,
            }
        });
        tokio::select! {
            () = stop => {}
            _failure = supervisor.failure() => {}
        }
        stopping.cancel();
        // The supervisor keeps the panics of its tasks.
        drop(device.await);
        hub.close();
        drop(notifier.await);
        supervisor.first_failure().map_or(Ok(()), Err)
    }
}

impl Handle {
    /// Sends an order and waits for its result.
    ///
    /// # Errors
    /// When the order is rejected, or the daemon is stopping.
    pub async fn order(&self, order: Order) -> Result<(), OrderError> {
        let gone = || {
            let help = "retry once it is running again";
            OrderError::new(OrderErrorKind::Stopping, "the daemon is stopping", help)
        };
        let (reply, answer) = oneshot::channel();
        self.orders.send(OrderRequest { order, reply }).await.map_err(|_| gone())?;
        answer.await.map_err(|_| gone())?
    }

    /// Submits an API request for scans. Returns the id of the accepted request.
    ///
    /// # Errors
    /// Those of [`order`](Self::order), and a request of zero scans.
    pub async fn start(&self, request: ScanRequest) -> Result<Started, OrderError> {
        let ScanRequest { scans, plan, pose } = request;
        if scans == Some(0) {
            let help = "set it to 1 or more, or omit it";
            return Err(OrderError::new(OrderErrorKind::Invalid, "scans is 0", help));
        }
        let request = Uuid::new_v4();
        self.order(Order::Start(QueuedScans { request, scans, plan, pose })).await?;
        Ok(Started { accepted: true, request })
    }

    /// Publishes an event with the current time to the log and the live streams.
    pub fn event(&self, kind: EventKind, detail: String) {
        let record = Record::Event(Event { time: Timestamp::now(), kind, detail });
        self.journal.record(&record);
        self.hub.publish(&record);
    }

    /// Publishes the latency timer of the port's adapter in the status, milliseconds; `None` if it
    /// has no effect.
    pub fn report_latency_timer(&self, latency_ms: Option<u32>) {
        self.state.report_latency_timer(latency_ms);
    }

    /// Publishes the server's addresses and faults in the status.
    pub fn report_server(&self, report: ServerReport) {
        self.state.report_server(report);
    }

    /// Publishes the state of the ROS 2 node in the status.
    pub fn report_ros(&self, report: RosReport) {
        self.state.report_ros(report);
    }

    /// Publishes the state of the MQTT connection in the status.
    pub fn report_mqtt(&self, report: MqttReport) {
        self.state.report_mqtt(report);
    }

    /// Current status of the daemon, as served by `GET /v1/status`.
    #[must_use]
    pub fn status(&self) -> Status {
        self.state.status(self.journal.status(), self.subscribers())
    }

    /// Number of records written to the log since the start.
    #[must_use]
    pub fn records_written(&self) -> u64 {
        self.journal.written()
    }

    /// Waits until the records published so far are in the log, or can't be written; for at most
    /// `timeout`.
    pub async fn flush_log(&self, timeout: Duration) {
        self.journal.flush(timeout).await;
    }

    /// Current health of the daemon, with the reasons of a problem.
    #[must_use]
    pub fn health(&self) -> Health {
        self.state.health(&self.journal.status())
    }

    /// Id of the last scan that has ended.
    #[must_use]
    pub fn latest_scan(&self) -> Option<Uuid> {
        self.state.latest_scan()
    }

    /// Current scene, if there is one.
    #[must_use]
    pub fn scene(&self) -> Option<Arc<Scene>> {
        self.state.published().current().scene.clone()
    }

    /// Current setup of scans by the configuration, and the pending one of the next scan.
    #[must_use]
    pub fn setup(&self) -> InForce<Setup> {
        let now = (*self.state.published().current().setup).clone();
        InForce { now, pending: self.status().pending.setup }
    }

    /// Settings of the next scan.
    #[must_use]
    pub fn next_scan(&self) -> NextScan {
        self.state.published().next_scan(Instant::now())
    }

    /// Current session of the log, once there was a scan.
    #[must_use]
    pub fn session(&self) -> Option<Arc<Session>> {
        self.state.published().session.clone()
    }

    /// Supervisor of the daemon's long-lived tasks.
    #[must_use]
    pub const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// Broadcast of live records.
    #[must_use]
    pub const fn hub(&self) -> &Hub {
        &self.hub
    }

    fn subscribers(&self) -> SubscriberReport {
        SubscriberReport {
            now: self.hub.subscribers(),
            dropped_readings: self.hub.dropped(),
            cut_off: self.hub.cut_off(),
        }
    }
}

fn first_status(settings: &Settings) -> PublishedStatus {
    let scan_settings = ScanSettings {
        plan: settings.plan(),
        pose: settings.pose,
        scene: settings.scene.clone(),
        setup: Arc::new(settings.setup()),
        array: settings.simulated.as_ref().map(|simulated| Arc::clone(&simulated.array)),
        air: AirControl::new(settings.keys.air.clone()),
    };
    let port = settings.keys.device.port.clone().unwrap_or_default();
    let link = LinkSnapshot::new(LinkState::Opening, port);
    let control = ControlSnapshot {
        next: scan_settings,
        scanning: settings.keys.scanning.clone(),
        paused: false,
        requested: 0,
        configuration: ConfigurationReport::default(),
    };
    // Reported from the first status on: a simulation must never be mistaken for a ranger.
    let simulation = settings.simulated.as_ref();
    let simulation = simulation.map(|simulated| SimulationReport::new(&simulated.array));
    PublishedStatus::new(link, control, simulation)
}
