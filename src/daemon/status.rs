//! What the daemon tells about itself.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicU32, AtomicU64, Ordering},
};

use firmware_protocol::host::LinkStats;
use jiff::Timestamp;
use schemars::JsonSchema;
use serde::Serialize;
use tokio::{sync::watch, time::Instant};
use uuid::Uuid;

use super::{
    air::{AirDesk, AirStatus},
    journal::LogStatus,
    machine::LinkState,
    settings::Setup,
    simulation::SimulationReport,
};
use crate::{
    config::{Mode, ScanningKeys},
    geometry::Pose,
    scan::{
        Device, Event, Ping, Provenance, Record, ScanEnd, ScanPlan, ScanStart, SceneRef, Session,
    },
    scene::Scene,
};

/// What the daemon is doing.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Status {
    /// Version of the program.
    pub sonard: String,
    /// How long it runs, seconds.
    pub uptime_s: f64,
    /// The link to the device.
    pub link: LinkReport,
    /// The device, once it told its identity on this connection.
    pub device: Option<Device>,
    /// Whether readings come from hardware.
    pub provenance: Option<Provenance>,
    /// When scans are taken.
    pub scanning: ScanningReport,
    /// The scan under way.
    pub scan: Option<ScanProgress>,
    /// Azimuths in force: of the daemon's own scan that is under way, else of the next.
    pub plan: ScanPlan,
    /// Where the ranger stands, likewise.
    pub pose: Pose,
    /// The scene that readings are predicted in, if there is one, likewise.
    pub scene: Option<SceneRef>,
    /// The air, likewise.
    pub air: AirStatus,
    /// What was changed since the scan under way began: it counts from the next one on.
    pub pending: Pending,
    /// The log.
    pub log: LogStatus,
    /// Clients of live streams.
    pub subscribers: SubscriberReport,
    /// What became of the last change of the configuration.
    pub configuration: ConfigurationReport,
    /// The array that the model plays, where nothing is measured.
    pub simulation: Option<SimulationReport>,
}

/// What counts from the next scan on, where that differs from what the one under way is taken by.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Pending {
    /// Other azimuths.
    pub plan: Option<ScanPlan>,
    /// Another place.
    pub pose: Option<Pose>,
    /// Another scene.
    pub scene: Option<SceneRef>,
    /// Other air.
    pub air: Option<AirStatus>,
    /// Another sensor, model or motion.
    pub setup: Option<Setup>,
}

/// What is in force, and what is to be.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct InForce<T> {
    /// In force: for the daemon's own scan that is under way, else for the next.
    #[serde(flatten)]
    pub now: T,
    /// What counts from the next scan on, if that is something else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pending: Option<T>,
}

/// The link to the device.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LinkReport {
    /// What it is doing or suffering.
    pub state: LinkState,
    /// Since when, by the wall clock.
    pub since: Timestamp,
    /// The port, as configured.
    pub port: String,
    /// What went wrong last and what to do, while the device can't be used.
    pub trouble: Option<String>,
    /// Failures since the device was last in proper use.
    pub failures: u32,
    /// Until the next try, seconds.
    pub retry_in_s: Option<f64>,
}

/// When scans are taken.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScanningReport {
    /// The mode.
    pub mode: Mode,
    /// From the start of a scan to the start of the next, seconds, when the mode is schedule.
    pub every_s: f64,
    /// Whether scans that nobody asked for are held since a stop, until a start without a number;
    /// a change of the mode does not end that. Scans that are asked for are taken all the same, so
    /// a stop in on-request mode, which takes no others, holds nothing.
    pub paused: bool,
    /// Scans asked for and not yet begun.
    pub requested: u32,
    /// Until the next scan, seconds, if that is known.
    pub next_in_s: Option<f64>,
}

/// How far a scan is.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScanProgress {
    /// The scan.
    pub scan: Uuid,
    /// Beams of the plan.
    pub beams: u32,
    /// Beams that are in.
    pub done: u32,
}

/// Clients of live streams.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SubscriberReport {
    /// At the moment.
    pub now: usize,
    /// Readings that slow ones missed.
    pub dropped_readings: u64,
    /// Clients that were cut off because they took nothing.
    pub cut_off: u64,
}

/// What became of the last change of the configuration.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ConfigurationReport {
    /// Why it was refused, if it was; what was in force before is in force still.
    pub error: Option<String>,
    /// Keys whose change waits for the next start.
    pub needs_restart: Vec<String>,
}

/// Whether all is well, with the figures to judge by.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Health {
    /// Whether the device can be used, the log written, and the temperature is fresh.
    pub healthy: bool,
    /// Why not.
    pub reasons: Vec<String>,
    /// The serial line, since the start.
    pub line: LineTotals,
    /// Scans since the start.
    pub scans: ScanTotals,
    /// The device's clock in the last scan.
    pub clock: ClockReport,
}

