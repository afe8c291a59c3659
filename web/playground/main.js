// Puts the playground together: what is shown is one state; every change of it asks the model anew.

import { BeamPanel, inWords } from "../../crates/sonard-daemon/src/server/page/beam.js";
import { Plan } from "../../crates/sonard-daemon/src/server/page/plan.js";
import { Ranger } from "../../crates/sonard-daemon/src/server/page/ranger.js";
import { Scan } from "../../crates/sonard-daemon/src/server/page/scan.js";
import { Strip } from "../../crates/sonard-daemon/src/server/page/strip.js";
import { BeamTable } from "../../crates/sonard-daemon/src/server/page/table.js";
import { addTools } from "../../crates/sonard-daemon/src/server/page/tools.js";
import { EchoTrace } from "../../crates/sonard-daemon/src/server/page/trace.js";
import { colours, legend } from "../../crates/sonard-daemon/src/server/page/verdicts.js";
import { count, setText } from "../../crates/sonard-daemon/src/server/page/words.js";
import { drawArcs } from "./arcs.js";
import { SideBySide } from "./compare.js";
import { Controls } from "./controls.js";
import { Editor } from "./editor.js";
import { Files } from "./files.js";
import { Logs } from "./logs.js";
import { Model } from "./model.js";
import { emptyRoom } from "./room.js";
import { inShort, setLamp, tellTrouble } from "./say.js";
import { showLink, stateFromLink, unsqueeze } from "./share.js";
import { planOf, settingsOf, usual } from "./state.js";
import { Tour } from "./tour.js";

/** @typedef {import("./state.js").State} State */

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));
/** What the module may unpack to, bytes. */
const MOST_BYTES = 16 << 20;
/** What changes with every frame of a drag is said when it is over, milliseconds. */
const REST_MS = 400;
/** So many times are remembered. */
const MOST_TIMES = 2000;

/** @type {Map<string, import("./room.js").SceneFile>} */
const rooms = new Map();
/** @type {Map<string, import("./engine.js").Sensor>} */
const sensors = new Map();

let palette = colours();
/** @type {State} */
let state = { ...usual(), scene: emptyRoom(), pose: { x_m: 1, y_m: 0.8, heading_deg: 0 } };
/** @type {Scan | null} */
let scan = null;
/** @type {import("./engine.js").Beam | null} */
let beam = null;
let half_beam_deg = 8;
/** How long sweeps took from the question to the picture, milliseconds. @type {number[]} */
const took = [];

const words = "Floor plan with what the ranger would read; the table of beams has the same in words";
const plan = /** @type {any} */ (new Plan(byId("stage"), select, words));
const fans = plan.addLayer("fans");
plan.view.what = "room";
const strip = /** @type {any} */ (new Strip(byId("residuals"), select));
const table = /** @type {any} */ (new BeamTable(byId("table")));
const trace = new EchoTrace(byId("trace"), choosePath);
const panel = /** @type {any} */ (new BeamPanel(byId("beam-panel"), showPath));
const sides = new SideBySide(byId("figures"), select);
const controls = new Controls(state, (changes) => change(changes));
const ranger = new Ranger(byId("stage"), plan.view, (pose) => change({ pose }, true), settle);
const editor = new Editor(byId("stage"), plan.view, (scene, kept) => change({ scene }, !kept), (pose) => change({ pose }));
const files = new Files({ room: openOwnRoom, log: openLog, refused: (problem) => tellTrouble(problem) });
const logs = new Logs(sensors, { onShow: showLogged, onSensors: fillSensors, onClose: () => change({ sensor: knownSensor() }) });
const tour = new Tour(({ title, text, scene, range_m, ...shown }) => {
  const room = structuredClone(/** @type {import("./room.js").SceneFile} */ (rooms.get(scene)));
  openRoom(room, { ...usual(), reach_m: range_m, ...shown });
});
/** @type {Model} */
let model;
addTools(plan, () => {
  place();
  if (scan) tellLegend();
});

/**
 * Changes what is shown. While somebody drags, the view of the plan stays.
 * @param {Partial<State>} changes
 * @param {boolean} [dragging]
 */
function change(changes, dragging = false) {
  const sceneBefore = state.scene;
  state = { ...state, ...changes };
  plan.held = dragging;
  if (state.scene !== sceneBefore) showScene();
  controls.show(state);
  place();
  if (plan.view.what !== state.fit) {
    plan.view.show(state.fit);
    byId("fit").value = state.fit;
    if (scan) redraw();
  }
  byId("arcs").checked = state.arcs;
  byId("compare").checked = state.compare;
  byId("figures").hidden = !state.compare;
  ask();
}

/** A drag is over: the view may follow. */
function settle() {
  plan.held = false;
  if (scan) redraw();
}

