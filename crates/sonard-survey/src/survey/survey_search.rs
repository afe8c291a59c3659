//! Search for poses and walls over all rounds.

use sonard_model::geometry::Pose;

use crate::{
    alternatives::{Assessment, assess},
    arc::Arc,
    arrangement::LineArrangement,
    boxes::with_box,
    bundle::{SupportedFeature, fit_feature},
    candidates::CandidateSources,
    covariance::PlanCovariance,
    judge::Judge,
    odometry::Move,
    options::SurveyOptions,
    polish::{fit_numbers, polish},
    pose_grid::improve_poses,
    posed::PosedPlan,
    posts::{MAX_POSTS, PostKind, with_new_posts, without_idle_posts},
    progress::{SurveyProgress, SurveyStage},
    range_errors::{FINE_SIGMA_M, RangeErrors},
    refine::refine,
    relocate::relocated,
    result::SearchEnd,
    search::{PlanSearch, ScoredPlan, initial_walls},
    sensor_fit::SensorFitter,
    slam::{
        VirtualMap, are_same_course, map_of_poses, orders, reassociated, virtual_map,
        virtual_map_in_order,
    },
    square::square_lines,
    trace::unexplained_by,
    workspace::Workspace,
};
/// Round of the search for walls with a fine ranger.
struct Round {
    /// Standard deviation of ranges, metres.
    sigma_m: f64,
    /// Maximum error of ranges that a refinement uses, metres.
    gate_m: f64,
    max_lines: usize,
}

/// Rounds, from rough poses to fine ones; the last is repeated while it gains.
const ROUNDS: [Round; 3] = [
    Round { sigma_m: 0.012, gate_m: 0.03, max_lines: 26 },
    Round { sigma_m: 0.006, gate_m: 0.012, max_lines: 30 },
    Round { sigma_m: FINE_SIGMA_M, gate_m: 0.012, max_lines: 30 },
];
/// Maximum number of restarts from the long walls.
const MAX_RESTARTS: usize = 2;
/// Maximum number of boxes that are completed.
const MAX_BOXES: usize = 3;
/// Length below which a wall is dropped by a restart, metres.
const SHORT_M: f64 = 0.3;
/// Maximum number of rounds.
const MAX_ROUNDS: usize = 6;
/// Share of all arcs unexplained from which a course may be wrong, and that of a coarse ranger or an
/// array.
const UNCERTAIN_SHARE: f64 = 0.2;
const COARSE_UNCERTAIN_SHARE: f64 = 0.07;
/// Gain of a round below which the last one is not repeated, nats.
const MIN_ROUND_GAIN: f64 = 0.5;
const LAST_ROUND: &Round = &ROUNDS[ROUNDS.len() - 1];
const REFINE_STEPS: usize = 4;
/// Search for poses and walls.
pub(super) struct SurveySearch<'a> {
    workspace: &'a Workspace<'a>,
    options: &'a SurveyOptions,
    features: Vec<SupportedFeature<'a>>,
    pub(super) posed: PosedPlan,
    pub(super) covariance: Option<PlanCovariance>,
    score: Option<f64>,
}

/// State to which a search returns where a trial loses.
struct SearchState<'a> {
    features: Vec<SupportedFeature<'a>>,
    posed: PosedPlan,
    covariance: Option<PlanCovariance>,
    score: Option<f64>,
}

impl<'a> SurveySearch<'a> {
    /// Begins with a given plan.
    pub(super) fn with_plan(
        workspace: &'a Workspace<'a>,
        options: &'a SurveyOptions,
        posed: PosedPlan,
    ) -> Self {
        Self { workspace, options, features: Vec::new(), posed, covariance: None, score: None }
    }

