// Entry point of the playground: the page shows one state, and every change of it requests a new view from the model.

import { BeamPanel, describeReading } from "../../crates/sonard-daemon/src/server/page/beam.js";
import { Plan } from "../../crates/sonard-daemon/src/server/page/plan.js";
import { Ranger } from "../../crates/sonard-daemon/src/server/page/ranger.js";
import { Scan } from "../../crates/sonard-daemon/src/server/page/scan.js";
import { Strip } from "../../crates/sonard-daemon/src/server/page/strip.js";
import { BeamTable } from "../../crates/sonard-daemon/src/server/page/table.js";
import { addTools } from "../../crates/sonard-daemon/src/server/page/tools.js";
import { EchoTrace } from "../../crates/sonard-daemon/src/server/page/trace.js";
import { colours, updateLegend } from "../../crates/sonard-daemon/src/server/page/verdicts.js";
import { count, setText } from "../../crates/sonard-daemon/src/server/page/format.js";
import { drawArcs } from "./arcs.js";
import { SideBySide } from "./compare.js";
import { Controls } from "./controls.js";
import { Editor } from "./editor.js";
import { Files } from "./files.js";
import { Logs } from "./logs.js";
import { Model } from "./model.js";
import { Pulse } from "./pulse.js";
import { newRoom } from "./room.js";
import { moduleBytes, pack, showLink, stateFromLink } from "./share.js";
import { defaultState, parseState, planOf, settingsOf } from "./state.js";
import { setLamp, showProblem, summaryOf } from "./status-text.js";
import { Tour } from "./tour.js";
import { poseWithinWalls } from "./walls.js";

/** @typedef {import("./state.js").State} State */

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));
/** Delay of the summary, so that screen readers do not read every frame of a drag. */
const SUMMARY_DELAY_MS = 400;
/** Maximum number of stored sweep times. */
const MAX_TIMES = 2000;
const MAX_UNDO = 50;
/** Changes of the same settings within this time are undone together, milliseconds. */
const SAME_CHANGE_MS = 800;
/** Width below which the echo trace is shown under the plan while a pulse is played. */
const NARROW = matchMedia("(max-width: 899px)");

/** @type {Map<string, import("./room.js").SceneFile>} */
const rooms = new Map();
/** @type {Map<string, import("./engine.js").Sensor>} */
const sensors = new Map();

let palette = colours();
/** @type {State} */
let state = { ...defaultState(), scene: newRoom(), pose: { x_m: 1, y_m: 0.8, heading_deg: 0 } };
/** @type {Scan | null} */
let scan = null;
/** @type {import("./engine.js").Beam | null} */
let beam = null;
let half_beam_deg = 8;
/** States before the last changes. @type {State[]} */
const undoStack = [];
/** State after a room, a step or a link was opened. @type {State | null} */
let opened = null;
/** Names and time of the last change; `null` after a drag has ended. @type {{keys: string, at_ms: number} | null} */
let lastChange = null;
/** Times from the request of a sweep to its picture, milliseconds. @type {number[]} */
const times_ms = [];

