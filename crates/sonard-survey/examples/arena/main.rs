//! Surveys of a real arena, whose plan was measured by hand, from five sweeps each.
//!
//! ```sh
//! cargo run --release -p sonard-survey --example arena -- FOLDER [--runs roberto-a,roberto-b] [--walls]
//! ```
//!
//! The folder has `arena.json` and `arena-sweeps.json`.

mod draw;
mod predict;
mod runs;

use std::{error::Error, path::PathBuf, sync::Arc, time::Instant};

use sonard_inverse::World;
use sonard_model::{
    acoustics::Air,
    geometry::{DVec2, Pose},
    model::Options,
    scene::Scene,
};
use sonard_survey::{
    NoObserver, OdometrySigma, PieceStatus, Survey, SurveyOptions, score_refined_plan, survey,
    trial::{Ends, RigidMotion, coverage},
};

use draw::{DrawnPlan, draw_plans};
use predict::{EchoCount, Predictor};
use runs::{Arena, Run};

/// Runs whose sweeps are predicted.
const HELD_OUT: [&str; 6] =
    ["roberto-a", "roberto-b", "roberto-c", "roberto-e", "roberto-f", "roberto-h"];
/// Distances and angles within which walls agree, metres and degrees.
const TOLERANCES: [[f64; 2]; 2] = [[0.04, 4.0], [0.06, 6.0]];

/// Options of the command line.
struct Settings {
    folder: PathBuf,
    runs: Option<Vec<String>>,
    seed: u64,
    options: SurveyOptions,
    /// SVG file.
    picture: Option<PathBuf>,
    prints_walls: bool,
}

/// Survey of a run, with its figures.
struct Trial {
    run: usize,
    found: Survey,
    scene: Scene,
    /// Walls without conjectured stretches, in the frame of the arena.
    walls: Vec<Ends>,
    /// From the frame of the survey to the arena's.
    motion: RigidMotion,
    /// Recall and precision by tolerance.
    shares: [[f64; 2]; 2],
    explained: EchoCount,
    true_explained: EchoCount,
    wrong_observed_m: f64,
    true_score: f64,
    pose_errors: [f64; 2],
    seconds: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let settings = Settings::from_args()?;
    let arena = Arena::load(&settings.folder, settings.seed)?;
    let truth: Vec<Ends> = arena.scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
    let is_selected = |run: &&Run| settings.runs.as_ref().is_none_or(|of| of.contains(&run.name));
    println!("{HEAD}");
    let mut trials = Vec::new();
    for (at, run) in arena.runs.iter().enumerate().filter(|(_, run)| is_selected(run)) {
        let trial = trial(&arena, at, &truth, &settings.options)?;
        print_trial(&run.name, &trial);
        if settings.prints_walls {
            print_walls(&trial, &truth);
            print_poses(&trial, run);
        }
        trials.push(trial);
    }
    print_means(&trials);
    if let Some(path) = &settings.picture {
        std::fs::write(path, draw(&arena, &trials, &truth))?;
    }
    println!("\n{HELD_OUT_HEAD}");
    let located = located_in_arena(&arena)?;
    for trial in &trials {
        print_held_out(&arena, trial, &located)?;
    }
    Ok(())
}

const HEAD: &str = "\
| run | recall, precision at 4 cm | at 6 cm | echoes explained % | arena at fitted poses % | walls | wrong observed m | \
score | arena's | position mm | heading deg | unexplained arcs | scenes | s |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |";
const HELD_OUT_HEAD: &str = "\
| plan from the sweeps of | other runs' echoes % | arena % |
| --- | --- | --- |";

