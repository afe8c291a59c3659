//! What the operator publishes, and other tasks look at.

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicU32, AtomicU64, Ordering},
};

use firmware_protocol::{host::LinkStats, messages::Identity};
use jiff::Timestamp;
use sonard_api::{
    AirStatus, ClockReport, ConfigurationReport, Health, LineTotals, LinkReport, LinkState,
    LogStatus, MqttReport, Pending, RosReport, ScanFit, ScanProgress, ScanTotals, ScanningReport,
    SensorFigures, ServerReport, Setup, SimulationReport, Status, SubscriberReport,
    config::ScanningKeys,
};
use sonard_interpret::compare::Explanation;
use sonard_model::{array::RangerArray, geometry::Pose, scene::Scene};
use sonard_records::{
    AirSource, Device, Provenance, Record, ScanEnd, ScanPlan, ScanView, SceneRef, Session,
};
use sonard_runtime::messages;
use tokio::{sync::watch, time::Instant};
use uuid::Uuid;

use super::{
    air::AirControl,
    fit::{Fit, news},
};

/// What the operator publishes; ages and waits are computed when somebody asks.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub(super) state: LinkState,
    pub(super) since: Timestamp,
    /// `since` on the clock that is never set.
    pub(super) changed: Instant,
    pub(super) port: String,
    pub(super) trouble: Option<String>,
    pub(super) failures: u32,
    pub(super) retry_at: Option<Instant>,
    pub(super) device: Option<Device>,
    pub(super) identity: Option<Identity>,
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
    pub(super) line: LinkFigures,
    pub(super) scans: ScanTotals,
    pub(super) clock: ClockReport,
    pub(super) simulation: Option<SimulationReport>,
}

/// Settings of the next scan.
#[derive(Debug, Clone)]
pub struct NextScan {
    /// Azimuths.
    pub plan: ScanPlan,
    /// Where the ranger stands.
    pub pose: Pose,
    /// The scene, if there is one.
    pub scene: Option<Arc<Scene>>,
    /// Sensor and model.
    pub setup: Arc<Setup>,
    /// The air.
    pub air: AirStatus,
    /// The array that is played in place of a ranger that turns, if one is.
    pub array: Option<Arc<RangerArray>>,
    /// The connected device, for its limits.
    pub device: Option<Identity>,
}

/// What scans are taken by.
#[derive(Debug, Clone)]
pub(super) struct Terms {
    pub(super) plan: ScanPlan,
    pub(super) pose: Pose,
    pub(super) scene: Option<Arc<Scene>>,
    pub(super) setup: Arc<Setup>,
    /// The array that is played, where nothing is measured.
    pub(super) array: Option<Arc<RangerArray>>,
    pub(super) air: AirControl,
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

    pub(super) fn next_scan(&self, at: Instant) -> NextScan {
        let Terms { plan, pose, scene, setup, array, air } = self.next.clone();
        let (air, device) = (air.status(at), self.identity);
        NextScan { plan, pose, scene, setup, air, array, device }
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
            sensor: Some(&next.setup.sensor)
                .filter(|sensor| **sensor != now.setup.sensor)
                .map(SensorFigures::of),
            setup: Some(&next.setup).filter(|setup| **setup != now.setup).map(|s| (**s).clone()),
        }
    }
}

/// Figures of the line: what is settled, and the connection that there is.
#[derive(Debug, Clone, Default)]
pub(super) struct LinkFigures {
    /// Connections before this one, and losses.
    pub(super) earlier: LineTotals,
    /// This one's, which go on changing.
    pub(super) live: Option<watch::Receiver<LinkStats>>,
}

impl LinkFigures {
    /// All together, now.
    pub(super) fn totals(&self) -> LineTotals {
        self.live.as_ref().map_or(self.earlier, |live| with(self.earlier, &live.borrow()))
    }

    /// The connection is over.
    pub(super) fn close(&mut self) {
        *self = Self { earlier: self.totals(), live: None };
    }
}

