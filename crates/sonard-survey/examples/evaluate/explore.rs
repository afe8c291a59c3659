//! Explorations of random rooms by the next view, compared with other choices of the next stop.

use std::{error::Error, fmt};

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;
use sonard_model::geometry::DVec2;
use sonard_survey::{
    NoObserver, survey,
    trial::{
        Comparison, Ends, Explorer, ExplorerSettings, RoomKind, Way, draw_trial, extent, generator,
        trial_world,
    },
};

use super::{COMPLETE, Settings};

/// Choice of the next stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    /// Next view of the survey.
    NextView,
    /// Reachable place at random.
    Random,
    /// Reachable place farthest from all stops.
    Farthest,
}

impl Choice {
    const ALL: [Self; 3] = [Self::NextView, Self::Random, Self::Farthest];
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::NextView => "next view",
            Self::Random => "random place",
            Self::Farthest => "farthest place",
        })
    }
}

/// Number of sweeps before the first choice.
const FIRST_STOPS: usize = 2;
/// Spacing of the places among which the other choices are, metres.
const SPACING_M: f64 = 0.2;
/// Minimum distance of a place from all stops, metres.
const MIN_MOVE_M: f64 = 0.15;

/// State of an exploration after a survey.
struct Step {
    recall: f64,
    precision: f64,
    open_nats: f64,
    driven_m: f64,
    cpu_s: f64,
}

impl Step {
    fn is_complete(&self) -> bool {
        self.recall > COMPLETE && self.precision > COMPLETE
    }
}

/// Explores each room by each choice and prints a table.
pub(crate) fn compare_choices(settings: &Settings) -> Result<(), Box<dyn Error>> {
    println!(
        "| kind | next stop | rooms | stops until complete | complete | stops | nothing open | recall | precision | open nats after 3 stops | after 4 | at the end | driven m | CPU s |"
    );
    for &kind in &settings.kinds {
        for choice in Choice::ALL {
            let mut runs = Vec::new();
            for seed in settings.seeds.clone() {
                let steps = explore(kind, seed, choice, settings)?;
                if settings.is_verbose {
                    print_steps(kind, seed, choice, &steps);
                }
                runs.push(steps);
            }
            print_row(kind, choice, &runs, settings.stops);
        }
    }
    Ok(())
}

fn print_steps(kind: RoomKind, seed: u64, choice: Choice, steps: &[Step]) {
    let text = steps
        .iter()
        .map(|step| format!("{:.2}/{:.2} {:.2} nats", step.recall, step.precision, step.open_nats));
    println!("# {kind} {seed} {choice}: {}", text.collect::<Vec<_>>().join("; "));
}

/// Means over rooms. A room that is never complete counts with one stop more than the limit.
fn print_row(kind: RoomKind, choice: Choice, runs: &[Vec<Step>], max_stops: usize) {
    let count = runs.len().max(1) as f64;
    let mean =
        |of: &dyn Fn(&[Step]) -> f64| runs.iter().map(|steps| of(steps)).sum::<f64>() / count;
    let number = |is: &dyn Fn(&[Step]) -> bool| runs.iter().filter(|steps| is(steps)).count();
    let until_complete = |steps: &[Step]| {
        let first = steps.iter().position(Step::is_complete);
        first.map_or(max_stops + 1, |at| FIRST_STOPS + at) as f64
    };
    let last = |steps: &[Step], of: &dyn Fn(&Step) -> f64| steps.last().map_or(0.0, of);
    let open_after = |steps: &[Step], stops: usize| {
        let at = (stops - FIRST_STOPS).min(steps.len().saturating_sub(1));
        steps.get(at).map_or(0.0, |step| step.open_nats)
    };
    println!(
        "| {kind} | {choice} | {} | {:.1} | {} | {:.1} | {} | {:.3} | {:.3} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} |",
        runs.len(),
        mean(&until_complete),
        number(&|steps| steps.last().is_some_and(Step::is_complete)),
        mean(&|steps| (FIRST_STOPS + steps.len() - 1) as f64),
        number(&|steps| last(steps, &|step| step.open_nats) < 0.1),
        mean(&|steps| last(steps, &|step| step.recall)),
        mean(&|steps| last(steps, &|step| step.precision)),
        mean(&|steps| open_after(steps, 3)),
        mean(&|steps| open_after(steps, 4)),
        mean(&|steps| last(steps, &|step| step.open_nats)),
        mean(&|steps| last(steps, &|step| step.driven_m)),
        mean(&|steps| steps.iter().map(|step| step.cpu_s).sum()),
    );
}

