//! Status of link, settings and session, as a function of the events applied to it.

use std::sync::Arc;

use firmware_protocol::{host::LinkStats, messages::Identity};
use jiff::Timestamp;
use sonard_api::{
    AirStatus, ClockReport, ConfigurationReport, LineTotals, LinkState, Pending, ScanTotals,
    SensorFigures, Setup, SimulationReport, config::ScanningKeys,
};
use sonard_model::{array::RangerArray, geometry::Pose, reading::PingStatus, scene::Scene};
use sonard_records::{Device, Provenance, ScanPlan, SceneRef, Session};
use tokio::{sync::watch, time::Instant};
use uuid::Uuid;

use super::super::air::AirControl;

/// Change of the daemon's state.
#[derive(Debug)]
pub(in super::super) enum StateEvent {
    /// The link, or the connected device, has changed.
    Link(Box<LinkSnapshot>),
    /// Settings of the next scan, schedule or configuration have changed.
    Control(Box<ControlSnapshot>),
    /// The settings of the next scan are those of the current one from now on.
    SettingsInForce,
    /// Time of the next scheduled scan.
    NextScanAt(Option<Instant>),
    /// Counters of finished scans.
    ScansCounted(ScanTotals),
    /// Counters of the serial line.
    LineCounted(Box<LinkFigures>),
    /// A session has begun.
    SessionStarted(Arc<Session>),
    /// A scan has begun, with its number of beams.
    ScanStarted { scan: Uuid, beams: u32 },
    /// The running scan has ended.
    ScanEnded,
    /// The computer's clock was stepped so many times.
    ClockStepped(u32),
    /// Drift of the board's clock, parts per million, and standard deviation of a reading's time,
    /// microseconds.
    ClockMeasured { drift_ppm: Option<f64>, sigma_us: Option<f64> },
    /// Simulated array, whether it drives, and the number of skipped firings; `None` without one.
    Simulation(Option<(Arc<RangerArray>, bool, u64)>),
    /// A ranger of the simulated array was fired.
    RangerFired { ranger: usize, time: Option<Timestamp>, status: PingStatus, range_m: Option<f64> },
}

/// State of the link and of the device at its end.
#[derive(Debug, Clone)]
pub(in super::super) struct LinkSnapshot {
    pub(in super::super) state: LinkState,
    /// Time of the last change of `state`, by both clocks.
    pub(in super::super) since: Timestamp,
    pub(in super::super) changed: Instant,
    pub(in super::super) port: String,
    pub(in super::super) trouble: Option<String>,
    pub(in super::super) failures: u32,
    pub(in super::super) retry_at: Option<Instant>,
    pub(in super::super) identity: Option<Identity>,
    pub(in super::super) device: Option<Device>,
    pub(in super::super) provenance: Option<Provenance>,
}

impl LinkSnapshot {
    /// Snapshot of a link without trouble and without a device that enters its state now.
    pub(in super::super) fn new(state: LinkState, port: String) -> Self {
        Self {
            state,
            since: Timestamp::now(),
            changed: Instant::now(),
            port,
            trouble: None,
            failures: 0,
            retry_at: None,
            identity: None,
            device: None,
            provenance: None,
        }
    }
}

/// Settings of the next scan, schedule and configuration.
#[derive(Debug, Clone)]
pub(in super::super) struct ControlSnapshot {
    pub(in super::super) next: ScanSettings,
    pub(in super::super) scanning: ScanningKeys,
    pub(in super::super) paused: bool,
    pub(in super::super) requested: u32,
    pub(in super::super) configuration: ConfigurationReport,
}

