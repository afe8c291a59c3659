//! World that predictions depend on, and its changes by parameters.

use std::{collections::BTreeMap, sync::Arc};

use glam::DVec2;
use sonard_model::{
    acoustics::{Air, Aperture, Receiver, Sensor},
    geometry::Pose,
    model::{ModelError, ObservationPoint, Options, Simulator, TooCostly},
    scene::{Material, PoseError, Scene},
};
use thiserror::Error;

use crate::{
    motion::SceneMotion,
    parameter::{EndOfWall, Parameter, PostPart},
    walls::{self, WallChange, moved_ends},
};

/// Maximum share of its length by which a wall is shortened at an end.
const MAX_SHORTENED: f64 = 0.9;

/// Minimum radius of a fitted cylinder, metres.
const MIN_RADIUS_M: f64 = 0.001;

/// Scene, sensor, air and stepper.
#[derive(Debug, Clone)]
pub struct World {
    /// Scene of the predictions.
    pub scene: Arc<Scene>,
    /// Sensor of the ranger.
    pub sensor: Sensor,
    /// Properties of the air.
    pub air: Air,
    /// Options of the simulator.
    pub options: Options,
    /// Offset added to every range, metres.
    pub delay_m: f64,
    /// Offset added to every azimuth, degrees.
    pub heading_zero_deg: f64,
    /// Factor applied to every azimuth.
    pub gear: f64,
}

/// Invalid world, or invalid pose in it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum WorldError {
    /// Invalid sensor or options.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// More paths than can be found.
    #[error(transparent)]
    TooCostly(#[from] TooCostly),
    /// Pose outside the free space.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Air outside the valid ranges.
    #[error("air: {0}")]
    Air(#[from] sonard_model::acoustics::AirError),
}

/// Arbitrary pose, for what does not depend on it.
const ANYWHERE: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };

impl World {
    /// World without range delay and with an exact stepper. A threshold among the options replaces
    /// the sensor's, so that it can be fitted.
    #[must_use]
    pub fn new(scene: Arc<Scene>, mut sensor: Sensor, air: Air, mut options: Options) -> Self {
        sensor.threshold = options.threshold.take().unwrap_or(sensor.threshold);
        Self { scene, sensor, air, options, delay_m: 0.0, heading_zero_deg: 0.0, gear: 1.0 }
    }

    /// Simulator of the world with the robot's body at a pose.
    ///
    /// # Errors
    /// Invalid sensor, air or options.
    pub fn simulator(&self, robot: &Pose) -> Result<Simulator, WorldError> {
        Ok(Simulator::new(self.scene_around(robot), self.sensor.clone(), self.air, self.options)?)
    }

    /// Scene with the robot's body, if it has one.
    fn scene_around(&self, robot: &Pose) -> Arc<Scene> {
        match self.scene.robot {
            Some(_) => Arc::new(self.scene.with_robot_at(robot)),
            None => Arc::clone(&self.scene),
        }
    }

    /// World with the transducer on the axis, where all directions share their paths.
    #[must_use]
    pub(crate) fn with_face_on_axis(&self) -> Self {
        let mut world = self.clone();
        let mounting = &mut world.sensor.mounting;
        (mounting.ahead_m, mounting.left_m, mounting.separation_m) = (0.0, 0.0, 0.0);
        world
    }

    /// World direction of a firing, radians.
    #[must_use]
    pub fn direction_rad(&self, pose: &Pose, azimuth_deg: f64) -> f64 {
        pose.direction_rad(self.heading_zero_deg + self.gear * azimuth_deg)
    }

