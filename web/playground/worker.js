// Worker that runs the model: computes the latest requested view in slices, so that a newer view can replace it.

import { Engine, ModelError, problemOf } from "./engine.js";

/** Target duration of a slice. */
const SLICE_MS = 20;

/** @type {Promise<Engine>} */
let engine;
/** Latest requested view. @type {import("./model.js").View | null} */
let requested = null;
let working = false;
/** JSON of the settings that the engine is configured with; empty if unknown. */
let configured = "";

/** @param {object} message */
const send = (message) => postMessage(message);

addEventListener("message", ({ data }) => {
  if (data.kind === "init") engine = Engine.load(data.bytes);
  else if (data.kind === "view") show(data.view);
  else if (data.kind === "load_log") respond(data.id, (model) => model.loadLog(data.text, data.pose));
  else if (data.kind === "list_presets") respond(data.id, (model) => model.listPresets());
  else if (data.kind === "memory") respond(data.id, (model) => ({ bytes: model.exports.memory.buffer.byteLength }));
  else if (data.kind === "request") {
    // A raw request may change the engine's settings.
    configured = "";
    respond(data.id, (model) => model.request(data.request));
  }
});

/**
 * @param {number} id
 * @param {(model: Engine) => object} compute
 */
async function respond(id, compute) {
  try {
    send({ kind: "response", id, response: compute(await engine) });
  } catch (error) {
    send({ kind: "error", id, problem: problemOf(error) });
  }
}

/** @param {import("./model.js").View} view */
async function show(view) {
  requested = view;
  if (working) return;
  working = true;
  while (requested) {
    const current = requested;
    try {
      await compute(await engine, current);
    } catch (error) {
      if (!(error instanceof ModelError)) configured = "";
      send({ kind: "error", id: current.id, problem: problemOf(error) });
    }
    if (requested === current) requested = null;
  }
  working = false;
}

/**
 * @param {Engine} model
 * @param {import("./model.js").View} view
 */
async function compute(model, view) {
  const settings = JSON.stringify(view.settings);
  if (settings !== configured) {
    configured = "";
    send({ kind: "plan", id: view.id, ...model.configure(view.settings) });
    configured = settings;
  }
  for (const name of view.engines) {
    const measured = name === view.engines[0] ? view.measured : null;
    const { start, session, beams } = model.startSweep(name, view.pose, view.plan, measured);
    send({ kind: "sweep_started", id: view.id, engine: name, start, session, beams });
    if (!(await sweep(model, view, name, beams))) return;
    // The selected beam belongs to the first engine and is sent before the other sweeps.
    if (name !== view.engines[0] || view.beam === null) continue;
    send({ kind: "beam", id: view.id, text: model.beam(name, Math.min(view.beam, beams - 1)) });
    if (!(await isCurrent(view))) return;
  }
  send({ kind: "done", id: view.id });
}

/**
 * Computes a sweep; resolves to `false` if another view replaced it.
 * @param {Engine} model
 * @param {import("./model.js").View} view
 * @param {import("./engine.js").EngineName} name
 * @param {number} beams
 */
async function sweep(model, view, name, beams) {
  let [left, count] = [beams, 32];
  while (left > 0) {
    const started = performance.now();
    const texts = [];
    while (left > 0 && performance.now() - started < SLICE_MS) {
      const before = performance.now();
      texts.push(model.nextReadings(name, count));
      left -= Math.min(left, count);
      const duration_ms = performance.now() - before;
      count = duration_ms > SLICE_MS ? Math.max(1, count >> 1) : duration_ms < SLICE_MS / 4 ? Math.min(2 * count, 512) : count;
    }
    send({ kind: "readings", id: view.id, engine: name, texts, left });
    if (left > 0 && !(await isCurrent(view))) return false;
  }
  return true;
}

const channel = new MessageChannel();
/** Yields to incoming messages; resolves to `true` if the view is still the requested one. @param {import("./model.js").View} view */
function isCurrent(view) {
  return new Promise((done) => {
    channel.port1.onmessage = () => done(requested === view);
    channel.port2.postMessage(null);
  });
}
