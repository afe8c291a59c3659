//! Surveys of random rooms, compared with the truth.
//!
//! ```sh
//! cargo run --release -p sonard-survey --example evaluate -- --kinds rectangle,l --seeds 100:110
//! cargo run --release -p sonard-survey --example evaluate -- --next-view --kinds l --stops 8
//! ```

mod baselines;
mod course;
mod explore;
mod intervals;
mod measure;
mod sensor;

use std::error::Error;

use sonard_inverse::ParameterGroup;
use sonard_model::{
    array::RangerArray,
    geometry::{DVec2, Pose},
    scene::Scene,
};
use sonard_survey::{
    NoObserver, OdometrySigma, PieceStatus, PostShape, SearchEnd, Survey, SurveyOptions,
    score_plan, survey,
    trial::{
        Comparison, Ends, ReadingNoise, RigidMotion, RoomKind, coverage, draw_place,
        simulate_sweeps,
    },
};

use baselines::compare_methods;
use course::Course;
use explore::compare_choices;
use intervals::{Intervals, count_intervals, print_intervals};
use measure::{explained, median, reflecting_walls};
use sensor::{Deviation, TrueSensor, print_deviations};

/// Settings of an evaluation.
struct Settings {
    kinds: Vec<RoomKind>,
    seeds: std::ops::Range<u64>,
    stops: usize,
    /// Number of sweeps along the course of the stops; `None` for one at each stop.
    poses: Option<usize>,
    beams: usize,
    /// Array that moves along the course, instead of a ranger on a stepper.
    array: Option<RangerArray>,
    odometry: [f64; 2],
    odometry_is_used: bool,
    square_deg: Option<f64>,
    noise: ReadingNoise,
    truth: TrueSensor,
    fit: Vec<ParameterGroup>,
    is_verbose: bool,
    prints_walls: bool,
    /// Compares choices of the next stop.
    compares_choices: bool,
    /// Compares other methods with the survey.
    compares_methods: bool,
}

/// Figures of one room.
struct Trial {
    seed: u64,
    recall: f64,
    /// Recall of the outer walls.
    outer_recall: f64,
    /// Recall of the walls that reflect a reading of the true room.
    met_recall: f64,
    /// Number of inner walls that reflect a reading of the true room, and of those found.
    faces: [usize; 2],
    /// Number of posts, of those observed within 2 cm, and of those observed elsewhere.
    posts: [usize; 3],
    precision: f64,
    corners_m: Vec<f64>,
    position_m: f64,
    heading_deg: f64,
    held: f64,
    true_held: f64,
    /// Score less that of the true room at the true poses, nats.
    lead_nats: f64,
    /// Length of walls reported as observed that are none, metres.
    wrong_observed_m: f64,
    intervals: Intervals,
    /// Numbers fitted, as errors in standard deviations, with the name.
    fitted: Vec<Deviation>,
    /// An alternative is the true room.
    is_listed: bool,
    /// No other plan found scores within 10 nats of the true room.
    is_determined: bool,
    /// Numbers of unexplained arcs and of all.
    arcs: [usize; 2],
    end: SearchEnd,
    scenes: usize,
    seconds: f64,
}

/// Number of places that the survey does not visit.
const HELD_PLACES: usize = 8;
/// Shares of covered length from which a plan is complete.
const COMPLETE: f64 = 0.995;
/// Share of covered length from which a face of a box is found.
const FOUND: f64 = 0.9;
/// Deficit of score from which a failure is one of the search, nats.
const SEARCH_NATS: f64 = 5.0;
/// Deficit of score up to which another plan leaves a room undetermined, nats.
const OPEN_NATS: f64 = 10.0;

impl Trial {
    fn is_complete(&self) -> bool {
        self.recall > COMPLETE && self.precision > COMPLETE
    }

