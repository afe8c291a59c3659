// Entry point of the page "Hidden room": the user drives a robot through a room that is not drawn, and a survey
// reconstructs the room from its sweeps.

import { addTools } from "../../crates/sonard-daemon/src/server/page/tools.js";
import { count, degrees, setText, showFacts } from "../../crates/sonard-daemon/src/server/page/format.js";
import { colours, updateLegend } from "../../crates/sonard-daemon/src/server/page/verdicts.js";
import { progressText, resultText } from "../../crates/sonard-daemon/src/server/page/surveyed-plan.js";
import { drawArcs } from "./arcs.js";
import { compose, corrected, MAX_SEED, newCourse, parseCourse, relative, roomOf, scanOfSweeps } from "./course.js";
import { HiddenPlan, KEYS_LABEL } from "./hidden-plan.js";
import { showLink, stateFromLink } from "./share.js";
import { setLamp, showProblem } from "./status-text.js";
import { showStops } from "./stops.js";
import { SurveyModule } from "./survey-module.js";
import { freeShare } from "./walls.js";

/** @import { Pose } from "./engine.js" */

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));
/** Script with the module, which is loaded with this page only. */
const MODULE = "survey-data.js";
/** Distance that the robot keeps from walls, metres. */
const CLEARANCE_M = 0.15;
/** Minimum distance between two sweeps, metres. */
const MIN_STEP_M = 0.05;
const STEP_M = 0.5;
const TURN_DEG = 30;
/** Moves of the buttons, in the frame of the robot. @type {Record<string, Pose>} */
const MOVES = {
  forward: { x_m: STEP_M, y_m: 0, heading_deg: 0 },
  back: { x_m: -STEP_M, y_m: 0, heading_deg: 0 },
  left: { x_m: 0, y_m: 0, heading_deg: TURN_DEG },
  right: { x_m: 0, y_m: 0, heading_deg: -TURN_DEG },
};
const NEEDED = "Two sweeps at different places are needed.";

let palette = colours();
let course = newCourse();
/** Readings by stop. @type {import("./course.js").Reading[][]} */
let sweeps = [];
/** Result of the last complete survey. @type {any} */
let survey = null;
/** Floor plan of the true room. @type {any} */
let room = null;
let revealed = false;
let half_beam_deg = 8;
/** Set while a survey runs. */
let surveying = false;
/** Number of the last survey. */
let surveys = 0;
/** Number of actions that are not complete, and the last of them. */
let waiting = 0;
let actions = Promise.resolve();
/** @type {SurveyModule} */
let module;

const plan = new HiddenPlan(byId("stage"), { onTarget: (at) => enqueue(() => driveTo(at)), onAction: (action) => enqueue(() => act(action)) });
const arcs = plan.addLayer("arcs");
addTools(plan, showView);
byId("stage").ariaLabel = KEYS_LABEL;

/** Runs an action after all earlier ones. @param {() => Promise<void>} action */
function enqueue(action) {
  waiting++;
  actions = actions.then(action).catch(showFailure).finally(() => {
    waiting--;
    show();
  });
}

/** @param {any} error */
function showFailure(error) {
  showProblem(error.problem ?? { message: error.message, help: "" });
}

/** Opens the room of a course and repeats its sweeps. @param {import("./course.js").CourseState} next */
async function open(next) {
  const opened = await module.request({ type: "open_room", room: roomOf(next) });
  endSurvey();
  showProblem(null);
  [course, room, half_beam_deg] = [next, opened.plan, opened.half_beam_deg];
  [sweeps, survey, revealed] = [[], null, false];
  course.robot ??= { truth: opened.start, odometry: opened.start };
  const { stops } = course;
  course.stops = [];
  setText(byId("summary"), "");
  setText(byId("survey-status"), NEEDED);
  const problem = await repeatSweeps(stops);
  if (problem) course.robot = course.stops.at(-1) ?? { truth: opened.start, odometry: opened.start };
  if (course.stops.length === 0) await takeSweep(course.robot);
  if (course.stops.length > 1) startSurvey();
  showProblem(problem);
}

