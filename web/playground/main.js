// Puts the playground together: what is shown is one state; every change of it asks the model anew.

import { BeamPanel, inWords } from "../../src/server/page/beam.js";
import { Plan } from "../../src/server/page/plan.js";
import { Scan } from "../../src/server/page/scan.js";
import { Strip } from "../../src/server/page/strip.js";
import { BeamTable } from "../../src/server/page/table.js";
import { colours, legend } from "../../src/server/page/verdicts.js";
import { count, setText } from "../../src/server/page/words.js";
import { drawArcs } from "./arcs.js";
import { SideBySide } from "./compare.js";
import { Controls } from "./controls.js";
import { Editor } from "./editor.js";
import { Files } from "./files.js";
import { Model } from "./model.js";
import { Ranger } from "./ranger.js";
import { emptyRoom } from "./room.js";
import { pack, stateFromLink, unsqueeze } from "./share.js";
import { planOf, settingsOf, usual } from "./state.js";
import { STEPS } from "./steps.js";
import { EchoTrace } from "./trace.js";

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
/** The scan of a log that is shown beside the model, and the air it was taken in. */
let logged = /** @type {{scan: number, air: any} | null} */ (null);
/** @type {Scan | null} */
let scan = null;
/** @type {import("./engine.js").Beam | null} */
let beam = null;
let half_beam_deg = 8;
let step = 0;
/** How long sweeps took from the question to the picture, milliseconds. @type {number[]} */
const took = [];

const plan = /** @type {any} */ (new Plan(byId("stage"), select));
plan.view.what = "room";
const strip = /** @type {any} */ (new Strip(byId("strip"), select));
const table = /** @type {any} */ (new BeamTable(byId("table")));
const trace = new EchoTrace(byId("trace"), choosePath);
const panel = /** @type {any} */ (new BeamPanel(byId("beam-panel"), showPath));
const sides = new SideBySide(byId("figures"), select);
const controls = new Controls(state, (changes) => change(changes));
const ranger = new Ranger(byId("stage"), plan.view, (pose) => change({ pose }, true), settle);
const editor = new Editor(byId("stage"), plan.view, (scene, kept) => change({ scene }, !kept), (pose) => change({ pose }));
const files = new Files({ room: openRoom, log: openLog, refused: (problem) => tellTrouble(problem) });
/** @type {Model} */
let model;

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
    [plan.view.what, plan.view.box] = [state.fit, null];
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
    settings: settingsOf(state, sensors, logged?.air ?? null),
    pose: state.pose,
    plan: planOf(state),
    engines: [state.engine, ...others],
    measured: logged?.scan ?? null,
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
  place();
  if (state.arcs) drawArcs(plan.layers[3], plan, half_beam_deg);
  else plan.layers[3].clear();
  const measured = logged !== null;
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
  legend(byId("legend"), sweep.counts, plan.pens(), palette);
  const { beyond } = plan.notShown();
  setText(byId("beyond"), beyond ? `${count(beyond, "reading")} beyond the view: arrows on its border` : "");
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
  resting = setTimeout(() => setText(byId("summary"), inShort(sweep)), REST_MS);
}
let resting = 0;

/** @param {any} sweep */
function inShort(sweep) {
  if (logged) return `${sweep.inWords()}.`;
  const heard = [...sweep.beams.values()].filter((ping) => ping.range_m !== null).length;
  const silent = sweep.beams.size - heard;
  if (silent === 0) return `The ranger hears something in all ${count(heard, "direction")}.`;
  return `The ranger hears something in ${count(heard, "direction")} and nothing in ${silent}.`;
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
  const list = byId("beam-panel").querySelector(".humps");
  const drawn = list?.querySelector("[aria-pressed=true]");
  if (drawn) list.scrollTop = drawn.offsetTop - list.clientHeight / 2;
  trace.redraw(palette);
  trace.show(beam, chosenOf(beam));
  plan.select(ping ?? null, told.polyline);
}

/** @param {import("./engine.js").Beam} told */
function chosenOf({ humps, polyline }) {
  return humps.find((hump) => JSON.stringify(hump.polyline) === JSON.stringify(polyline)) ?? null;
}

/** Another sound of the beam. @param {import("./engine.js").Hump} hump */
function choosePath(hump) {
  const at = beam?.humps.indexOf(hump) ?? -1;
  byId("beam-panel").querySelectorAll(".humps button")[at]?.click();
}

