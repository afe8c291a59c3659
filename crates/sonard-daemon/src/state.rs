//! State of the daemon: what its tasks report as [`StateEvent`]s, summaries of scans, and reports of
//! the outputs. The status of the API is derived from it when it is requested.

mod published;

use std::sync::{
    Mutex, MutexGuard, PoisonError,
    atomic::{AtomicU32, AtomicU64, Ordering},
};

use jiff::Timestamp;
use sonard_api::{
    AirStatus, Health, LinkReport, LogStatus, MqttReport, RosReport, ScanFit, ScanProgress,
    ScanningReport, SensorFigures, ServerReport, Status, SubscriberReport,
};
use sonard_interpret::compare::Explanation;
use sonard_records::{AirSource, Record, ScanEnd, ScanView, SceneRef};
use sonard_runtime::messages;
use tokio::{sync::watch, time::Instant};
use uuid::Uuid;

pub use published::NextScan;
pub(super) use published::{
    ControlSnapshot, LinkFigures, LinkSnapshot, PublishedStatus, ScanSettings, StateEvent,
};

use super::fit::{FitAccumulator, describe_change};

/// State of the daemon, shared between its tasks.
#[derive(Debug)]
pub(super) struct DaemonState {
    pub(super) started: Instant,
    /// Name of the robot, fixed at the start.
    pub(super) robot: String,
    /// Changed by [`Self::apply`] only.
    published: watch::Sender<PublishedStatus>,
    /// Heartbeats of the device task, which the watchdog of systemd examines.
    beats: AtomicU64,
    beams_done: AtomicU32,
    /// Latency timer of the port's adapter, milliseconds; 0 without an effect.
    latency_timer_ms: AtomicU32,
    scans: Mutex<ScanSummaries>,
    server: Mutex<ServerReport>,
    ros: Mutex<Option<RosReport>>,
    mqtt: Mutex<Option<MqttReport>>,
}

/// Summary of the running scan and of the last one. Their readings are in the log.
#[derive(Debug, Default)]
struct ScanSummaries {
    current: Option<Uuid>,
    /// End of the last scan, and the standard deviation of its last reading's time in microseconds.
    latest: Option<(ScanEnd, Option<f64>)>,
    sigma_us: Option<f64>,
    /// Agreement of the running scan with the model, and that of the last scan.
    fit: FitAccumulator,
    latest_fit: Option<ScanFit>,
    /// Time of the last scan's end.
    ended: Option<Instant>,
    /// Start of the running scan by both clocks. Times of its readings are relative to the wall
    /// clock at that moment.
    began: Option<(Instant, Timestamp)>,
    /// Best explanation published by the last event.
    published: Option<Explanation>,
    /// Delay from the firing of the last reading to its reception, seconds.
    lateness_s: Option<f64>,
    /// Time of reception of the last reading.
    read: Option<Instant>,
}

impl DaemonState {
    pub(super) fn new(published: PublishedStatus, robot: String) -> Self {
        Self {
            started: Instant::now(),
            robot,
            published: watch::Sender::new(published),
            beats: AtomicU64::new(0),
            beams_done: AtomicU32::new(0),
            latency_timer_ms: AtomicU32::new(0),
            scans: Mutex::default(),
            server: Mutex::default(),
            ros: Mutex::default(),
            mqtt: Mutex::default(),
        }
    }

    /// Applies events in order; subscribers see all of them or none.
    pub(super) fn apply(&self, events: impl IntoIterator<Item = StateEvent>) {
        self.published.send_modify(|published| {
            events.into_iter().for_each(|event| published.apply(event));
        });
    }