const label = "Floor plan with the predicted readings. The table of beams lists the same readings.";
const plan = /** @type {any} */ (new Plan(byId("stage"), select, label));
const arcs = plan.addLayer("arcs");
plan.view.mode = "room";
const strip = /** @type {any} */ (new Strip(byId("residuals"), select));
const table = /** @type {any} */ (new BeamTable(byId("table")));
const trace = new EchoTrace(byId("trace"), selectArrival);
const panel = /** @type {any} */ (new BeamPanel(byId("beam-panel"), showPath));
const sideBySide = new SideBySide(byId("figures"), select);
const controls = new Controls(state, (changes) => change(changes, false, true));
// The pulse travels within the room, which then fills the plan.
const pulse = new Pulse(plan, trace, () => state.fit !== "room" && change({ fit: "room" }));
const ranger = new Ranger(byId("stage"), plan.view, (pose) => change({ pose: poseWithinWalls(plan.scene, state.pose, pose) }, true), endDrag);
const editor = new Editor(byId("stage"), plan.view, (scene, final, pose) => change(pose ? { scene, pose } : { scene }, !final));
const files = new Files({ room: openEditedRoom, log: openLog, onError: (problem) => showProblem(problem) });
const logs = new Logs(sensors, { onShow: showLogged, onSensors: fillSensors, onClose: () => change({ sensor: knownSensor() }) });
const tour = new Tour(({ title, text, scene, range_m, ...shown }) => {
  const room = structuredClone(/** @type {import("./room.js").SceneFile} */ (rooms.get(scene)));
  openRoom(room, { ...defaultState(), reach_m: range_m, ...shown });
});
/** @type {Model} */
let model;
addTools(plan, () => {
  placeHandles();
  if (scan) updatePlanTexts();
});

/**
 * Changes the state and shows it. The view of the plan stays while a handle is dragged.
 * @param {Partial<State>} changes
 * @param {boolean} [dragging]
 * @param {boolean} [sliding] set for controls that send a change for each step
 */
function change(changes, dragging = false, sliding = false) {
  const { scene } = state;
  keepForUndo(changes, dragging, sliding);
  state = { ...state, ...changes };
  plan.held = dragging;
  if (state.scene !== scene) showScene();
  controls.show(state);
  placeHandles();
  if (plan.view.mode !== state.fit) {
    plan.view.show(state.fit);
    byId("fit").value = state.fit;
    if (scan) redraw();
  }
  byId("arcs").checked = state.arcs;
  byId("compare").checked = state.compare;
  byId("figures").hidden = !state.compare;
  requestView();
}

/** Keeps the state before a change, unless it continues the last one. @param {Partial<State>} changes @param {boolean} dragging @param {boolean} sliding */
function keepForUndo(changes, dragging, sliding) {
  const [keys, at_ms] = [Object.keys(changes).sort().join(), performance.now()];
  // The view of the plan is no setting.
  if (keys === "fit") return;
  const continues = lastChange?.keys === keys && (dragging || plan.held || (sliding && at_ms - lastChange.at_ms < SAME_CHANGE_MS));
  lastChange = { keys, at_ms };
  if (!continues) undoStack.push(state);
  if (undoStack.length > MAX_UNDO) undoStack.shift();
  byId("undo").disabled = false;
  byId("reset").disabled = opened === null;
}

/** Shows an earlier state. @param {State | null | undefined} earlier */
function restore(earlier) {
  if (!earlier) return;
  const { beam } = state;
  lastChange = null;
  change({ ...earlier, beam });
  lastChange = null;
}

function undo() {
  restore(undoStack.pop());
  // The restored state is not a change of its own.
  undoStack.pop();
  byId("undo").disabled = undoStack.length === 0;
}

/** Fits the view again after a drag. */
function endDrag() {
  plan.held = false;
  lastChange = null;
  if (scan) redraw();
}

function requestView() {
  const engines = /** @type {import("./engine.js").EngineName[]} */ (["paths", "fan", "cone"]);
  const others = state.compare ? engines.filter((name) => name !== state.engine) : [];
  model.show({
    settings: settingsOf(state, sensors, airOfLog()),
    pose: state.pose,
    plan: planOf(state),
    engines: [state.engine, ...others],
    measured: logs.scan,
    beam: state.beam,
  });
}

/** @type {Map<string, Scan>} Running sweeps by engine. */
const running = new Map();

/** Handles a message of the worker. @param {any} message */
function handleMessage(message) {
  if (message.kind === "plan") {
    plan.scene = message.plan;
    half_beam_deg = message.half_beam_deg;
    sideBySide.setScene(plan.scene);
  } else if (message.kind === "sweep_started") startSweep(message);
  else if (message.kind === "readings") addReadings(message);
  else if (message.kind === "beam") showBeam(JSON.parse(message.text));
  else if (message.kind === "error") showError(message.problem);
  else if (message.kind === "done") setLamp("good", "ready");
}