function ask() {
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

/** @type {Map<string, Scan>} Sweeps under way by engine. */
const coming = new Map();

/** What the model says. @param {any} message */
function take(message) {
  if (message.kind === "plan") {
    plan.scene = message.plan;
    half_beam_deg = message.half_beam_deg;
    sides.setScene(plan.scene);
  } else if (message.kind === "begun") begin(message);
  else if (message.kind === "readings") readings(message);
  else if (message.kind === "beam") showBeam(JSON.parse(message.text));
  else if (message.kind === "refused") refuse(message.problem);
  else if (message.kind === "done") setLamp("good", "ready");
}

/** @param {any} message */
function begin({ engine, start, session, beams }) {
  const next = /** @type {any} */ (new Scan(start, session));
  next.planned = beams;
  next.underWay = true;
  coming.set(engine, next);
  tellTrouble(null);
}

/** @param {any} message */
function readings({ engine, texts, left }) {
  const sweep = /** @type {any} */ (coming.get(engine));
  for (const text of texts) for (const ping of JSON.parse(text).readings) sweep.add(ping);
  sweep.added = [];
  sweep.underWay = left > 0;
  if (engine === state.engine) {
    scan = sweep;
    redraw();
    if (left === 0) {
      took.push(performance.now() - model.began);
      if (took.length > MOST_TIMES) took.shift();
    } else setLamp("wait", "the model is at work");
  }
  if (state.compare && left === 0) sides.show(engine, sweep, palette, scan?.beams.get(state.beam ?? -1));
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
  tell(selected);
}

/** The texts around the plan. @param {any} selected */
function tell(selected) {
  const sweep = /** @type {any} */ (scan);
  const progress = byId("progress");
  progress.hidden = !sweep.underWay || took.length === 0;
  progress.max = sweep.planned;
  progress.value = sweep.beams.size;
  setText(byId("which"), count(sweep.beams.size, "beam"));
  const slider = byId("beam");
  slider.max = Math.max(0, sweep.planned - 1);
  if (selected) {
    slider.value = selected.index;
    slider.setAttribute("aria-valuetext", inWords(selected));
  }
  setText(byId("beam-now"), selected ? inWords(selected) : "none selected");
  clearTimeout(resting);
  resting = setTimeout(() => setText(byId("summary"), inShort(sweep, logs.scan !== null)), REST_MS);
}
let resting = 0;

/** What is drawn, which depends on the view. */
function tellLegend() {
  legend(byId("legend"), scan?.counts ?? new Map(), plan.pens(), palette);
  const { beyond } = plan.notShown();
  setText(byId("beyond"), beyond ? `${count(beyond, "reading")} beyond the view: arrows on its border` : "");
}

/** @param {number} index */
function select(index) {
  state.beam = index;
  beam = null;
  plan.path = null;
  if (scan) redraw();
  ask();
}

/** @param {any} told */
function showBeam(told) {
  beam = /** @type {import("./engine.js").Beam} */ (told);
  const ping = scan?.beams.get(told.reading.index);
  told.reading.mark = ping?.mark ?? "silent";
  panel.show(told.reading);
  panel.showDetails(told);
  const list = byId("beam-panel").querySelector(".peaks");
  const drawn = list?.querySelector("[aria-pressed=true]");
  if (drawn) list.scrollTop = drawn.offsetTop - list.clientHeight / 2;
  trace.redraw(palette);
  trace.show(beam, chosenOf(beam));
  plan.select(ping ?? null, told.polyline);
}

/** @param {import("./engine.js").Beam} told */
function chosenOf({ peaks, polyline }) {
  return peaks.find((peak) => JSON.stringify(peak.polyline) === JSON.stringify(polyline)) ?? null;
}

/** Another sound of the beam. @param {import("./engine.js").Peak} peak */
function choosePath(peak) {
  const at = beam?.peaks.indexOf(peak) ?? -1;
  byId("beam-panel").querySelectorAll(".peaks button")[at]?.click();
}

/** @param {[number, number][]} polyline */
function showPath(polyline) {
  plan.select(plan.selected, polyline);
  const peak = beam?.peaks.find((one) => one.polyline === polyline);
  trace.show(beam, peak ?? null);
}

/** @param {import("./engine.js").Problem} problem */
function refuse(problem) {
  // Where no ranger can stand, the readings of before would be lies.
  scan = /** @type {any} */ (new Scan({ plan: planOf(state), pose: state.pose, scan: "none" }));
  beam = null;
  if (plan.scene) {
    redraw();
    panel.clear();
    trace.show(null);
    plan.select(null);
  }
  setLamp("bad", "no readings");
  tellTrouble(problem);
}

/** What lies on the plan, to where its things are in the view. */
function place() {
  if (scan && plan.palette) drawArcs(fans, plan, state.arcs ? half_beam_deg : null);
  if (!plan.view.width || !plan.view.box) return;
  ranger.place(state.pose);
  editor.show(state.scene);
}

function showScene() {
  setText(byId("floor-title"), `Floor plan: ${state.scene.name}`);
  const name = [...rooms].find(([, room]) => JSON.stringify(room) === JSON.stringify(state.scene))?.[0] ?? "";
  const list = byId("scene");
  list.options[0].hidden = name !== "";
  list.options[0].text = name === "" ? `${state.scene.name} (own)` : "own";
  list.value = name;
  const poses = Object.keys(state.scene.poses ?? {});
  if (byId("pose").dataset.poses !== poses.join()) {
    byId("pose").dataset.poses = poses.join();
    byId("pose").replaceChildren(new Option("pose…", ""), ...poses.map((pose) => new Option(pose, pose)));
  }
}

/**
 * @param {import("./room.js").SceneFile} scene
 * @param {Partial<State>} [further]
 */
function openRoom(scene, further = {}) {
  const pose = Object.values(scene.poses ?? {})[0] ?? { x_m: 0, y_m: 0, heading_deg: 0 };
  logs.close();
  plan.view.show(plan.view.what);
  editor.toggle(false);
  change({ scene, pose, beam: 0, height_m: null, sensor: knownSensor(), ...further });
  byId("pose").value = "";
}

/** @param {import("./room.js").SceneFile} scene */
function openOwnRoom(scene) {
  openRoom(scene);
  tour.leave(String(scene.name), scene.source ?? "");
}

/** @param {string} text */
async function openLog(text) {
  try {
    const { scans } = await model.ask({ kind: "log", text, pose: state.pose });
    logs.open(scans);
    const words =
      "Marks are what was measured, rings what the model reads at the same place. Drag the ranger to where the two agree; " +
      "change sensor, air and walls.";
    tour.leave("Measured and predicted", words);
  } catch (problem) {
    tellTrouble(/** @type {any} */ (problem));
  }
}

/** @param {Partial<State>} changes */
function showLogged(changes) {
  plan.view.show(plan.view.what);
  editor.toggle(false);
  change(changes);
}

/** What the log says of its air and the controls do not have; the speed of sound, where it was given by hand. */
function airOfLog() {
  const air = logs.air;
  if (!air || air.temperature_c !== state.temperature_c || air.humidity_percent !== state.humidity_percent) return null;
  return air;
}

/** The sensor in force, or the usual one when that was a log's that was closed. */
const knownSensor = () => (sensors.has(state.sensor) ? state.sensor : usual().sensor);

function fillSensors() {
  byId("sensor").replaceChildren(...[...sensors.keys()].map((name) => new Option(name, name)));
}

function listen() {
  byId("scene").addEventListener("change", () => {
    const room = structuredClone(/** @type {import("./room.js").SceneFile} */ (rooms.get(byId("scene").value)));
    openRoom(room);
    tour.leave(room.name, room.source ?? "");
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
  byId("save").addEventListener("click", () => files.save({ ...state.scene, poses: { ...state.scene.poses, here: state.pose } }));
  byId("share").addEventListener("click", () => showLink(state));
  addEventListener("hashchange", () => openLink());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    palette = colours();
    trace.redraw(palette);
    if (scan) redraw();
    ask();
  });
}

/** Whether the address had a view in it. */
async function openLink() {
  if (location.hash.length < 2) return false;
  const given = await stateFromLink(location.hash.slice(1));
  if (!given) return false;
  openRoom(given.scene, given);
  tour.leave("A view that was shared", "Drag the ranger, turn it, change what you like.");
  return true;
}

async function start() {
  const { wasm, worker } = /** @type {any} */ (globalThis).SONARD_MODEL;
  const squeezed = Uint8Array.from(atob(wasm), (letter) => letter.charCodeAt(0));
  const bytes = await unsqueeze(squeezed, "gzip", MOST_BYTES);
  model = new Model(bytes.buffer, worker, take);
  const shipped = await model.ask({ kind: "shipped" });
  for (const { name, text } of shipped.scenes) rooms.set(name, JSON.parse(text));
  for (const sensor of shipped.sensors) sensors.set(sensor.name, sensor);
  byId("scene").replaceChildren(new Option("own", ""), ...[...rooms.keys()].map((name) => new Option(name, name)));
  fillSensors();
  listen();
  if (await openLink()) return;
  tour.go(0);
  if (location.hash.length > 1) setText(byId("tour-text"), "The link holds no view of this page: it may have been cut off. Ask for it again.");
}

/** For tests and the curious. */
Object.assign(globalThis, {
  playground: {
    plan, took, change, select,
    state: () => state,
    scan: () => scan,
    beam: () => beam,
    ask: (/** @type {any} */ question) => model.ask(question),
    /** Whether all that was asked for is shown. */
    idle: () => scan !== null && model.busy === null && model.next === null,
  },
});

start().catch((error) => {
  setLamp("bad", "the model can't be loaded");
  tellTrouble({ message: `this browser can't run the model: ${error.message}`, help: "try a newer one" });
});