/// Totals of earlier connections, and the figures of one more.
fn with(mut totals: LineTotals, stats: &LinkStats) -> LineTotals {
    let dropped = &stats.dropped;
    totals.bytes_sent += stats.bytes_sent;
    totals.bytes_received += stats.bytes_received;
    totals.frames_received += stats.frames_received;
    totals.crc_errors += u64::from(dropped.checksum);
    totals.framing_errors += u64::from(dropped.stuffing) + u64::from(dropped.too_long);
    totals.retries += stats.retries;
    totals.repaired += stats.repaired;
    totals.refused += stats.refused;
    totals
}

/// State that several tasks look at.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) started: Instant,
    /// The robot's name, as of the start.
    pub(super) robot: String,
    pub(super) view: watch::Sender<View>,
    /// Counts whatever shows that the operator gets on; the watchdog looks at it.
    beats: AtomicU64,
    beams_done: AtomicU32,
    scans: Mutex<Collector>,
    server: Mutex<ServerReport>,
    ros: Mutex<Option<RosReport>>,
    mqtt: Mutex<Option<MqttReport>>,
}

/// What is remembered of scans. Their readings are in the log.
#[derive(Debug, Default)]
struct Collector {
    current: Option<Uuid>,
    /// How the last one ended, and the standard deviation of its last reading's time, microseconds.
    latest: Option<(ScanEnd, Option<f64>)>,
    sigma_us: Option<f64>,
    /// How the scan under way agrees with the model, and how the last one did.
    fit: Fit,
    latest_fit: Option<ScanFit>,
    /// When the last one ended.
    ended: Option<Instant>,
    /// Start of the scan under way by both clocks. Times of its readings follow the wall clock as it
    /// was then.
    began: Option<(Instant, Timestamp)>,
    /// The best explanation that an event told.
    told: Option<Explanation>,
    /// How long after its firing the last reading came in, seconds.
    lateness_s: Option<f64>,
    /// When it came in.
    read: Option<Instant>,
}

impl Shared {
    pub(super) fn new(view: View, robot: String) -> Self {
        Self {
            started: Instant::now(),
            robot,
            view: watch::Sender::new(view),
            beats: AtomicU64::new(0),
            beams_done: AtomicU32::new(0),
            scans: Mutex::default(),
            server: Mutex::default(),
            ros: Mutex::default(),
            mqtt: Mutex::default(),
        }
    }

