//! The daemon: one task a resource, an explicit state machine for the link, orders at any time.
//!
//! ```text
//!  API, signals ──orders─> Control ┐                        ┌──> Journal (thread: log folder)
//!  emergency stop, thermometer ────┤   Operator (port,      ├──> Hub ──> subscribers
//!                                  └─> Ranger) ──records──> ┤
//!                      LinkMachine, Agenda: what to do      └──> Shared: status, latest scan
//! ```
//!
//! [`LinkMachine`] and [`Agenda`] are pure and decide; the operator carries out their decisions and reports the
//! outcome to them. [`prepare`] wires them, and [`Daemon::run`] returns when all are done.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod agenda;
mod air;
mod blocking;
mod control;
mod fan_out;
mod fit;
mod follower;
mod forecast;
mod hub;
mod journal;
mod judged;
mod limits;
mod machine;
mod notify;
mod operator;
mod refusal;
pub mod secret;
mod sensor;
pub mod server;
mod settings;
mod shared;
mod simulated_array;

use std::sync::Arc;

use jiff::Timestamp;
use sonard_api::{
    ClockReport, ConfigurationReport, Health, InForce, LinkState, MqttReport, RosReport,
    ScanRequest, ScanTotals, ServerReport, Setup, SimulationReport, Started, Status,
    SubscriberReport,
};
use sonard_device::host_gpio::{HostGpio, NoGpio};
use sonard_model::scene::Scene;
use sonard_records::{Event, EventKind, Record, Session};
use sonard_runtime::supervisor::{Supervisor, Task, TaskFailure};
use tokio::{
    sync::{mpsc, oneshot},
    time::Instant,
};
use uuid::Uuid;

pub use agenda::{Agenda, Asked, Due};
pub use control::{Order, Request};
pub use follower::{Audience, Follower};
pub(crate) use hub::Shelf;
pub use hub::{Attendance, Hub, Line, Moved, ScanSubscription, Subscription, Wanted};
pub use journal::{Journal, JournalThread};
pub use judged::judged_line;
pub use limits::{check_device, check_plan, check_pose, ordered_air};
pub use machine::{BackOff, Input, LinkMachine, Step, Transition};
pub use operator::OpenPort;
pub use refusal::{Refusal, RefusalKind};
pub use sensor::ordered_sensor;
pub use settings::{Mismatch, OptionalOutputs, Settings, Simulated};
pub use shared::NextScan;

use air::AirControl;
use control::Control;
use fan_out::RecordFanOut;
use operator::Operator;
use shared::{Shared, Terms, View};
use simulated_array::SimulatedArray;

/// Orders that may wait while one is carried out.
const ORDERS: usize = 64;

/// Resources that the daemon owns.
pub struct Resources {
    /// Opens the serial port.
    pub open_port: OpenPort,
    /// Pins of the computer.
    pub gpio: Box<dyn HostGpio>,
    /// The log.
    pub journal: Journal,
    /// Supervisor of the daemon's tasks.
    pub supervisor: Supervisor,
}

/// The daemon for whoever gives it orders or wants to know something: cheap to clone.
#[derive(Debug, Clone)]
pub struct Handle {
    orders: mpsc::Sender<Request>,
    shared: Arc<Shared>,
    hub: Hub,
    journal: Journal,
    supervisor: Supervisor,
}

/// The daemon's tasks, not yet running.
pub struct Daemon {
    worker: Worker,
    shared: Arc<Shared>,
    hub: Hub,
    supervisor: Supervisor,
}

/// Who has the readings: a ranger on a port, or the model.
enum Worker {
    Ranger(Box<Operator>),
    Array(Box<SimulatedArray>),
}

/// A daemon that owns `resources` and works by `settings`, and the handle to it. Must be called
/// within a multi-threaded tokio runtime.
#[must_use]
pub fn prepare(resources: Resources, settings: Settings) -> (Daemon, Handle) {
    let Resources { open_port, gpio, journal, supervisor } = resources;
    wire(gpio, journal, supervisor, settings, |control, out| {
        Worker::Ranger(Box::new(Operator::new(control, open_port, out)))
    })
}

/// The same for the array that `settings` name, played by the model: no port and no pin is opened.
#[must_use]
pub fn prepare_simulated(
    journal: Journal,
    supervisor: Supervisor,
    settings: Settings,
) -> (Daemon, Handle) {
    wire(Box::new(NoGpio), journal, supervisor, settings, |control, out| {
        Worker::Array(Box::new(SimulatedArray::new(control, out)))
    })
}

fn wire(
    gpio: Box<dyn HostGpio>,
    journal: Journal,
    supervisor: Supervisor,
    settings: Settings,
    employ: impl FnOnce(Control, RecordFanOut) -> Worker,
) -> (Daemon, Handle) {
    let (orders, requests) = mpsc::channel(ORDERS);
    let hub = Hub::new(settings.keys.server.queue as usize);
    let shared = Arc::new(Shared::new(first_view(&settings), settings.keys.fleet.robot.clone()));
    let gate = (supervisor.clone(), Arc::clone(&shared));
    let control = Control::new(settings, gpio, requests, gate, journal.clone());
    let out = RecordFanOut::new(journal.clone(), hub.clone(), Arc::clone(&shared));
    let worker = employ(control, out);
    let handle = Handle {
        orders,
        shared: Arc::clone(&shared),
        hub: hub.clone(),
        journal,
        supervisor: supervisor.clone(),
    };
    (Daemon { worker, shared, hub, supervisor }, handle)
}

