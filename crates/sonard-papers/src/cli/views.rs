//! Command `sonard-papers benchmark views` and its table.

use std::{
    fmt,
    io::{self, Write},
};

use comfy_table::{CellAlignment, Table};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

use sonard_inverse::World;
use sonard_model::geometry::Pose;
use sonard_papers::explore::{
    ExploreSettings, RobotSettings, Sensing, SimulatedRobot, explore, explore_views,
};
use sonard_survey::{
    OdometrySigma, SurveyOptions,
    trial::{
        Comparison, Ends, Explorer, ExplorerSettings, ReadingNoise, RigidMotion, RoomKind,
        coverage, draw_trial, generator, trial_world,
    },
};

use super::{
    Failure, Outcome,
    answer::{RULED, print_result},
    explore::RangerName,
    progress,
};

/// Options of `sonard-papers benchmark views`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Number of rooms of each kind, each explored six times
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rooms: u32,
    /// Seed of the first room of each kind, and of the noise there; those of the others follow
    #[arg(long, value_name = "N", default_value_t = 1000)]
    seed: u64,
    /// Kinds of rooms: rectangle, oblique, cut, l, t, box, posts, furnished
    #[arg(long, value_name = "KIND,...", value_delimiter = ',',
          default_values_t = [RoomKind::Rectangle, RoomKind::Cut, RoomKind::L])]
    kinds: Vec<RoomKind>,
    /// Standard deviations of inexact odometry: of the position per metre driven, metres, and of
    /// the heading, degrees
    #[arg(long, value_name = "M,DEG", default_value = "0.05,5", value_parser = parse_odometry)]
    odometry: OdometryError,
    /// Number of sweeps before the first survey
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=40))]
    first_stops: u32,
    /// Maximum number of sweeps of an exploration by next views
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..=40))]
    max_views: u32,
    /// Maximum number of stops of an exploration by lines
    #[arg(long, value_name = "N", default_value_t = ExploreSettings::default().max_stops)]
    max_stops: usize,
    /// Sonars of an exploration by lines
    #[arg(long, value_enum, default_value_t = RangerName::Stepper)]
    ranger: RangerName,
    /// JSON instead of text; object per exploration
    #[arg(long)]
    json: bool,
}

pub(crate) const ABOUT: &str = "\
Explore random rooms by next views, and by the lines of the paper.

The rooms are those of the evidence for surveys: 2.2 to 4.2 m, turned by any angle. In each, robots start at the \
same pose, with exact and with inexact odometry. One sweeps at stops 0.4 to 0.8 m apart, then surveys its \
sweeps and drives to the next view until nothing is open that a reachable place resolves. The others map with \
line segments, with sonar only and with the laser just in time, as `sonard-papers explore` does.";

const HELP: &str = "\
Examples:
  sonard-papers benchmark views                          five rooms of each kind
  sonard-papers benchmark views --kinds l --rooms 20 --json

Recall is the share of the walls' length that the map has, precision the share of the map's length that is a \
wall: within 2 cm and 2 degrees, and within 10 cm and 5 degrees. Maps are compared after the rigid motion that \
lays the stops by the map on the true ones: by the survey's poses, or by odometry. Processor time includes the \
simulation of the readings.";

/// Number of beams of a sweep.
const BEAMS: usize = 400;
/// Noise of readings.
const NOISE: ReadingNoise = ReadingNoise { sigma_db: 0.5, sigma_m: 0.001 };
/// Minimum standard deviations that surveys assume, metres and degrees per metre.
const MIN_SIGMA_PER_M: [f64; 2] = [0.001, 0.1];

/// Standard deviations of odometry, metres and degrees per metre.
type OdometryError = [f64; 2];

fn parse_odometry(text: &str) -> Result<OdometryError, String> {
    let help = "use M,DEG: numbers from 0 to 0.2 and from 0 to 30";
    let (m, deg) = text.split_once(',').ok_or(help)?;
    let number = |text: &str, max: f64| {
        let value = text.parse::<f64>().ok();
        value.filter(|value| (0.0..=max).contains(value)).ok_or(help)
    };
    Ok([number(m, 0.2)?, number(deg, 30.0)?])
}

/// Map that a robot explores with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Method {
    NextViews,
    SonarLines,
    JustInTimeLines,
}