/// Status of link, settings and session. Ages and waits are computed when the status is read.
#[derive(Debug, Clone)]
pub(in super::super) struct PublishedStatus {
    pub(in super::super) link: LinkSnapshot,
    /// Settings of the next scan, schedule and configuration.
    pub(in super::super) control: ControlSnapshot,
    /// Settings of the running scan, without those of its own request.
    now: ScanSettings,
    pub(in super::super) session: Option<Arc<Session>>,
    pub(in super::super) next_at: Option<Instant>,
    pub(in super::super) scan: Option<(Uuid, u32)>,
    pub(in super::super) line: LinkFigures,
    pub(in super::super) scans: ScanTotals,
    pub(in super::super) clock: ClockReport,
    pub(in super::super) simulation: Option<SimulationReport>,
}

/// Settings of the next scan.
#[derive(Debug, Clone)]
pub struct NextScan {
    /// Azimuths of the beams.
    pub plan: ScanPlan,
    /// Position and heading of the ranger.
    pub pose: Pose,
    /// Scene of the predictions, if there is one.
    pub scene: Option<Arc<Scene>>,
    /// Sensor, model and motion.
    pub setup: Arc<Setup>,
    /// Temperature, humidity, pressure and speed of sound.
    pub air: AirStatus,
    /// Simulated array, if the readings come from the model.
    pub array: Option<Arc<RangerArray>>,
    /// Connected device, for its limits.
    pub device: Option<Identity>,
}

/// Settings of a scan: azimuths, pose, scene, sensor and air.
#[derive(Debug, Clone)]
pub(in super::super) struct ScanSettings {
    pub(in super::super) plan: ScanPlan,
    pub(in super::super) pose: Pose,
    pub(in super::super) scene: Option<Arc<Scene>>,
    pub(in super::super) setup: Arc<Setup>,
    /// Simulated array, if the readings come from the model.
    pub(in super::super) array: Option<Arc<RangerArray>>,
    pub(in super::super) air: AirControl,
}

impl ScanSettings {
    /// Returns `true` if both settings describe the same scan. The air is ignored, since it may
    /// change at any time.
    pub(in super::super) fn same_scan_as(&self, other: &Self) -> bool {
        let scene = |settings: &Self| settings.scene.as_ref().map(Arc::as_ptr);
        (self.plan, self.pose, scene(self)) == (other.plan, other.pose, scene(other))
            && Arc::ptr_eq(&self.setup, &other.setup)
    }
}

impl PublishedStatus {
    /// Status before the link is opened.
    pub(in super::super) fn new(
        link: LinkSnapshot,
        control: ControlSnapshot,
        simulation: Option<SimulationReport>,
    ) -> Self {
        Self {
            now: control.next.clone(),
            link,
            control,
            session: None,
            next_at: None,
            scan: None,
            line: LinkFigures::default(),
            scans: ScanTotals::default(),
            clock: ClockReport::default(),
            simulation,
        }
    }

    /// Applies an event.
    pub(in super::super) fn apply(&mut self, event: StateEvent) {
        match event {
            StateEvent::Link(mut link) => {
                if link.state == self.link.state {
                    (link.since, link.changed) = (self.link.since, self.link.changed);
                }
                self.link = *link;
            }
            StateEvent::Control(control) => self.control = *control,
            StateEvent::SettingsInForce => self.now = self.control.next.clone(),
            StateEvent::NextScanAt(at) => self.next_at = at,
            StateEvent::ScansCounted(scans) => self.scans = scans,
            StateEvent::LineCounted(line) => self.line = *line,
            StateEvent::SessionStarted(session) => self.session = Some(session),
            StateEvent::ScanStarted { scan, beams } => self.scan = Some((scan, beams)),
            StateEvent::ScanEnded => self.scan = None,
            StateEvent::ClockStepped(steps) => self.clock.steps += u64::from(steps),
            StateEvent::ClockMeasured { drift_ppm, sigma_us } => {
                (self.clock.drift_ppm, self.clock.sigma_us) = (drift_ppm, sigma_us);
            }
            StateEvent::Simulation(simulated) => {
                let before = self.simulation.take();
                self.simulation = simulated.map(|(array, driving, skipped)| {
                    let new = SimulationReport::new(&array);
                    let before = before.filter(|report| report.matches_array(&array));
                    let readings = before.map_or(new.readings, |before| before.readings);
                    SimulationReport { driving, skipped, readings, ..new }
                });
            }
            StateEvent::RangerFired { ranger, time, status, range_m } => {
                let readings = self.simulation.as_mut().map(|report| &mut report.readings);
                if let Some(reading) = readings.and_then(|readings| readings.get_mut(ranger)) {
                    (reading.time, reading.status) = (time, Some(status));
                    reading.range_m = range_m;
                }
            }
        }
    }