/// Sweeps and surveys until nothing is open or the number of stops is reached.
fn explore(
    kind: RoomKind,
    seed: u64,
    choice: Choice,
    settings: &Settings,
) -> Result<Vec<Step>, Box<dyn Error>> {
    let (room, course) = draw_trial(kind, FIRST_STOPS, &mut generator(kind, seed))?;
    let world = trial_world(room)?;
    let truth: Vec<Ends> = world.scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
    let Settings { beams, noise, odometry: odometry_per_m, .. } = *settings;
    let mut explorer = Explorer::new(&world, ExplorerSettings { beams, noise, odometry_per_m });
    let mut random = Pcg64::seed_from_u64(seed);
    explorer.sweep_along(&course, &mut random)?;
    let mut steps = Vec::new();
    loop {
        let options = settings.survey_options();
        let start_s = super::cpu_s();
        let found = survey(&world, explorer.readings(), &options, &NoObserver)?;
        let cpu_s = super::cpu_s() - start_s;
        let Comparison { motion, recall, precision, .. } =
            Comparison::new(&found, &world.scene, explorer.stops());
        if settings.prints_walls {
            super::print_walls(&found, &motion, &truth);
            println!(
                "#   {} of {} arcs unexplained, {:?}",
                found.unexplained.len(),
                found.arcs,
                found.next_view
            );
        }
        let (open_nats, driven_m) = (found.open_nats, explorer.driven_m());
        steps.push(Step { recall, precision, open_nats, driven_m, cpu_s });
        let view = found.next_view.as_ref().map(|view| motion.of(view.pose.position()));
        let next =
            view.and_then(|view| choice.way(&explorer, view, options.view_reach_m, &mut random));
        let Some(way) = next.filter(|_| explorer.stops().len() < settings.stops) else {
            return Ok(steps);
        };
        explorer.drive(way, &mut random)?;
    }
}

impl Choice {
    /// Way to the next stop, given the next view of the survey.
    fn way(
        self,
        explorer: &Explorer,
        view: DVec2,
        reach_m: f64,
        random: &mut impl Rng,
    ) -> Option<Way> {
        if self == Self::NextView {
            return explorer.way_to_view(view, reach_m);
        }
        let ways = ways(explorer, reach_m);
        if self == Self::Random {
            let at = random.random_range(0..ways.len().max(1));
            return ways.get(at).copied();
        }
        let off_m = |way: &Way| stop_distance_m(explorer, way.place);
        ways.into_iter().max_by(|a, b| off_m(a).total_cmp(&off_m(b)))
    }
}

/// Ways to places of a grid that are reachable by a straight move in the true room.
fn ways(explorer: &Explorer, reach_m: f64) -> Vec<Way> {
    let [low, high] = extent(&explorer.world().scene);
    let [columns, rows] = ((high - low) / SPACING_M).to_array().map(|count| count as u32);
    let at = |(x, y): (u32, u32)| low + SPACING_M * DVec2::new(f64::from(x), f64::from(y));
    let all = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(at);
    let is_far = |place: &DVec2| stop_distance_m(explorer, *place) > MIN_MOVE_M;
    all.filter(is_far).filter_map(|place| explorer.way_to(place, reach_m)).collect()
}

/// Distance of a place from the nearest stop, metres.
fn stop_distance_m(explorer: &Explorer, place: DVec2) -> f64 {
    let stops = explorer.stops().iter().map(|pose| pose.position().distance(place));
    stops.fold(f64::INFINITY, f64::min)
}
