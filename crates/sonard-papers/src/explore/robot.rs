//! Interface of an exploring robot, and its simulation by the model.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::laser::{Laser, join_shots};
use crate::trial::simulate_reading;
use sonard_interpret::interpret::{BeamOutcome, Sweep, SweepBeam, lines::LaserScan};
use sonard_model::{
    geometry::{DVec2, Pose, wrap_360, wrap_pi},
    model::{Simulator, TooCostly, raycast::Reflectors},
};

/// Robot controlled by an exploration.
pub trait Robot {
    /// Returns the pose by odometry.
    fn pose(&self) -> Pose;
    /// Measures with all sonars while the robot turns in place.
    fn sonar(&mut self) -> Sweep;
    /// Takes a laser shot in a world direction, radians.
    fn laser(&mut self, direction_rad: f64) -> LaserScan;
    /// Takes a full turn of laser shots; returns the scan and the number of shots.
    fn laser_turn(&mut self) -> (LaserScan, u32);
    /// Drives straight to a position or to the first obstacle.
    fn drive(&mut self, to: DVec2) -> DriveOutcome;
}

/// Outcome of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveOutcome {
    /// Arrived at the requested position.
    Arrived,
    /// Collided with an obstacle and backed off.
    Collided,
}

/// Arrangement of the robot's sonars.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SonarLayout {
    /// Twelve sonars at equal angles; the robot turns by 2 degrees between readings: 180 at each
    /// stop.
    Ring,
    /// Single ranger on a stepper: 400 readings, 0.9 degrees apart.
    Stepper,
}

impl SonarLayout {
    /// Azimuths of the readings at each stop and their spacing, degrees.
    fn azimuths_deg(self) -> (impl Iterator<Item = f64>, f64) {
        let (count, step_deg) = match self {
            Self::Ring => (12 * 15, 2.0),
            Self::Stepper => (400, 0.9),
        };
        ((0..count).map(move |at| wrap_360(step_deg * f64::from(at))), step_deg)
    }
}

/// Properties of a simulated robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotSettings {
    /// Arrangement of the sonars.
    pub ranger: SonarLayout,
    /// Properties of the laser.
    pub laser: Laser,
    /// Radius of the body, metres. The body does not affect the sound.
    pub radius_m: f64,
    /// Standard deviation of a sonar range, metres.
    pub range_sigma_m: f64,
    /// Relative standard deviation of the distance and of the turn of each drive. The resulting
    /// errors are unknown to the robot.
    pub odometry_noise: f64,
    /// Standard deviations of the errors of each drive, also unknown to the robot: of the position,
    /// metres per metre, ahead and to the left, and of the heading, degrees per metre.
    pub drift_per_m: [f64; 2],
}

impl Default for RobotSettings {
    /// Ring with a body of 12 inches like the paper's B12, and exact odometry as in the paper.
    fn default() -> Self {
        Self {
            ranger: SonarLayout::Ring,
            laser: Laser::default(),
            radius_m: 0.15,
            range_sigma_m: 0.005,
            odometry_noise: 0.0,
            drift_per_m: [0.0; 2],
        }
    }
}

/// Robot in a scene with readings simulated by the model.
pub struct SimulatedRobot<'a, R> {
    simulator: &'a Simulator,
    room: Reflectors,
    settings: RobotSettings,
    rng: R,
    truth: Pose,
    odometry: Pose,
    course: Vec<Pose>,
    error: Option<TooCostly>,
}

/// Distance by which a robot backs off after a collision, metres.
const BACK_OFF_M: f64 = 0.05;

impl<'a, R: Rng> SimulatedRobot<'a, R> {
    /// Robot at an exactly known pose in the simulator's scene.
    #[must_use]
    pub fn new(simulator: &'a Simulator, pose: Pose, settings: RobotSettings, rng: R) -> Self {
        let room = Reflectors::new(simulator.scene(), &simulator.scene().ray_plan());
        let (truth, odometry, course) = (pose, pose, Vec::new());
        Self { simulator, room, settings, rng, truth, odometry, course, error: None }
    }

    /// Last error of the model. The affected sonar readings lack an echo, so the exploration is
    /// invalid.
    #[must_use]
    pub const fn error(&self) -> Option<&TooCostly> {
        self.error.as_ref()
    }

    /// True pose, unknown to the exploration.
    #[must_use]
    pub const fn truth(&self) -> Pose {
        self.truth
    }

    /// True poses of the sonar sweeps and laser turns, unknown to the exploration.
    #[must_use]
    pub fn course(&self) -> &[Pose] {
        &self.course
    }