/** Sweeps at the stops of a link, up to the first invalid one; resolves to its problem. @param {import("./course.js").Place[]} stops */
async function repeatSweeps(stops) {
  for (const [at, stop] of stops.entries()) {
    try {
      await takeSweep(stop);
    } catch (/** @type {any} */ error) {
      const { message, help } = error.problem ?? error;
      return { message: `stop ${at + 1}: ${message}`, help };
    }
  }
  return null;
}

/** @param {import("./course.js").Place} place */
async function takeSweep(place) {
  const { seed, stops } = course;
  const request = { type: "take_sweep", room: roomOf(course), pose: place.truth, seed, number: stops.length };
  const { readings } = await module.request(request);
  stops.push(place);
  sweeps.push(readings);
}

/** Sweeps at the robot's pose, and surveys again. */
async function sweep() {
  const { stops, robot } = course;
  const last = stops.at(-1)?.truth;
  if (last && Math.hypot(last.x_m - robot.truth.x_m, last.y_m - robot.truth.y_m) < MIN_STEP_M) {
    return showProblem({ message: "the last sweep was taken here", help: "drive on before the next one" });
  }
  showProblem(null);
  await takeSweep(robot);
  startSurvey();
}

/** Best known pose of the robot. */
const robotPose = () => corrected(course.robot.odometry, course.stops, survey);

/** Drives straight to a point of the plan. @param {[number, number]} at */
async function driveTo([x_m, y_m]) {
  const from = robotPose();
  const heading_deg = (Math.atan2(y_m - from.y_m, x_m - from.x_m) * 180) / Math.PI;
  await drive(relative(from, { x_m, y_m, heading_deg }));
  if (byId("auto").checked) await sweep();
}

/** @param {string} action */
async function act(action) {
  if (action === "sweep") return sweep();
  await drive(MOVES[action]);
}

/** Drives by a move that odometry measures, up to the next obstacle. @param {Pose} by */
async function drive(by) {
  showProblem(null);
  const { seed, robot } = course;
  const driven = await module.request({ type: "drive", by, seed, number: course.moves++ });
  const share = freeShare(room, robot.truth, compose(robot.truth, driven), CLEARANCE_M);
  const part = (/** @type {Pose} */ { x_m, y_m, heading_deg }) => ({ x_m: share * x_m, y_m: share * y_m, heading_deg });
  course.robot = { truth: compose(robot.truth, part(driven)), odometry: compose(robot.odometry, part(by)) };
  setText(byId("summary"), share < 1 ? "The robot stopped before an obstacle." : "");
}

/** Surveys all sweeps; a running survey is cancelled. */
async function startSurvey() {
  module.cancel();
  const number = ++surveys;
  surveying = true;
  setText(byId("survey-status"), "Surveying …");
  show();
  const status = byId("survey-status");
  try {
    const all = course.stops.map(({ odometry }, at) => ({ pose: odometry, readings: sweeps[at] }));
    const found = await module.survey(all, (progress) => setText(status, progressText(progress)));
    if (number !== surveys) return;
    survey = found;
    setText(status, resultText(found, "sweep"));
  } catch (/** @type {any} */ error) {
    if (number !== surveys) return;
    if (error.name === "AbortError") setText(status, "Survey cancelled.");
    else {
      setText(status, "Not surveyed.");
      showFailure(error);
    }
  }
  surveying = false;
  await compare().catch(showFailure);
  show();
}

/** Ends a survey whose result is no longer needed. */
function endSurvey() {
  surveys++;
  surveying = false;
  module.cancel();
}

/** Compares the survey with the revealed room. */
async function compare() {
  if (!revealed || !survey) return showFacts(byId("comparison"), []);
  const truths = course.stops.slice(0, survey.poses.length).map(({ truth }) => truth);
  const compared = await module.request({ type: "compare", room: roomOf(course), course: truths, survey });
  const { recall, precision, corner_m, position_m, heading_deg, posts } = compared;
  const percent = (/** @type {number} */ share) => `${(100 * share).toFixed(1)} %`;
  const mm = (/** @type {number | null} */ m) => (m === null ? "–" : `${(1e3 * m).toFixed(1)} mm`);
  const figures = [
    ["Recall: true walls that are found", percent(recall)],
    ["Precision: found walls that are true", percent(precision)],
    ["Corners, median error", mm(corner_m)],
    ["Poses, mean error", `${mm(position_m)}, ${degrees(heading_deg)}`],
  ];
  if (posts[0] || posts[2]) figures.push(["Posts found", `${posts[1]} of ${posts[0]}${posts[2] ? `, ${posts[2]} wrong` : ""}`]);
  showFacts(byId("comparison"), figures);
}

