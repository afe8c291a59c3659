// What the page says of itself: its state, what is refused, and a sweep in one sentence.

import { count, setText } from "../../crates/sonard-daemon/src/server/page/words.js";

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

/** @param {import("./engine.js").Problem | null} problem */
export function tellTrouble(problem) {
  const place = byId("trouble");
  place.hidden = problem === null;
  setText(place, problem ? sentence(problem) : "");
}

/** @param {import("./engine.js").Problem} problem */
function sentence({ message, help }) {
  const parts = [message, help].filter((part) => part);
  return parts.map((part) => `${part[0].toUpperCase()}${part.slice(1)}.`).join(" ");
}

/**
 * @param {any} sweep
 * @param {boolean} measured
 */
export function inShort(sweep, measured) {
  if (sweep.beams.size === 0) return "";
  if (measured) return `${sweep.inWords()}.`;
  const heard = [...sweep.beams.values()].filter((ping) => ping.range_m !== null).length;
  const silent = sweep.beams.size - heard;
  if (silent === 0) return `The ranger hears something in all ${count(heard, "direction")}.`;
  return `The ranger hears something in ${count(heard, "direction")} and nothing in ${silent}.`;
}
