//! Explorations of random rooms by the next view, compared with other choices of the next stop.

use std::{error::Error, fmt, sync::Arc};

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;
use sonard_inverse::{FitSweep, World};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::Options,
    scene::Scene,
};
use sonard_survey::{
    NoObserver, Survey, SurveyOptions, survey,
    trial::{
        Comparison, Ends, RigidMotion, RoomKind, add_posts, draw_course, draw_room, drift, extent,
        generator, is_free, simulate_sweeps,
    },
};
use uuid::Uuid;

use super::{COMPLETE, MAX_RANGE_M, Settings};

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
/// Distance from a wall at which a robot stops, metres.
const CONTACT_M: f64 = 0.15;

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

/// Robot with its course and readings.
struct Explorer<'a, R> {
    world: &'a World,
    settings: &'a Settings,
    random: R,
    truth: Vec<Pose>,
    readings: Vec<FitSweep>,
    /// Distances between stops along the moves, metres.
    between_m: Vec<Vec<f64>>,
    driven_m: f64,
}

/// Sweeps and surveys until nothing is open or the number of stops is reached.
fn explore(
    kind: RoomKind,
    seed: u64,
    choice: Choice,
    settings: &Settings,
) -> Result<Vec<Step>, Box<dyn Error>> {
    let mut random = generator(kind, seed);
    let mut room = draw_room(kind, &mut random)?;
    let poses = draw_course(&room, FIRST_STOPS, &mut random);
    if kind.has_posts() {
        add_posts(&mut room, &poses, &mut random);
    }
    let sensor = Sensor::preset("senscomp-6500")?;
    let options = Options { max_range_m: Some(MAX_RANGE_M), ..Options::default() };
    let world = World::new(Arc::new(room), sensor, Air::default(), options);
    let truth: Vec<Ends> = world.scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
    let mut explorer = Explorer {
        world: &world,
        settings,
        random: Pcg64::seed_from_u64(seed),
        truth: Vec::new(),
        readings: Vec::new(),
        between_m: Vec::new(),
        driven_m: 0.0,
    };
    for (at, pose) in poses.iter().enumerate() {
        explorer.sweep(*pose, at.saturating_sub(1))?;
    }
    let mut steps = Vec::new();
    loop {
        let options = settings.survey_options();
        let start_s = super::cpu_s();
        let found = survey(&world, &explorer.readings, &options, &NoObserver)?;
        let cpu_s = super::cpu_s() - start_s;
        let Comparison { motion, recall, precision, .. } =
            Comparison::new(&found, &world.scene, &explorer.truth);
        if settings.prints_walls {
            super::print_walls(&found, &motion, &truth);
            println!(
                "#   {} of {} arcs unexplained, {:?}",
                found.unexplained.len(),
                found.arcs,
                found.next_view
            );
        }
        steps.push(Step {
            recall,
            precision,
            open_nats: found.open_nats,
            driven_m: explorer.driven_m,
            cpu_s,
        });
        let next = explorer.choose(choice, &found, &motion, &options);
        let Some((place, via)) = next.filter(|_| explorer.truth.len() < settings.stops) else {
            return Ok(steps);
        };
        explorer.drive(place, via)?;
    }
}

