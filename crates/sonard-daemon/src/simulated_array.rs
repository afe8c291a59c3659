//! Device task of a simulated array: fires its rangers in turn, at fixed intervals.
//!
//! After R. Arrabales' service of simulated sonars: one ranger per interval (25 Hz on a Pioneer),
//! one scan per round. No port is opened, and every record is marked as simulated. The model
//! computes the paths of an observation point once: a robot at rest needs no further computation, a
//! moving one needs a path search for each firing.

mod firing_grid;
mod simulation;

use std::{ops::ControlFlow, sync::Arc, time::Duration};

use jiff::Timestamp;
use sonard_api::{LinkState, ScanTotals};
use sonard_model::geometry::Pose;
use sonard_records::{
    EventKind, Ping, Provenance, Record, STOPPED_ON_REQUEST, ScanEnd, ScanStart, Session, Sink as _,
};
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

use super::{
    control::{Control, Interrupt},
    fan_out::RecordFanOut,
    schedule::Due,
    state::{LinkSnapshot, StateEvent},
};
use firing_grid::FiringGrid;
use simulation::{RobotMotion, Simulation};

/// Heartbeat interval while the task is waiting.
const HEARTBEAT: Duration = Duration::from_secs(1);

pub(super) struct SimulatedArray {
    control: Control,
    out: RecordFanOut,
    simulation: Option<Simulation>,
    motion: RobotMotion,
    firing_grid: FiringGrid,
    /// Current session record of the log.
    session: Option<Session>,
    state: LinkState,
    scans: ScanTotals,
}

/// A round of firings, and the pose at its start.
#[derive(Debug, Clone, Copy)]
struct Round {
    scan: Uuid,
    pose: Pose,
}

impl SimulatedArray {
    pub(super) fn new(control: Control, out: RecordFanOut) -> Self {
        Self {
            motion: RobotMotion::new(&control),
            control,
            out,
            simulation: None,
            firing_grid: FiringGrid::new(Instant::now()),
            session: None,
            state: LinkState::Ready,
            scans: ScanTotals::default(),
        }
    }

    /// Runs the simulation until the daemon stops.
    pub(super) async fn run(mut self) {
        if let Some(simulated) = &self.control.settings.simulated {
            let array = &simulated.array;
            let (name, count) = (&array.name, array.rangers.len());
            tracing::info!("simulation: {count} rangers, array {name}");
        }
        loop {
            let due = match self.control.schedule.due(self.control.now()) {
                // No round starts unless its readings can be logged.
                Due::Now if self.out.journal.is_writable() => {
                    if self.run_round().await.is_break() {
                        break;
                    }
                    continue;
                }
                Due::Now | Due::OnRequest => None,
                Due::At(at) => Some(self.control.epoch + at),
            };
            self.enter(LinkState::Ready);
            let heartbeat = Instant::now() + HEARTBEAT;
            let until = due.map_or(heartbeat, |due| due.min(heartbeat));
            if self.attend_until(until).await == Some(Interrupt::Shutdown) {
                break;
            }
            self.out.state.beat();
        }
        self.enter(LinkState::Stopped);
    }