    fn failure(&self) -> &'static str {
        match (self.is_complete(), self.lead_nats < -SEARCH_NATS) {
            (true, _) => "",
            (false, true) => "search",
            (false, false) => "information",
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let settings = Settings::from_args()?;
    if settings.compares_methods {
        return compare_methods(&settings);
    }
    if settings.compares_choices {
        return compare_choices(&settings);
    }
    println!("{HEAD}");
    let mut all = Vec::new();
    for &kind in &settings.kinds {
        let mut trials = Vec::new();
        for seed in settings.seeds.clone() {
            let trial = run(kind, seed, &settings)?;
            if settings.is_verbose || !trial.is_complete() {
                print_trial(kind, &trial);
            }
            trials.push(trial);
        }
        print_summary(kind, &trials);
        print_fitted(&trials);
        all.extend(trials);
    }
    print_intervals(&all.iter().map(|trial| trial.intervals).collect::<Vec<_>>());
    Ok(())
}

const HEAD: &str = "| kind | rooms | complete | recall | precision | corner mm | position mm | heading deg | \
held | true room | score within 5 | wrong observed m | outer recall | recall of walls met | faces found | posts found | wrong posts | determined | complete of these | CPU s | scenes |";

fn run(kind: RoomKind, seed: u64, settings: &Settings) -> Result<Trial, Box<dyn Error>> {
    let mut course = Course::draw(kind, seed, settings)?;
    let held: Vec<Pose> = (0..HELD_PLACES)
        .map(|at| {
            let place = draw_place(&course.world.scene, &mut course.random);
            Pose { x_m: place.x, y_m: place.y, heading_deg: 45.0 * at as f64 }
        })
        .collect();
    let (beams, noise) = (settings.beams, settings.noise);
    let held_out = simulate_sweeps(&course.world, &held, beams, noise, &mut course.random)?;
    let readings = course.readings();
    let Course { assumed, world, poses, .. } = &course;
    let options = settings.survey_options();
    let start_s = cpu_s();
    let found = survey(assumed, readings, &options, &NoObserver)?;
    let seconds = cpu_s() - start_s;
    let truth: Vec<Ends> = world.scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
    let cylinders = world.scene.cylinders.iter();
    let true_posts: Vec<PostShape> =
        cylinders.map(|of| PostShape { center: of.center, radius_m: of.radius_m }).collect();
    // Plans are scored with the same sensor.
    let scorer = if settings.fit.is_empty() { assumed } else { world };
    let true_score = score_plan(scorer, readings, &options, (&truth, &true_posts), poses)?;
    let compared = Comparison::new(&found, &world.scene, poses);
    let Comparison { motion, walls, recall, precision, corners_m, .. } = compared;
    let observed = observed(&found, &motion);
    let wrong: f64 = observed
        .iter()
        .map(|wall| {
            wall[0].distance(wall[1])
                * (1.0 - coverage(std::slice::from_ref(wall), &truth, 0.02, 2.0))
        })
        .sum();
    if settings.prints_walls {
        print_walls(&found, &motion, &truth);
        print_posts(&found, &motion, &true_posts);
    }
    // The frame of the survey is the first pose of odometry, which is the true one.
    let intervals = count_intervals(&found, poses, &truth, &true_posts);
    let scene = found.scene("found", false).build()?;
    let reflecting = reflecting_walls(world, poses, settings.beams)?;
    let (mut outer, mut inner, mut met) = (Vec::new(), Vec::new(), Vec::new());
    for (at, (wall, ends)) in world.scene.walls.iter().zip(&truth).enumerate() {
        let is_outer = wall.id.starts_with("wall");
        let is_met = reflecting.contains(&at);
        outer.extend(is_outer.then_some(*ends));
        inner.extend((!is_outer && is_met).then_some(*ends));
        met.extend(is_met.then_some(*ends));
    }
    let is_found = |face: &&Ends| coverage(std::slice::from_ref(*face), &walls, 0.02, 2.0) > FOUND;
    let in_frame = |sweep: &sonard_inverse::FitSweep| motion.inverse_of(&sweep.pose);
    let is_true = |walls: &[Ends]| {
        coverage(&truth, walls, 0.02, 2.0) > COMPLETE
            && coverage(walls, &truth, 0.02, 2.0) > COMPLETE
    };
    let others = found.alternatives.iter().map(|plan| {
        let walls = plan.walls.iter().map(|ends| ends.map(|end| motion.of(end.into())));
        (is_true(&walls.collect::<Vec<_>>()), found.score + plan.score_difference)
    });
    let others: Vec<(bool, f64)> = others.collect();
    let is_open = |&(is_true, score): &(bool, f64)| !is_true && score > true_score - OPEN_NATS;
    let best = [(is_true(&walls), found.score)];
    let is_determined = !others.iter().chain(&best).any(is_open);
    let is_listed = others.iter().any(|(is_true, _)| *is_true);
    Ok(Trial {
        seed,
        recall,
        outer_recall: coverage(&outer, &walls, 0.02, 2.0),
        met_recall: coverage(&met, &walls, 0.02, 2.0),
        faces: [inner.len(), inner.iter().filter(is_found).count()],
        posts: compared.posts,
        precision,
        corners_m,
        position_m: compared.position_m,
        heading_deg: compared.heading_deg,
        held: explained(world, scene, &held_out, in_frame)?,
        true_held: explained(world, Scene::clone(&world.scene), &held_out, |sweep| sweep.pose)?,
        fitted: settings.truth.deviations(&found),
        lead_nats: found.score - true_score,
        wrong_observed_m: wrong,
        intervals,
        is_listed,
        is_determined,
        arcs: [found.unexplained.len(), found.arcs],
        end: found.end,
        scenes: found.scored_scenes,
        seconds,
    })
}

/// Prints how far the fitted numbers of all rooms are off.
fn print_fitted(trials: &[Trial]) {
    print_deviations(trials.iter().flat_map(|trial| &trial.fitted));
}

/// Posts with their status, in the true frame, and the true posts.
fn print_posts(found: &Survey, motion: &RigidMotion, truth: &[PostShape]) {
    for PostShape { center, radius_m } in truth {
        println!("#   true post ({:.3}, {:.3}) radius {radius_m:.4}", center.x, center.y);
    }
    for post in &found.posts {
        let at = motion.of(post.center_m.into());
        println!(
            "#   {} ({:.3}, {:.3}) radius {:.4} {:?} sweeps {} evidence {:.1} sigma {:?} {:?}",
            post.id,
            at.x,
            at.y,
            post.radius_m,
            post.status,
            post.sweeps,
            post.evidence_nats,
            post.sigma_m,
            post.sigma_radius_m,
        );
    }
}

/// CPU time of all threads so far, seconds (Linux).
fn cpu_s() -> f64 {
    const TICKS_PER_S: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = text.rsplit(')').next().unwrap_or_default();
    let ticks = after_name.split_whitespace().skip(11).take(2).flat_map(str::parse::<f64>);
    ticks.sum::<f64>() / TICKS_PER_S
}

/// Observed pieces in the true frame.
fn observed(found: &Survey, motion: &RigidMotion) -> Vec<Ends> {
    let pieces = found.walls.iter().flat_map(|wall| &wall.pieces);
    let observed = pieces.filter(|piece| piece.status == PieceStatus::Observed);
    observed.map(|piece| [piece.from_m, piece.to_m].map(|end| motion.of(end.into()))).collect()
}

/// Pieces of walls with their status, in the true frame, and the true walls.
fn print_walls(found: &Survey, motion: &RigidMotion, truth: &[Ends]) {
    let place = |at: DVec2| format!("({:.3}, {:.3})", at.x, at.y);
    for [a, b] in truth {
        println!("#   true {} {}", place(*a), place(*b));
    }
    for wall in &found.walls {
        for piece in &wall.pieces {
            let [a, b] = [piece.from_m, piece.to_m].map(|end| place(motion.of(end.into())));
            let (id, status, evidence) = (&wall.id, piece.status, wall.evidence_nats);
            println!("#   {id} {a} {b} {status:?} evidence {evidence:.1}");
        }
    }
}

fn print_trial(kind: RoomKind, trial: &Trial) {
    let corner_mm = 1e3 * median(trial.corners_m.clone());
    println!(
        "# {kind} {}: recall {:.3} precision {:.3} corner {corner_mm:.1} mm poses {:.2} mm {:.3} deg held {:.3} \
         ({:.3}) score {:+.1} observed wrong {:.2} m posts {:?} listed {} determined {} unexplained {} of {} arcs {:?} {} scenes \
         {:.1} s {}",
        trial.seed,
        trial.recall,
        trial.precision,
        1e3 * trial.position_m,
        trial.heading_deg,
        trial.held,
        trial.true_held,
        trial.lead_nats,
        trial.wrong_observed_m,
        trial.posts,
        trial.is_listed,
        trial.is_determined,
        trial.arcs[0],
        trial.arcs[1],
        trial.end,
        trial.scenes,
        trial.seconds,
        trial.failure(),
    );
}

fn print_summary(kind: RoomKind, trials: &[Trial]) {
    let count = trials.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Trial) -> f64| trials.iter().map(of).sum::<f64>() / count;
    let middle = |of: &dyn Fn(&Trial) -> f64| median(trials.iter().map(of).collect());
    let corners: Vec<f64> =
        trials.iter().flat_map(|trial| trial.corners_m.iter().copied()).collect();
    println!(
        "| {kind} | {} | {} | {:.3} | {:.3} | {:.2} | {:.2} | {:.3} | {:.3} | {:.3} | {} | {:.2} | {:.3} | {:.3} | {} of {} | {} of {} | {} | {} | {} | {:.1} | {:.0} |",
        trials.len(),
        trials.iter().filter(|trial| trial.is_complete()).count(),
        mean(&|trial| trial.recall),
        mean(&|trial| trial.precision),
        1e3 * median(corners),
        1e3 * middle(&|trial| trial.position_m),
        middle(&|trial| trial.heading_deg),
        mean(&|trial| trial.held),
        mean(&|trial| trial.true_held),
        trials.iter().filter(|trial| trial.lead_nats > -SEARCH_NATS).count(),
        // Without the sign of a zero.
        trials.iter().map(|trial| trial.wrong_observed_m).sum::<f64>().max(0.0) + 0.0,
        mean(&|trial| trial.outer_recall),
        mean(&|trial| trial.met_recall),
        trials.iter().map(|trial| trial.faces[1]).sum::<usize>(),
        trials.iter().map(|trial| trial.faces[0]).sum::<usize>(),
        trials.iter().map(|trial| trial.posts[1]).sum::<usize>(),
        trials.iter().map(|trial| trial.posts[0]).sum::<usize>(),
        trials.iter().map(|trial| trial.posts[2]).sum::<usize>(),
        trials.iter().filter(|trial| trial.is_determined).count(),
        trials.iter().filter(|trial| trial.is_determined && trial.is_complete()).count(),
        mean(&|trial| trial.seconds),
        mean(&|trial| trial.scenes as f64),
    );
}