    /// Current settings: those of the running scan, otherwise those of the next one.
    pub(in super::super) const fn current(&self) -> &ScanSettings {
        if self.scan.is_some() { &self.now } else { &self.control.next }
    }

    pub(in super::super) fn next_scan(&self, at: Instant) -> NextScan {
        let ScanSettings { plan, pose, scene, setup, array, air } = self.control.next.clone();
        let (air, device) = (air.status(at), self.link.identity);
        NextScan { plan, pose, scene, setup, air, array, device }
    }

    /// Settings of the next scan that differ from the current ones.
    pub(in super::super) fn pending(&self, at: Instant) -> Pending {
        let (now, next) = (self.current(), &self.control.next);
        let hash =
            |settings: &ScanSettings| settings.scene.as_ref().map(|scene| scene.sha256.clone());
        let scene = next.scene.as_deref().filter(|_| hash(now) != hash(next));
        Pending {
            plan: Some(next.plan).filter(|plan| *plan != now.plan),
            pose: Some(next.pose).filter(|pose| *pose != now.pose),
            scene: scene.map(SceneRef::from_scene),
            air: next.air.differs(&now.air).then(|| next.air.status(at)),
            sensor: Some(&next.setup.sensor)
                .filter(|sensor| **sensor != now.setup.sensor)
                .map(SensorFigures::from_sensor),
            setup: Some(&next.setup).filter(|setup| **setup != now.setup).map(|s| (**s).clone()),
        }
    }
}

/// Counters of the serial line: totals of closed connections, and the open connection.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct LinkFigures {
    /// Totals of closed connections, and the number of losses.
    pub(in super::super) earlier: LineTotals,
    /// Live counters of the open connection.
    pub(in super::super) live: Option<watch::Receiver<LinkStats>>,
}

impl LinkFigures {
    /// Current totals of all connections.
    pub(in super::super) fn totals(&self) -> LineTotals {
        self.live.as_ref().map_or(self.earlier, |live| add_stats(self.earlier, &live.borrow()))
    }

    /// Adds the counters of the open connection to the totals when it is closed.
    pub(in super::super) fn close(&mut self) {
        *self = Self { earlier: self.totals(), live: None };
    }
}