    /// World after changes of its parameters; those of single sweeps are ignored.
    ///
    /// # Errors
    /// Air outside the valid ranges.
    pub fn changed(&self, changes: &[(&Parameter, f64)]) -> Result<Self, WorldError> {
        let mut world = self.clone();
        let mut changes_of_walls: BTreeMap<usize, WallChange> = BTreeMap::new();
        let mut cylinders = self.scene.cylinders.clone();
        let mut materials: BTreeMap<&str, Material> = BTreeMap::new();
        for &(parameter, by) in changes {
            let (min, max) = self.limits(parameter);
            let by = by.clamp(min, max);
            match parameter {
                Parameter::X(_) | Parameter::Y(_) | Parameter::Heading(_) => {}
                Parameter::HeadingZero => world.heading_zero_deg += by,
                Parameter::Gear => world.gear *= 1.0 + by,
                Parameter::Ahead => world.sensor.mounting.ahead_m += by,
                Parameter::Left => world.sensor.mounting.left_m += by,
                Parameter::Height => {
                    world.sensor.mounting.z_m = self.sensor_z_m().map(|z_m| z_m + by);
                }
                Parameter::SoundSpeed => {
                    let speed_m_s = world.air.sound_speed_m_s() * (1.0 + by);
                    world.air = world.air.with_temperature_for_sound_speed(speed_m_s)?;
                }
                Parameter::Delay => world.delay_m += by,
                Parameter::Threshold => world.sensor.threshold *= 10f64.powf(by / 20.0),
                Parameter::ThresholdRise => world.sensor.threshold_rise_db_per_m += by,
                Parameter::Skirts => {
                    if let Aperture::Piston { skirts_db: Some(db), .. } = &mut world.sensor.aperture
                    {
                        *db += by;
                    }
                }
                Parameter::Aperture => scale_aperture(&mut world.sensor.aperture, by.exp()),
                Parameter::Bandwidth => world.sensor.pulse.widen_band(by.exp()),
                Parameter::Reflectance(name) | Parameter::Roughness(name) => {
                    if let Some(material) = self.scene.materials.get(name) {
                        let new = materials.entry(name).or_insert(*material);
                        // Rounding may exceed a limit.
                        match parameter {
                            Parameter::Roughness(_) => {
                                new.roughness = (material.roughness + by).clamp(0.0, 1.0);
                            }
                            _ => new.reflectance = (material.reflectance * by.exp()).min(1.0),
                        }
                    }
                }
                Parameter::Wall(wall) => {
                    changes_of_walls.entry(*wall).or_default().offset_m += by;
                }
                Parameter::WallTurn(wall) => {
                    changes_of_walls.entry(*wall).or_default().turn_rad += by.to_radians();
                }
                Parameter::WallEnd(wall, end) => {
                    let [a, b] = &mut changes_of_walls.entry(*wall).or_default().longer_m;
                    *(if *end == EndOfWall::A { a } else { b }) += by;
                }
                Parameter::Post(post, part) => {
                    if let Some(cylinder) = cylinders.get_mut(*post) {
                        match part {
                            PostPart::X => cylinder.center.x += by,
                            PostPart::Y => cylinder.center.y += by,
                            PostPart::Radius => cylinder.radius_m += by,
                        }
                    }
                }
            }
        }
        let walls: Vec<_> = changes_of_walls.into_iter().collect();
        if !walls.is_empty() || !materials.is_empty() || cylinders != self.scene.cylinders {
            let scene = Scene { cylinders, ..Scene::clone(&self.scene) };
            world.scene = Arc::new(changed_scene(&scene, &walls, &materials));
        }
        Ok(world)
    }

    /// Minimum and maximum change of a parameter: the threshold does not fall with range, the
    /// side-lobe floor is not above the axis, no material reflects or scatters more than it
    /// receives, and no wall or cylinder vanishes.
    #[must_use]
    pub fn limits(&self, parameter: &Parameter) -> (f64, f64) {
        let (min, max) = (f64::NEG_INFINITY, f64::INFINITY);
        match parameter {
            Parameter::ThresholdRise => (-self.sensor.threshold_rise_db_per_m, max),
            Parameter::Skirts => match self.sensor.aperture {
                Aperture::Piston { skirts_db: Some(db), .. } => (min, -db),
                _ => (min, max),
            },
            Parameter::Reflectance(name) => {
                let known = self.scene.materials.get(name);
                (min, known.map_or(max, |material| -material.reflectance.ln()))
            }
            Parameter::Roughness(name) => {
                let known = self.scene.materials.get(name);
                known.map_or((min, max), |material| (-material.roughness, 1.0 - material.roughness))
            }
            Parameter::WallEnd(wall, _) => {
                let known = self.scene.walls.get(*wall);
                (known.map_or(min, |wall| MAX_SHORTENED * -wall.a.distance(wall.b)), max)
            }
            Parameter::Post(post, PostPart::Radius) => {
                let known = self.scene.cylinders.get(*post);
                (known.map_or(min, |cylinder| (MIN_RADIUS_M - cylinder.radius_m).min(0.0)), max)
            }
            _ => (min, max),
        }
    }