/** @param {any} message */
function startSweep({ engine, start, session, beams }) {
  const sweep = /** @type {any} */ (new Scan(start, session));
  sweep.planned = beams;
  sweep.running = true;
  running.set(engine, sweep);
  showProblem(null);
}

/** @param {any} message */
function addReadings({ engine, texts, left }) {
  const sweep = /** @type {any} */ (running.get(engine));
  for (const text of texts) for (const ping of JSON.parse(text).readings) sweep.add(ping);
  sweep.added = [];
  sweep.running = left > 0;
  if (engine === state.engine) {
    scan = sweep;
    redraw();
    if (left === 0) {
      times_ms.push(performance.now() - model.startedAt);
      if (times_ms.length > MAX_TIMES) times_ms.shift();
    } else setLamp("wait", "computing");
  }
  if (state.compare && left === 0) sideBySide.show(engine, sweep, palette, scan?.beams.get(state.beam ?? -1));
}

function redraw() {
  const sweep = /** @type {any} */ (scan);
  const selected = state.beam === null ? null : (sweep.beams.get(state.beam) ?? null);
  for (const view of [plan, table]) view.scan = sweep;
  plan.selected = selected;
  plan.redraw(palette);
  const measured = logs.scan !== null;
  byId("residuals").hidden = !measured;
  if (measured) {
    strip.scan = sweep;
    strip.selected = selected;
    strip.redraw(palette);
  }
  if (byId("table").open) table.redraw();
  updateTexts(selected);
}

/** Updates the texts around the plan. @param {any} selected */
function updateTexts(selected) {
  const sweep = /** @type {any} */ (scan);
  const progress = byId("progress");
  progress.hidden = !sweep.running || times_ms.length === 0;
  progress.max = sweep.planned;
  progress.value = sweep.beams.size;
  setText(byId("scan-label"), count(sweep.beams.size, "beam"));
  const slider = byId("beam");
  slider.max = Math.max(0, sweep.planned - 1);
  if (selected) {
    slider.value = selected.index;
    slider.setAttribute("aria-valuetext", describeReading(selected));
  }
  setText(byId("beam-label"), selected ? describeReading(selected) : "none selected");
  clearTimeout(summaryTimer);
  summaryTimer = setTimeout(() => setText(byId("summary"), summaryOf(sweep, logs.scan !== null)), SUMMARY_DELAY_MS);
}
let summaryTimer = 0;

/** Updates the texts that depend on the view of the plan. */
function updatePlanTexts() {
  updateLegend(byId("legend"), scan?.counts ?? new Map(), plan.pens(), palette);
  const { outside } = plan.hiddenCounts();
  setText(byId("out-of-view"), outside ? `${count(outside, "reading")} outside the view (arrows at the edge)` : "");
}

/** @param {number} index */
function select(index) {
  state.beam = index;
  beam = null;
  plan.path = null;
  if (scan) redraw();
  requestView();
}

/** @param {any} details */
function showBeam(details) {
  beam = /** @type {import("./engine.js").Beam} */ (details);
  const ping = scan?.beams.get(details.reading.index);
  details.reading.mark = ping?.mark ?? "no_echo";
  panel.show(details.reading);
  panel.showDetails(details);
  const list = byId("beam-panel").querySelector(".peaks");
  const drawn = list?.querySelector("[aria-pressed=true]");
  if (drawn) list.scrollTop = drawn.offsetTop - list.clientHeight / 2;
  trace.redraw(palette);
  trace.show(beam, peakOfReading(beam));
  pulse.show(beam);
  plan.select(ping ?? null, details.polyline);
  updatePlanTexts();
}

/** @param {import("./engine.js").Beam} beam */
function peakOfReading({ peaks, polyline }) {
  return peaks.find((peak) => JSON.stringify(peak.polyline) === JSON.stringify(polyline)) ?? null;
}