/** @param {[number, number][]} polyline */
function showPath(polyline) {
  plan.select(plan.selected, polyline);
  const hump = beam?.humps.find((one) => one.polyline === polyline);
  trace.show(beam, hump ?? null);
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

/** @param {import("./engine.js").Problem | null} problem */
function tellTrouble(problem) {
  const place = byId("trouble");
  place.hidden = problem === null;
  setText(place, problem ? sentence(problem) : "");
}

/** @param {import("./engine.js").Problem} problem */
function sentence({ message, help }) {
  const first = message[0].toUpperCase() + message.slice(1);
  return help ? `${first}. ${help[0].toUpperCase()}${help.slice(1)}.` : `${first}.`;
}

/** Handles to where their things are. */
function place() {
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
  closeLog();
  plan.view.box = null;
  editor.toggle(false);
  change({ scene, pose, beam: null, height_m: null, ...further });
  panel.clear();
  trace.show(null);
  byId("pose").value = "";
}

/**
 * A log's scans: the first that is shown sets room, pose, sensor and air as it was taken in.
 * @param {string} text
 */
async function openLog(text) {
  try {
    const { scans } = await model.ask({ kind: "log", text, pose: state.pose });
    const list = byId("logged-scan");
    list.replaceChildren(...scans.map((/** @type {any} */ one, /** @type {number} */ i) =>
      new Option(`${i + 1} of ${scans.length}: ${count(one.readings, "reading")}`, String(i))));
    list.onchange = () => showLogged(scans[Number(list.value)], Number(list.value));
    byId("logged").hidden = false;
    showLogged(scans[0], 0);
  } catch (problem) {
    tellTrouble(/** @type {any} */ (problem));
  }
}

/**
 * @param {import("./engine.js").LoggedScan} found
 * @param {number} number
 */
function showLogged(found, number) {
  const scene = found.scene ? JSON.parse(found.scene) : state.scene;
  if (found.sensor) {
    const name = "of the log";
    sensors.set(name, found.sensor);
    fillSensors();
  }
  const { temperature_c, humidity_percent, ...rest } = found.air ?? {};
  logged = { scan: number, air: null };
  plan.view.box = null;
  change({
    scene,
    pose: found.pose ?? state.pose,
    sensor: found.sensor ? "of the log" : state.sensor,
    temperature_c: temperature_c ?? state.temperature_c,
    humidity_percent: humidity_percent ?? state.humidity_percent,
    engine: "paths",
    threshold_db: 0,
    gain: "own",
    height_m: null,
    beam: null,
  });
}

function closeLog() {
  logged = null;
  byId("logged").hidden = true;
  if (sensors.delete("of the log")) {
    fillSensors();
    if (state.sensor === "of the log") state.sensor = "senscomp-6500";
  }
}

function fillSensors() {
  byId("sensor").replaceChildren(...[...sensors.keys()].map((name) => new Option(name, name)));
}

/** @param {number} to */
function showStep(to) {
  step = to;
  const { title, text, scene, pose, beam: index, range_m, ...shown } = STEPS[step];
  setText(byId("tour-title"), title);
  setText(byId("tour-count"), `${step + 1} of ${STEPS.length}`);
  setText(byId("tour-text"), text);
  byId("tour-back").disabled = step === 0;
  byId("tour-next").disabled = step === STEPS.length - 1;
  const room = structuredClone(/** @type {import("./room.js").SceneFile} */ (rooms.get(scene)));
  openRoom(room, { ...usual(), pose, beam: index, reach_m: range_m, ...shown });
}

/**
 * @param {"good" | "wait" | "bad"} lamp
 * @param {string} text
 */
function setLamp(lamp, text) {
  const link = byId("link");
  if (link.dataset.lamp !== lamp) link.dataset.lamp = lamp;
  setText(link, text);
}

function listen() {
  byId("scene").addEventListener("change", () => openRoom(structuredClone(/** @type {any} */ (rooms.get(byId("scene").value)))));
  byId("pose").addEventListener("change", () => {
    const pose = state.scene.poses?.[byId("pose").value];
    if (pose) change({ pose });
  });
  byId("fit").addEventListener("change", () => change({ fit: byId("fit").value }));
  byId("arcs").addEventListener("change", () => change({ arcs: byId("arcs").checked }));
  byId("compare").addEventListener("change", () => change({ compare: byId("compare").checked }));
  byId("table").addEventListener("toggle", () => scan && redraw());
  byId("beam").addEventListener("input", () => select(Number(byId("beam").value)));
  byId("tour-back").addEventListener("click", () => showStep(step - 1));
  byId("tour-next").addEventListener("click", () => showStep(step + 1));
  byId("close-log").addEventListener("click", () => {
    closeLog();
    change({});
  });
  byId("save").addEventListener("click", () => files.save({ ...state.scene, poses: { ...state.scene.poses, here: state.pose } }));
  byId("share").addEventListener("click", share);
  byId("copy").addEventListener("click", async () => {
    byId("address").select();
    await navigator.clipboard?.writeText(byId("address").value).catch(() => document.execCommand("copy"));
    setText(byId("copy"), "Copied");
  });
  addEventListener("hashchange", () => openLink());
  new ResizeObserver(place).observe(byId("stage"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    palette = colours();
    trace.redraw(palette);
    if (scan) redraw();
    ask();
  });
}

async function share() {
  byId("address").value = `${location.href.split("#")[0]}#${await pack(state)}`;
  setText(byId("copy"), "Copy");
  byId("shared").showModal();
  byId("address").select();
}

/** Whether the address had a view in it. */
async function openLink() {
  if (location.hash.length < 2) return false;
  const given = await stateFromLink(location.hash.slice(1));
  if (!given) return false;
  openRoom(given.scene, given);
  setText(byId("tour-title"), "A view that was shared");
  setText(byId("tour-count"), "");
  setText(byId("tour-text"), "Drag the ranger, turn it, change what you like. The tour begins with “Next”.");
  byId("tour-back").disabled = true;
  byId("tour-next").disabled = false;
  step = -1;
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
  showStep(0);
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