impl Settings {
    fn survey_options(&self) -> SurveyOptions {
        let [m_per_m, deg_per_m] = self.odometry;
        let sigma = OdometrySigma { m_per_m, deg_per_m, ..OdometrySigma::default() };
        SurveyOptions {
            odometry: self.odometry_is_used.then_some(sigma),
            square_deg: self.square_deg,
            fit: self.fit.clone(),
            ..SurveyOptions::default()
        }
    }

    fn from_args() -> Result<Self, Box<dyn Error>> {
        let mut settings = Self {
            kinds: RoomKind::ALL.to_vec(),
            seeds: 0..4,
            stops: 8,
            poses: None,
            beams: 400,
            array: None,
            odometry: [0.05, 5.0],
            odometry_is_used: true,
            square_deg: None,
            noise: ReadingNoise { sigma_db: 0.5, sigma_m: 0.001 },
            truth: TrueSensor::default(),
            fit: Vec::new(),
            is_verbose: false,
            prints_walls: false,
            compares_choices: false,
            compares_methods: false,
        };
        let mut args = std::env::args().skip(1);
        while let Some(name) = args.next() {
            match name.as_str() {
                "--verbose" => {
                    settings.is_verbose = true;
                    continue;
                }
                "--walls" => {
                    settings.prints_walls = true;
                    continue;
                }
                "--next-view" => {
                    settings.compares_choices = true;
                    continue;
                }
                "--baselines" => {
                    settings.compares_methods = true;
                    continue;
                }
                "--no-odometry" => {
                    settings.odometry_is_used = false;
                    continue;
                }
                "--square" => {
                    settings.square_deg = Some(1.0);
                    continue;
                }
                _ => {}
            }
            let value = args.next().ok_or_else(|| format!("{name}: a value is missing"))?;
            match name.as_str() {
                "--kinds" => {
                    settings.kinds = value.split(',').map(str::parse).collect::<Result<_, _>>()?;
                }
                "--seeds" => {
                    let (from, to) = value.split_once(':').ok_or("--seeds: use FROM:TO")?;
                    settings.seeds = from.parse()?..to.parse()?;
                }
                "--stops" => settings.stops = value.parse()?,
                "--poses" => settings.poses = Some(value.parse()?),
                "--array" => settings.array = Some(RangerArray::preset(&value)?),
                "--beams" => settings.beams = value.parse()?,
                "--odometry" => {
                    let (m, deg) = value.split_once(',').ok_or("--odometry: use M,DEG")?;
                    settings.odometry = [m.parse()?, deg.parse()?];
                }
                "--threshold-db" => settings.truth.threshold_db = value.parse()?,
                "--reflectance" => settings.truth.reflectance = value.parse()?,
                "--temperature-c" => settings.truth.temperature_c = value.parse()?,
                "--ahead-m" => settings.truth.ahead_m = value.parse()?,
                "--left-m" => settings.truth.left_m = value.parse()?,
                "--fit" => {
                    let groups = value.split(',').map(|name| serde_json::from_value(name.into()));
                    settings.fit = groups.collect::<Result<_, _>>()?;
                }
                "--sigma-db" => settings.noise.sigma_db = value.parse()?,
                "--sigma-m" => settings.noise.sigma_m = value.parse()?,
                _ => return Err(format!("{name} is no option").into()),
            }
        }
        Ok(settings)
    }
}