/// Figures of the serial line since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LineTotals {
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// Frames received whose checksum was right.
    pub frames_received: u64,
    /// Frames whose checksum was wrong.
    pub crc_errors: u64,
    /// Frames that were damaged otherwise.
    pub framing_errors: u64,
    /// Requests sent again.
    pub retries: u64,
    /// Readings that were lost at first and fetched again.
    pub repaired: u64,
    /// Readings and answers that made no sense.
    pub refused: u64,
    /// Times that the device was lost from use.
    pub losses: u64,
}

/// Figures of the scans since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ScanTotals {
    /// Every beam was measured.
    pub completed: u64,
    /// Stopped on request.
    pub stopped: u64,
    /// Given up.
    pub failed: u64,
    /// Beams measured.
    pub beams: u64,
    /// Beams that scans lacked at their end.
    pub missing: u64,
    /// Restarts of the device that scans survived.
    pub restarts: u64,
}

/// The device's clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct ClockReport {
    /// Deviation from its nominal rate, parts in a million.
    pub drift_ppm: Option<f64>,
    /// Standard deviation of the times in records, microseconds.
    pub sigma_us: Option<f64>,
    /// Times that the computer's wall clock was set.
    pub steps: u64,
}

/// One scan, whole. The daemon does not keep it: its log does.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScanReport {
    /// How it began.
    pub start: ScanStart,
    /// Its readings.
    pub pings: Vec<Ping>,
    /// What happened meanwhile.
    pub events: Vec<Event>,
    /// How it ended.
    pub end: Option<ScanEnd>,
}

/// What the operator publishes; ages and waits are computed when somebody asks.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub(super) state: LinkState,
    pub(super) since: Timestamp,
    pub(super) port: String,
    pub(super) trouble: Option<String>,
    pub(super) failures: u32,
    pub(super) retry_at: Option<Instant>,
    pub(super) device: Option<Device>,
    pub(super) provenance: Option<Provenance>,
    pub(super) scanning: ScanningKeys,
    pub(super) session: Option<Arc<Session>>,
    pub(super) paused: bool,
    pub(super) requested: u32,
    pub(super) next_at: Option<Instant>,
    pub(super) scan: Option<(Uuid, u32)>,
    /// What the scan under way is taken by, unless it was asked for otherwise.
    pub(super) now: Terms,
    /// What the next one will be taken by.
    pub(super) next: Terms,
    pub(super) configuration: ConfigurationReport,
    pub(super) line: Line,
    pub(super) scans: ScanTotals,
    pub(super) clock: ClockReport,
    pub(super) simulation: Option<SimulationReport>,
}

/// What scans are taken by.
#[derive(Debug, Clone)]
pub(super) struct Terms {
    pub(super) plan: ScanPlan,
    pub(super) pose: Pose,
    pub(super) scene: Option<Arc<Scene>>,
    pub(super) setup: Arc<Setup>,
    pub(super) air: AirDesk,
}

impl Terms {
    /// Whether a scan by these is one by others, but for the air, which may change at any time.
    pub(super) fn measures_as(&self, other: &Self) -> bool {
        let scene = |terms: &Self| terms.scene.as_ref().map(Arc::as_ptr);
        (self.plan, self.pose, scene(self)) == (other.plan, other.pose, scene(other))
            && Arc::ptr_eq(&self.setup, &other.setup)
    }
}

impl View {
    /// What is in force. Without a scan under way that is what the next one will be taken by.
    pub(super) const fn in_force(&self) -> &Terms {
        if self.scan.is_some() { &self.now } else { &self.next }
    }

    /// What differs from it in the next scan.
    fn pending(&self, at: Instant) -> Pending {
        let (now, next) = (self.in_force(), &self.next);
        let hash = |terms: &Terms| terms.scene.as_ref().map(|scene| scene.sha256.clone());
        let scene = next.scene.as_deref().filter(|_| hash(now) != hash(next));
        Pending {
            plan: Some(next.plan).filter(|plan| *plan != now.plan),
            pose: Some(next.pose).filter(|pose| *pose != now.pose),
            scene: scene.map(SceneRef::of),
            air: next.air.differs(&now.air).then(|| next.air.status(at)),
            setup: Some(&next.setup).filter(|setup| **setup != now.setup).map(|s| (**s).clone()),
        }
    }
}

/// Figures of the line: what is settled, and the connection that there is.
#[derive(Debug, Clone, Default)]
pub(super) struct Line {
    /// Connections before this one, and losses.
    pub(super) earlier: LineTotals,
    /// This one's, which go on changing.
    pub(super) live: Option<watch::Receiver<LinkStats>>,
}

impl Line {
    /// All together, now.
    pub(super) fn totals(&self) -> LineTotals {
        self.live.as_ref().map_or(self.earlier, |live| self.earlier.with(&live.borrow()))
    }

    /// The connection is over.
    pub(super) fn close(&mut self) {
        *self = Self { earlier: self.totals(), live: None };
    }
}

/// State that several tasks look at.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) started: Instant,
    pub(super) view: watch::Sender<View>,
    /// Counts whatever shows that the operator gets on; the watchdog looks at it.
    beats: AtomicU64,
    beams_done: AtomicU32,
    scans: Mutex<Collector>,
}

