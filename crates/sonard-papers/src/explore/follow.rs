//! Closest-object following.

use super::{
    Exploration, ExploreSettings, Sensing, Stop, Task,
    ground::Ground,
    objects::Objects,
    robot::{Drive, Robot},
};
use sonard_interpret::interpret::{
    Heard,
    lines::{LaserScan, LineKind, LineMap, MapLine},
};
use sonard_model::geometry::DVec2;

/// The robot has arrived so close to where it wanted to go, metres.
const ARRIVED_M: f64 = 0.12;
/// Ends of lines so close are one end, metres.
const SAME_END_M: f64 = 0.15;
/// An end so close to another line goes on there, metres.
const JOINED_M: f64 = 0.25;
/// So many drives for one end are enough.
const MOST_DRIVES: usize = 10;
/// A corner is looked for within this beyond the end of a line, metres.
const CORNER_REACH_M: f64 = 1.3;
/// And lines turn there by at least this, degrees.
const CORNER_DEG: f64 = 25.0;
/// What a corner returns looks like a line so long at most, metres,
const CORNER_ECHO_M: f64 = 0.6;
/// turned against its walls by at least this, degrees.
const SLANT_DEG: f64 = 25.0;
/// A line of sonar that is shorter than this, by an end that the laser saw, is no wall of its own,
/// metres.
const LEAST_WALL_M: f64 = 0.4;
/// No face is looked for behind the ends of shorter lines, metres.
const LEAST_FACE_M: f64 = 0.3;
/// The laser is aimed at nothing farther away, metres.
const AIM_REACH_M: f64 = 2.5;

/// Leads a robot round all it finds, and maps that.
///
/// The robot follows the nearest object at about [`standoff_m`](ExploreSettings::standoff_m),
/// lengthening its line, until the line's end no longer moves. With sonar alone that is all there is
/// to know of the end. The laser, just in time, is aimed at the corner with the next line or at the
/// end itself, and makes it terminal. An object without open ends is done; the next is the one that
/// was discovered first.
#[must_use]
pub fn explore(
    robot: &mut impl Robot,
    sensing: Sensing,
    settings: &ExploreSettings,
) -> Exploration {
    explore_watched(robot, sensing, settings, |_| {})
}

/// [`explore`], showing what is known after each stop.
#[must_use]
pub fn explore_watched(
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
        notes: Notes::default(),
        log: Exploration::default(),
    };
    explorer.stop(Task::Begin, None);
    while explorer.log.stops.len() < settings.most_stops {
        on_stop(&explorer.log);
        let Some(goal) = explorer.choose() else {
            explorer.log.finished = true;
            break;
        };
        explorer.go(&goal);
    }
    explorer.log
}

/// A place to look at something from.
#[derive(Debug, Clone, Copy)]
struct Goal {
    task: Task,
    /// What to look at: the end of a line.
    target: DVec2,
    /// Where from.
    view: DVec2,
    /// First straight bit of the way there.
    next: DVec2,
    cost: u32,
}

/// What was tried already.
#[derive(Debug, Default)]
struct Notes {
    /// Ends of which no more can be known.
    done: Vec<DVec2>,
    /// Ends behind which was looked.
    rounded: Vec<DVec2>,
    /// Ends that drives were for.
    drives: Vec<DVec2>,
    /// Where the robot ran into something.
    bumps: Vec<DVec2>,
    /// The end that the last drive was for.
    last: Option<DVec2>,
}

struct Explorer<'a, R> {
    robot: &'a mut R,
    sensing: Sensing,
    settings: ExploreSettings,
    map: LineMap,
    objects: Objects,
    notes: Notes,
    log: Exploration,
}

