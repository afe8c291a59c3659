// Table of stops: driven length, poses by odometry, their correction by the survey, and their error once the room is revealed.

import { make } from "../../crates/sonard-daemon/src/server/page/dom.js";
import { degrees } from "../../crates/sonard-daemon/src/server/page/format.js";
import { relative } from "./course.js";

/** @import { Pose } from "./engine.js" */

const place = (/** @type {Pose} */ { x_m, y_m }) => `${x_m.toFixed(2)}, ${y_m.toFixed(2)} m`.replaceAll("-", "−");

/** Distance and angle from one pose to another. @param {Pose} from @param {Pose} to */
function deviation(from, to) {
  const { x_m, y_m, heading_deg } = relative(from, to);
  return `${(1e3 * Math.hypot(x_m, y_m)).toFixed(1)} mm, ${degrees(Math.abs(heading_deg))}`;
}

/**
 * @param {HTMLElement} table
 * @param {import("./course.js").Place[]} stops
 * @param {any} survey
 * @param {boolean} revealed
 */
export function showStops(table, stops, survey, revealed) {
  const columns = ["Stop", "Odometry", "Correction", ...(revealed ? ["Error left"] : [])];
  const rows = stops.map(({ truth, odometry }, at) => {
    const found = survey?.poses[at]?.pose;
    const cells = [place(odometry), found ? deviation(odometry, found) : "–"];
    if (revealed) cells.push(deviation(found ?? odometry, truth));
    const name = make("th", { scope: "row", textContent: String(at + 1) });
    return make("tr", {}, name, ...cells.map((textContent) => make("td", { textContent })));
  });
  const head = columns.map((textContent) => make("th", { scope: "col", textContent }));
  table.replaceChildren(make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows));
}