    /// Height of the transducer, metres; `None` in a scene without floor and ceiling.
    #[must_use]
    pub fn sensor_z_m(&self) -> Option<f64> {
        sonard_model::model::sensor_z_m(&self.scene, &self.sensor)
    }

    /// Motion by a parameter, if independent of the beam direction.
    pub(crate) fn steady_motion(&self, parameter: &Parameter) -> Option<SceneMotion> {
        match parameter {
            Parameter::X(_) => Some(self.with_body(DVec2::X)),
            Parameter::Y(_) => Some(self.with_body(DVec2::Y)),
            Parameter::Height => Some(SceneMotion { up: 1.0, ..SceneMotion::default() }),
            Parameter::Wall(wall) => {
                Some(self.with_wall(*wall, &WallChange { offset_m: 1.0, ..WallChange::default() }))
            }
            Parameter::WallTurn(wall) => {
                let turn_rad = 1f64.to_radians();
                Some(self.with_wall(*wall, &WallChange { turn_rad, ..WallChange::default() }))
            }
            Parameter::WallEnd(wall, end) => {
                let longer_m =
                    [EndOfWall::A, EndOfWall::B].map(|of| f64::from(u8::from(of == *end)));
                Some(self.with_wall(*wall, &WallChange { longer_m, ..WallChange::default() }))
            }
            Parameter::Post(post, part) => {
                let (velocity, growth) = match part {
                    PostPart::X => (DVec2::X, 0.0),
                    PostPart::Y => (DVec2::Y, 0.0),
                    PostPart::Radius => (DVec2::ZERO, 1.0),
                };
                let cylinders = vec![(*post as u32, velocity, growth)];
                Some(SceneMotion { cylinders, ..SceneMotion::default() })
            }
            _ => None,
        }
    }

    /// Motion by a change of a wall, per unit.
    fn with_wall(&self, wall: usize, unit: &WallChange) -> SceneMotion {
        let walls = walls::velocities(&self.scene, wall, unit);
        SceneMotion { walls, ..SceneMotion::default() }
    }

    /// Motion of the transducer by a parameter for a firing; `None` if it changes no length.
    pub(crate) fn turning_motion(
        &self,
        parameter: &Parameter,
        direction_rad: f64,
        azimuth_deg: f64,
    ) -> Option<SceneMotion> {
        let ahead = DVec2::from_angle(direction_rad);
        match parameter {
            Parameter::Ahead => Some(SceneMotion::for_transducer(ahead)),
            Parameter::Left => Some(SceneMotion::for_transducer(ahead.perp())),
            Parameter::Heading(_) | Parameter::HeadingZero => {
                self.turned(direction_rad, 1f64.to_radians())
            }
            Parameter::Gear => self.turned(direction_rad, azimuth_deg.to_radians()),
            _ => None,
        }
    }

    /// Motion of an off-axis transducer by a rotation.
    fn turned(&self, direction_rad: f64, by_rad: f64) -> Option<SceneMotion> {
        let mounting = &self.sensor.mounting;
        if mounting.is_on_axis() {
            return None;
        }
        let places = mounting.transducer_positions(DVec2::ZERO, direction_rad);
        Some(SceneMotion {
            transducer: places.map(|place| by_rad * place.perp()),
            ..SceneMotion::default()
        })
    }