impl<R: Robot> Explorer<'_, R> {
    /// Senses where the robot is.
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

    /// Drives towards a goal, senses, and looks closer once it is there.
    fn go(&mut self, goal: &Goal) {
        let from = self.robot.pose().position();
        let drive = self.robot.drive(goal.next);
        let at = self.robot.pose().position();
        self.log.travel_m += from.distance(at);
        self.notes.last = Some(goal.target);
        self.notes.drives.push(goal.target);
        if drive == Drive::Bumped {
            self.log.bumps += 1;
            let ahead = (goal.next - from).normalize_or_zero();
            self.notes.bumps.push(at + self.settings.keep_off_m * ahead);
        }
        self.stop(goal.task, Some(goal.target));
        if at.distance(goal.view) < ARRIVED_M {
            self.settle(goal);
        } else if count_near(&self.notes.drives, goal.target) > MOST_DRIVES {
            self.close(goal);
        }
    }

    /// The robot sees what it came for: decides on it.
    fn settle(&mut self, goal: &Goal) {
        if goal.task == Task::Follow && self.sensing == Sensing::JustInTime {
            self.look_closer(goal.target);
        }
        self.close(goal);
    }

    /// Leaves what is still open at a goal as it is.
    fn close(&mut self, goal: &Goal) {
        match goal.task {
            Task::Follow => {
                // An end that has moved on is another one.
                if let Some((line, end)) = self.open_end_at(goal.target) {
                    self.notes.done.push(line.ends[end]);
                }
            }
            _ => self.notes.rounded.push(goal.target),
        }
    }

    /// Aims the laser at the corner where an end may lie, and if that doesn't tell, at the end.
    fn look_closer(&mut self, target: DVec2) {
        for aim_at_corner in [true, false] {
            let Some((line, end)) = self.open_end_at(target) else { return };
            let corner = self.corner_beyond(&line, end).filter(|_| aim_at_corner);
            if corner.is_none() && aim_at_corner {
                continue;
            }
            let way = corner.unwrap_or(line.ends[end]) - self.robot.pose().position();
            if way.length() < AIM_REACH_M {
                let scan = self.robot.laser(way.to_angle());
                self.log.laser_shots += 1;
                self.take_in(scan);
            }
        }
    }

    fn take_in(&mut self, scan: LaserScan) {
        self.map.add_laser(&scan);
        let lines = self.map.lines().to_vec();
        self.objects.discover(&lines, scan.pose.position());
        if let Some(stop) = self.log.stops.last_mut() {
            stop.laser.push(scan);
            stop.lines = lines;
        }
    }

    /// The line with an open end at a place.
    fn open_end_at(&self, target: DVec2) -> Option<(MapLine, usize)> {
        let ends = self.map.lines().iter().flat_map(|line| [0, 1].map(|end| (*line, end)));
        ends.filter(|(line, end)| !line.terminal[*end])
            .map(|(line, end)| (line.ends[end].distance(target), (line, end)))
            .filter(|(off_m, _)| *off_m < SAME_END_M)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, found)| found)
    }

    /// Where the line through an end meets another line of the map, not far beyond it.
    fn corner_beyond(&self, line: &MapLine, end: usize) -> Option<DVec2> {
        let (tip, outwards) = outwards(line, end);
        let robot = self.robot.pose().position();
        let meet = |other: &MapLine| {
            let corner = line.meets(other, CORNER_DEG)?;
            let beyond_m = outwards.dot(corner - tip);
            let near = (-JOINED_M..CORNER_REACH_M).contains(&beyond_m)
                && other.distance_m(corner) < CORNER_REACH_M
                && corner.distance(robot) < AIM_REACH_M;
            near.then_some((beyond_m, corner))
        };
        let corners = self.map.lines().iter().filter_map(meet);
        corners.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, corner)| corner)
    }

    /// The nearest thing to do at the object whose turn it is.
    fn choose(&self) -> Option<Goal> {
        let robot = self.robot.pose().position();
        let lines = self.map.lines();
        let trodden: Vec<DVec2> = self.log.stops.iter().map(|stop| stop.pose.position()).collect();
        let keep_off_m = self.settings.keep_off_m;
        let ground = Ground::around(robot, lines, &self.notes.bumps, &trodden, keep_off_m)?;
        if lines.is_empty() {
            return self.approach(&ground);
        }
        self.objects.in_order(lines).iter().find_map(|object| {
            let ends = object.iter().flat_map(|at| [0, 1].map(|end| (&lines[*at], end)));
            let goals = ends.filter_map(|(line, end)| self.goal(&ground, line, end));
            goals.min_by_key(|goal| {
                // Going on is better than turning back for something a little nearer.
                let goes_on = self.notes.last.is_some_and(|last| last.distance(goal.target) < 0.7);
                goal.cost + if goes_on { 0 } else { 70 }
            })
        })
    }

    /// What there is to do at an end of a line.
    fn goal(&self, ground: &Ground, line: &MapLine, end: usize) -> Option<Goal> {
        let (tip, outwards) = outwards(line, end);
        let left = outwards.perp();
        let inwards = if left.dot(line.seen_from - tip) >= 0.0 { left } else { -left };
        let is_open = !line.terminal[end]
            && count_near(&self.notes.done, tip) == 0
            && !self.is_known_end(line, tip);
        if self.is_corner_echo(line) {
            return None;
        }
        let (task, view) = if is_open {
            (Task::Follow, self.view_of(ground, tip, outwards, inwards)?)
        } else {
            let is_joined = |other: &MapLine| other != line && other.distance_m(tip) < JOINED_M;
            let is_face = line.length_m() >= LEAST_FACE_M
                && (line.terminal[end] || self.sensing == Sensing::Sonar);
            if !is_face
                || self.map.lines().iter().any(is_joined)
                || count_near(&self.notes.rounded, tip) > 0
            {
                return None;
            }
            (Task::Round, view_round(ground, tip, outwards, inwards)?)
        };
        self.goal_at(ground, task, tip, view)
    }

    /// Whether the laser has been at an end of a short sonar line already, for another line.
    fn is_known_end(&self, line: &MapLine, tip: DVec2) -> bool {
        let lines = self.map.lines().iter();
        let mut ends =
            lines.flat_map(|other| [0, 1].map(|end| (other.ends[end], other.terminal[end])));
        line.kind == LineKind::Sonar
            && line.length_m() < LEAST_WALL_M
            && ends.any(|(end, terminal)| terminal && end.distance(tip) < JOINED_M)
    }

    /// Whether a line is the "third wall" that a corner returns: short, by the end of a longer
    /// line, and turned against it by about half a right angle.
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

    fn goal_at(&self, ground: &Ground, task: Task, target: DVec2, view: DVec2) -> Option<Goal> {
        let stride_m = match self.sensing {
            Sensing::Laser => self.settings.laser_stride_m,
            _ => self.settings.sonar_stride_m,
        };
        let (cost, next) =
            (ground.cost(view)?, ground.next(self.robot.pose().position(), view, stride_m)?);
        Some(Goal { task, target, view, next, cost })
    }

    /// A place beside the end of a line, if possible a standoff away from it and from all else, and
    /// a little further on.
    fn view_of(
        &self,
        ground: &Ground,
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

    /// Towards the nearest reading of any kind, while the map is empty.
    fn approach(&self, ground: &Ground) -> Option<Goal> {
        let stop = self.log.stops.last()?;
        let echoes = stop.sonar.iter().flat_map(|sweep| {
            sweep.beams.iter().filter_map(|beam| match beam.heard {
                Heard::Echo(range_m) => Some((range_m, stop.pose.direction_rad(beam.azimuth_deg))),
                _ => None,
            })
        });
        let seen = stop.laser.iter().flat_map(|scan| {
            scan.returns
                .iter()
                .filter_map(|one| Some((one.range_m?, scan.pose.direction_rad(one.azimuth_deg))))
        });
        let (range_m, direction_rad) = echoes.chain(seen).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (robot, ray) = (stop.pose.position(), DVec2::from_angle(direction_rad));
        let target = robot + range_m * ray;
        let view = robot + (range_m - self.settings.standoff_m).clamp(0.0, 1.0) * ray;
        let is_new = count_near(&self.notes.rounded, target) == 0;
        is_new.then(|| self.goal_at(ground, Task::Approach, target, view)).flatten()
    }
}

/// A place from which a face that leaves a line at its end can be seen: beyond the end, and behind
/// the line.
fn view_round(ground: &Ground, tip: DVec2, outwards: DVec2, inwards: DVec2) -> Option<DVec2> {
    const PLACES_M: [(f64, f64); 4] = [(1.0, -0.3), (0.8, -0.3), (0.6, -0.2), (0.5, -0.5)];
    PLACES_M
        .iter()
        .map(|(out_m, in_m)| tip + *out_m * outwards + *in_m * inwards)
        .find(|view| is_good(ground, *view, 0.45))
}

fn is_good(ground: &Ground, view: DVec2, clearance_m: f64) -> bool {
    ground.clearance_m(view).is_some_and(|free_m| free_m >= clearance_m)
        && ground.cost(view).is_some()
}

/// An end of a line and the direction in which the line would go on there.
fn outwards(line: &MapLine, end: usize) -> (DVec2, DVec2) {
    let along = line.direction();
    (line.ends[end], if end == 0 { -along } else { along })
}

fn count_near(places: &[DVec2], target: DVec2) -> usize {
    places.iter().filter(|place| place.distance(target) < SAME_END_M).count()
}