impl Daemon {
    /// Runs until `stop` completes or a task fails; then the motor is stopped, the scan closed, and every live stream
    /// ended.
    ///
    /// # Errors
    /// The first failure of a task.
    pub async fn run(self, stop: impl Future<Output = ()>) -> Result<(), TaskFailure> {
        let Self { worker, shared, hub, supervisor } = self;
        let stopping = supervisor.stopping().clone();
        let notifier = supervisor.spawn(Task::Notifications, notify::run(shared, stopping.clone()));
        let device = supervisor.spawn(Task::Device, async {
            match worker {
                Worker::Ranger(operator) => operator.run().await,
                Worker::Array(array) => array.run().await,
            }
        });
        tokio::select! {
            () = stop => {}
            _failure = supervisor.failure() => {}
        }
        stopping.cancel();
        // The supervisor has their panics.
        drop(device.await);
        hub.close();
        drop(notifier.await);
        supervisor.first_failure().map_or(Ok(()), Err)
    }
}

impl Handle {
    /// Gives an order and waits for the answer.
    ///
    /// # Errors
    /// When the order is refused, or the daemon is stopping.
    pub async fn order(&self, order: Order) -> Result<(), Refusal> {
        let gone = || Refusal {
            kind: RefusalKind::Stopping,
            message: "the daemon is stopping".into(),
            help: "ask the next one".into(),
        };
        let (reply, answer) = oneshot::channel();
        self.orders.send(Request { order, reply }).await.map_err(|_| gone())?;
        answer.await.map_err(|_| gone())?
    }

    /// Takes in a request for scans, as programs make it.
    ///
    /// # Errors
    /// As [`order`](Self::order), and for a request of no scans.
    pub async fn start(&self, asked: ScanRequest) -> Result<Started, Refusal> {
        let ScanRequest { scans, plan, pose } = asked;
        if scans == Some(0) {
            return Err(Refusal {
                kind: RefusalKind::Wrong,
                message: "scans is 0".into(),
                help: "give 1 or more, or leave it out".into(),
            });
        }
        let request = Uuid::new_v4();
        self.order(Order::Start(Asked { request, scans, plan, pose })).await?;
        Ok(Started { accepted: true, request })
    }

    /// An event of now for log and live streams.
    pub fn event(&self, kind: EventKind, detail: String) {
        let record = Record::Event(Event { time: Timestamp::now(), kind, detail });
        self.journal.record(&record);
        self.hub.publish(&record);
    }

    /// Publishes where clients reach the server.
    pub fn report_server(&self, report: ServerReport) {
        self.shared.report_server(report);
    }

    /// Says how it goes with ROS 2.
    pub fn report_ros(&self, report: RosReport) {
        self.shared.report_ros(report);
    }

    /// Says how it goes with the MQTT broker.
    pub fn report_mqtt(&self, report: MqttReport) {
        self.shared.report_mqtt(report);
    }

    /// What the daemon is doing.
    #[must_use]
    pub fn status(&self) -> Status {
        self.shared.status(self.journal.status(), self.subscribers())
    }

    /// Records that are in the log since the start.
    #[must_use]
    pub fn records_written(&self) -> u64 {
        self.journal.written()
    }

    /// Whether all is well.
    #[must_use]
    pub fn health(&self) -> Health {
        self.shared.health(&self.journal.status())
    }

    /// The last scan that is over.
    #[must_use]
    pub fn latest_scan(&self) -> Option<Uuid> {
        self.shared.latest_scan()
    }

    /// The scene in force, if there is one.
    #[must_use]
    pub fn scene(&self) -> Option<Arc<Scene>> {
        self.shared.view.borrow().in_force().scene.clone()
    }

    /// What the configuration in force decides about every scan.
    #[must_use]
    pub fn setup(&self) -> InForce<Setup> {
        let now = (*self.shared.view.borrow().in_force().setup).clone();
        InForce { now, pending: self.status().pending.setup }
    }

    /// What the next scan is taken by.
    #[must_use]
    pub fn next_scan(&self) -> NextScan {
        self.shared.view.borrow().next_scan(Instant::now())
    }

    /// The session in force in the log, once there was a scan.
    #[must_use]
    pub fn session(&self) -> Option<Arc<Session>> {
        self.shared.view.borrow().session.clone()
    }

    /// Supervisor of the daemon's tasks.
    #[must_use]
    pub const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// Live records.
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

fn first_view(settings: &Settings) -> View {
    let terms = Terms {
        plan: settings.plan(),
        pose: settings.pose,
        scene: settings.scene.clone(),
        setup: Arc::new(settings.setup()),
        array: settings.simulated.as_ref().map(|simulated| Arc::clone(&simulated.array)),
        air: AirControl::new(settings.keys.air.clone()),
    };
    View {
        state: LinkState::Opening,
        since: Timestamp::now(),
        changed: Instant::now(),
        port: settings.keys.device.port.clone().unwrap_or_default(),
        trouble: None,
        failures: 0,
        retry_at: None,
        device: None,
        identity: None,
        provenance: None,
        scanning: settings.keys.scanning.clone(),
        session: None,
        paused: false,
        requested: 0,
        next_at: None,
        scan: None,
        now: terms.clone(),
        next: terms,
        configuration: ConfigurationReport::default(),
        line: shared::LinkFigures::default(),
        scans: ScanTotals::default(),
        clock: ClockReport::default(),
        // From the first look on: nobody shall take a simulation for a ranger.
        simulation: settings.simulated.as_ref().map(|one| SimulationReport::new(&one.array)),
    }
}