fn trial(
    arena: &Arena,
    at: usize,
    truth: &[Ends],
    options: &SurveyOptions,
) -> Result<Trial, Box<dyn Error>> {
    let run = &arena.runs[at];
    let empty = Scene::builder("unknown room").material("wall", options.reflectance).build()?;
    let world = World::new(Arc::new(empty), run.sensor.clone(), Air::default(), Options::default());
    let start = Instant::now();
    let found = survey(&world, &run.sweeps, options, &NoObserver)?;
    let seconds = start.elapsed().as_secs_f64();
    let poses: Vec<Pose> = found.poses.iter().map(|of| of.pose).collect();
    let motion = RigidMotion::between(&poses, &run.poses);
    let in_arena = |ends: [[f64; 2]; 2]| ends.map(|end| motion.of(DVec2::from(end)));
    let walls: Vec<Ends> =
        found.walls.iter().flat_map(|wall| wall.stretches(false)).map(in_arena).collect();
    let [m, deg] = TOLERANCES[1];
    let pieces = found.walls.iter().flat_map(|wall| &wall.pieces);
    let observed = pieces.filter(|piece| piece.status == PieceStatus::Observed);
    let wrong_m = |of: Ends| of[0].distance(of[1]) * (1.0 - coverage(&[of], truth, m, deg));
    let scene = found.scene("found", false).build()?;
    let counted = |scene: &Scene, poses: &[Pose]| -> Result<EchoCount, Box<dyn Error>> {
        let predictor = Predictor::new(scene.clone(), &run.sensor)?;
        Ok(run.sweeps.iter().zip(poses).map(|(sweep, pose)| predictor.count(sweep, pose)).sum())
    };
    Ok(Trial {
        run: at,
        shares: TOLERANCES
            .map(|[m, deg]| [coverage(truth, &walls, m, deg), coverage(&walls, truth, m, deg)]),
        explained: counted(&scene, &poses)?,
        true_explained: counted(&arena.scene, &run.poses)?,
        wrong_observed_m: observed.map(|of| wrong_m(in_arena([of.from_m, of.to_m]))).sum(),
        true_score: score_refined_plan(&world, &run.sweeps, options, truth, &run.poses)?,
        pose_errors: motion.pose_errors(&poses, &run.poses),
        found,
        scene,
        walls,
        motion,
        seconds,
    })
}

fn print_trial(name: &str, of: &Trial) {
    let [near, far] = of.shares.map(|[recall, precision]| format!("{recall:.2}, {precision:.2}"));
    println!(
        "| {name} | {near} | {far} | {:.1} | {:.1} | {} | {:.2} | {:.1} | {:.1} | {:.0} | {:.1} | {} of {} | {} | {:.1} |",
        of.explained.percent(),
        of.true_explained.percent(),
        of.found.walls.len(),
        of.wrong_observed_m,
        of.found.score,
        of.true_score,
        1e3 * of.pose_errors[0],
        of.pose_errors[1],
        of.found.unexplained.len(),
        of.found.arcs,
        of.found.scored_scenes,
        of.seconds,
    );
}

/// Prints stretches of walls in the frame of the arena, with their share within 6 cm and 6 degrees of
/// the walls measured, and the standard deviations of each wall.
fn print_walls(of: &Trial, truth: &[Ends]) {
    for wall in &of.found.walls {
        for piece in &wall.pieces {
            let ends = [piece.from_m, piece.to_m].map(|end| of.motion.of(end.into()));
            let [m, deg] = TOLERANCES[1];
            println!(
                "#   {} {:.3} to {:.3} {:?} right {:.2} evidence {:.1} sigma {:.1?} deg {:.3?} m",
                wall.id,
                ends[0],
                ends[1],
                piece.status,
                coverage(&[ends], truth, m, deg),
                wall.evidence_nats,
                wall.sigma_direction_deg,
                wall.sigma_across_m,
            );
        }
    }
}

/// Prints errors of poses in the frame of the arena, with their standard deviations.
fn print_poses(of: &Trial, run: &Run) {
    for (found, truth) in of.found.poses.iter().zip(&run.poses) {
        let [off_m, off_deg] = of.motion.pose_errors(&[found.pose], &[*truth]);
        println!(
            "#   pose off {off_m:.3} m {off_deg:.1} deg, sigma {:.3?} m {:.1?} deg",
            found.sigma_m, found.sigma_heading_deg
        );
    }
}

fn print_means(trials: &[Trial]) {
    let count = trials.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Trial) -> f64| trials.iter().map(of).sum::<f64>() / count;
    let shares = |at: usize| {
        let [recall, precision] = [0, 1].map(|of| mean(&|trial| trial.shares[at][of]));
        format!("{recall:.2}, {precision:.2}")
    };
    println!(
        "| mean | {} | {} | {:.1} | {:.1} | {:.1} | {:.2} | {:.1} | {:.1} | | | | | {:.1} |",
        shares(0),
        shares(1),
        mean(&|of| of.explained.percent()),
        mean(&|of| of.true_explained.percent()),
        mean(&|of| of.found.walls.len() as f64),
        mean(&|of| of.wrong_observed_m),
        mean(&|of| of.found.score),
        mean(&|of| of.true_score),
        mean(&|of| of.seconds),
    );
}

