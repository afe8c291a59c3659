// Overlays of the floor plan: a pinned scan, its average or difference with the shown one, and the interpretation of
// the shown scan (map, lines, features).

import { requestJson } from "./api.js";
import { make } from "./dom.js";
import { describeCell, describeFinding, drawFeature, drawLine, drawMap, markContradictions } from "./findings.js";
import { disc, line } from "./layers.js";
import { positionOf } from "./sketch.js";
import { clock, count, failure, millimetres, sentences, setText } from "./format.js";

const KINDS = { map: "Map", lines: "Lines", features: "Features" };
const MODES = { overlay: "overlaid", average: "average", difference: "difference" };
/** Minimum difference that is drawn, metres. */
const MIN_DIFFERENCE_M = 1e-3;

export class Overlays {
  /**
   * @param {HTMLElement} section
   * @param {any} plan
   * @param {any} strip
   * @param {{announce: (text: string) => void, completed: () => any}} callbacks `completed()` returns the newest complete scan
   */
  constructor(section, plan, strip, { announce, completed }) {
    this.plan = plan;
    this.strip = strip;
    this.announce = announce;
    this.completed = completed;
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
    this.source = make("p", { id: "findings-status", className: "hint", hidden: true });
    section.append(make("p", { className: "row" }, ...this.boxes, this.pin, this.mode), this.source, this.status);
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

  /** Scan whose findings are shown: the shown one, or during a scan the last complete one. */
  subject() {
    const { scan } = this.plan;
    return scan?.running && !scan.replayed ? (scan.previous ?? this.completed()) : scan;
  }

  /** Loads the findings of a complete scan. */
  async loadFindings() {
    const subject = this.subject();
    const isOther = this.plan.scan?.id !== subject?.id;
    this.source.hidden = !this.enabled.size || !isOther || !subject;
    if (isOther && subject) setText(this.source, `${findingNames(this.enabled)} of the last complete scan, ${clock(subject.start.time)}`);
    if (!this.enabled.size || !subject || this.found?.id === subject.id || this.loading === subject.id) return;
    this.loading = subject.id;
    try {
      const found = { id: subject.id, ...(await requestJson(`/v1/scans/${subject.id}/findings`)) };
      markContradictions(found, subject, this.plan.sceneFits() ? this.plan.scene : null);
      this.found = found;
      if (found.unavailable_reason) this.announce(sentences(found.unavailable_reason));
    } catch (/** @type {any} */ error) {
      this.announce(failure("Not computed", error));
    }
    this.loading = null;
    if (this.shown()) this.plan.redraw();
  }

  /** Loaded findings, if they are those to be shown. */
  shown() {
    return this.enabled.size && this.found && this.found.id === this.subject()?.id ? this.found : null;
  }

  describeAt(px, plan) {
    const found = this.shown();
    return found ? describeFinding(found, this.enabled, plan.view, px) : undefined;
  }

  describeUnder(px, plan) {
    const found = this.shown();
    return found?.map && this.enabled.has("map") ? describeCell(found.map, plan.view, px) : undefined;
  }

  /** Range difference between shown and pinned scan, metres; `null` unless both have a range. */
  differenceOf(ping) {
    const other = this.pinned?.beams.get(ping.index);
    return other?.range_m != null && ping.range_m !== null ? ping.range_m - other.range_m : null;
  }

  drawUnder(layer, plan) {
    const found = this.shown();
    if (found?.map && this.enabled.has("map")) drawMap(layer, plan, found.map, false);
    if (!this.pinned) return;
    const mode = this.mode.value;
    if (mode === "average") return this.drawAverage(layer, plan);
    if (mode === "difference") this.drawDifference(layer, plan);
    plan.sketch(layer, this.pinned).dots([...this.pinned.beams.values()], "pinned");
  }

  /** Draws what was found above the readings. */
  drawAbove(layer, plan) {
    const found = this.shown();
    if (!found) return;
    if (found.map && this.enabled.has("map")) drawMap(layer, plan, found.map, true);
    if (this.enabled.has("lines")) for (const segment of found.lines) drawLine(layer, plan, segment);
    if (this.enabled.has("features")) for (const feature of found.features) drawFeature(layer, plan, feature);
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

/** Names of findings as the start of a sentence. @param {Set<string>} enabled */
function findingNames(enabled) {
  const names = Object.keys(KINDS).filter((kind) => enabled.has(kind));
  return sentences(names.join(", ").replace(/, ([^,]*)$/, " and $1")).slice(0, -1);
}
