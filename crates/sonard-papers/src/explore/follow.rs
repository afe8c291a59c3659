//! Closest-object following with line maps.

use super::{
    Exploration, ExploreSettings, Sensing, Stop, Task,
    ground::FloorGrid,
    objects::Objects,
    robot::{DriveOutcome, Robot},
};
use sonard_interpret::interpret::{
    BeamOutcome,
    lines::{LaserScan, LineKind, LineMap, MapLine},
};
use sonard_model::geometry::DVec2;

/// Distance from a goal that counts as arrival, metres.
const ARRIVED_M: f64 = 0.12;
/// Maximum distance between observations of reading line end, metres.
const SAME_END_M: f64 = 0.15;
/// Maximum distance of an end from a line that continues it, metres.
const JOINED_M: f64 = 0.25;
/// Maximum number of drives for reading end.
const MAX_DRIVES: usize = 10;
/// Maximum distance of a corner beyond the end of a line, metres.
const CORNER_REACH_M: f64 = 1.3;
/// Minimum angle between the lines of a corner, degrees.
const CORNER_DEG: f64 = 25.0;
/// Maximum length of the line that a corner echo resembles, metres.
const CORNER_ECHO_M: f64 = 0.6;
/// Minimum angle between the line of a corner echo and the walls, degrees.
const SLANT_DEG: f64 = 25.0;
/// Minimum length of a separate sonar wall next to an end measured by the laser, metres.
const MIN_WALL_M: f64 = 0.4;
/// Minimum length of a line whose ends are rounded to find further faces, metres.
const MIN_FACE_M: f64 = 0.3;
/// Maximum distance of a laser target, metres.
const AIM_REACH_M: f64 = 2.5;

/// Explores and maps with closest-object following.
///
/// The robot follows the nearest object at about [`standoff_m`](ExploreSettings::standoff_m),
/// lengthening its line, until the line's end no longer moves. With sonar only the end then remains
/// as it is. In just-in-time sensing the laser is aimed at the corner with the next line or at the
/// end, and makes it terminal. An object without open ends is finished. The objects follow in the
/// order of discovery.
#[must_use]
pub fn explore(
    robot: &mut impl Robot,
    sensing: Sensing,
    settings: &ExploreSettings,
) -> Exploration {
    explore_observed(robot, sensing, settings, |_| {})
}

/// Explores as [`explore`] does, with a callback after each stop.
#[must_use]
pub fn explore_observed(
    robot: &mut impl Robot,
    sensing: Sensing,
    settings: &ExploreSettings,
    mut on_stop: impl FnMut(&Exploration),
) -> Exploration {
    let mut explorer = Explorer {
        robot,
        sensing,
        settings: *settings,
        map: LineMap::new(settings.map),
        objects: Objects::default(),
        history: History::default(),
        log: Exploration::default(),
    };
    explorer.stop(Task::Begin, None);
    while explorer.log.stops.len() < settings.max_stops {
        on_stop(&explorer.log);
        let Some(goal) = explorer.choose() else {
            explorer.log.finished = true;
            break;
        };
        explorer.go(&goal);
    }
    explorer.log
}

/// Position for the observation of a line end.
#[derive(Debug, Clone, Copy)]
struct Goal {
    task: Task,
    /// End of the line to observe.
    target: DVec2,
    /// Position for the observation.
    view: DVec2,
    /// End of the first straight segment of the path to `view`.
    next: DVec2,
    cost: u32,
}

/// History of earlier goals.
#[derive(Debug, Default)]
struct History {
    /// Line ends that need no further observation.
    done: Vec<DVec2>,
    /// Line ends whose other side has been observed.
    rounded: Vec<DVec2>,
    /// Target of each drive.
    drives: Vec<DVec2>,
    /// Obstacle position of each collision.
    bumps: Vec<DVec2>,
    /// Target of the last drive.
    last: Option<DVec2>,
}

struct Explorer<'a, R> {
    robot: &'a mut R,
    sensing: Sensing,
    settings: ExploreSettings,
    map: LineMap,
    objects: Objects,
    history: History,
    log: Exploration,
}

