// Overlays of the floor plan: a pinned scan, its average or difference with the shown one, and the interpretation of
// the shown scan (map, lines, features).

import { requestJson } from "./api.js";
import { make } from "./dom.js";
import { drawFeatures, drawFindings } from "./findings.js";
import { disc, line } from "./layers.js";
import { positionOf } from "./sketch.js";
import { clock, count, failure, millimetres, sentences, setText } from "./format.js";

const KINDS = { map: "Map", lines: "Lines", features: "Features" };
const MODES = { overlay: "overlaid", average: "average", difference: "difference" };
/** Minimum difference that is drawn, metres. */
const MIN_DIFFERENCE_M = 1e-3;

export class Overlays {
  /** @param {HTMLElement} section @param {any} plan @param {any} strip @param {(text: string) => void} announce */
  constructor(section, plan, strip, announce) {
    this.plan = plan;
    this.strip = strip;
    this.announce = announce;
    /** Enabled findings. */
    this.enabled = new Set();
    this.found = null;
    /** Scan whose findings are being loaded. */
    this.loading = null;
    /** Pinned scan. */
    this.pinned = null;
    this.boxes = Object.entries(KINDS).map(([kind, text]) => this.box(kind, text));
    this.pin = make("button", { type: "button", id: "pin", textContent: "Compare with …", ariaPressed: "false" });
    this.mode = make("select", { id: "pinned-mode", ariaLabel: "Display of the pinned scan", disabled: true });
    this.mode.append(...Object.entries(MODES).map(([value, text]) => new Option(text, value)));
    this.status = make("p", { id: "pinned-status", className: "hint", hidden: true });
    section.append(make("p", { className: "row" }, ...this.boxes, this.pin, this.mode), this.status);
    this.pin.addEventListener("click", () => this.setPinned(this.pinned ? null : this.plan.scan));
    this.mode.addEventListener("change", () => this.redraw());
    plan.overlays.push(this);
  }

  box(kind, text) {
    const input = make("input", { type: "checkbox", id: `show-${kind}` });
    input.addEventListener("change", () => {
      if (input.checked) this.enabled.add(kind);
      else this.enabled.delete(kind);
      this.redraw();
    });
    return make("label", { className: "check" }, input, ` ${text}`);
  }

  setPinned(scan) {
    if (!scan && !this.pinned) return this.announce("There is no scan to compare with yet.");
    this.pinned = scan;
    this.pin.ariaPressed = String(scan !== null);
    this.pin.textContent = scan ? "Unpin" : "Compare with …";
    this.mode.disabled = scan === null;
    this.redraw();
  }

  redraw() {
    this.update();
    this.strip.redraw();
    this.plan.redraw();
  }

  /** Updates texts and findings after another scan is shown or the shown one is complete. */
  update() {
    const { strip } = this;
    if (this.pinned && this.mode.value === "difference") {
      const caption = "this − pinned (mm) vs azimuth; line: selected beam";
      strip.show((ping) => this.differenceOf(ping), "Difference", caption);
    } else strip.show();
    this.status.hidden = !this.pinned;
    setText(this.status, this.statusText());
    this.loadFindings();
  }

  /** Loads the findings of the shown scan once it is complete. */
  async loadFindings() {
    const scan = this.plan.scan;
    if (!this.enabled.size || !scan || scan.running || this.found?.id === scan.id || this.loading === scan.id) return;
    this.loading = scan.id;
    try {
      this.found = { id: scan.id, ...(await requestJson(`/v1/scans/${scan.id}/findings`)) };
      if (this.found.unavailable_reason) this.announce(sentences(this.found.unavailable_reason));
    } catch (/** @type {any} */ error) {
      this.announce(failure("Not computed", error));
    }
    this.loading = null;
    if (this.plan.scan?.id === scan.id && this.found?.id === scan.id) this.plan.redraw();
  }

  /** Range difference between shown and pinned scan, metres; `null` unless both have a range. */
  differenceOf(ping) {
    const other = this.pinned?.beams.get(ping.index);
    return other?.range_m != null && ping.range_m !== null ? ping.range_m - other.range_m : null;
  }

  drawUnder(layer, plan) {
    if (this.found && this.found.id === plan.scan?.id) drawFindings(layer, plan, this.found, this.enabled);
    if (!this.pinned) return;
    const mode = this.mode.value;
    if (mode === "average") return this.drawAverage(layer, plan);
    if (mode === "difference") this.drawDifference(layer, plan);
    plan.sketch(layer, this.pinned).dots([...this.pinned.beams.values()], "pinned");
  }

  drawOver(layer, plan) {
    if (this.found && this.found.id === plan.scan?.id && this.enabled.has("features")) drawFeatures(layer, plan, this.found);
  }

  drawAverage(layer, plan) {
    const c = layer.pen("average", plan.palette);
    for (const ping of plan.readings()) {
      const by = this.differenceOf(ping);
      if (by !== null && ping.viewpoint) disc(c, plan.view.px(positionOf(ping, ping.range_m - by / 2)), 3.5);
    }
  }

  drawDifference(layer, plan) {
    const c = layer.pen("difference", plan.palette);
    for (const ping of plan.readings()) {
      const by = this.differenceOf(ping);
      if (by === null || Math.abs(by) < MIN_DIFFERENCE_M || !ping.viewpoint) continue;
      line(c, [plan.view.px(positionOf(this.pinned.beams.get(ping.index))), plan.view.px(positionOf(ping))]);
    }
  }

  statusText() {
    if (!this.pinned) return "";
    const pinned = `Pinned: scan of ${clock(this.pinned.start.time)}`;
    const scan = this.plan.scan;
    if (!scan || scan.id === this.pinned.id) return `${pinned}. Choose another scan to compare it with.`;
    const all = this.plan.readings().map((ping) => this.differenceOf(ping)).filter((by) => by !== null);
    if (!all.length) return `${pinned}: no common beams.`;
    const sorted = all.toSorted((a, b) => a - b);
    const sizes = all.map(Math.abs).sort((a, b) => a - b);
    const p95_mm = 1e3 * sizes[Math.floor(0.95 * (sizes.length - 1))];
    return `${pinned}: ${count(all.length, "beam")} in common, median difference ${millimetres(sorted[sorted.length >> 1])}, 95 % within ${p95_mm.toFixed(1)} mm.`;
  }
}
