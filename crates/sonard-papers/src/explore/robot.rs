//! Robots that explore: what one can do, and one that the model simulates.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::laser::{Laser, side_by_side};
use crate::trial::hear;
use sonard_interpret::interpret::{Beam, Heard, Sweep, lines::LaserScan};
use sonard_model::{
    geometry::{DVec2, Pose, wrap_360, wrap_pi},
    model::{Simulator, TooCostly, raycast::Reflectors},
};

/// A robot as an exploration sees it.
pub trait Robot {
    /// Where the robot believes to be.
    fn pose(&self) -> Pose;
    /// The readings of all its sonars, the robot turned in place between them.
    fn sonar(&mut self) -> Sweep;
    /// What the laser sees in a world direction, radians.
    fn laser(&mut self, direction_rad: f64) -> LaserScan;
    /// What the laser sees all around, and how many shots that took.
    fn laser_turn(&mut self) -> (LaserScan, u32);
    /// Drives straight to a place; says whether it got there or ran into something.
    fn drive(&mut self, to: DVec2) -> Drive;
}

/// The outcome of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// At the place.
    There,
    /// Something was in the way; the robot backed off.
    Bumped,
}

/// Arrangement of its sonars.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ranger {
    /// Twelve sonars at equal angles; the robot turns 2 degrees between their readings: 180 at each
    /// place.
    Ring,
    /// One ranger on a stepper: 400 readings, 0.9 degrees apart.
    Stepper,
}

impl Ranger {
    /// Azimuths read at each place, degrees, and from one to the next.
    fn azimuths_deg(self) -> (impl Iterator<Item = f64>, f64) {
        let (count, step_deg) = match self {
            Self::Ring => (12 * 15, 2.0),
            Self::Stepper => (400, 0.9),
        };
        ((0..count).map(move |at| wrap_360(step_deg * f64::from(at))), step_deg)
    }
}

/// A simulated robot's figures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotSettings {
    /// Its sonars.
    pub ranger: Ranger,
    /// Its laser.
    pub laser: Laser,
    /// Radius of its body, metres. The body is no obstacle to its own sound.
    pub radius_m: f64,
    /// Standard deviation of a sonar's range, metres.
    pub range_sigma_m: f64,
    /// Standard deviation of the way and of the turn of each drive, as a share of them: what the
    /// robot does not know of where it is.
    pub odometry_noise: f64,
}

impl Default for RobotSettings {
    /// A body as wide as the paper's B12, 12 inches; no error of odometry, as in the paper.
    fn default() -> Self {
        Self {
            ranger: Ranger::Ring,
            laser: Laser::default(),
            radius_m: 0.15,
            range_sigma_m: 0.005,
            odometry_noise: 0.0,
        }
    }
}

/// A robot in a scene, its sonars heard by the model.
pub struct SimulatedRobot<'a, R> {
    simulator: &'a Simulator,
    room: Reflectors,
    settings: RobotSettings,
    rng: R,
    truth: Pose,
    believed: Pose,
    refusal: Option<TooCostly>,
}

/// How far a robot that ran into something backs off, metres.
const BACK_OFF_M: f64 = 0.05;

impl<'a, R: Rng> SimulatedRobot<'a, R> {
    /// At a pose of the simulator's scene that it knows exactly.
    #[must_use]
    pub fn new(simulator: &'a Simulator, pose: Pose, settings: RobotSettings, rng: R) -> Self {
        let room = Reflectors::new(simulator.scene(), &simulator.scene().ray_plan());
        Self { simulator, room, settings, rng, truth: pose, believed: pose, refusal: None }
    }

    /// Why the model could not say what its sonars heard, if that was so anywhere; they were silent there, and
    /// an exploration with that is worth nothing.
    #[must_use]
    pub const fn refusal(&self) -> Option<&TooCostly> {
        self.refusal.as_ref()
    }

    /// Where it really is.
    #[must_use]
    pub const fn truth(&self) -> Pose {
        self.truth
    }

