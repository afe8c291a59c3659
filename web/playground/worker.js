// The model at work beside the page: the last view that was asked for, piece by piece.

import { Engine, Refused } from "./engine.js";

/** A piece of work is to take about so long: then somebody may want something else. */
const PIECE_MS = 20;

/** @type {Promise<Engine>} */
let engine;
/** @type {import("./model.js").View | null} */
let wanted = null;
let working = false;
let set = "";

/** @param {object} message */
const tell = (message) => postMessage(message);

addEventListener("message", ({ data }) => {
  if (data.kind === "begin") engine = Engine.of(data.bytes);
  else if (data.kind === "view") show(data.view);
  else if (data.kind === "log") answer(data.id, (model) => model.log(data.text, data.pose));
  else if (data.kind === "shipped") answer(data.id, (model) => model.shipped());
  else if (data.kind === "memory") answer(data.id, (model) => ({ bytes: model.exports.memory.buffer.byteLength }));
  else if (data.kind === "ask") {
    // Whatever is asked may set the model otherwise than the page did.
    set = "";
    answer(data.id, (model) => model.ask(data.request));
  }
});

/**
 * @param {number} id
 * @param {(model: Engine) => object} ask
 */
async function answer(id, ask) {
  try {
    tell({ kind: "answer", id, answer: ask(await engine) });
  } catch (error) {
    tell({ kind: "refused", id, problem: problemOf(error) });
  }
}

/** @param {import("./model.js").View} view */
async function show(view) {
  wanted = view;
  if (working) return;
  working = true;
  while (wanted) {
    const now = wanted;
    try {
      await work(await engine, now);
    } catch (error) {
      if (!(error instanceof Refused)) set = "";
      tell({ kind: "refused", id: now.id, problem: problemOf(error) });
    }
    if (wanted === now) wanted = null;
  }
  working = false;
}

/**
 * @param {Engine} model
 * @param {import("./model.js").View} view
 */
async function work(model, view) {
  const settings = JSON.stringify(view.settings);
  if (settings !== set) {
    set = "";
    tell({ kind: "plan", id: view.id, ...model.set(view.settings) });
    set = settings;
  }
  for (const name of view.engines) {
    const measured = name === view.engines[0] ? view.measured : null;
    const { start, session, beams } = model.stand(name, view.pose, view.plan, measured);
    tell({ kind: "begun", id: view.id, engine: name, start, session, beams });
    if (!(await sweep(model, view, name, beams))) return;
    // The selected beam is of the first engine, and comes before the others' sweeps.
    if (name !== view.engines[0] || view.beam === null) continue;
    tell({ kind: "beam", id: view.id, text: model.beam(name, Math.min(view.beam, beams - 1)) });
    if (!(await goesOn(view))) return;
  }
  tell({ kind: "done", id: view.id });
}

/**
 * Whether it came to its end.
 * @param {Engine} model
 * @param {import("./model.js").View} view
 * @param {import("./engine.js").EngineName} name
 * @param {number} beams
 */
async function sweep(model, view, name, beams) {
  let [left, count] = [beams, 32];
  while (left > 0) {
    const began = performance.now();
    const texts = [];
    while (left > 0 && performance.now() - began < PIECE_MS) {
      const since = performance.now();
      texts.push(model.more(name, count));
      left -= Math.min(left, count);
      const took = performance.now() - since;
      count = took > PIECE_MS ? Math.max(1, count >> 1) : took < PIECE_MS / 4 ? Math.min(2 * count, 512) : count;
    }
    tell({ kind: "readings", id: view.id, engine: name, texts, left });
    if (left > 0 && !(await goesOn(view))) return false;
  }
  return true;
}

/** Lets messages in; whether the view is wanted still. */
const channel = new MessageChannel();
/** @param {import("./model.js").View} view */
function goesOn(view) {
  return new Promise((done) => {
    channel.port1.onmessage = () => done(wanted === view);
    channel.port2.postMessage(null);
  });
}

/** @param {any} error */
function problemOf(error) {
  if (error instanceof Refused) return error.problem;
  return { message: `The model broke down: ${error.message}`, help: "load the page again", broken: true };
}