    /// Something went on.
    pub(super) fn beat(&self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn beats(&self) -> u64 {
        self.beats.load(Ordering::Relaxed)
    }

    /// Takes in a record of a scan; gives back the scan if this was its end, with its readings if they were few enough.
    pub(super) fn collect(&self, record: &Record) -> Option<(Uuid, Option<ScanView>)> {
        self.beat();
        let session = self.view.borrow().session.clone();
        let mut scans = self.scans();
        match record {
            Record::ScanStart(start) => {
                self.beams_done.store(0, Ordering::Relaxed);
                (scans.current, scans.sigma_us) = (Some(start.scan), None);
                scans.began = Some((Instant::now(), start.time));
                scans.fit = Fit::of(start, session);
            }
            Record::Ping(ping) => {
                self.beams_done.fetch_add(1, Ordering::Relaxed);
                scans.sigma_us = ping.time_sigma_us;
                scans.read = Some(Instant::now());
                scans.fit.add(ping);
                let fired = ping.time.filter(|_| ping.time_sigma_us.is_some());
                scans.lateness_s = fired.zip(scans.began).map(|(fired, (at, time))| {
                    at.elapsed().as_secs_f64() - fired.duration_since(time).as_secs_f64()
                });
            }
            Record::ScanEnd(end) => {
                let fit = std::mem::take(&mut scans.fit);
                scans.latest_fit = Some(fit.report(end));
                scans.ended = Some(Instant::now());
                let scan = scans.current.take()?;
                scans.latest = Some((end.clone(), scans.sigma_us));
                return Some((scan, fit.into_scan()));
            }
            Record::Session(_) | Record::Event(_) => {}
        }
        None
    }

    /// Takes in what would explain a scan better; gives back what there is to say of it.
    pub(super) fn explained(&self, scan: Uuid, found: &[Explanation]) -> Option<String> {
        let mut scans = self.scans();
        let news = news(scans.told.as_ref(), found.first());
        if news.is_some() {
            scans.told = found.first().cloned();
        }
        let latest = scans.latest_fit.as_mut().filter(|fit| fit.scan == scan);
        latest.into_iter().for_each(|fit| fit.explanations = found.to_vec());
        news
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
            robot: self.robot.clone(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            uptime_s: now.duration_since(self.started).as_secs_f64(),
            link: LinkReport {
                state: view.state,
                since: view.since,
                for_s: Some(now.saturating_duration_since(view.changed).as_secs_f64()),
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
            last_reading_age_s: self
                .scans()
                .read
                .map(|read| now.duration_since(read).as_secs_f64()),
            scan: view.scan.map(|(scan, beams)| ScanProgress {
                scan,
                beams,
                done: self.beams_done.load(Ordering::Relaxed),
            }),
            plan: in_force.plan,
            pose: in_force.pose,
            scene: in_force.scene.as_deref().map(SceneRef::of),
            air: in_force.air.status(now),
            sensor: SensorFigures::of(&in_force.setup.sensor),
            pending,
            log,
            subscribers,
            server: held(&self.server).clone(),
            ros: held(&self.ros).clone(),
            mqtt: held(&self.mqtt).clone(),
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
        reasons.extend(log.incident.iter().map(|incident| format!("the log: {incident}")));
        reasons.extend(log.busy_s.map(|busy_s| {
            format!(
                "the log: the disk does not respond: a write or sync has taken {busy_s:.0} s so far"
            )
        }));
        reasons.extend(air.error.as_ref().map(|error| describe_thermometer(error, &air)));
        if air.stale {
            reasons.push("the air temperature is stale".into());
        }
        reasons.extend(held(&self.server).trouble.iter().cloned());
        let (fit, last_scan_age_s, reading_lateness_s) = {
            let scans = self.scans();
            let age_s = scans.ended.map(|ended| ended.elapsed().as_secs_f64());
            (scans.latest_fit.clone(), age_s, scans.lateness_s)
        };
        Health {
            healthy: reasons.is_empty(),
            dropped_messages: messages::dropped(),
            reasons,
            line: view.line.totals(),
            scans: view.scans,
            clock: view.clock,
            fit,
            last_scan_age_s,
            reading_lateness_s,
        }
    }

    /// Takes in where clients reach the server.
    pub(super) fn report_server(&self, report: ServerReport) {
        *held(&self.server) = report;
    }

    /// How it goes with ROS 2.
    pub(super) fn report_ros(&self, report: RosReport) {
        *held(&self.ros) = Some(report);
    }

    /// How it goes with the broker.
    pub(super) fn report_mqtt(&self, report: MqttReport) {
        *held(&self.mqtt) = Some(report);
    }

    fn scans(&self) -> MutexGuard<'_, Collector> {
        held(&self.scans)
    }
}

/// A thermometer's fault, and what ranges are computed with meanwhile.
fn describe_thermometer(error: &str, air: &AirStatus) -> String {
    let temperature_c = air.temperature_c;
    let in_use = match (air.source, air.age_s) {
        (AirSource::File, Some(age_s)) => {
            format!("the last valid temperature, {temperature_c:.1} C, is {age_s:.0} s old")
        }
        (AirSource::Api, _) => format!("{temperature_c:.1} C was set by a program"),
        _ => format!("{temperature_c:.1} C is the configured temperature"),
    };
    format!("the thermometer has no valid temperature: {error}; {in_use}")
}

/// Nothing under these locks can panic, so a poisoned one holds what it should.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