    /// Begins with the poses of the virtual map.
    pub(super) fn new(workspace: &'a Workspace<'a>, options: &'a SurveyOptions) -> Self {
        let start = workspace.readings[0].odometry;
        let empty = PosedPlan::without_walls(Vec::new());
        let mut search = Self::with_plan(workspace, options, empty);
        search.report_progress(SurveyStage::Course);
        if search.begins_at_odometry() {
            // Few arcs, which cut each other, determine poses less well than odometry.
            let readings = workspace.readings.iter();
            let poses: Vec<Pose> = readings.map(|readings| readings.odometry).collect();
            search.features = reassociated(&[], &workspace.arcs, &poses);
            search.posed = PosedPlan::without_walls(poses);
        } else {
            search.begin(virtual_map(&workspace.arcs, start, &workspace.moves));
        }
        search
    }

    /// Returns `true` if the sweeps begin at the poses of odometry rather than of the virtual map.
    fn begins_at_odometry(&self) -> bool {
        let is_array = self.workspace.is_array;
        self.errors().is_coarse() && self.options.odometry.is_some() && !is_array
    }

    /// Begins with a course and no walls.
    fn begin(&mut self, map: VirtualMap<'a>) {
        (self.features, self.posed) = (map.features, PosedPlan::without_walls(map.poses));
        (self.covariance, self.score) = (None, None);
    }

    /// Searches poses and walls; where many arcs remain unexplained, again with the sweeps located
    /// in other orders, and keeps the best.
    pub(super) fn run(&mut self) {
        self.run_from_course();
        for order in self.further_orders() {
            if self.workspace.is_over() || !self.is_course_uncertain() {
                break;
            }
            let map = self.map_in_order(&order);
            if are_same_course(&map.poses, &self.posed.poses) {
                continue;
            }
            self.try_search(|search| {
                search.begin(map);
                search.run_from_course();
            });
        }
    }

    /// Orders of the virtual maps from which a search that leaves arcs unexplained begins again.
    ///
    /// Where it began at odometry, the order of the course is the first, and none is left out: the
    /// courses differ by the headings, which few arcs of a coarse ranger determine.
    fn further_orders(&self) -> Vec<Vec<usize>> {
        let count = self.workspace.arcs.len();
        match self.begins_at_odometry() {
            true => [vec![(0..count).collect()], orders(count, false)].concat(),
            false => orders(count, self.options.odometry.is_some()),
        }
    }

    /// Continues from the plan of a search with another sensor; where arcs remain unexplained, also
    /// searches from the course, and keeps the better plan.
    pub(super) fn run_after(&mut self, last: PosedPlan) {
        let course = self.state();
        let workspace = self.workspace;
        self.begin(map_of_poses(&workspace.arcs, last.poses.clone(), &workspace.moves));
        self.posed = last;
        self.rounds(1);
        self.find_boxes();
        if self.left().is_empty() || workspace.is_over() {
            return;
        }
        self.try_search(|search| {
            search.restore(course);
            search.run();
        });
    }

    /// Refines the plan by all rounds; returns its score, nats.
    pub(super) fn refine_given(&mut self) -> f64 {
        for (number, round) in ROUNDS.iter().enumerate() {
            let sigma_m = self.errors().sigma_m(round.sigma_m);
            let judge = Judge::of(self.workspace, &self.posed, sigma_m);
            self.improve_poses(&judge, number);
            let judge = Judge::of(self.workspace, &self.posed, sigma_m);
            self.refine(&judge, self.errors().gate_m(round.gate_m));
        }
        self.score_now(self.errors().final_sigma_m())
    }