impl Method {
    const ALL: [Self; 3] = [Self::NextViews, Self::SonarLines, Self::JustInTimeLines];
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::NextViews => "next views",
            Self::SonarLines => "lines, sonar",
            Self::JustInTimeLines => "lines, just in time",
        })
    }
}

/// Agreement of a map's walls with the true ones.
#[derive(Debug, Clone, Copy, Serialize)]
struct WallShares {
    recall: f64,
    precision: f64,
}

impl WallShares {
    /// Shares within a distance, metres, and an angle, degrees.
    fn within(off_m: f64, off_deg: f64, walls: &[Ends], truth: &[Ends]) -> Self {
        Self {
            recall: coverage(truth, walls, off_m, off_deg),
            precision: coverage(walls, truth, off_m, off_deg),
        }
    }
}

/// Exploration of a room: an object of the JSON output.
#[derive(Debug, Serialize)]
struct Row {
    kind: &'static str,
    seed: u64,
    /// Standard deviations of odometry, metres and degrees per metre.
    odometry_per_m: OdometryError,
    method: Method,
    #[serde(flatten)]
    made: Explored,
    cpu_s: f64,
}

#[derive(Debug, Serialize)]
struct Explored {
    finished: bool,
    stops: usize,
    laser_shots: u32,
    driven_m: f64,
    within_2_cm: WallShares,
    within_10_cm: WallShares,
}

