//! The operator of an array that the model plays: fires its rangers turn by turn, by the clock.
//!
//! After R. Arrabales' service of simulated sonars: one ranger each interval (25 Hz on a Pioneer), a
//! scan for each round. No port is opened, and every record says that it is simulated. The model finds the
//! paths of an observation point once: a robot that stands costs nothing new, one that moves a search for each firing.

mod rhythm;
mod simulation;

use std::{ops::ControlFlow, time::Duration};

use jiff::Timestamp;
use sonard_api::{LinkState, ScanTotals, SimulationReport};
use sonard_model::geometry::Pose;
use sonard_records::{
    EventKind, Ping, Provenance, Record, STOPPED_ON_REQUEST, ScanEnd, ScanStart, Session, Sink as _,
};
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

use super::{
    agenda::Due,
    control::{Control, Interrupt},
    fan_out::RecordFanOut,
};
use rhythm::Rhythm;
use simulation::{Drive, Simulation};

/// How often a array that waits shows that it is alive.
const BEAT: Duration = Duration::from_secs(1);

pub(super) struct SimulatedArray {
    control: Control,
    out: RecordFanOut,
    simulation: Option<Simulation>,
    drive: Drive,
    rhythm: Rhythm,
    /// The session's record that is in force in the log.
    session: Option<Session>,
    state: LinkState,
    since: Timestamp,
    changed: Instant,
    scans: ScanTotals,
}

/// A round, and where it began.
#[derive(Debug, Clone, Copy)]
struct Round {
    scan: Uuid,
    pose: Pose,
}

impl SimulatedArray {
    pub(super) fn new(control: Control, out: RecordFanOut) -> Self {
        Self {
            drive: Drive::new(&control),
            control,
            out,
            simulation: None,
            rhythm: Rhythm::new(Instant::now()),
            session: None,
            state: LinkState::Ready,
            since: Timestamp::now(),
            changed: Instant::now(),
            scans: ScanTotals::default(),
        }
    }

    /// Plays until the end.
    pub(super) async fn run(mut self) {
        if let Some(simulated) = &self.control.settings.simulated {
            let array = &simulated.array;
            let (name, count) = (&array.name, array.rangers.len());
            tracing::info!("nothing is measured: the model plays {count} rangers, array {name}");
        }
        loop {
            let due = match self.control.agenda.due(self.control.now()) {
                // Nothing is told that can't be kept.
                Due::Now if self.out.journal.is_well() => {
                    if self.round().await.is_break() {
                        break;
                    }
                    continue;
                }
                Due::Now | Due::OnRequest => None,
                Due::At(at) => Some(self.control.epoch + at),
            };
            self.enter(LinkState::Ready);
            let beat = Instant::now() + BEAT;
            let until = due.map_or(beat, |due| due.min(beat));
            if self.attend_until(until).await == Some(Interrupt::Shutdown) {
                break;
            }
            self.out.shared.beat();
        }
        self.enter(LinkState::Stopped);
    }