/// Adds the counters of a connection to the totals.
fn add_stats(mut totals: LineTotals, stats: &LinkStats) -> LineTotals {
    let dropped = &stats.dropped;
    totals.bytes_sent += stats.bytes_sent;
    totals.bytes_received += stats.bytes_received;
    totals.frames_received += stats.frames_received;
    totals.crc_errors += u64::from(dropped.checksum);
    totals.framing_errors += u64::from(dropped.stuffing) + u64::from(dropped.too_long);
    totals.retries += stats.retries;
    totals.repaired += stats.repaired;
    totals.rejected += stats.rejected;
    totals
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use sonard_api::config::{AirKeys, ModelKeys, MotionKeys};
    use sonard_model::acoustics::Sensor;

    use super::*;

    fn settings(x_m: f64) -> ScanSettings {
        let setup = Setup {
            sensor: Sensor::preset("senscomp-6500").expect("a preset"),
            model: ModelKeys::default(),
            motion: MotionKeys::default(),
            thermometer: false,
        };
        ScanSettings {
            plan: ScanPlan::default(),
            pose: Pose { x_m, y_m: 0.0, heading_deg: 0.0 },
            scene: None,
            setup: Arc::new(setup),
            array: None,
            air: AirControl::new(AirKeys::default()),
        }
    }

    fn control(x_m: f64) -> ControlSnapshot {
        ControlSnapshot {
            next: settings(x_m),
            scanning: ScanningKeys::default(),
            paused: false,
            requested: 0,
            configuration: ConfigurationReport::default(),
        }
    }

    fn link(state: LinkState, at: Instant) -> LinkSnapshot {
        LinkSnapshot { changed: at, ..LinkSnapshot::new(state, "/dev/ttyACM0".to_owned()) }
    }

    fn status() -> PublishedStatus {
        PublishedStatus::new(link(LinkState::Opening, Instant::now()), control(0.0), None)
    }

    fn apply(status: &mut PublishedStatus, events: impl IntoIterator<Item = StateEvent>) {
        events.into_iter().for_each(|event| status.apply(event));
    }

    fn set_pose(x_m: f64) -> StateEvent {
        StateEvent::Control(Box::new(control(x_m)))
    }

    #[test]
    fn settings_of_a_running_scan_are_kept() {
        let (mut status, scan) = (status(), Uuid::from_u128(1));
        apply(&mut status, [set_pose(1.0), StateEvent::SettingsInForce]);
        apply(&mut status, [StateEvent::ScanStarted { scan, beams: 400 }, set_pose(2.0)]);
        assert_eq!((status.current().pose.x_m, status.scan), (1.0, Some((scan, 400))));
        let pending = |status: &PublishedStatus| status.pending(Instant::now()).pose;
        assert_eq!(pending(&status).map(|pose| pose.x_m), Some(2.0));
        status.apply(StateEvent::ScanEnded);
        assert_eq!((status.current().pose.x_m, pending(&status)), (2.0, None));
    }

    #[test]
    fn link_state_is_dated_by_its_change() {
        let (mut status, start) = (status(), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        let events = [
            (LinkState::Ready, 1, 1),
            (LinkState::Ready, 2, 1),
            (LinkState::Scanning, 3, 3),
            (LinkState::Ready, 4, 4),
        ];
        for (state, reported_s, changed_s) in events {
            status.apply(StateEvent::Link(Box::new(link(state, at(reported_s)))));
            assert_eq!((status.link.state, status.link.changed), (state, at(changed_s)));
        }
    }

    #[test]
    fn readings_stay_with_their_array() {
        let array = |name: &str| Arc::new(RangerArray::preset(name).expect("a preset"));
        let simulate = |name: &str| StateEvent::Simulation(Some((array(name), true, 3)));
        let fire = StateEvent::RangerFired {
            ranger: 2,
            time: Some(Timestamp::UNIX_EPOCH),
            status: PingStatus::Echo,
            range_m: Some(1.5),
        };
        let range_m = |status: &PublishedStatus| {
            status.simulation.as_ref().map(|report| report.readings[2].range_m)
        };
        let mut status = status();
        apply(&mut status, [simulate("pioneer-8"), fire, simulate("pioneer-8")]);
        assert_eq!(range_m(&status), Some(Some(1.5)));
        status.apply(simulate("ring-12"));
        assert_eq!(range_m(&status), Some(None));
        status.apply(StateEvent::Simulation(None));
        assert_eq!(range_m(&status), None);
        // A late reading of an array that is gone.
        let late = StateEvent::RangerFired {
            ranger: 9,
            time: None,
            status: PingStatus::NoEcho,
            range_m: None,
        };
        status.apply(late);
        assert_eq!(range_m(&status), None);
    }

    #[test]
    fn clock_steps_add_up() {
        let mut status = status();
        let measured = StateEvent::ClockMeasured { drift_ppm: Some(20.0), sigma_us: Some(100.0) };
        apply(&mut status, [StateEvent::ClockStepped(1), measured, StateEvent::ClockStepped(2)]);
        assert_eq!((status.clock.steps, status.clock.drift_ppm), (3, Some(20.0)));
    }
}