/// What is remembered of scans. Their readings are in the log.
#[derive(Debug, Default)]
struct Collector {
    current: Option<Uuid>,
    /// How the last one ended, and the standard deviation of its last reading's time, microseconds.
    latest: Option<(ScanEnd, Option<f64>)>,
    sigma_us: Option<f64>,
}

impl Shared {
    pub(super) fn new(view: View) -> Self {
        Self {
            started: Instant::now(),
            view: watch::Sender::new(view),
            beats: AtomicU64::new(0),
            beams_done: AtomicU32::new(0),
            scans: Mutex::default(),
        }
    }

    /// Something went on.
    pub(super) fn beat(&self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn beats(&self) -> u64 {
        self.beats.load(Ordering::Relaxed)
    }

    /// Takes in a record of a scan; gives back the scan if this was its end.
    pub(super) fn collect(&self, record: &Record) -> Option<Uuid> {
        self.beat();
        let mut scans = self.scans();
        match record {
            Record::ScanStart(start) => {
                self.beams_done.store(0, Ordering::Relaxed);
                (scans.current, scans.sigma_us) = (Some(start.scan), None);
            }
            Record::Ping(ping) => {
                self.beams_done.fetch_add(1, Ordering::Relaxed);
                scans.sigma_us = ping.time_sigma_us;
            }
            Record::ScanEnd(end) => {
                let scan = scans.current.take()?;
                scans.latest = Some((end.clone(), scans.sigma_us));
                return Some(scan);
            }
            Record::Session(_) | Record::Event(_) => {}
        }
        None
    }

    /// The last scan that is over.
    pub(super) fn latest_scan(&self) -> Option<Uuid> {
        self.scans().latest.as_ref().map(|(end, _)| end.scan)
    }

    /// How it ended, and the standard deviation of its last reading's time, microseconds.
    pub(super) fn latest_end(&self) -> Option<(ScanEnd, Option<f64>)> {
        self.scans().latest.clone()
    }

    pub(super) fn status(&self, log: LogStatus, subscribers: SubscriberReport) -> Status {
        let now = Instant::now();
        let until =
            |at: Option<Instant>| at.map(|at| at.saturating_duration_since(now).as_secs_f64());
        let view = self.view.borrow().clone();
        let (in_force, pending) = (view.in_force().clone(), view.pending(now));
        Status {
            sonard: env!("CARGO_PKG_VERSION").into(),
            uptime_s: now.duration_since(self.started).as_secs_f64(),
            link: LinkReport {
                state: view.state,
                since: view.since,
                port: view.port,
                trouble: view.trouble,
                failures: view.failures,
                retry_in_s: until(view.retry_at),
            },
            device: view.device,
            provenance: view.provenance,
            scanning: ScanningReport {
                mode: view.scanning.mode,
                every_s: view.scanning.every_s,
                paused: view.paused,
                requested: view.requested,
                next_in_s: until(view.next_at),
            },
            scan: view.scan.map(|(scan, beams)| ScanProgress {
                scan,
                beams,
                done: self.beams_done.load(Ordering::Relaxed),
            }),
            plan: in_force.plan,
            pose: in_force.pose,
            scene: in_force.scene.as_deref().map(SceneRef::of),
            air: in_force.air.status(now),
            pending,
            log,
            subscribers,
            configuration: view.configuration,
            simulation: view.simulation,
        }
    }

    pub(super) fn health(&self, log: &LogStatus) -> Health {
        let view = self.view.borrow().clone();
        // A scan takes its time: the thermometer is judged by what it said last.
        let air = view.next.air.status(Instant::now());
        let mut reasons = Vec::new();
        if !view.state.is_up() {
            let trouble = view.trouble.unwrap_or_default();
            reasons.push(format!("the link is {}: {trouble}", view.state.name()));
        }
        reasons.extend(log.error.iter().map(|error| format!("the log: {error}")));
        if air.stale {
            reasons.push("the air temperature is stale".into());
        }
        Health {
            healthy: reasons.is_empty(),
            reasons,
            line: view.line.totals(),
            scans: view.scans,
            clock: view.clock,
        }
    }

    fn scans(&self) -> MutexGuard<'_, Collector> {
        // Nothing under this lock can panic, so a poisoned one holds what it should.
        self.scans.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl LineTotals {
    /// These and the figures of one connection more.
    pub(super) fn with(mut self, stats: &LinkStats) -> Self {
        let dropped = &stats.dropped;
        self.bytes_sent += stats.bytes_sent;
        self.bytes_received += stats.bytes_received;
        self.frames_received += stats.frames_received;
        self.crc_errors += u64::from(dropped.checksum);
        self.framing_errors += u64::from(dropped.stuffing) + u64::from(dropped.too_long);
        self.retries += stats.retries;
        self.repaired += stats.repaired;
        self.refused += stats.refused;
        self
    }
}