impl<R: Rng> Explorer<'_, R> {
    /// Next place and the stop before it; `None` where the survey has no next view.
    fn choose(
        &mut self,
        choice: Choice,
        found: &Survey,
        motion: &RigidMotion,
        options: &SurveyOptions,
    ) -> Option<(DVec2, usize)> {
        let view = motion.of(found.next_view.as_ref()?.pose.position());
        if choice == Choice::NextView {
            let nearest = |a: &usize, b: &usize| {
                let off_m = |at: &usize| self.truth[*at].position().distance(view);
                off_m(a).total_cmp(&off_m(b))
            };
            let via = (0..self.truth.len()).min_by(nearest)?;
            return Some((view, self.via(view, options.view_reach_m).unwrap_or(via)));
        }
        let places = self.places(options.view_reach_m);
        match choice {
            Choice::Random => {
                let at = self.random.random_range(0..places.len().max(1));
                places.get(at).copied()
            }
            _ => places.into_iter().max_by(|a, b| {
                let off_m = |place: DVec2| {
                    let stops = self.truth.iter().map(|pose| pose.position().distance(place));
                    stops.fold(f64::INFINITY, f64::min)
                };
                off_m(a.0).total_cmp(&off_m(b.0))
            }),
        }
    }

    /// Places that are reachable by a straight move in the true room, with the stop before each.
    fn places(&self, reach_m: f64) -> Vec<(DVec2, usize)> {
        let [low, high] = extent(&self.world.scene);
        let [columns, rows] = ((high - low) / SPACING_M).to_array().map(|count| count as u32);
        let at = |(x, y): (u32, u32)| low + SPACING_M * DVec2::new(f64::from(x), f64::from(y));
        let all = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(at);
        let is_far = |place: &DVec2| {
            self.truth.iter().all(|pose| pose.position().distance(*place) > MIN_MOVE_M)
        };
        all.filter(is_far).filter_map(|place| Some((place, self.via(place, reach_m)?))).collect()
    }

    /// Stop from which a place is reachable with the shortest drive.
    fn via(&self, place: DVec2, reach_m: f64) -> Option<usize> {
        let last = self.truth.len() - 1;
        let length_m =
            |at: usize| self.between_m[last][at] + self.truth[at].position().distance(place);
        let is_reached = |at: &usize| {
            let from = self.truth[*at].position();
            from.distance(place) <= reach_m && is_way_free(&self.world.scene, from, place)
        };
        let reached = (0..=last).filter(is_reached);
        reached.min_by(|a, b| length_m(*a).total_cmp(&length_m(*b)))
    }

    /// Drives towards a place from a stop, as far as walls allow, and sweeps.
    fn drive(&mut self, place: DVec2, via: usize) -> Result<(), Box<dyn Error>> {
        let from = self.truth[via].position();
        let steps = (from.distance(place) / 0.02).ceil().max(1.0);
        let at = |step: usize| from.lerp(place, step as f64 / steps);
        let is_clear = |step: &usize| self.world.scene.clearance_m(at(*step)) > CONTACT_M;
        let reached = (0..=steps as usize).take_while(is_clear).last().map_or(from, at);
        let heading_deg = (place - from).to_angle().to_degrees();
        self.sweep(Pose { x_m: reached.x, y_m: reached.y, heading_deg }, via)
    }

    fn sweep(&mut self, pose: Pose, via: usize) -> Result<(), Box<dyn Error>> {
        let Settings { beams, noise, odometry, .. } = *self.settings;
        let known = match (self.truth.last(), self.readings.last()) {
            (Some(from), Some(last)) => {
                let moved = drift(&[*from, pose], odometry, &mut self.random);
                let back = |of: &Pose, by: DVec2| {
                    DVec2::from_angle(-of.heading_deg.to_radians()).rotate(by)
                };
                let by = back(from, moved[1].position() - from.position());
                let by = DVec2::from_angle(last.pose.heading_deg.to_radians()).rotate(by);
                Pose {
                    x_m: last.pose.x_m + by.x,
                    y_m: last.pose.y_m + by.y,
                    heading_deg: last.pose.heading_deg + moved[1].heading_deg - from.heading_deg,
                }
            }
            _ => pose,
        };
        let mut fired = simulate_sweeps(self.world, &[pose], beams, noise, &mut self.random)?;
        for sweep in &mut fired {
            sweep.pose = known;
            sweep.scan = Uuid::from_u128(self.truth.len() as u128 + 1);
        }
        let mut row: Vec<f64> = (0..self.truth.len())
            .map(|at| {
                self.between_m[via][at] + self.truth[via].position().distance(pose.position())
            })
            .collect();
        self.driven_m += row.last().copied().unwrap_or(0.0);
        self.between_m.iter_mut().zip(&row).for_each(|(of, m)| of.push(*m));
        row.push(0.0);
        self.between_m.push(row);
        self.truth.push(pose);
        self.readings.extend(fired);
        Ok(())
    }
}

fn is_way_free(scene: &Scene, from: DVec2, to: DVec2) -> bool {
    let steps = (from.distance(to) / 0.05).ceil().max(1.0);
    (1..=steps as usize).all(|step| is_free(scene, from.lerp(to, step as f64 / steps)))
}