/// Room with the first stops.
struct Room {
    world: World,
    course: Vec<Pose>,
    seed: u64,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let bar = progress::bar(args.kinds.len() as u64 * u64::from(args.rooms), "rooms");
    let mut rows = Vec::new();
    for &kind in &args.kinds {
        for number in 0..args.rooms {
            rows.extend(explore_room(args, kind, args.seed.wrapping_add(number.into()))?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    print_result(args.json, &rows, |out| print(out, args, &rows))
}

impl Args {
    /// Exact odometry and the inexact one.
    fn odometry(&self) -> Vec<OdometryError> {
        let mut all = vec![[0.0; 2], self.odometry];
        all.dedup();
        all
    }
}

/// Explores a room by each method with each odometry, one after the other for their processor time.
fn explore_room(args: &Args, kind: RoomKind, seed: u64) -> Result<Vec<Row>, Failure> {
    let room = Room::draw(kind, seed, args.first_stops as usize).map_err(|error| reject(&error))?;
    let mut rows = Vec::new();
    for odometry_per_m in args.odometry() {
        for method in Method::ALL {
            let start_s = cpu_s();
            let made = match method {
                Method::NextViews => room.explore_by_views(args, odometry_per_m),
                Method::SonarLines => room.explore_by_lines(args, Sensing::Sonar, odometry_per_m),
                Method::JustInTimeLines => {
                    room.explore_by_lines(args, Sensing::JustInTime, odometry_per_m)
                }
            }?;
            let cpu_s = cpu_s() - start_s;
            rows.push(Row { kind: kind.name(), seed, odometry_per_m, method, made, cpu_s });
        }
    }
    Ok(rows)
}

fn reject(error: &dyn fmt::Display) -> Failure {
    Failure::input(error.to_string(), "see `sonard-papers benchmark views --help`")
}

/// Processor time of all threads so far, seconds.
fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

impl Room {
    fn draw(
        kind: RoomKind,
        seed: u64,
        first_stops: usize,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let (scene, course) = draw_trial(kind, first_stops, &mut generator(kind, seed))?;
        Ok(Self { world: trial_world(scene)?, course, seed })
    }

    fn truth(&self) -> Vec<Ends> {
        self.world.scene.walls.iter().map(|wall| [wall.a, wall.b]).collect()
    }

    fn explore_by_views(
        &self,
        args: &Args,
        odometry_per_m: OdometryError,
    ) -> Result<Explored, Failure> {
        let settings = ExplorerSettings { beams: BEAMS, noise: NOISE, odometry_per_m };
        let mut explorer = Explorer::new(&self.world, settings);
        let [m_per_m, deg_per_m] =
            [0, 1].map(|at| f64::max(odometry_per_m[at], MIN_SIGMA_PER_M[at]));
        let sigma = OdometrySigma { m_per_m, deg_per_m, ..OdometrySigma::default() };
        let options = SurveyOptions { odometry: Some(sigma), ..SurveyOptions::default() };
        let (max_stops, mut random) = (args.max_views as usize, Pcg64::seed_from_u64(self.seed));
        let found = explore_views(&mut explorer, &self.course, &options, max_stops, &mut random)
            .map_err(|error| reject(&error))?;
        let compared = Comparison::new(&found, &self.world.scene, explorer.stops());
        let truth = self.truth();
        Ok(Explored {
            finished: found.next_view.is_none(),
            stops: explorer.stops().len(),
            laser_shots: 0,
            driven_m: explorer.driven_m(),
            within_2_cm: WallShares::within(0.02, 2.0, &compared.walls, &truth),
            within_10_cm: WallShares::within(0.10, 5.0, &compared.walls, &truth),
        })
    }

    fn explore_by_lines(
        &self,
        args: &Args,
        sensing: Sensing,
        odometry_per_m: OdometryError,
    ) -> Result<Explored, Failure> {
        let start = self.course[0];
        let simulator = self.world.simulator(&start).map_err(|error| reject(&error))?;
        let robot = RobotSettings {
            ranger: args.ranger.layout(),
            range_sigma_m: NOISE.sigma_m,
            drift_per_m: odometry_per_m,
            ..RobotSettings::default()
        };
        let random = Pcg64::seed_from_u64(self.seed);
        let mut robot = SimulatedRobot::new(&simulator, start, robot, random);
        let settings =
            ExploreSettings { max_stops: args.max_stops.max(1), ..ExploreSettings::default() };
        let made = explore(&mut robot, sensing, &settings);
        if let Some(error) = robot.error() {
            return Err(reject(error));
        }
        let stops: Vec<Pose> = made.stops.iter().map(|stop| stop.pose).collect();
        let motion = RigidMotion::between(&stops, robot.course());
        let lines = made.lines().iter().map(|line| line.ends.map(|end| motion.of(end)));
        let (walls, truth): (Vec<Ends>, _) = (lines.collect(), self.truth());
        Ok(Explored {
            finished: made.finished,
            stops: stops.len(),
            laser_shots: made.laser_shots,
            driven_m: made.travel_m,
            within_2_cm: WallShares::within(0.02, 2.0, &walls, &truth),
            within_10_cm: WallShares::within(0.10, 5.0, &walls, &truth),
        })
    }
}

fn print(out: &mut impl Write, args: &Args, rows: &[Row]) -> io::Result<()> {
    let mut table = Table::new();
    table.load_style(RULED).set_header([
        "kind",
        "odometry",
        "map",
        "rooms",
        "stops",
        "shots",
        "driven",
        "recall 2 cm",
        "precision 2 cm",
        "recall 10 cm",
        "precision 10 cm",
        "processor",
        "",
    ]);
    for kind in &args.kinds {
        for odometry_per_m in args.odometry() {
            for method in Method::ALL {
                let group = rows.iter().filter(|row| {
                    (row.kind, row.odometry_per_m, row.method)
                        == (kind.name(), odometry_per_m, method)
                });
                table.add_row(line(&group.collect::<Vec<_>>()));
            }
        }
    }
    for column in table.column_iter_mut().skip(3) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    writeln!(out, "{table}")
}

/// Means of explorations of one kind of room by one method, of which there is at least one.
fn line(group: &[&Row]) -> Vec<String> {
    let Some(first) = group.first() else { return Vec::new() };
    let mean = |value: fn(&Row) -> f64| {
        group.iter().map(|row| value(row)).sum::<f64>() / group.len() as f64
    };
    let [m, deg] = first.odometry_per_m;
    let is_exact = first.odometry_per_m == [0.0; 2];
    let incomplete = group.iter().filter(|row| !row.made.finished).count();
    vec![
        first.kind.into(),
        if is_exact { "exact".into() } else { format!("{m} m, {deg} deg") },
        first.method.to_string(),
        group.len().to_string(),
        format!("{:.1}", mean(|row| row.made.stops as f64)),
        format!("{:.0}", mean(|row| f64::from(row.made.laser_shots))),
        format!("{:.1} m", mean(|row| row.made.driven_m)),
        format!("{:.3}", mean(|row| row.made.within_2_cm.recall)),
        format!("{:.3}", mean(|row| row.made.within_2_cm.precision)),
        format!("{:.3}", mean(|row| row.made.within_10_cm.recall)),
        format!("{:.3}", mean(|row| row.made.within_10_cm.precision)),
        format!("{:.2} s", mean(|row| row.cpu_s)),
        if incomplete == 0 { String::new() } else { format!("{incomplete} incomplete") },
    ]
}
