//! Sweeps, computed in parts.

use std::sync::Arc;

use jiff::Timestamp;
use sonard_interpret::compare::{AnnotatedPing, Classification};
use sonard_model::{
    geometry::Pose,
    model::{ObservationPoint, Simulator, TooCostly},
    scan_plan::ScanPlan,
};
use sonard_records::{Ping, PingStatus, ScanStart, ScanView, Session, SimRecord};
use uuid::Uuid;

use crate::{RequestError, observation_cache::ObservationCache, setup::with_robot};

/// Sweep of an engine at a pose.
pub(crate) struct Sweep {
    simulator: Arc<Simulator>,
    /// Session and start records, and the pings: measured ones of a log, or planned ones without
    /// readings.
    pub(crate) view: ScanView,
    is_measured: bool,
    next: usize,
    cache: Option<ObservationCache>,
}

impl Sweep {
    /// Starts a simulated sweep.
    pub(crate) fn simulated(
        simulator: Arc<Simulator>,
        pose: Pose,
        plan: ScanPlan,
    ) -> Result<Self, RequestError> {
        plan.check()?;
        let (scan, time) = (Uuid::nil(), Timestamp::UNIX_EPOCH);
        let planned = |index| {
            let azimuth_deg = plan.azimuth_deg(index / plan.pings_per_stop.max(1));
            Ping::new(scan, index, azimuth_deg, PingStatus::NoEcho)
        };
        let view = ScanView {
            scan,
            session: Some(Arc::new(session(&simulator))),
            start: Some(ScanStart::new(scan, time, pose, plan)),
            pings: (0..plan.beams()).map(planned).collect(),
            events: Vec::new(),
            end: None,
        };
        Ok(Self { simulator, view, is_measured: false, next: 0, cache: None })
    }

    /// Starts a sweep that compares the readings of a logged scan with predictions at a pose.
    pub(crate) fn measured(simulator: Arc<Simulator>, pose: Pose, log: &ScanView) -> Self {
        let mut view = ScanView { events: Vec::new(), ..log.clone() };
        if let Some(start) = &mut view.start {
            start.pose = pose;
        }
        let array = log.session.as_ref().and_then(|session| session.array.clone());
        let session = Session { array, ..session(&simulator) };
        view.session = Some(Arc::new(session));
        Self { simulator, view, is_measured: true, next: 0, cache: None }
    }

    /// Computes the next readings, at most `count`.
    pub(crate) fn next_readings(
        &mut self,
        count: usize,
    ) -> Result<Vec<AnnotatedPing>, RequestError> {
        let end = self.view.pings.len().min(self.next + count);
        let readings = (self.next..end).map(|position| self.reading(position)).collect();
        self.next = end;
        readings
    }

    /// Number of readings not yet computed.
    pub(crate) fn remaining(&self) -> usize {
        self.view.pings.len() - self.next
    }

    /// Annotated reading without its path, which is part of [`Beam`](crate::beam::Beam).
    fn reading(&mut self, position: usize) -> Result<AnnotatedPing, RequestError> {
        let mut reading = self.annotated(position)?;
        reading.ping.path = None;
        if let Some(sim) = &mut reading.ping.sim {
            sim.path = None;
        }
        Ok(reading)
    }

    /// Reading with prediction and verdict. A simulated reading is classified by its own path.
    pub(crate) fn annotated(&mut self, position: usize) -> Result<AnnotatedPing, RequestError> {
        let ping = self.view.pings[position].clone();
        let (scan, index, azimuth_deg) = (ping.scan, ping.index, ping.azimuth_deg);
        let predict = |simulator: &Simulator, point: &ObservationPoint<'_>, axis: &Pose| {
            let prediction = point.ping(axis.direction_rad(0.0))?;
            let simulated = Ping::simulated(simulator, scan, index, azimuth_deg, &prediction);
            Ok::<_, TooCostly>((SimRecord::from_prediction(simulator, &prediction), simulated))
        };
        let Some((sim, simulated)) = self.observe(&ping, predict)?.transpose()? else {
            return Ok(AnnotatedPing::new(ping, &self.view));
        };
        if self.is_measured {
            let residual_m = ping.range_m.zip(sim.range_m).map(|(range, sim)| range - sim);
            return Ok(AnnotatedPing::new(Ping { sim: Some(sim), residual_m, ..ping }, &self.view));
        }
        let verdict = Classification::from_ping(&Ping { sim: Some(sim), ..simulated.clone() });
        let mut reading = AnnotatedPing::new(simulated, &self.view);
        reading.annotations.verdict = verdict;
        Ok(reading)
    }

    /// Position of a beam in the sweep.
    pub(crate) fn position_of(&self, index: u32) -> Result<usize, RequestError> {
        let position = self.view.pings.iter().position(|ping| ping.index == index);
        position.ok_or_else(|| RequestError::new(&format!("the sweep has no beam {index}"), ""))
    }

    /// Calls a function with the observation point and axis of a ping; returns `None` if the log
    /// has no pose for it.
    pub(crate) fn observe<T>(
        &mut self,
        ping: &Ping,
        compute: impl FnOnce(&Simulator, &ObservationPoint<'_>, &Pose) -> T,
    ) -> Result<Option<T>, RequestError> {
        let Some(robot) = ping.pose.or_else(|| self.view.pose()) else { return Ok(None) };
        let Some(axis) = ping.axis(self.view.session.as_deref(), &robot) else { return Ok(None) };
        let cache = match self.cache.take().filter(|cache| cache.is_at(&robot, &axis)) {
            Some(cache) => cache,
            None => ObservationCache::new(with_robot(&self.simulator, &robot)?, robot, axis),
        };
        let result = cache.with(|simulator, point| compute(simulator, point, &axis));
        self.cache = Some(cache);
        Ok(Some(result))
    }
}

/// Session of a simulator, without the scene's text, which the page has.
fn session(simulator: &Simulator) -> Session {
    Session { scene_text: None, ..Session::simulated(simulator, Timestamp::UNIX_EPOCH) }
}