    /// Current status of link, settings and session.
    pub(super) fn published(&self) -> watch::Ref<'_, PublishedStatus> {
        self.published.borrow()
    }

    /// Subscribes to changes of the status.
    pub(super) fn subscribe(&self) -> watch::Receiver<PublishedStatus> {
        self.published.subscribe()
    }

    /// Counts a heartbeat of the device task.
    pub(super) fn beat(&self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn beats(&self) -> u64 {
        self.beats.load(Ordering::Relaxed)
    }

    /// Updates the summaries with a record. At the end of a scan, returns its id, and its readings
    /// unless there were too many to keep.
    pub(super) fn update(&self, record: &Record) -> Option<(Uuid, Option<ScanView>)> {
        self.beat();
        let session = self.published().session.clone();
        let mut scans = self.scans();
        match record {
            Record::ScanStart(start) => {
                self.beams_done.store(0, Ordering::Relaxed);
                (scans.current, scans.sigma_us) = (Some(start.scan), None);
                scans.began = Some((Instant::now(), start.time));
                scans.fit = FitAccumulator::new(start, session);
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

    /// Stores the explanations of a scan that fit better than its settings. Returns the text of an
    /// event if the best one changed.
    pub(super) fn set_explanations(&self, scan: Uuid, found: &[Explanation]) -> Option<String> {
        let mut scans = self.scans();
        let change = describe_change(scans.published.as_ref(), found.first());
        if change.is_some() {
            scans.published = found.first().cloned();
        }
        let latest = scans.latest_fit.as_mut().filter(|fit| fit.scan == scan);
        latest.into_iter().for_each(|fit| fit.explanations = found.to_vec());
        change
    }

    /// Id of the last scan that has ended.
    pub(super) fn latest_scan(&self) -> Option<Uuid> {
        self.scans().latest.as_ref().map(|(end, _)| end.scan)
    }

    /// End of the last scan, and the standard deviation of its last reading's time in microseconds.
    pub(super) fn latest_end(&self) -> Option<(ScanEnd, Option<f64>)> {
        self.scans().latest.clone()
    }

    pub(super) fn status(&self, log: LogStatus, subscribers: SubscriberReport) -> Status {
        let now = Instant::now();
        let until =
            |at: Option<Instant>| at.map(|at| at.saturating_duration_since(now).as_secs_f64());
        let published = self.published().clone();
        let (current, pending) = (published.current().clone(), published.pending(now));
        let PublishedStatus { link, control, next_at, scan, simulation, .. } = published;
        Status {
            robot: self.robot.clone(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            uptime_s: now.duration_since(self.started).as_secs_f64(),
            link: LinkReport {
                state: link.state,
                since: link.since,
                for_s: Some(now.saturating_duration_since(link.changed).as_secs_f64()),
                port: link.port,
                error: link.trouble,
                failures: link.failures,
                retry_in_s: until(link.retry_at),
                latency_timer_ms: Some(self.latency_timer_ms.load(Ordering::Relaxed))
                    .filter(|ms| *ms > 0),
            },
            device: link.device,
            provenance: link.provenance,
            scanning: ScanningReport {
                mode: control.scanning.mode,
                every_s: control.scanning.every_s,
                paused: control.paused,
                requested: control.requested,
                next_in_s: until(next_at),
            },
            last_reading_age_s: self
                .scans()
                .read
                .map(|read| now.duration_since(read).as_secs_f64()),
            scan: scan.map(|(scan, beams)| ScanProgress {
                scan,
                beams,
                done: self.beams_done.load(Ordering::Relaxed),
            }),
            plan: current.plan,
            pose: current.pose,
            scene: current.scene.as_deref().map(SceneRef::from_scene),
            air: current.air.status(now),
            sensor: SensorFigures::from_sensor(&current.setup.sensor),
            pending,
            log,
            subscribers,
            server: lock(&self.server).clone(),
            ros: lock(&self.ros).clone(),
            mqtt: lock(&self.mqtt).clone(),
            configuration: control.configuration,
            simulation,
        }
    }

    pub(super) fn health(&self, log: &LogStatus) -> Health {
        let published = self.published().clone();
        // The current air would be that of the scan's start; health reports the last temperature.
        let air = published.control.next.air.status(Instant::now());
        let mut reasons = Vec::new();
        let link = published.link;
        if !link.state.is_up() {
            let trouble = link.trouble.unwrap_or_default();
            reasons.push(format!("the link is {}: {trouble}", link.state.name()));
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
        reasons.extend(lock(&self.server).errors.iter().cloned());
        let (fit, last_scan_age_s, reading_lateness_s) = {
            let scans = self.scans();
            let age_s = scans.ended.map(|ended| ended.elapsed().as_secs_f64());
            (scans.latest_fit.clone(), age_s, scans.lateness_s)
        };
        Health {
            healthy: reasons.is_empty(),
            dropped_messages: messages::dropped(),
            reasons,
            line: published.line.totals(),
            scans: published.scans,
            clock: published.clock,
            fit,
            last_scan_age_s,
            reading_lateness_s,
        }
    }

    /// Stores the server's addresses and faults.
    pub(super) fn report_server(&self, report: ServerReport) {
        *lock(&self.server) = report;
    }

    /// Stores the latency timer of the port's adapter.
    pub(super) fn report_latency_timer(&self, latency_ms: Option<u32>) {
        self.latency_timer_ms.store(latency_ms.unwrap_or(0), Ordering::Relaxed);
    }

    /// Stores the state of the ROS 2 node.
    pub(super) fn report_ros(&self, report: RosReport) {
        *lock(&self.ros) = Some(report);
    }

    /// Stores the state of the MQTT connection.
    pub(super) fn report_mqtt(&self, report: MqttReport) {
        *lock(&self.mqtt) = Some(report);
    }

    fn scans(&self) -> MutexGuard<'_, ScanSummaries> {
        lock(&self.scans)
    }
}

/// Describes a fault of the thermometer, and the temperature used for ranges meanwhile.
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

/// Locks a mutex. No code under these locks can panic, so a poisoned value is valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
