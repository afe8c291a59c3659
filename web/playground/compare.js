// Engines side by side, each with its differences from the exact paths.

import { Plan } from "../../crates/sonard-daemon/src/server/page/plan.js";
import { Scan } from "../../crates/sonard-daemon/src/server/page/scan.js";
import { setText } from "../../crates/sonard-daemon/src/server/page/format.js";

/** Tolerance of agreement: 10 mm or 1 % of the range, whichever is larger. */
const AGREE_M = 0.01;
const AGREE_SHARE = 0.01;
/** Names of missed readings by mark, singular and plural. */
const KINDS = {
  direct: ["direct echo", "direct echoes"],
  multiple: ["multiple reflection", "multiple reflections"],
  edge: ["edge", "edges"],
  min_range: ["minimum-range reading", "minimum-range readings"],
};

export class SideBySide {
  /**
   * @param {HTMLElement} place element with a figure for each engine
   * @param {(index: number) => void} onPick
   */
  constructor(place, onPick) {
    this.figures = [...place.querySelectorAll("figure")].map((figure) => ({
      name: /** @type {import("./engine.js").EngineName} */ (figure.dataset.engine),
      plan: new Plan(figure.querySelector(".stage"), onPick, `Readings of the engine ${figure.dataset.engine}`),
      caption: /** @type {HTMLElement} */ (figure.querySelector(".misses")),
    }));
    /** @type {Map<string, Scan>} */
    this.scans = new Map();
  }

  /** @param {import("./engine.js").FloorPlan} scene */
  setScene(scene) {
    for (const { plan } of this.figures) plan.scene = scene;
  }

  /**
   * @param {string} engine
   * @param {Scan} scan
   * @param {Record<string, string>} palette
   * @param {any} selected
   */
  show(engine, scan, palette, selected) {
    this.scans.set(engine, scan);
    const figure = this.figures.find(({ name }) => name === engine);
    if (!figure) return;
    figure.plan.view.mode = "room";
    figure.plan.scan = scan;
    figure.plan.selected = selected ? (scan.beams.get(selected.index) ?? null) : null;
    figure.plan.redraw(palette);
    this.updateCaptions();
  }

  updateCaptions() {
    const exact = this.scans.get("paths");
    for (const { name, caption } of this.figures) {
      const scan = this.scans.get(name);
      if (scan && exact) setText(caption, name === "paths" ? echoCount(exact) : differences(scan, exact));
    }
  }
}

/** @param {Scan} exact */
function echoCount(exact) {
  const echoes = [...exact.beams.values()].filter((ping) => ping.range_m !== null).length;
  return `${echoes} of ${exact.beams.size} beams with an echo.`;
}

/**
 * @param {Scan} scan
 * @param {Scan} exact
 */
function differences(scan, exact) {
  /** @type {Map<string, number>} */
  const missed = new Map();
  let agreeing = 0;
  for (const ping of exact.beams.values()) {
    const other = scan.beams.get(ping.index);
    if (!other) continue;
    if (agrees(ping.range_m, other.range_m)) agreeing++;
    else missed.set(ping.mark, (missed.get(ping.mark) ?? 0) + 1);
  }
  const misses = Object.entries(KINDS).flatMap(([kind, [singular, plural]]) => {
    const number = missed.get(kind);
    return number ? [`${number} ${number === 1 ? singular : plural}`] : [];
  });
  const parts = [`Agrees in ${agreeing} of ${exact.beams.size} beams`];
  if (misses.length) parts.push(`misses ${misses.join(", ")}`);
  const falseEchoes = missed.get("no_echo");
  if (falseEchoes) parts.push(`${falseEchoes} false echo${falseEchoes === 1 ? "" : "es"}`);
  return `${parts.join("; ")}.`;
}

/**
 * @param {number | null} exact_m
 * @param {number | null} other_m
 */
function agrees(exact_m, other_m) {
  if (exact_m === null || other_m === null) return exact_m === other_m;
  return Math.abs(exact_m - other_m) <= Math.max(AGREE_M, AGREE_SHARE * exact_m);
}