impl<R: Robot> Explorer<'_, R> {
    /// Measures at the current pose and updates the map.
    fn stop(&mut self, task: Task, target: Option<DVec2>) {
        let (mut sonar, mut laser) = (None, Vec::new());
        if self.sensing == Sensing::Laser {
            let (scan, shots) = self.robot.laser_turn();
            self.log.laser_shots += shots;
            self.map.add_laser(&scan);
            laser.push(scan);
        } else {
            let sweep = self.robot.sonar();
            self.log.sonar_readings += sweep.beams.len();
            self.map.add_sonar(&sweep);
            sonar = Some(sweep);
        }
        let (pose, lines) = (self.robot.pose(), self.map.lines().to_vec());
        self.objects.discover(&lines, pose.position());
        self.log.stops.push(Stop { pose, task, target, sonar, laser, lines });
    }

    /// Drives towards a goal, measures, and completes the goal on arrival.
    fn go(&mut self, goal: &Goal) {
        let from = self.robot.pose().position();
        let drive = self.robot.drive(goal.next);
        let at = self.robot.pose().position();
        self.log.travel_m += from.distance(at);
        self.history.last = Some(goal.target);
        self.history.drives.push(goal.target);
        if drive == DriveOutcome::Collided {
            self.log.collisions += 1;
            let ahead = (goal.next - from).normalize_or_zero();
            self.history.bumps.push(at + self.settings.min_clearance_m * ahead);
        }
        self.stop(goal.task, Some(goal.target));
        if at.distance(goal.view) < ARRIVED_M {
            self.complete(goal);
        } else if count_near(&self.history.drives, goal.target) > MAX_DRIVES {
            self.close(goal);
        }
    }

    /// Completes a goal in view, with laser shots in just-in-time sensing.
    fn complete(&mut self, goal: &Goal) {
        if goal.task == Task::Follow && self.sensing == Sensing::JustInTime {
            self.confirm_end(goal.target);
        }
        self.close(goal);
    }

    /// Marks a goal as finished.
    fn close(&mut self, goal: &Goal) {
        match goal.task {
            Task::Follow => {
                // An end that has moved since is a new target.
                if let Some((line, end)) = self.open_end_at(goal.target) {
                    self.history.done.push(line.ends[end]);
                }
            }
            _ => self.history.rounded.push(goal.target),
        }
    }

    /// Aims the laser at the possible corner beyond an end and, if the end stays open, at the end.
    fn confirm_end(&mut self, target: DVec2) {
        for aim_at_corner in [true, false] {
            let Some((line, end)) = self.open_end_at(target) else { return };
            let corner = self.corner_beyond(&line, end).filter(|_| aim_at_corner);
            if corner.is_none() && aim_at_corner {
                continue;
            }
            let offset = corner.unwrap_or(line.ends[end]) - self.robot.pose().position();
            if offset.length() < AIM_REACH_M {
                let scan = self.robot.laser(offset.to_angle());
                self.log.laser_shots += 1;
                self.add_laser_scan(scan);
            }
        }
    }

    fn add_laser_scan(&mut self, scan: LaserScan) {
        self.map.add_laser(&scan);
        let lines = self.map.lines().to_vec();
        self.objects.discover(&lines, scan.pose.position());
        if let Some(stop) = self.log.stops.last_mut() {
            stop.laser.push(scan);
            stop.lines = lines;
        }
    }

    /// Finds the line whose open end is nearest to a target.
    fn open_end_at(&self, target: DVec2) -> Option<(MapLine, usize)> {
        let ends = self.map.lines().iter().flat_map(|line| [0, 1].map(|end| (*line, end)));
        ends.filter(|(line, end)| !line.terminal[*end])
            .map(|(line, end)| (line.ends[end].distance(target), (line, end)))
            .filter(|(off_m, _)| *off_m < SAME_END_M)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, found)| found)
    }

    /// Finds the nearest corner of an extended line with another line of the map.
    fn corner_beyond(&self, line: &MapLine, end: usize) -> Option<DVec2> {
        let (tip, outwards) = outwards(line, end);
        let robot = self.robot.pose().position();
        let corner_with = |other: &MapLine| {
            let corner = line.intersection(other, CORNER_DEG)?;
            let beyond_m = outwards.dot(corner - tip);
            let near = (-JOINED_M..CORNER_REACH_M).contains(&beyond_m)
                && other.distance_m(corner) < CORNER_REACH_M
                && corner.distance(robot) < AIM_REACH_M;
            near.then_some((beyond_m, corner))
        };
        let corners = self.map.lines().iter().filter_map(corner_with);
        corners.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, corner)| corner)
    }

    /// Selects the cheapest goal at the first object that has any.
    fn choose(&self) -> Option<Goal> {
        let robot = self.robot.pose().position();
        let lines = self.map.lines();
        let visited: Vec<DVec2> = self.log.stops.iter().map(|stop| stop.pose.position()).collect();
        let keep_off_m = self.settings.min_clearance_m;
        let ground = FloorGrid::around(robot, lines, &self.history.bumps, &visited, keep_off_m)?;
        if lines.is_empty() {
            return self.approach(&ground);
        }
        self.objects.in_order(lines).iter().find_map(|object| {
            let ends = object.iter().flat_map(|at| [0, 1].map(|end| (&lines[*at], end)));
            let goals = ends.filter_map(|(line, end)| self.goal(&ground, line, end));
            goals.min_by_key(|goal| {
                // Continuing is better than a return to a slightly nearer goal.
                let continues =
                    self.history.last.is_some_and(|last| last.distance(goal.target) < 0.7);
                goal.cost + if continues { 0 } else { 70 }
            })
        })
    }

    /// Plans the goal at an end of a line; `None` if it needs no observation.
    fn goal(&self, ground: &FloorGrid, line: &MapLine, end: usize) -> Option<Goal> {
        let (tip, outwards) = outwards(line, end);
        let left = outwards.perp();
        let inwards = if left.dot(line.seen_from - tip) >= 0.0 { left } else { -left };
        let is_open = !line.terminal[end]
            && count_near(&self.history.done, tip) == 0
            && !self.is_known_end(line, tip);
        if self.is_corner_echo(line) {
            return None;
        }
        let (task, view) = if is_open {
            (Task::Follow, self.follow_view(ground, tip, outwards, inwards)?)
        } else {
            let is_joined = |other: &MapLine| other != line && other.distance_m(tip) < JOINED_M;
            let is_face = line.length_m() >= MIN_FACE_M
                && (line.terminal[end] || self.sensing == Sensing::Sonar);
            if !is_face
                || self.map.lines().iter().any(is_joined)
                || count_near(&self.history.rounded, tip) > 0
            {
                return None;
            }
            (Task::Round, round_view(ground, tip, outwards, inwards)?)
        };
        self.goal_at(ground, task, tip, view)
    }

    /// Whether the end of a short sonar line is a confirmed end of another line.
    fn is_known_end(&self, line: &MapLine, tip: DVec2) -> bool {
        let lines = self.map.lines().iter();
        let mut ends =
            lines.flat_map(|other| [0, 1].map(|end| (other.ends[end], other.terminal[end])));
        line.kind == LineKind::Sonar
            && line.length_m() < MIN_WALL_M
            && ends.any(|(end, terminal)| terminal && end.distance(tip) < JOINED_M)
    }

    /// Whether a line is the "third wall" that a corner echo produces: short, next to the end of a
    /// longer line, and at about 45 degrees to it.
    fn is_corner_echo(&self, line: &MapLine) -> bool {
        let slant = SLANT_DEG.to_radians();
        let is_wall = |other: &MapLine| {
            let sine = line.direction().perp_dot(other.direction()).abs();
            other.length_m() > line.length_m()
                && (slant.sin()..slant.cos()).contains(&sine)
                && other.ends.iter().any(|end| line.distance_m(*end) < JOINED_M)
        };
        line.kind == LineKind::Sonar
            && line.length_m() < CORNER_ECHO_M
            && self.map.lines().iter().any(is_wall)
    }

    fn goal_at(&self, ground: &FloorGrid, task: Task, target: DVec2, view: DVec2) -> Option<Goal> {
        let stride_m = match self.sensing {
            Sensing::Laser => self.settings.laser_stride_m,
            _ => self.settings.sonar_stride_m,
        };
        let (cost, next) =
            (ground.cost(view)?, ground.next(self.robot.pose().position(), view, stride_m)?);
        Some(Goal { task, target, view, next, cost })
    }

    /// Selects a position next to the end of a line and slightly beyond it, if possible at the
    /// standoff from all obstacles.
    fn follow_view(
        &self,
        ground: &FloorGrid,
        tip: DVec2,
        outwards: DVec2,
        inwards: DVec2,
    ) -> Option<DVec2> {
        const CLEARANCES: [f64; 3] = [0.8, 0.5, 0.3];
        const STANDOFFS: [f64; 4] = [1.0, 0.8, 0.6, 0.45];
        const LEADS_M: [f64; 4] = [0.35, 0.1, -0.15, -0.4];
        let standoff_m = self.settings.standoff_m;
        CLEARANCES.iter().find_map(|clearance| {
            STANDOFFS.iter().filter(|standoff| *standoff >= clearance).find_map(|standoff| {
                LEADS_M
                    .iter()
                    .map(|lead_m| tip + lead_m * outwards + standoff * standoff_m * inwards)
                    .find(|view| is_good(ground, *view, clearance * standoff_m))
            })
        })
    }

    /// Plans a drive towards the nearest reading, for an empty map.
    fn approach(&self, ground: &FloorGrid) -> Option<Goal> {
        let stop = self.log.stops.last()?;
        let echoes = stop.sonar.iter().flat_map(|sweep| {
            sweep.beams.iter().filter_map(|beam| match beam.outcome {
                BeamOutcome::Echo(range_m) => {
                    Some((range_m, stop.pose.direction_rad(beam.azimuth_deg)))
                }
                _ => None,
            })
        });
        let seen = stop.laser.iter().flat_map(|scan| {
            scan.returns.iter().filter_map(|reading| {
                Some((reading.range_m?, scan.pose.direction_rad(reading.azimuth_deg)))
            })
        });
        let (range_m, direction_rad) = echoes.chain(seen).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (robot, ray) = (stop.pose.position(), DVec2::from_angle(direction_rad));
        let target = robot + range_m * ray;
        let view = robot + (range_m - self.settings.standoff_m).clamp(0.0, 1.0) * ray;
        let is_new = count_near(&self.history.rounded, target) == 0;
        is_new.then(|| self.goal_at(ground, Task::Approach, target, view)).flatten()
    }
}

/// Selects a position beyond the end of a line and behind it, for the observation of adjacent
/// faces.
fn round_view(ground: &FloorGrid, tip: DVec2, outwards: DVec2, inwards: DVec2) -> Option<DVec2> {
    const PLACES_M: [(f64, f64); 4] = [(1.0, -0.3), (0.8, -0.3), (0.6, -0.2), (0.5, -0.5)];
    PLACES_M
        .iter()
        .map(|(out_m, in_m)| tip + *out_m * outwards + *in_m * inwards)
        .find(|view| is_good(ground, *view, 0.45))
}

fn is_good(ground: &FloorGrid, view: DVec2, clearance_m: f64) -> bool {
    ground.clearance_m(view).is_some_and(|free_m| free_m >= clearance_m)
        && ground.cost(view).is_some()
}

/// End of a line and the outward direction of the line there.
fn outwards(line: &MapLine, end: usize) -> (DVec2, DVec2) {
    let along = line.direction();
    (line.ends[end], if end == 0 { -along } else { along })
}

fn count_near(places: &[DVec2], target: DVec2) -> usize {
    places.iter().filter(|place| place.distance(target) < SAME_END_M).count()
}