    fn noise(&mut self) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.rng);
        self.settings.odometry_noise * unit
    }

    /// Error of a drive per metre. Exact odometry takes no random numbers.
    fn drift(&mut self, sigma_per_m: f64) -> f64 {
        if sigma_per_m > 0.0 {
            let unit: f64 = StandardNormal.sample(&mut self.rng);
            sigma_per_m * unit
        } else {
            0.0
        }
    }

    /// True pose turned to a direction in the robot's odometry frame.
    fn true_pose_towards(&self, direction_rad: f64) -> Pose {
        let turn_deg = direction_rad.to_degrees() - self.odometry.heading_deg;
        Pose { heading_deg: self.truth.heading_deg + turn_deg, ..self.truth }
    }

    fn shoot(&mut self, direction_rad: f64) -> LaserScan {
        let pose = self.true_pose_towards(direction_rad);
        let scan = self.settings.laser.shoot(&self.room, pose, &mut self.rng);
        LaserScan {
            pose: Pose { heading_deg: direction_rad.to_degrees(), ..self.odometry },
            ..scan
        }
    }

    /// Free distance of the body along a direction, at most `length_m`, metres.
    fn free_distance_m(&self, direction: DVec2, length_m: f64) -> f64 {
        const CONTACT_M: f64 = 1e-3;
        let mut distance_m = 0.0;
        while distance_m < length_m {
            // The clearance is a lower bound of the free distance in any direction.
            let at = self.truth.position() + distance_m * direction;
            let free_m = self.simulator.scene().clearance_m(at) - self.settings.radius_m;
            let leaves = || {
                self.simulator.scene().clearance_m(at + CONTACT_M * direction)
                    >= free_m + self.settings.radius_m
            };
            if free_m < CONTACT_M && !leaves() {
                return distance_m;
            }
            distance_m += free_m.max(CONTACT_M);
        }
        length_m
    }
}

impl<R: Rng> Robot for SimulatedRobot<'_, R> {
    fn pose(&self) -> Pose {
        self.odometry
    }

    fn sonar(&mut self) -> Sweep {
        self.course.push(self.truth);
        let point = self.simulator.at(self.truth.position());
        let (azimuths_deg, step_deg) = self.settings.ranger.azimuths_deg();
        let beams = azimuths_deg.zip(0..).map(|(azimuth_deg, index)| {
            let sigma_m = self.settings.range_sigma_m;
            let outcome = match point.ping(self.truth.direction_rad(azimuth_deg)) {
                Ok(prediction) => simulate_reading(&prediction, sigma_m, &mut self.rng),
                Err(error) => {
                    self.error = Some(error);
                    BeamOutcome::NoEcho
                }
            };
            SweepBeam { azimuth_deg, index, outcome, mount: DVec2::ZERO }
        });
        Sweep { beams: beams.collect(), pose: self.odometry, step_deg, closed: true }
    }

    fn laser(&mut self, direction_rad: f64) -> LaserScan {
        self.shoot(direction_rad)
    }

    fn laser_turn(&mut self) -> (LaserScan, u32) {
        self.course.push(self.truth);
        let count = self.settings.laser.shots_per_turn();
        let directions_deg = (0..count).map(|shot| f64::from(shot) * 360.0 / f64::from(count));
        let pose = self.odometry;
        let shots: Vec<(f64, LaserScan)> = directions_deg
            .map(|azimuth_deg| (azimuth_deg, self.shoot(pose.direction_rad(azimuth_deg))))
            .collect();
        (join_shots(pose, &shots), count)
    }

    fn drive(&mut self, to: DVec2) -> DriveOutcome {
        let offset = to - self.odometry.position();
        let length_m = offset.length();
        if length_m == 0.0 {
            return DriveOutcome::Arrived;
        }
        let turn_rad = wrap_pi(offset.to_angle() - self.odometry.direction_rad(0.0));
        let true_turn_rad = turn_rad * (1.0 + self.noise());
        let [position_per_m, heading_deg_per_m] = self.settings.drift_per_m;
        let stretch = 1.0 + self.noise() + self.drift(position_per_m);
        self.truth.heading_deg = wrap_360(self.truth.heading_deg + true_turn_rad.to_degrees());
        let sideways_rad = self.drift(position_per_m).atan();
        let direction = DVec2::from_angle(self.truth.direction_rad(0.0) + sideways_rad);
        let free_m = self.free_distance_m(direction, length_m * stretch);
        let (driven_m, drive) = if free_m < length_m * stretch {
            ((free_m - BACK_OFF_M).max(0.0), DriveOutcome::Collided)
        } else {
            (free_m, DriveOutcome::Arrived)
        };
        let true_place = self.truth.position() + driven_m * direction;
        let place = self.odometry.position() + driven_m / stretch * offset / length_m;
        (self.truth.x_m, self.truth.y_m) = true_place.into();
        self.truth.heading_deg += driven_m * self.drift(heading_deg_per_m);
        let heading_deg = wrap_360(offset.to_angle().to_degrees());
        self.odometry = Pose { x_m: place.x, y_m: place.y, heading_deg };
        drive
    }
}