/** Selects an arrival picked in the trace. @param {import("./engine.js").Peak} peak */
function selectArrival(peak) {
  const at = beam?.peaks.indexOf(peak) ?? -1;
  byId("beam-panel").querySelectorAll(".peaks button")[at]?.click();
}

/** @param {[number, number][]} polyline */
function showPath(polyline) {
  plan.select(plan.selected, polyline);
  const peak = beam?.peaks.find((candidate) => candidate.polyline === polyline);
  trace.show(beam, peak ?? null);
}

/** @param {import("./engine.js").Problem} problem */
function showError(problem) {
  // Readings of an earlier pose would be wrong here.
  scan = /** @type {any} */ (new Scan({ plan: planOf(state), pose: state.pose, scan: "none" }));
  beam = null;
  if (plan.scene) {
    redraw();
    panel.clear();
    trace.show(null);
    pulse.show(null);
    plan.select(null);
  }
  setLamp("bad", problem.message.includes("outside") ? "outside the room" : "no readings");
  showProblem(problem);
}

/** Moves arcs and handles to their positions in the current view. */
function placeHandles() {
  if (scan && plan.palette) drawArcs(arcs, plan, state.arcs ? half_beam_deg : null);
  pulse.draw();
  if (!plan.view.width || !plan.view.box) return;
  ranger.place(state.pose);
  editor.show(state.scene);
}

function showScene() {
  setText(byId("floor-title"), `Floor plan: ${state.scene.name}`);
  const name = [...rooms].find(([, room]) => JSON.stringify(room) === JSON.stringify(state.scene))?.[0] ?? "";
  const list = byId("scene");
  list.options[0].hidden = name !== "";
  list.options[0].text = name === "" ? `${state.scene.name} (edited)` : "edited";
  list.value = name;
  const poses = Object.keys(state.scene.poses ?? {});
  if (byId("pose").dataset.poses !== poses.join()) {
    byId("pose").dataset.poses = poses.join();
    byId("pose").replaceChildren(new Option("pose …", ""), ...poses.map((pose) => new Option(pose, pose)));
  }
}

/**
 * @param {import("./room.js").SceneFile} scene
 * @param {Partial<State>} [further]
 */
function openRoom(scene, further = {}) {
  const pose = Object.values(scene.poses ?? {})[0] ?? { x_m: 0, y_m: 0, heading_deg: 0 };
  logs.close();
  plan.view.show(plan.view.mode);
  editor.toggle(false);
  change({ scene, pose, beam: 0, height_m: null, sensor: knownSensor(), ...further });
  byId("pose").value = "";
  [opened, lastChange] = [state, null];
  undoStack.length = 0;
  for (const id of ["undo", "reset"]) byId(id).disabled = true;
}

/** @param {import("./room.js").SceneFile} scene */
function openEditedRoom(scene) {
  openRoom(scene);
  tour.pause(String(scene.name), scene.source ?? "");
}

/** @param {string} text */
async function openLog(text) {
  try {
    const { scans } = await model.request({ kind: "load_log", text, pose: state.pose });
    logs.open(scans);
    const hint =
      "Solid marks are measured readings, rings are predicted ones at the shown pose. Drag the ranger to where they agree, " +
      "or change sensor, air and walls.";
    tour.pause("Measured and predicted", hint);
  } catch (problem) {
    showProblem(/** @type {any} */ (problem));
  }
}

/** @param {Partial<State>} changes */
function showLogged(changes) {
  plan.view.show(plan.view.mode);
  editor.toggle(false);
  change(changes);
}

/** Air of the log while the controls match it; it may have an explicit speed of sound, which has no control. */
function airOfLog() {
  const air = logs.air;
  if (!air || air.temperature_c !== state.temperature_c || air.humidity_percent !== state.humidity_percent) return null;
  return air;
}