/// Picture of the plans found, with the echoes at the poses found.
fn draw(arena: &Arena, trials: &[Trial], truth: &[Ends]) -> String {
    let sound_speed_m_s = Air::default().sound_speed_m_s();
    let drawn = trials.iter().map(|trial| {
        let run = &arena.runs[trial.run];
        let poses = trial.found.poses.iter().map(|of| of.pose);
        let in_sweep = |(sweep, pose): (&sonard_inverse::FitSweep, Pose)| {
            let echo = |beam: &sonard_inverse::SweepFiring| {
                let range_m = beam.range_m(sound_speed_m_s)? + run.sensor.mounting.ahead_m;
                Some(trial.motion.of(pose.point_at(beam.azimuth_deg, range_m)))
            };
            sweep.beams.iter().filter_map(echo).collect::<Vec<_>>()
        };
        DrawnPlan {
            title: &run.name,
            walls: trial.walls.clone(),
            places: poses.clone().map(|pose| trial.motion.of(pose.position())).collect(),
            echoes: run.sweeps.iter().zip(poses).flat_map(in_sweep).collect(),
        }
    });
    draw_plans(&drawn.collect::<Vec<_>>(), truth)
}

/// Echoes of each run that the arena predicts from poses located near those fitted by hand.
fn located_in_arena(arena: &Arena) -> Result<Vec<EchoCount>, Box<dyn Error>> {
    let of_run = |run: &Run| -> Result<EchoCount, Box<dyn Error>> {
        let predictor = Predictor::new(arena.scene.clone(), &run.sensor)?;
        let pairs = run.sweeps.iter().zip(&run.poses);
        Ok(pairs
            .map(|(sweep, pose)| predictor.count(sweep, &predictor.locate_near(sweep, pose)))
            .sum())
    };
    arena.runs.iter().map(of_run).collect()
}

/// Prints how many echoes of other runs' sweeps a plan found predicts, from poses located near
/// those fitted by hand.
fn print_held_out(
    arena: &Arena,
    trial: &Trial,
    located: &[EchoCount],
) -> Result<(), Box<dyn Error>> {
    let others = || {
        let runs = arena.runs.iter().enumerate();
        runs.filter(|(at, run)| *at != trial.run && HELD_OUT.contains(&run.name.as_str()))
    };
    let mut counts = Vec::new();
    for (_, run) in others() {
        let predictor = Predictor::new(trial.scene.clone(), &run.sensor)?;
        counts.extend(run.sweeps.iter().zip(&run.poses).map(|(sweep, pose)| {
            let near = trial.motion.inverse_of(pose);
            predictor.count(sweep, &predictor.locate_near(sweep, &near))
        }));
    }
    let in_arena: EchoCount = others().map(|(at, _)| located[at]).sum();
    println!(
        "| {} | {:.1} | {:.1} |",
        arena.runs[trial.run].name,
        counts.into_iter().sum::<EchoCount>().percent(),
        in_arena.percent()
    );
    Ok(())
}

impl Settings {
    fn from_args() -> Result<Self, Box<dyn Error>> {
        // Waypoints are right to a centimetre or two, their frame to 3 degrees, headings to 5.
        let odometry = OdometrySigma {
            m_per_m: 0.03,
            deg_per_m: 0.01,
            m_per_stop: 0.012,
            deg_per_stop: 5.0,
            are_waypoints: true,
        };
        let mut settings = Self {
            folder: PathBuf::new(),
            runs: None,
            seed: 1,
            options: SurveyOptions { odometry: Some(odometry), ..SurveyOptions::default() },
            picture: None,
            prints_walls: false,
        };
        let mut args = std::env::args().skip(1);
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or(format!("{arg} needs a value"));
            match arg.as_str() {
                "--walls" => settings.prints_walls = true,
                "--runs" => settings.runs = Some(value()?.split(',').map(str::to_owned).collect()),
                "--seed" => settings.seed = value()?.parse()?,
                "--square" => settings.options.square_deg = Some(value()?.parse()?),
                "--range-sigma" => settings.options.range_sigma_m = Some(value()?.parse()?),
                "--arc" => settings.options.arc_deg = value()?.parse()?,
                "--max-scenes" => settings.options.max_scenes = value()?.parse()?,
                "--min-arc-beams" => settings.options.min_arc_beams = Some(value()?.parse()?),
                "--picture" => settings.picture = Some(value()?.into()),
                _ => settings.folder = arg.into(),
            }
        }
        Ok(settings)
    }
}