    /// One round of the array.
    async fn round(&mut self) -> ControlFlow<()> {
        if let Err(why) = self.set_stage().await {
            // Trying again would fail again, until somebody changes something.
            self.control.agenda.stop();
            tracing::error!("no scan is taken: {why}");
            self.out.event(EventKind::Stopped, format!("no scan is taken: {why}"));
            return ControlFlow::Continue(());
        }
        let Some(simulation) = &self.simulation else { return ControlFlow::Continue(()) };
        let (model, turns) = (simulation.model(), simulation.turns());
        self.enter(LinkState::Scanning);
        self.control.agenda.begun(self.control.now());
        self.rhythm.resume(Instant::now());
        let round =
            Round { scan: Uuid::new_v4(), pose: self.drive.pose(&mut self.control, &self.out) };
        let air = self.control.air.settled();
        let start = ScanStart {
            air: Some(self.control.air.scan_air(&air, Instant::now())),
            ..ScanStart::of_array(&model, round.scan, round.pose, 1, Timestamp::now())
        };
        self.put(&Record::ScanStart(start));
        let (mut index, mut fired, mut halted) = (0, 0, None);
        for turn in &turns {
            halted = self.attend_until(self.rhythm.next()).await;
            if halted.is_some() {
                break;
            }
            let at = (Instant::now(), Timestamp::now());
            for &ranger in turn {
                fired += u32::from(self.fire(round, index, ranger, at).await);
                index += 1;
            }
            self.rhythm.advance(Instant::now(), self.interval());
        }
        if let Some(interrupt) = halted {
            let stopping = interrupt == Interrupt::Shutdown;
            let why = if stopping { "the daemon is stopping" } else { STOPPED_ON_REQUEST };
            self.out.event(EventKind::Stopped, why.to_owned());
        }
        let missing = turns.iter().map(Vec::len).sum::<usize>() as u32 - fired;
        let counts = [fired, missing];
        self.put(&Record::ScanEnd(ScanEnd::of_array(&model, round.scan, counts, Timestamp::now())));
        self.count(counts);
        match halted {
            Some(Interrupt::Shutdown) => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }

    /// Fires one ranger in a turn that began at a time, and tells of its reading when its echo is back or its turn
    /// is over; not if the model failed.
    async fn fire(
        &mut self,
        round: Round,
        index: u32,
        ranger: usize,
        (slot, time): (Instant, Timestamp),
    ) -> bool {
        let pose = self.drive.pose(&mut self.control, &self.out);
        let Some(simulation) = &mut self.simulation else { return false };
        let heard = match simulation.reading(index as usize, pose).await {
            Ok(heard) => heard,
            Err(why) => {
                tracing::error!("ranger {ranger}: {why}");
                return false;
            }
        };
        let pose = Some(pose).filter(|pose| *pose != round.pose);
        let ping = Ping { scan: round.scan, index, pose, time: Some(time), ..heard };
        let listening_s = ping.tof_us.map_or_else(|| simulation.window_s(), |tof_us| tof_us * 1e-6);
        sleep_until(slot + Duration::from_secs_f64(listening_s.max(0.0))).await;
        self.out.shared.view.send_modify(|view| {
            let readings = view.simulation.as_mut().map(|told| &mut told.readings);
            if let Some(reading) = readings.and_then(|readings| readings.get_mut(ranger)) {
                (reading.time, reading.status) = (ping.time, Some(ping.status));
                reading.range_m = ping.range_m;
            }
        });
        self.put(&Record::Ping(Box::new(ping)));
        true
    }

    /// Carries out orders until a time, or until one that a round has to end for.
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
                        tracing::error!("no scan until the log can be written: {error}");
                    }
                    None => tracing::info!("the log can be written again"),
                },
                // There is neither a port nor a board.
                Interrupt::PortChanged
                | Interrupt::EmergencyStop(_)
                | Interrupt::Start
                | Interrupt::Agenda => {}
            }
            self.tell();
            // A waiting array has to look at its agenda again.
            if self.state == LinkState::Ready {
                return Some(interrupt);
            }
        }
    }

    /// The model of what is in force now, and a session that says so.
    async fn set_stage(&mut self) -> Result<(), String> {
        let air = self.control.air.settled();
        let stale = std::mem::take(&mut self.control.stale);
        if stale {
            self.drive.reload(&self.control);
        }
        if stale || self.simulation.as_ref().is_none_or(|simulation| !simulation.is_of(&air)) {
            self.simulation = Some(Simulation::set(&self.control.settings, air).await?);
        }
        let Some(simulation) = &self.simulation else { return Ok(()) };
        let session = self.out.named(Session::of_array(&simulation.model(), Timestamp::now()));
        let same = self.session.as_ref().is_some_and(|before| {
            *before == Session { started: before.started, ..session.clone() }
        });
        if !same {
            self.put(&Record::Session(Box::new(session.clone())));
            self.session = Some(session);
            self.tell();
        }
        Ok(())
    }

    fn put(&mut self, record: &Record) {
        // The journal keeps what can't be written yet.
        let _ = self.out.record(record);
    }

    fn count(&mut self, [beams, missing]: [u32; 2]) {
        self.out.shared.view.send_modify(|view| view.scan = None);
        *if missing > 0 { &mut self.scans.stopped } else { &mut self.scans.completed } += 1;
        self.scans.beams += u64::from(beams);
        self.scans.missing += u64::from(missing);
        self.tell();
    }

    fn enter(&mut self, state: LinkState) {
        if std::mem::replace(&mut self.state, state) != state {
            (self.since, self.changed) = (Timestamp::now(), Instant::now());
            if state == LinkState::Stopped {
                tracing::info!("stopped");
            }
        }
        self.tell();
    }

    /// Publishes what is in force.
    fn tell(&mut self) {
        let next_at = match self.control.agenda.due(self.control.now()) {
            Due::At(at) => Some(self.control.epoch + at),
            Due::Now | Due::OnRequest => None,
        };
        let (control, drive, rhythm) = (&self.control, &self.drive, &self.rhythm);
        self.out.shared.view.send_modify(|view| {
            (view.state, view.since, view.changed) = (self.state, self.since, self.changed);
            view.provenance = Some(Provenance::Simulated);
            // Whatever port is configured, none is open.
            view.port.clear();
            view.scanning = control.scanning.clone();
            (view.paused, view.requested) =
                (control.agenda.is_paused(), control.agenda.requested());
            view.next_at = next_at;
            (view.now, view.next) = (control.terms(), control.terms());
            view.configuration = control.configuration.clone();
            view.scans = self.scans;
            let told = control.settings.simulated.as_ref().map(|simulated| {
                let array = &simulated.array;
                let now = SimulationReport::new(array);
                let before = view.simulation.take().filter(|told| told.is_of(array));
                let readings = before.map_or(now.readings, |before| before.readings);
                let (driving, skipped) = (drive.is_driving(), rhythm.skipped());
                SimulationReport { driving, skipped, readings, ..now }
            });
            view.simulation = told;
        });
    }

    fn interval(&self) -> Duration {
        let simulated = self.control.settings.simulated.as_ref();
        let interval_ms = simulated.map_or(40.0, |simulated| simulated.array.interval_ms);
        Duration::from_secs_f64(interval_ms * 1e-3)
    }
}
