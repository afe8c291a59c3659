//! The model of an array with what it said last, and the robot's way through the scene.

use std::sync::Arc;

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::{Air, TofNoise},
    array::Course,
    geometry::Pose,
    model::ArrayModel,
};
use sonard_records::{EventKind, Ping, PingStatus};
use tokio::time::Instant;
use uuid::Uuid;

use super::super::{control::Control, fan_out::RecordFanOut, settings::Settings};

/// The model in force, with the last reading of each firing of a round and the pose it is of.
pub(super) struct Simulation {
    model: Arc<ArrayModel>,
    air: Air,
    heard: Vec<Option<(Pose, Ping)>>,
    noise: TofNoise,
    rng: Pcg64,
}

impl Simulation {
    /// Makes the model of what the configuration names, beside everything else.
    pub(super) async fn set(settings: &Settings, air: Air) -> Result<Self, String> {
        let (Some(simulated), Some(scene)) = (&settings.simulated, &settings.scene) else {
            return Err("there is no array or no scene to play".into());
        };
        let (array, scene) = (Arc::clone(&simulated.array), Arc::clone(scene));
        let (sensor, options) = (settings.sensor.clone(), settings.options());
        let firings = array.round().count();
        let making = move || ArrayModel::new(array, &scene, &sensor, air, options);
        let model = tokio::task::spawn_blocking(making)
            .await
            .map_err(|error| format!("the model failed: {error}"))?
            .map_err(|error| error.to_string())?;
        let keys = &settings.keys.simulate;
        Ok(Self {
            model: Arc::new(model),
            air,
            heard: vec![None; firings],
            noise: TofNoise::of_range_mm(keys.noise_mm, air.sound_speed_m_s()),
            rng: Pcg64::seed_from_u64(keys.seed),
        })
    }

    pub(super) fn model(&self) -> Arc<ArrayModel> {
        Arc::clone(&self.model)
    }

    /// The rangers of a round by turn, by index.
    pub(super) fn turns(&self) -> Vec<Vec<usize>> {
        self.model.array().turns()
    }

    pub(super) fn is_of(&self, air: &Air) -> bool {
        self.air == *air
    }

    /// How long a ranger listens, seconds.
    pub(super) fn window_s(&self) -> f64 {
        2.0 * self.model.simulator().receiver().max_range_m / self.air.sound_speed_m_s()
    }

    /// What a firing of a round reads with the robot at a pose, with noise. The model is asked for another
    /// pose than last time only.
    pub(super) async fn reading(&mut self, firing: usize, pose: Pose) -> Result<Ping, String> {
        let known = self.heard.get(firing).and_then(Option::as_ref);
        let known = known.filter(|(of, _)| *of == pose).map(|(_, ping)| ping.clone());
        let ping = match known {
            Some(ping) => ping,
            None => {
                let model = Arc::clone(&self.model);
                let asking = tokio::task::spawn_blocking(move || ask(&model, firing, pose));
                let ping = asking.await.map_err(|error| format!("the model failed: {error}"))??;
                if let Some(heard) = self.heard.get_mut(firing) {
                    *heard = Some((pose, ping.clone()));
                }
                ping
            }
        };
        Ok(self.disturbed(ping))
    }

    /// With noise, where there is an echo to be timed.
    fn disturbed(&mut self, mut ping: Ping) -> Ping {
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

fn ask(model: &ArrayModel, firing: usize, pose: Pose) -> Result<Ping, String> {
    let ranger = model.array().round().nth(firing).ok_or("a round has no such firing")?;
    let stand = model.at(pose).map_err(|error| error.to_string())?;
    let prediction = stand.ping_in_round(firing).map_err(|error| error.to_string())?;
    Ok(Ping::of_array(&stand, Uuid::nil(), &pose, 0, ranger, &prediction))
}

/// Where the robot is: along the configured course until that ends or somebody puts it elsewhere.
pub(super) struct Drive {
    course: Option<Arc<Course>>,
    /// When it left the first pose; `None` when it stands.
    left: Option<Instant>,
    /// Where it was told to be last by the course.
    at: Pose,
}

impl Drive {
    pub(super) fn new(control: &Control) -> Self {
        let course = control.settings.simulated.as_ref().and_then(|one| one.course.clone());
        Self { left: course.is_some().then(Instant::now), course, at: control.pose }
    }

    /// Takes another course, if the configuration has one.
    pub(super) fn reload(&mut self, control: &Control) {
        let other = Self::new(control);
        if other.course != self.course {
            *self = other;
        }
    }

    pub(super) const fn is_driving(&self) -> bool {
        self.left.is_some()
    }

    /// Where it is now; the control knows it too.
    pub(super) fn pose(&mut self, control: &mut Control, out: &RecordFanOut) -> Pose {
        if control.pose != self.at {
            // A program has put it there: the course is over.
            (self.left, self.at) = (None, control.pose);
        }
        let (Some(course), Some(left)) = (&self.course, self.left) else { return self.at };
        let driven_s = left.elapsed().as_secs_f64();
        let pose = course.pose_at(driven_s);
        if let Err(refusal) = control.check_pose(&pose) {
            self.left = None;
            let detail = format!("the robot stops on its course: {}", refusal.message);
            tracing::warn!("{detail}");
            out.event(EventKind::Stopped, detail);
            return self.at;
        }
        if driven_s >= course.duration_s() {
            self.left = None;
        }
        (self.at, control.pose) = (pose, pose);
        pose
    }
}