    /// Motion of the transducer together with the robot's body.
    fn with_body(&self, velocity: DVec2) -> SceneMotion {
        let mut motion = SceneMotion::for_transducer(velocity);
        if let Some(robot) = &self.scene.robot {
            let around = self.scene.with_robot_at(&ANYWHERE);
            debug_assert!(around.walls.len() + around.cylinders.len() > 0, "{robot:?}");
            let of = |from: usize, to: usize| from as u32..to as u32;
            let walls = of(self.scene.walls.len(), around.walls.len());
            motion.walls = walls.map(|wall| (wall, [velocity; 2])).collect();
            let cylinders = of(self.scene.cylinders.len(), around.cylinders.len());
            motion.cylinders = cylinders.map(|cylinder| (cylinder, velocity, 0.0)).collect();
        }
        motion
    }
}

/// Simulators of a world at any pose: a single one, unless a robot's body moves along.
#[derive(Clone)]
pub(crate) struct SimulatorSet {
    world: World,
    anywhere: Arc<Simulator>,
}

impl SimulatorSet {
    pub(crate) fn new(world: &World) -> Result<Self, WorldError> {
        Ok(Self { world: world.clone(), anywhere: Arc::new(world.simulator(&ANYWHERE)?) })
    }

    /// Simulators of another world, sharing whatever it has in common with this one.
    pub(crate) fn changed_to(&self, world: &World) -> Result<Self, WorldError> {
        let World { scene, sensor, air, options, .. } = &self.world;
        if *sensor != world.sensor || *air != world.air || *options != world.options {
            return Self::new(world);
        }
        let anywhere = match Arc::ptr_eq(scene, &world.scene) {
            true => Arc::clone(&self.anywhere),
            false => Arc::new(self.anywhere.in_scene(world.scene_around(&ANYWHERE))?),
        };
        Ok(Self { world: world.clone(), anywhere })
    }

    /// Receiver, which is common to all poses.
    pub(crate) fn receiver(&self) -> &Receiver {
        self.anywhere.receiver()
    }

    /// Evaluates the simulator with the robot at a pose.
    pub(crate) fn at<T>(
        &self,
        pose: &Pose,
        evaluate: impl FnOnce(&Simulator, &ObservationPoint) -> Result<T, WorldError>,
    ) -> Result<T, WorldError> {
        let own;
        let simulator = match self.world.scene.robot {
            None => &*self.anywhere,
            Some(_) => {
                own = self.anywhere.in_scene(self.world.scene_around(pose))?;
                &own
            }
        };
        evaluate(simulator, &simulator.at(pose.position()))
    }
}

fn scale_aperture(aperture: &mut Aperture, by: f64) {
    match aperture {
        Aperture::Piston { radius_m, .. } => *radius_m *= by,
        Aperture::Line { half_length_m, .. } => *half_length_m *= by,
        Aperture::Gaussian { half_angle_deg, .. } => *half_angle_deg /= by,
        Aperture::Table { points, .. } => {
            points.iter_mut().for_each(|point| point.angle_deg = (point.angle_deg / by).min(180.0));
            // Points that no longer fit between front and back are removed.
            let fits = 1 + points.iter().take_while(|point| point.angle_deg < 180.0).count();
            points.truncate(fits);
            if let Some(last) = points.last_mut() {
                last.level_db = None;
            }
        }
    }
}

fn changed_scene(
    scene: &Scene,
    changes: &[(usize, WallChange)],
    materials: &BTreeMap<&str, Material>,
) -> Scene {
    let mut changed = scene.clone();
    if !changes.is_empty() {
        for (wall, [a, b]) in changed.walls.iter_mut().zip(moved_ends(scene, changes)) {
            (wall.a, wall.b) = (a, b);
        }
    }
    for (&name, &new) in materials {
        let Some(material) = scene.materials.get(name) else { continue };
        let of = changed.walls.iter_mut().map(|wall| &mut wall.material);
        let of = of.chain(changed.cylinders.iter_mut().map(|cylinder| &mut cylinder.material));
        let of = of.chain([&mut changed.floor_material, &mut changed.ceiling_material]);
        of.filter(|known| **known == *material).for_each(|known| *known = new);
        changed.materials.insert(name.to_owned(), new);
    }
    changed
}