    /// Fires each ranger of the array once.
    async fn run_round(&mut self) -> ControlFlow<()> {
        if let Err(why) = self.update_simulation().await {
            // A retry would fail again until an order or the configuration changes the scan.
            self.control.schedule.stop();
            tracing::error!("scanning stopped: {why}");
            self.out.event(EventKind::Stopped, format!("scanning stopped: {why}"));
            return ControlFlow::Continue(());
        }
        let Some(simulation) = &self.simulation else { return ControlFlow::Continue(()) };
        let (model, turns) = (simulation.model(), simulation.turns());
        self.enter(LinkState::Scanning);
        self.control.schedule.begun(self.control.now());
        self.firing_grid.resume(Instant::now());
        let round =
            Round { scan: Uuid::new_v4(), pose: self.motion.pose(&mut self.control, &self.out) };
        let air = self.control.air.settled();
        let start = ScanStart {
            air: Some(self.control.air.scan_air(&air, Instant::now())),
            ..ScanStart::for_array(&model, round.scan, round.pose, 1, Timestamp::now())
        };
        self.put(&Record::ScanStart(start));
        let (mut index, mut fired, mut interrupted) = (0, 0, None);
        for turn in &turns {
            interrupted = self.attend_until(self.firing_grid.next()).await;
            if interrupted.is_some() {
                break;
            }
            let at = (Instant::now(), Timestamp::now());
            for &ranger in turn {
                fired += u32::from(self.fire(round, index, ranger, at).await);
                index += 1;
            }
            self.firing_grid.advance(Instant::now(), self.interval());
        }
        if let Some(interrupt) = interrupted {
            let stopping = interrupt == Interrupt::Shutdown;
            let why = if stopping { "the daemon is stopping" } else { STOPPED_ON_REQUEST };
            self.out.event(EventKind::Stopped, why.to_owned());
        }
        let missing = turns.iter().map(Vec::len).sum::<usize>() as u32 - fired;
        let counts = [fired, missing];
        self.put(&Record::ScanEnd(ScanEnd::for_array(
            &model,
            round.scan,
            counts,
            Timestamp::now(),
        )));
        self.count(counts);
        match interrupted {
            Some(Interrupt::Shutdown) => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }

    /// Fires a ranger in a slot that began at the given time. Its reading is published when the
    /// echo arrives or the receive window ends. Returns `false` if the model fails.
    async fn fire(
        &mut self,
        round: Round,
        index: u32,
        ranger: usize,
        (slot, time): (Instant, Timestamp),
    ) -> bool {
        let pose = self.motion.pose(&mut self.control, &self.out);
        let Some(simulation) = &mut self.simulation else { return false };
        let reading = match simulation.reading(index as usize, pose).await {
            Ok(reading) => reading,
            Err(why) => {
                tracing::error!("ranger {ranger}: {why}");
                return false;
            }
        };
        let pose = Some(pose).filter(|pose| *pose != round.pose);
        let ping = Ping { scan: round.scan, index, pose, time: Some(time), ..reading };
        let delay_s = ping.tof_us.map_or_else(|| simulation.window_s(), |tof_us| tof_us * 1e-6);
        sleep_until(slot + Duration::from_secs_f64(delay_s.max(0.0))).await;
        let Ping { time, status, range_m, .. } = ping;
        self.out.state.apply([StateEvent::RangerFired { ranger, time, status, range_m }]);
        self.put(&Record::Ping(Box::new(ping)));
        true
    }

    /// Carries out orders until a time, or until an interrupt that ends the round.
    async fn attend_until(&mut self, until: Instant) -> Option<Interrupt> {
        loop {
            let interrupt = tokio::select! {
                () = sleep_until(until) => return None,
                interrupt = self.control.next() => interrupt,
            };
            match interrupt {
                Interrupt::Shutdown | Interrupt::Stop => return Some(interrupt),
                Interrupt::Log => match self.out.journal.status().error {
                    Some(error) => {
                        tracing::error!("scanning is paused: the log can't be written: {error}");
                    }
                    None => tracing::info!("the log can be written again"),
                },
                // A simulation has neither a port nor a board.
                Interrupt::PortChanged
                | Interrupt::EmergencyStop(_)
                | Interrupt::Start
                | Interrupt::ScheduleChanged => {}
            }
            self.publish_status();
            // The order may have changed the next due time.
            if self.state == LinkState::Ready {
                return Some(interrupt);
            }
        }
    }

    /// Updates the model to the current settings, and publishes a session if they changed.
    async fn update_simulation(&mut self) -> Result<(), String> {
        let air = self.control.air.settled();
        let stale = std::mem::take(&mut self.control.stale);
        if stale {
            self.motion.reload(&self.control);
        }
        if stale || self.simulation.as_ref().is_none_or(|simulation| !simulation.matches(&air)) {
            self.simulation = Some(Simulation::new(&self.control.settings, air).await?);
        }
        let Some(simulation) = &self.simulation else { return Ok(()) };
        let session =
            self.out.with_robot_name(Session::for_array(&simulation.model(), Timestamp::now()));
        let same = self.session.as_ref().is_some_and(|before| {
            *before == Session { started: before.started, ..session.clone() }
        });
        if !same {
            self.put(&Record::Session(Box::new(session.clone())));
            self.session = Some(session);
            self.publish_status();
        }
        Ok(())
    }

    fn put(&mut self, record: &Record) {
        // The journal buffers records that can't be written yet.
        let _ = self.out.record(record);
    }

    fn count(&mut self, [beams, missing]: [u32; 2]) {
        self.out.state.apply([StateEvent::ScanEnded]);
        *if missing > 0 { &mut self.scans.stopped } else { &mut self.scans.completed } += 1;
        self.scans.beams += u64::from(beams);
        self.scans.missing += u64::from(missing);
        self.publish_status();
    }

    fn enter(&mut self, state: LinkState) {
        if std::mem::replace(&mut self.state, state) != state && state == LinkState::Stopped {
            tracing::info!("stopped");
        }
        self.publish_status();
    }

    /// Publishes the current status and settings.
    fn publish_status(&mut self) {
        let control = &self.control;
        // A configured port is not opened.
        let link = LinkSnapshot {
            provenance: Some(Provenance::Simulated),
            ..LinkSnapshot::new(self.state, String::new())
        };
        let simulation = control.settings.simulated.as_ref().map(|simulated| {
            let array = Arc::clone(&simulated.array);
            (array, self.motion.is_driving(), self.firing_grid.skipped())
        });
        self.out.state.apply([
            StateEvent::Link(Box::new(link)),
            control.snapshot(),
            StateEvent::SettingsInForce,
            control.next_scan_at(),
            StateEvent::ScansCounted(self.scans),
            StateEvent::Simulation(simulation),
        ]);
    }

    fn interval(&self) -> Duration {
        let simulated = self.control.settings.simulated.as_ref();
        let interval_ms = simulated.map_or(40.0, |simulated| simulated.array.interval_ms);
        Duration::from_secs_f64(interval_ms * 1e-3)
    }
}
