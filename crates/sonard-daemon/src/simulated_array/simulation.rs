//! Model of an array with its last readings, and motion of the robot through the scene.

use std::sync::Arc;

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::{Air, TofNoise},
    array::RobotCourse,
    geometry::Pose,
    model::ArrayModel,
};
use sonard_records::{EventKind, Ping, PingStatus};
use tokio::time::Instant;
use uuid::Uuid;

use super::super::{control::Control, fan_out::RecordFanOut, settings::Settings};

/// Current model, with the last reading of each firing of a round and its pose.
pub(super) struct Simulation {
    model: Arc<ArrayModel>,
    air: Air,
    /// Last pose and noise-free reading, by firing of a round.
    readings: Vec<Option<(Pose, Ping)>>,
    noise: TofNoise,
    rng: Pcg64,
}

impl Simulation {
    /// Builds the model of the configured array and scene, in a thread of its own.
    pub(super) async fn new(settings: &Settings, air: Air) -> Result<Self, String> {
        let (Some(simulated), Some(scene)) = (&settings.simulated, &settings.scene) else {
            return Err("the simulation needs an array and a scene".into());
        };
        let (array, scene) = (Arc::clone(&simulated.array), Arc::clone(scene));
        let (sensor, options) = (settings.sensor.clone(), settings.options());
        let firings = array.round().count();
        let build = move || ArrayModel::new(array, &scene, &sensor, air, options);
        let model = tokio::task::spawn_blocking(build)
            .await
            .map_err(|error| format!("the model failed: {error}"))?
            .map_err(|error| error.to_string())?;
        let keys = &settings.keys.simulate;
        Ok(Self {
            model: Arc::new(model),
            air,
            readings: vec![None; firings],
            noise: TofNoise::from_range_sigma_mm(keys.noise_mm, air.sound_speed_m_s()),
            rng: Pcg64::seed_from_u64(keys.seed),
        })
    }

    pub(super) fn model(&self) -> Arc<ArrayModel> {
        Arc::clone(&self.model)
    }

    /// Indices of the rangers that fire in each slot of a round.
    pub(super) fn turns(&self) -> Vec<Vec<usize>> {
        self.model.array().slots()
    }

    pub(super) fn matches(&self, air: &Air) -> bool {
        self.air == *air
    }

    /// Receive window of a ranger, seconds.
    pub(super) fn window_s(&self) -> f64 {
        2.0 * self.model.simulator().receiver().max_range_m / self.air.sound_speed_m_s()
    }

    /// Reading of a firing of the round with the robot at a pose, with noise. The model is
    /// evaluated only if the pose differs from the last one.
    pub(super) async fn reading(&mut self, firing: usize, pose: Pose) -> Result<Ping, String> {
        let cached = self.readings.get(firing).and_then(Option::as_ref);
        let cached = cached.filter(|(at, _)| *at == pose).map(|(_, ping)| ping.clone());
        let ping = match cached {
            Some(ping) => ping,
            None => {
                let model = Arc::clone(&self.model);
                let task = tokio::task::spawn_blocking(move || evaluate(&model, firing, pose));
                let ping = task.await.map_err(|error| format!("the model failed: {error}"))??;
                if let Some(cached) = self.readings.get_mut(firing) {
                    *cached = Some((pose, ping.clone()));
                }
                ping
            }
        };
        Ok(self.add_noise(ping))
    }

    /// Adds timing noise to a reading with an echo.
    fn add_noise(&mut self, mut ping: Ping) -> Ping {
        if self.noise.sigma_us > 0.0
            && ping.status == PingStatus::Echo
            && let (Some(tof_us), Some(range_m)) = (&mut ping.tof_us, &mut ping.range_m)
        {
            let error_us = self.noise.sample_us(&mut self.rng).max(-*tof_us);
            *tof_us += error_us;
            *range_m += self.air.sound_speed_m_s() * error_us * 1e-6 / 2.0;
        }
        ping
    }
}

fn evaluate(model: &ArrayModel, firing: usize, pose: Pose) -> Result<Ping, String> {
    let ranger = model.array().round().nth(firing).ok_or("the round has no such firing")?;
    let placed = model.at(pose).map_err(|error| error.to_string())?;
    let prediction = placed.ping_in_round(firing).map_err(|error| error.to_string())?;
    Ok(Ping::for_array(&placed, Uuid::nil(), &pose, 0, ranger, &prediction))
}

/// Motion of the robot: along the configured course, until it ends or an order sets another pose.
pub(super) struct RobotMotion {
    course: Option<Arc<RobotCourse>>,
    /// Departure from the first pose; `None` at rest.
    departed: Option<Instant>,
    /// Last pose set by the course.
    at: Pose,
}

impl RobotMotion {
    pub(super) fn new(control: &Control) -> Self {
        let course =
            control.settings.simulated.as_ref().and_then(|simulated| simulated.course.clone());
        Self { departed: course.is_some().then(Instant::now), course, at: control.pose }
    }

    /// Restarts with the configured course, if it changed.
    pub(super) fn reload(&mut self, control: &Control) {
        let configured = Self::new(control);
        if configured.course != self.course {
            *self = configured;
        }
    }

    pub(super) const fn is_driving(&self) -> bool {
        self.departed.is_some()
    }

    /// Current pose of the robot, which is also set in `control`.
    pub(super) fn pose(&mut self, control: &mut Control, out: &RecordFanOut) -> Pose {
        if control.pose != self.at {
            // An order has set another pose, which ends the course.
            (self.departed, self.at) = (None, control.pose);
        }
        let (Some(course), Some(departed)) = (&self.course, self.departed) else { return self.at };
        let driven_s = departed.elapsed().as_secs_f64();
        let pose = course.pose_at(driven_s);
        if let Err(error) = control.check_pose(&pose) {
            self.departed = None;
            let detail = format!("the robot stopped on its course: {}", error.message);
            tracing::warn!("{detail}");
            out.event(EventKind::Stopped, detail);
            return self.at;
        }
        if driven_s >= course.duration_s() {
            self.departed = None;
        }
        (self.at, control.pose) = (pose, pose);
        pose
    }
}
