// Status texts of the page: model state, errors, and the summary of a sweep.

import { count, sentences, setText } from "../../crates/sonard-daemon/src/server/page/format.js";

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

/**
 * @param {"good" | "wait" | "bad"} lamp
 * @param {string} text
 */
export function setLamp(lamp, text) {
  const link = byId("link");
  if (link.dataset.lamp !== lamp) link.dataset.lamp = lamp;
  setText(link, text);
}

/** Shows an error, or hides the last one. @param {import("./engine.js").Problem | null} problem */
export function showProblem(problem) {
  const element = byId("trouble");
  element.hidden = problem === null;
  setText(element, problem ? sentences(problem.message, problem.help) : "");
}

/**
 * @param {any} sweep
 * @param {boolean} measured set for readings of a log
 */
export function summaryOf(sweep, measured) {
  if (sweep.beams.size === 0) return "";
  if (measured) return sentences(sweep.summary());
  const withEcho = [...sweep.beams.values()].filter((ping) => ping.range_m !== null).length;
  const without = sweep.beams.size - withEcho;
  return `${count(withEcho, "beam")} with an echo${without ? `, ${without} without` : ""}`;
}
