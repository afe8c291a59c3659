// What lies under the readings: a pinned scan, its average with this one or the difference, and what was found in the
// scan: map, lines and features.

import { ask } from "./api.js";
import { make } from "./dom.js";
import { drawFeatures, drawFindings } from "./findings.js";
import { disc, line } from "./pens.js";
import { place } from "./sketch.js";
import { clock, count, millimetres, setText } from "./words.js";

const KINDS = { map: "Map", lines: "Lines", features: "Features" };
const WAYS = { beside: "beside this one", average: "average", difference: "difference" };
/** Differences below this are not drawn, metres. */
const LEAST_M = 1e-3;

export class Overlays {
  /** @param {HTMLElement} section @param {any} plan @param {any} strip @param {(text: string) => void} say */
  constructor(section, plan, strip, say) {
    this.plan = plan;
    this.strip = strip;
    this.say = say;
    this.wanted = new Set();
    this.found = null;
    this.asking = null;
    /** The pinned scan. */
    this.second = null;
    this.boxes = Object.entries(KINDS).map(([kind, text]) => this.box(kind, text));
    this.pin = make("button", { type: "button", id: "pin", textContent: "Pin this scan", ariaPressed: "false" });
    this.way = make("select", { id: "second-as", ariaLabel: "How the pinned scan is shown", disabled: true });
    this.way.append(...Object.entries(WAYS).map(([value, text]) => new Option(text, value)));
    this.told = make("p", { id: "second-now", className: "hint", hidden: true });
    section.append(make("p", { className: "row" }, ...this.boxes, this.pin, this.way), this.told);
    this.pin.addEventListener("click", () => this.setSecond(this.second ? null : this.plan.scan));
    this.way.addEventListener("change", () => this.redraw());
    plan.overlays.push(this);
  }

  box(kind, text) {
    const input = make("input", { type: "checkbox", id: `show-${kind}` });
    input.addEventListener("change", () => {
      if (input.checked) this.wanted.add(kind);
      else this.wanted.delete(kind);
      this.redraw();
    });
    return make("label", { className: "check" }, input, ` ${text}`);
  }

  setSecond(scan) {
    if (!scan && !this.second) return this.say("There is no scan to pin yet.");
    this.second = scan;
    this.pin.ariaPressed = String(scan !== null);
    this.pin.textContent = scan ? "Unpin" : "Pin this scan";
    this.way.disabled = scan === null;
    this.redraw();
  }

  redraw() {
    this.tell();
    this.strip.redraw();
    this.plan.redraw();
  }

  /** Another scan is shown, or its readings are complete now. */
  tell() {
    const { strip } = this;
    const differs = this.second && this.way.value === "difference";
    if (differs) {
      const words = "this scan minus the pinned one in mm, against azimuth; the upright line is the selected beam";
      strip.show((ping) => this.differenceOf(ping), "Difference", words);
    } else strip.show();
    this.told.hidden = !this.second;
    setText(this.told, this.inWords());
    this.ask();
  }

  /** Asks what can be found in the scan that is shown, once it is over. */
  async ask() {
    const scan = this.plan.scan;
    if (!this.wanted.size || !scan || scan.underWay || this.found?.id === scan.id || this.asking === scan.id) return;
    this.asking = scan.id;
    try {
      this.found = { id: scan.id, ...(await ask(`/v1/scans/${scan.id}/findings`)) };
      if (this.found.lacks) this.say(`${this.found.lacks}.`);
    } catch (/** @type {any} */ error) {
      this.say(`Nothing is found in this scan: ${error.message}. ${error.help ?? ""}`);
    }
    this.asking = null;
    if (this.plan.scan?.id === scan.id && this.found?.id === scan.id) this.plan.redraw();
  }

  /** Of a beam that both scans have a range of, metres. */
  differenceOf(ping) {
    const other = this.second?.beams.get(ping.index);
    return other?.range_m != null && ping.range_m !== null ? ping.range_m - other.range_m : null;
  }

  drawUnder(layer, plan) {
    if (this.found && this.found.id === plan.scan?.id) drawFindings(layer, plan, this.found, this.wanted);
    if (!this.second) return;
    const way = this.way.value;
    if (way === "average") return this.drawAverage(layer, plan);
    if (way === "difference") this.drawDifference(layer, plan);
    plan.sketch(layer, this.second).dots([...this.second.beams.values()], "second");
  }

  drawOver(layer, plan) {
    if (this.found && this.found.id === plan.scan?.id && this.wanted.has("features")) drawFeatures(layer, plan, this.found);
  }

  drawAverage(layer, plan) {
    const c = layer.pen("average", plan.palette);
    for (const ping of plan.readings()) {
      const by = this.differenceOf(ping);
      if (by !== null && ping.viewpoint) disc(c, plan.view.px(place(ping, ping.range_m - by / 2)), 3.5);
    }
  }

  drawDifference(layer, plan) {
    const c = layer.pen("difference", plan.palette);
    for (const ping of plan.readings()) {
      const by = this.differenceOf(ping);
      if (by === null || Math.abs(by) < LEAST_M || !ping.viewpoint) continue;
      line(c, [plan.view.px(place(this.second.beams.get(ping.index))), plan.view.px(place(ping))]);
    }
  }

  inWords() {
    if (!this.second) return "";
    const pinned = `Pinned: the scan of ${clock(this.second.start.time)}`;
    const scan = this.plan.scan;
    if (!scan || scan.id === this.second.id) return `${pinned}. Choose another one to compare it with.`;
    const all = this.plan.readings().map((ping) => this.differenceOf(ping)).filter((by) => by !== null);
    if (!all.length) return `${pinned}: no beam has a range in both.`;
    const sorted = all.toSorted((one, other) => one - other);
    const sizes = all.map(Math.abs).sort((one, other) => one - other);
    const most = 1e3 * sizes[Math.floor(0.95 * (sizes.length - 1))];
    return `${pinned}: ${count(all.length, "beam")} with a range in both, median difference ${millimetres(sorted[sorted.length >> 1])}, 95 % within ${most.toFixed(1)} mm.`;
  }
}