    fn noise(&mut self) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.rng);
        self.settings.odometry_noise * unit
    }

    /// A true pose that looks into a direction as the robot believes it.
    fn looking(&self, direction_rad: f64) -> Pose {
        let turn_deg = direction_rad.to_degrees() - self.believed.heading_deg;
        Pose { heading_deg: self.truth.heading_deg + turn_deg, ..self.truth }
    }

    fn shoot(&mut self, direction_rad: f64) -> LaserScan {
        let pose = self.looking(direction_rad);
        let seen = self.settings.laser.shoot(&self.room, pose, &mut self.rng);
        LaserScan {
            pose: Pose { heading_deg: direction_rad.to_degrees(), ..self.believed },
            ..seen
        }
    }

    /// How far the body gets along a direction, up to a length, metres.
    fn free_way_m(&self, direction: DVec2, length_m: f64) -> f64 {
        const CONTACT_M: f64 = 1e-3;
        let mut way_m = 0.0;
        while way_m < length_m {
            // No nearer to anything than the clearance, so that far it can go at once.
            let at = self.truth.position() + way_m * direction;
            let free_m = self.simulator.scene().clearance_m(at) - self.settings.radius_m;
            let leaves = || {
                self.simulator.scene().clearance_m(at + CONTACT_M * direction)
                    >= free_m + self.settings.radius_m
            };
            if free_m < CONTACT_M && !leaves() {
                return way_m;
            }
            way_m += free_m.max(CONTACT_M);
        }
        length_m
    }
}

impl<R: Rng> Robot for SimulatedRobot<'_, R> {
    fn pose(&self) -> Pose {
        self.believed
    }

    fn sonar(&mut self) -> Sweep {
        let point = self.simulator.at(self.truth.position());
        let (azimuths_deg, step_deg) = self.settings.ranger.azimuths_deg();
        let beams = azimuths_deg.zip(0..).map(|(azimuth_deg, index)| {
            let sigma_m = self.settings.range_sigma_m;
            let heard = match point.ping(self.truth.direction_rad(azimuth_deg)) {
                Ok(heard) => hear(&heard, sigma_m, &mut self.rng),
                Err(refusal) => {
                    self.refusal = Some(refusal);
                    Heard::Silent
                }
            };
            Beam { azimuth_deg, index, heard, mount: DVec2::ZERO }
        });
        Sweep { beams: beams.collect(), pose: self.believed, step_deg, closed: true }
    }

    fn laser(&mut self, direction_rad: f64) -> LaserScan {
        self.shoot(direction_rad)
    }

    fn laser_turn(&mut self) -> (LaserScan, u32) {
        let count = self.settings.laser.shots_per_turn();
        let directions_deg = (0..count).map(|shot| f64::from(shot) * 360.0 / f64::from(count));
        let pose = self.believed;
        let shots: Vec<(f64, LaserScan)> = directions_deg
            .map(|azimuth_deg| (azimuth_deg, self.shoot(pose.direction_rad(azimuth_deg))))
            .collect();
        (side_by_side(pose, &shots), count)
    }

    fn drive(&mut self, to: DVec2) -> Drive {
        let way = to - self.believed.position();
        let length_m = way.length();
        if length_m == 0.0 {
            return Drive::There;
        }
        let turn_rad = wrap_pi(way.to_angle() - self.believed.direction_rad(0.0));
        let true_turn_rad = turn_rad * (1.0 + self.noise());
        let stretch = 1.0 + self.noise();
        self.truth.heading_deg = wrap_360(self.truth.heading_deg + true_turn_rad.to_degrees());
        let direction = DVec2::from_angle(self.truth.direction_rad(0.0));
        let free_m = self.free_way_m(direction, length_m * stretch);
        let (driven_m, drive) = if free_m < length_m * stretch {
            ((free_m - BACK_OFF_M).max(0.0), Drive::Bumped)
        } else {
            (free_m, Drive::There)
        };
        let true_place = self.truth.position() + driven_m * direction;
        let place = self.believed.position() + driven_m / stretch * way / length_m;
        (self.truth.x_m, self.truth.y_m) = true_place.into();
        let heading_deg = wrap_360(way.to_angle().to_degrees());
        self.believed = Pose { x_m: place.x, y_m: place.y, heading_deg };
        drive
    }
}
