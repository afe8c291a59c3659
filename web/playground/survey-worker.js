// Worker that runs the module of surveys: answers requests in order, and forwards the progress of a survey.

import { Engine, problemOf } from "./engine.js";

/** Time after which a survey ends with the best plan so far. */
const MAX_SURVEY_MS = 30_000;

/** @type {Promise<Engine>} */
let engine;
let startedAt = 0;
const observer = {
  onProgress: (/** @type {any} */ progress) => postMessage({ progress }),
  isOver: () => performance.now() - startedAt > MAX_SURVEY_MS,
};

addEventListener("message", async ({ data: { bytes, id, request } }) => {
  if (bytes) {
    engine = Engine.load(bytes, observer);
    return;
  }
  try {
    const module = await engine;
    startedAt = performance.now();
    postMessage({ id, response: module.request(request) });
  } catch (error) {
    postMessage({ id, problem: problemOf(error) });
  }
});
