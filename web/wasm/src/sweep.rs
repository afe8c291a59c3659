//! A sweep, told piece by piece.

use std::sync::Arc;

use jiff::Timestamp;
use sonard_interpret::compare::{JudgedPing, Word};
use sonard_model::{
    geometry::Pose,
    model::{ObservationPoint, Simulator, TooCostly},
    plan::ScanPlan,
};
use sonard_records::{Ping, PingStatus, ScanStart, ScanView, Session, SimRecord};
use uuid::Uuid;

use crate::{Refusal, setup::around, standing::Standing};

/// Readings of an engine at a pose.
pub(crate) struct Sweep {
    simulator: Arc<Simulator>,
    /// Session, start, and the firings: of a log as they were measured, else as they are planned.
    pub(crate) view: ScanView,
    is_measured: bool,
    next: usize,
    standing: Option<Standing>,
}

impl Sweep {
    /// What the model alone reads.
    pub(crate) fn modelled(
        simulator: Arc<Simulator>,
        pose: Pose,
        plan: ScanPlan,
    ) -> Result<Self, Refusal> {
        plan.check()?;
        let (scan, time) = (Uuid::nil(), Timestamp::UNIX_EPOCH);
        let firing = |index| {
            let azimuth_deg = plan.azimuth_deg(index / plan.pings_per_stop.max(1));
            Ping::new(scan, index, azimuth_deg, PingStatus::NoEcho)
        };
        let view = ScanView {
            scan,
            session: Some(Arc::new(session(&simulator))),
            start: Some(ScanStart::new(scan, time, pose, plan)),
            pings: (0..plan.beams()).map(firing).collect(),
            events: Vec::new(),
            end: None,
        };
        Ok(Self { simulator, view, is_measured: false, next: 0, standing: None })
    }

    /// What was measured, beside what the model reads if the ranger stood at a pose.
    pub(crate) fn measured(simulator: Arc<Simulator>, pose: Pose, log: &ScanView) -> Self {
        let mut view = ScanView { events: Vec::new(), ..log.clone() };
        if let Some(start) = &mut view.start {
            start.pose = pose;
        }
        let array = log.session.as_ref().and_then(|session| session.array.clone());
        let session = Session { array, ..session(&simulator) };
        view.session = Some(Arc::new(session));
        Self { simulator, view, is_measured: true, next: 0, standing: None }
    }

    /// The next readings, at most so many.
    pub(crate) fn more(&mut self, count: usize) -> Result<Vec<JudgedPing>, Refusal> {
        let last = self.view.pings.len().min(self.next + count);
        let readings = (self.next..last).map(|place| self.reading(place)).collect();
        self.next = last;
        readings
    }

    /// How many are to come.
    pub(crate) fn left(&self) -> usize {
        self.view.pings.len() - self.next
    }

    /// One reading without its path, which [`beam`](crate::beam) tells.
    fn reading(&mut self, place: usize) -> Result<JudgedPing, Refusal> {
        let mut judged = self.judged(place)?;
        judged.ping.path = None;
        if let Some(sim) = &mut judged.ping.sim {
            sim.path = None;
        }
        Ok(judged)
    }

    /// One reading with what explains it. What the model alone reads is explained by the model.
    pub(crate) fn judged(&mut self, place: usize) -> Result<JudgedPing, Refusal> {
        let firing = self.view.pings[place].clone();
        let (scan, index, azimuth_deg) = (firing.scan, firing.index, firing.azimuth_deg);
        let predict = |simulator: &Simulator, point: &ObservationPoint<'_>, axis: &Pose| {
            let prediction = point.ping(axis.direction_rad(0.0))?;
            let alone = Ping::simulated(simulator, scan, index, azimuth_deg, &prediction);
            Ok::<_, TooCostly>((SimRecord::of(simulator, &prediction), alone))
        };
        let Some((sim, alone)) = self.look(&firing, predict)?.transpose()? else {
            return Ok(JudgedPing::of(firing, &self.view));
        };
        if self.is_measured {
            let residual_m = firing.range_m.zip(sim.range_m).map(|(range, sim)| range - sim);
            return Ok(JudgedPing::of(Ping { sim: Some(sim), residual_m, ..firing }, &self.view));
        }
        let verdict = Word::of(&Ping { sim: Some(sim), ..alone.clone() });
        let mut judged = JudgedPing::of(alone, &self.view);
        judged.beside.verdict = verdict;
        Ok(judged)
    }

    /// Where a beam stands in the sweep.
    pub(crate) fn place_of(&self, index: u32) -> Result<usize, Refusal> {
        let place = self.view.pings.iter().position(|ping| ping.index == index);
        place.ok_or_else(|| Refusal::new(&format!("the sweep has no beam {index}"), ""))
    }

    /// Looks from where a firing was taken along its axis; `None` if its log does not say where.
    pub(crate) fn look<T>(
        &mut self,
        firing: &Ping,
        see: impl FnOnce(&Simulator, &ObservationPoint<'_>, &Pose) -> T,
    ) -> Result<Option<T>, Refusal> {
        let Some(robot) = firing.pose.or_else(|| self.view.pose()) else { return Ok(None) };
        let Some(axis) = firing.axis(self.view.session.as_deref(), &robot) else { return Ok(None) };
        let there = self.standing.take().filter(|standing| standing.is_at(&robot, &axis));
        let standing = match there {
            Some(standing) => standing,
            None => Standing::new(around(&self.simulator, &robot)?, robot, axis),
        };
        let seen = standing.look(|simulator, point| see(simulator, point, &axis));
        self.standing = Some(standing);
        Ok(Some(seen))
    }
}

/// A session of the simulator, without the text of its scene, which the page has.
fn session(simulator: &Simulator) -> Session {
    Session { scene_text: None, ..Session::simulated(simulator, Timestamp::UNIX_EPOCH) }
}