function show() {
  if (!room) return;
  const { stops, seed, scene } = course;
  const robot = robotPose();
  Object.assign(plan, { survey, truth: revealed ? room : null, odometry: stops.map(({ odometry }) => odometry) });
  // Before walls are known, there are only readings to see.
  const mode = plan.corners().length ? "room" : "near";
  if (plan.view.mode !== mode) plan.view.show(mode);
  plan.scan = scanOfSweeps(stops, sweeps, survey, robot);
  plan.redraw(palette);
  showStops(byId("stops"), stops, survey, revealed);
  byId("kind").value = scene ? "drawn" : course.kind;
  setText(byId("room-label"), `${scene ? "drawn room" : `room ${seed}`}, ${count(stops.length, "sweep")}`);
  byId("progress").hidden = !surveying;
  setText(byId("survey"), surveying ? "Cancel" : "Survey");
  byId("reveal").ariaPressed = String(revealed);
  setText(byId("reveal"), revealed ? "Hide the room" : "Reveal the room");
}

/** Draws what depends on the view of the plan. */
function showView() {
  if (!plan.scan || !plan.palette) return;
  drawArcs(arcs, plan, byId("arcs").checked ? half_beam_deg : null);
  updateLegend(byId("legend"), plan.scan.counts, plan.pens(), palette);
  const { outside } = plan.hiddenCounts();
  setText(byId("out-of-view"), outside ? `${count(outside, "reading")} outside the view (arrows at the edge)` : "");
}

/** Opens a random room. @param {string} kind @param {number} seed */
const openRandom = (kind, seed) => enqueue(() => open(newCourse(kind, seed)));

function addListeners() {
  for (const action of [...Object.keys(MOVES), "sweep"]) byId(action).addEventListener("click", () => enqueue(() => act(action)));
  byId("arcs").addEventListener("change", showView);
  byId("kind").addEventListener("change", () => openRandom(byId("kind").value, course.seed));
  byId("next-room").addEventListener("click", () => openRandom(course.kind, (course.seed + 1) % MAX_SEED));
  byId("survey").addEventListener("click", () => (surveying ? module.cancel() : startSurvey()));
  byId("reveal").addEventListener("click", () =>
    enqueue(async () => {
      revealed = !revealed;
      await compare();
    }),
  );
  byId("share").addEventListener("click", () => showLink(course));
  addEventListener("hashchange", () => openLink());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    palette = colours();
    show();
  });
}

/** Opens the course in the page's address, or else a random room. */
async function openLink() {
  const shared = location.hash.length > 1 ? await stateFromLink(location.hash.slice(1), parseCourse) : null;
  if (shared) return enqueue(() => open(shared));
  openRandom("any", 1 + Math.floor(Math.random() * (MAX_SEED - 1)));
  if (location.hash.length > 1) setText(byId("about"), "This link is incomplete. Here is another room.");
}

async function start() {
  module = await SurveyModule.load(MODULE);
  addListeners();
  await openLink();
  setLamp("good", "ready");
}

/** Interface for tests and the browser's console. */
Object.assign(globalThis, {
  hiddenRoom: {
    plan,
    course: () => course,
    survey: () => survey,
    open: (/** @type {any} */ value) => enqueue(() => open(/** @type {any} */ (parseCourse(value)))),
    request: (/** @type {object} */ request) => module.request(request),
    /** Returns `true` once all actions and the survey are complete. */
    idle: () => room !== null && waiting === 0 && !surveying,
  },
});

start().catch((error) => {
  setLamp("bad", "survey not loaded");
  showProblem({ message: `the survey cannot run: ${error.message}`, help: "reload the page, or try a newer browser" });
});
