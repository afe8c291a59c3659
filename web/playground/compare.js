// The engines side by side: what each would have the ranger read, and what it misses.

import { Plan } from "../../crates/sonard-daemon/src/server/page/plan.js";
import { Scan } from "../../crates/sonard-daemon/src/server/page/scan.js";
import { setText } from "../../crates/sonard-daemon/src/server/page/words.js";

/** Ranges agree within so much, metres, or that share: what the module is made for. */
const AGREE_M = 0.01;
const AGREE_SHARE = 0.01;
/** Verdicts in words, of what another engine misses. */
const KINDS = {
  direct: ["direct echo", "direct echoes"],
  multiple: ["multiple reflection", "multiple reflections"],
  edge: ["edge", "edges"],
  min_range: ["nearest range", "nearest ranges"],
  silent: ["silence", "silences"],
};

export class SideBySide {
  /**
   * @param {HTMLElement} place with a figure for each engine
   * @param {(index: number) => void} onPick
   */
  constructor(place, onPick) {
    this.figures = [...place.querySelectorAll("figure")].map((figure) => ({
      name: /** @type {import("./engine.js").EngineName} */ (figure.dataset.engine),
      plan: new Plan(figure.querySelector(".stage"), onPick, `What the engine ${figure.dataset.engine} reads`),
      words: /** @type {HTMLElement} */ (figure.querySelector(".misses")),
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
    figure.plan.view.what = "room";
    figure.plan.scan = scan;
    figure.plan.selected = selected ? (scan.beams.get(selected.index) ?? null) : null;
    figure.plan.redraw(palette);
    this.tell();
  }

  /** What each engine misses of the exact paths. */
  tell() {
    const exact = this.scans.get("paths");
    for (const { name, words } of this.figures) {
      const scan = this.scans.get(name);
      if (scan && exact) setText(words, name === "paths" ? heard(exact) : misses(scan, exact));
    }
  }
}

/** @param {Scan} exact */
function heard(exact) {
  const echoes = [...exact.beams.values()].filter((ping) => ping.range_m !== null).length;
  return `Hears something in ${echoes} of ${exact.beams.size} beams.`;
}

/**
 * @param {Scan} scan
 * @param {Scan} exact
 */
function misses(scan, exact) {
  /** @type {Map<string, number>} */
  const missed = new Map();
  let same = 0;
  for (const ping of exact.beams.values()) {
    const other = scan.beams.get(ping.index);
    if (!other) continue;
    if (agrees(ping.range_m, other.range_m)) same++;
    else missed.set(ping.mark, (missed.get(ping.mark) ?? 0) + 1);
  }
  const parts = Object.entries(KINDS).flatMap(([kind, [one, many]]) => {
    const count = missed.get(kind);
    return count ? [`${count} ${count === 1 ? one : many}`] : [];
  });
  const all = `Reads the same in ${same} of ${exact.beams.size} beams.`;
  return parts.length ? `${all} Misses ${parts.join(", ")}.` : all;
}

/**
 * @param {number | null} exact_m
 * @param {number | null} other_m
 */
function agrees(exact_m, other_m) {
  if (exact_m === null || other_m === null) return exact_m === other_m;
  return Math.abs(exact_m - other_m) <= Math.max(AGREE_M, AGREE_SHARE * exact_m);
}