    fn map_in_order(&self, order: &[usize]) -> VirtualMap<'a> {
        let workspace = self.workspace;
        let odometry = |sweep: &usize| workspace.readings[*sweep].odometry;
        let poses: Vec<Pose> = order.iter().map(odometry).collect();
        let between = |sigma| Move::between(&poses, sigma);
        let moves = self.options.odometry.map_or_else(Vec::new, between);
        let start = workspace.readings[0].odometry;
        virtual_map_in_order(&workspace.arcs, start, order, (&moves, &workspace.moves))
    }

    /// Returns `true` if more arcs are unexplained than in a plan whose poses are right.
    fn is_course_uncertain(&self) -> bool {
        let all: usize = self.workspace.arcs.iter().map(Vec::len).sum();
        let share = match self.errors().is_coarse() || self.workspace.is_array {
            true => COARSE_UNCERTAIN_SHARE,
            false => UNCERTAIN_SHARE,
        };
        self.left().len() as f64 > share * all as f64
    }

    /// Runs the rounds; where arcs remain unexplained, begins again from the long walls alone.
    fn run_from_course(&mut self) {
        self.rounds(0);
        self.find_lost_sweeps();
        for _ in 0..MAX_RESTARTS {
            if self.workspace.is_over() || self.left().is_empty() && !self.has_short_walls() {
                break;
            }
            let is_better = self.try_search(|search| {
                // Their directions, mostly those of chance alignments, go with them.
                search.posed = search.posed.without_short_walls(SHORT_M);
                search.rounds(1);
            });
            if !is_better {
                break;
            }
        }
        self.find_boxes();
    }

    /// Fits numbers of sensor and air together with the plan found; returns `true` if they changed
    /// enough for another search.
    pub(super) fn fit_sensor(&mut self, fitter: &mut SensorFitter) -> bool {
        if fitter.is_empty() {
            return false;
        }
        let sigma_m = self.errors().final_sigma_m();
        let judge = Judge::of(self.workspace, &self.posed, sigma_m);
        let fitted = fit_numbers(&mut self.posed, &judge, fitter.numbers());
        fitted.is_some_and(|(numbers, covariance)| fitter.update(&numbers, covariance))
    }

    /// Completes boxes of which faces are found, or echoes remain unexplained, one after the other.
    fn find_boxes(&mut self) {
        for _ in 0..MAX_BOXES {
            let sigma_m = self.errors().final_sigma_m();
            let judge = Judge::of(self.workspace, &self.posed, sigma_m);
            let grown =
                (!self.workspace.is_over()).then(|| with_box(&self.posed, &judge, &self.left()));
            let Some(grown) = grown.flatten() else { break };
            let is_better = self.try_search(|search| {
                search.posed = grown;
                search.refine(&judge, search.errors().gate_m(LAST_ROUND.gate_m));
                search.rounds(ROUNDS.len() - 1);
            });
            if !is_better {
                break;
            }
        }
    }

    /// Searches on; returns `false`, and to the state before, if the result scores less.
    fn try_search(&mut self, search: impl FnOnce(&mut Self)) -> bool {
        let before = self.state();
        search(self);
        let is_worse = self.score < before.score;
        if is_worse {
            self.restore(before);
        }
        !is_worse
    }

    fn errors(&self) -> RangeErrors {
        self.workspace.errors
    }

    fn state(&self) -> SearchState<'a> {
        let (features, posed) = (self.features.clone(), self.posed.clone());
        SearchState { features, posed, covariance: self.covariance.clone(), score: self.score }
    }

    fn restore(&mut self, state: SearchState<'a>) {
        let SearchState { features, posed, covariance, score } = state;
        (self.features, self.posed) = (features, posed);
        (self.covariance, self.score) = (covariance, score);
    }

    /// Locates sweeps whose poses the course got wrong in the plan of the others, and begins again
    /// with these poses.
    fn find_lost_sweeps(&mut self) {
        for _ in 0..MAX_RESTARTS {
            let judge = Judge::of(self.workspace, &self.posed, self.errors().final_sigma_m());
            let moved = (!self.workspace.is_over()).then(|| relocated(&self.posed, &judge));
            let Some(poses) = moved.flatten() else { break };
            let is_better = self.try_search(|search| {
                let workspace = search.workspace;
                search.begin(map_of_poses(&workspace.arcs, poses, &workspace.moves));
                search.rounds(0);
            });
            if !is_better {
                break;
            }
        }
    }

    /// Returns `true` with walls that are too short to be trusted.
    fn has_short_walls(&self) -> bool {
        let walls = self.posed.plan.segments(&self.posed.walls);
        walls.iter().any(|wall| wall.length_m() < SHORT_M)
    }

    /// Runs rounds from a number on, until no arc is left or a round gains nothing.
    fn rounds(&mut self, first: usize) {
        for number in first..MAX_ROUNDS {
            self.report_progress(SurveyStage::Walls { round: number + 1 });
            let before = self.score.filter(|_| number >= ROUNDS.len());
            self.round(number);
            self.add_posts(number);
            let is_settled = before
                .is_some_and(|before| self.score.is_some_and(|now| now < before + MIN_ROUND_GAIN));
            let is_done = number + 1 >= ROUNDS.len() && self.left().is_empty();
            if is_settled || is_done || self.workspace.is_over() {
                break;
            }
        }
    }

    /// Adds posts at unexplained arcs as long as they gain, and removes those that do not pay.
    ///
    /// Arcs of a coarse ranger, of which many remain unexplained, do not determine a radius.
    fn add_posts(&mut self, number: usize) {
        if self.errors().is_coarse() {
            return;
        }
        let round = &ROUNDS[number.min(ROUNDS.len() - 1)];
        let sigma_m = self.errors().sigma_m(round.sigma_m);
        let gate_m = self.errors().gate_m(round.gate_m);
        let is_last = number + 1 >= ROUNDS.len();
        let kind = if is_last { PostKind::Any } else { PostKind::Round };
        for _ in 0..2 * MAX_POSTS {
            let judge = Judge::of(self.workspace, &self.posed, sigma_m);
            if self.workspace.is_over() || self.posed.posts.is_empty() && self.left().is_empty() {
                break;
            }
            let changed = without_idle_posts(&self.posed, &judge).or_else(|| {
                with_new_posts(&self.posed, &judge, kind, |posed| {
                    unexplained_by(posed, self.workspace)
                })
            });
            let Some(changed) = changed else { break };
            self.posed = changed;
            self.refine(&judge, gate_m);
            self.score = Some(self.score_now(sigma_m));
        }
    }

    /// Chooses lines, searches walls on them, and refines poses and lines.
    fn round(&mut self, number: usize) {
        let round = &ROUNDS[number.min(ROUNDS.len() - 1)];
        let is_first = number == 0;
        if self.errors().is_coarse() && !is_first {
            let poses = &self.posed.poses;
            self.features = reassociated(&self.features, &self.workspace.arcs, poses);
        }
        for of in &mut self.features {
            fit_feature(of, &self.posed.poses);
        }
        let plan = self.arrangement(round, is_first);
        let walls = if is_first {
            initial_walls(&plan, &self.posed.poses)
        } else {
            plan.transfer(&self.posed.plan, &self.posed.walls)
        };
        let sigma_m = self.errors().sigma_m(round.sigma_m);
        let judge = Judge::of(self.workspace, &self.posed, sigma_m);
        let judge = match self.begins_at_odometry() {
            true => judge.with_free_headings(),
            false => judge,
        };
        let search = PlanSearch { plan: &plan, judge: &judge, excluded: None };
        let found = search.trim(search.climb(ScoredPlan::new(&plan, &judge, walls)));
        (self.posed.plan, self.posed.walls) = (plan, found.walls);
        let poses = judge.poses_of(&self.posed.plan.segments(&self.posed.walls));
        self.posed.poses = poses.unwrap_or(judge.poses);
        let judge = Judge::of(self.workspace, &self.posed, sigma_m);
        self.improve_poses(&judge, number);
        self.refine(&judge, self.errors().gate_m(round.gate_m));
        self.score = Some(self.score_now(sigma_m));
    }

    /// Moves poses by the likelihood of the readings of a coarse ranger or of an array, less far with
    /// each round.
    fn improve_poses(&mut self, judge: &Judge, number: usize) {
        /// Spans of the first round, metres and degrees.
        const OF_COARSE: [f64; 2] = [0.03, 8.0];
        const OF_ARRAY: [f64; 2] = [0.01, 3.0];
        let spans = match (self.errors().is_coarse(), self.workspace.is_array) {
            (true, _) => OF_COARSE,
            (false, true) => OF_ARRAY,
            (false, false) => return,
        };
        let parts = (number.min(ROUNDS.len() - 1) + 1) as f64;
        improve_poses(&mut self.posed, judge, spans.map(|span| span / parts));
    }

    fn refine(&mut self, judge: &Judge, gate_m: f64) {
        self.covariance = refine(&mut self.posed, judge, gate_m, REFINE_STEPS);
    }

    fn score_now(&self, sigma_m: f64) -> f64 {
        let judge = Judge::of(self.workspace, &self.posed, sigma_m);
        judge.score(&self.posed.plan, &self.posed.walls)
    }

    /// Arrangement of the candidate lines of a round.
    fn arrangement(&self, round: &Round, is_first: bool) -> LineArrangement {
        let PosedPlan { plan, walls, poses, .. } = &self.posed;
        let segments = plan.segments(walls);
        let left = self.left();
        let is_used = |line: usize| segments.iter().any(|wall| wall.line == line);
        let used = (0..plan.lines.len()).filter(|line| is_used(*line));
        let sources = CandidateSources {
            features: &self.features,
            poses,
            kept: used.map(|line| plan.lines[line].clone()).collect(),
            walls: &segments,
            left: (!is_first).then_some(&left),
        };
        let mut lines = sources.lines(round.max_lines);
        if self.options.square_deg.is_some() {
            square_lines(&mut lines, poses);
        }
        LineArrangement::new(lines, poses, self.workspace.reach_m())
    }

    /// Arcs that the walls leave unexplained.
    fn left(&self) -> Vec<&'a Arc> {
        unexplained_by(&self.posed, self.workspace)
    }

    pub(super) fn early_end(&self) -> Option<SearchEnd> {
        if self.workspace.observer.is_cancelled() {
            Some(SearchEnd::Cancelled)
        } else {
            self.workspace.is_spent().then_some(SearchEnd::Budget)
        }
    }

    pub(super) fn last_end(&self) -> SearchEnd {
        if self.left().is_empty() { SearchEnd::Complete } else { SearchEnd::UnexplainedArcs }
    }

    /// Refines and judges the walls; continues with an alternative that is better.
    pub(super) fn settle(&mut self) -> Assessment {
        let errors = self.errors();
        let judge = Judge::of(self.workspace, &self.posed, errors.sigma_m(LAST_ROUND.sigma_m));
        self.refine(&judge, errors.gate_m(LAST_ROUND.gate_m));
        for is_last in [false, false, true] {
            let sigma_m = errors.sigma_m(LAST_ROUND.sigma_m);
            let judge = Judge::of(self.workspace, &self.posed, sigma_m);
            self.polish(&judge);
            let judge = Judge::of(self.workspace, &self.posed, sigma_m);
            let mut assessment = assess(&self.posed, &judge, self.covariance.as_ref());
            match assessment.better.take().filter(|_| !is_last) {
                Some(better) => {
                    self.posed.walls = better.walls;
                    self.refine(&judge, errors.gate_m(LAST_ROUND.gate_m));
                }
                None => return assessment,
            }
        }
        unreachable!("the last assessment is returned")
    }

    /// Estimates poses and walls by the likelihood of all readings.
    ///
    /// With a coarse ranger an estimate that scores lower is dropped: where arcs end depends on a
    /// sensitivity that is not known well, and its few wide beams let that move the poses.
    fn polish(&mut self, judge: &Judge) {
        let is_coarse = self.errors().is_coarse();
        let before = is_coarse.then(|| (self.posed.clone(), self.score_now(judge.sigma_m)));
        let covariance = polish(&mut self.posed, judge);
        match before {
            Some((posed, score)) if self.score_now(judge.sigma_m) < score => self.posed = posed,
            // Few arcs of an array have more than one beam, on which that of a refinement depends.
            _ if self.workspace.is_array => {
                self.covariance = covariance.or_else(|| self.covariance.take());
            }
            _ => (),
        }
    }

    pub(super) fn report_progress(&self, stage: SurveyStage) {
        self.workspace.observer.progress(SurveyProgress {
            stage,
            scored_scenes: self.workspace.scored(),
            score: self.score,
            walls: self.posed.plan.runs(&self.posed.walls).len(),
        });
    }
}