/** Current sensor, or the default one if the current one belonged to a closed log. */
const knownSensor = () => (sensors.has(state.sensor) ? state.sensor : defaultState().sensor);

function fillSensors() {
  byId("sensor").replaceChildren(...[...sensors.keys()].map((name) => new Option(name, name)));
}

function addListeners() {
  byId("scene").addEventListener("change", () => {
    const room = structuredClone(/** @type {import("./room.js").SceneFile} */ (rooms.get(byId("scene").value)));
    openRoom(room);
    tour.pause(room.name, room.source ?? "");
  });
  byId("pose").addEventListener("change", () => {
    const pose = state.scene.poses?.[byId("pose").value];
    if (pose) change({ pose });
  });
  byId("fit").addEventListener("change", () => change({ fit: byId("fit").value }));
  byId("arcs").addEventListener("change", () => change({ arcs: byId("arcs").checked }));
  byId("compare").addEventListener("change", () => change({ compare: byId("compare").checked }));
  byId("table").addEventListener("toggle", () => scan && redraw());
  byId("beam").addEventListener("input", () => select(Number(byId("beam").value)));
  byId("undo").addEventListener("click", undo);
  byId("reset").addEventListener("click", () => restore(opened));
  addEventListener("keydown", (event) => {
    const isEditing = /** @type {any} */ (event.target).matches?.("input:not([type=range]), textarea");
    if (!isEditing && (event.ctrlKey || event.metaKey) && event.key === "z" && undoStack.length) {
      event.preventDefault();
      undo();
    }
  });
  const placeTrace = () => (NARROW.matches ? byId("pulse").append(byId("trace")) : byId("beam-panel").before(byId("trace")));
  NARROW.addEventListener("change", placeTrace);
  placeTrace();
  byId("save").addEventListener("click", () => files.save({ ...state.scene, poses: { ...state.scene.poses, here: state.pose } }));
  byId("share").addEventListener("click", () => showLink(state));
  byId("hide-room").addEventListener("click", async () => {
    // The room becomes the hidden one of the other page, where a course begins at the ranger.
    location.href = `hidden-room.html#${await pack({ scene: state.scene, start: state.pose })}`;
  });
  addEventListener("hashchange", () => openLink());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    palette = colours();
    trace.redraw(palette);
    if (scan) redraw();
    requestView();
  });
}

/** Opens the view in the page's address; resolves to `false` if it has none. */
async function openLink() {
  if (location.hash.length < 2) return false;
  const shared = await stateFromLink(location.hash.slice(1), parseState);
  if (!shared) return false;
  openRoom(shared.scene, shared);
  tour.pause("Shared view", "Drag or turn the ranger, or change the settings.");
  return true;
}

async function start() {
  const { wasm, worker } = /** @type {any} */ (globalThis).SONARD_MODEL;
  model = new Model(await moduleBytes(wasm), worker, handleMessage);
  const presets = await model.request({ kind: "list_presets" });
  for (const { name, text } of presets.scenes) rooms.set(name, JSON.parse(text));
  for (const sensor of presets.sensors) sensors.set(sensor.name, sensor);
  byId("scene").replaceChildren(new Option("edited", ""), ...[...rooms.keys()].map((name) => new Option(name, name)));
  fillSensors();
  addListeners();
  if (await openLink()) return;
  tour.goTo(0);
  if (location.hash.length > 1) setText(byId("tour-text"), "This link is incomplete.");
}

/** Interface for tests and the browser's console. */
Object.assign(globalThis, {
  playground: {
    plan, times_ms, change, select, pulse,
    state: () => state,
    scan: () => scan,
    beam: () => beam,
    request: (/** @type {any} */ message) => model.request(message),
    /** Returns `true` once the requested view is shown. */
    idle: () => scan !== null && model.current === null && model.next === null,
  },
});

start().catch((error) => {
  setLamp("bad", "model not loaded");
  showProblem({ message: `this browser can't run the model: ${error.message}`, help: "try a newer browser" });
});
