// Hypotheses that fit the last scan better than the current settings (`fit.explanations` of `GET /v1/health`): listed,
// drawn on the plan if they move a wall or the robot, and previewed by the model.

import { make } from "./dom.js";
import { arrow, line } from "./layers.js";
import { rounded } from "./ranger.js";
import * as format from "./format.js";

const ZERO_C = 273.15;

/** @typedef {{change: string, estimates: {name: string, value: number, sigma: number}[], gain: number, explains: number}} Explanation */

export class Explanations {
  /**
   * @param {HTMLElement} section
   * @param {any} plan
   * @param {{show: (scan: string) => void, propose: (change: (draft: any) => void) => void}} callbacks
   */
  constructor(section, plan, callbacks) {
    this.section = section;
    this.plan = plan;
    this.callbacks = callbacks;
    /** Latest report, with the scan that it is about. @type {{scan: string, explanations: Explanation[]}} */
    this.report = { scan: "", explanations: [] };
    /** Selected change. @type {string | null} */
    this.selected = null;
    this.list = make("ul", { id: "hypotheses-list", className: "peaks" });
    this.hint = make("p", { className: "hint", textContent: "±: one standard deviation. Gain: increase of log-likelihood." });
    this.preview = make("button", { type: "button", id: "hypotheses-preview", textContent: "Preview", className: "writes", hidden: true });
    this.preview.addEventListener("click", () => this.propose());
    section.append(make("h3", { textContent: "Better-fitting hypotheses" }), this.list, make("p", { className: "row" }, this.preview, this.hint));
    plan.overlays.push(this);
  }

  /** Updates the list from a health report. @param {any} health */
  update({ fit }) {
    const report = { scan: fit?.scan ?? "", explanations: fit?.explanations ?? [] };
    if (JSON.stringify(report) === JSON.stringify(this.report)) return;
    this.report = report;
    if (!this.explanation()) this.selected = null;
    this.section.hidden = report.explanations.length === 0;
    this.list.replaceChildren(...report.explanations.map((explanation) => make("li", {}, this.entry(explanation))));
    this.redraw();
  }

  /** @param {Explanation} explanation */
  entry({ change, estimates, explains, gain }) {
    const button = make("button", { type: "button" });
    button.dataset.change = change;
    const values = estimates.map(format.estimateText).join(", ");
    const texts = [`${change.replaceAll("_", " ")}: ${values}`, `${explains} more readings agree`, `gain ${gain.toFixed(0)}`];
    for (const textContent of texts) button.append(make("span", { textContent }));
    button.addEventListener("click", () => {
      this.selected = this.selected === change ? null : change;
      if (this.selected && !this.scan()) this.callbacks.show(this.report.scan);
      this.redraw();
    });
    return button;
  }

  redraw() {
    for (const button of this.list.querySelectorAll("button")) button.ariaPressed = String(button.dataset.change === this.selected);
    this.preview.hidden = !this.proposal();
    this.plan.drawOver();
    this.plan.onView();
  }

  /** Selected hypothesis, if it is still reported. @returns {Explanation | undefined} */
  explanation() {
    return this.report.explanations.find(({ change }) => change === this.selected);
  }

  /** Scan that the report is about, if it or its successor is shown. */
  scan() {
    return [this.plan.scan, this.plan.scan?.previous].find((scan) => scan?.id === this.report.scan);
  }

  /** Pose under the selected hypothesis; `null` if it does not move the robot. */
  pose() {
    const [explanation, scan] = [this.explanation(), this.scan()];
    if (!explanation || !scan) return null;
    const by = Object.fromEntries(explanation.estimates.map(({ name, value }) => [name, value]));
    const pose = { ...scan.start.pose };
    const moved = ["x_m", "y_m", "heading_deg"].filter((key) => key in by);
    for (const key of moved) pose[key] += by[key];
    return moved.length ? pose : null;
  }

  /** Function that applies the selected hypothesis to the settings of the next scan; `null` if no setting expresses it. */
  proposal() {
    const explanation = this.explanation();
    if (!explanation) return null;
    const valueOf = (/** @type {string} */ name) => explanation.estimates.find((estimate) => estimate.name === name)?.value;
    const [pose, percent, db] = [this.pose(), valueOf("percent"), valueOf("threshold_db")];
    if (!pose && percent === undefined && db === undefined) return null;
    return (/** @type {any} */ draft) => {
      if (pose) draft.pose = { x_m: rounded(pose.x_m, 4), y_m: rounded(pose.y_m, 4), heading_deg: rounded(pose.heading_deg, 2) };
      // The speed of sound is proportional to the square root of the absolute temperature.
      if (percent !== undefined) draft.air.temperature_c = rounded((draft.air.temperature_c + ZERO_C) * (1 + percent / 100) ** 2 - ZERO_C, 2);
      if (db !== undefined) draft.sensor.threshold = rounded(draft.sensor.threshold * 10 ** (db / 20), 6);
    };
  }

  propose() {
    const change = this.proposal();
    if (change) this.callbacks.propose(change);
  }

  /** @param {any} layer @param {any} plan */
  drawOver(layer, plan) {
    const [explanation, scan] = [this.explanation(), this.scan()];
    if (!explanation || !scan) return;
    const pose = this.pose();
    if (pose) plan.drawRobot(pose, "hypothesis", "hypothesis");
    const id = explanation.change.startsWith("wall ") && explanation.change.slice("wall ".length);
    const wall = plan.sceneFits() ? plan.scene.walls.find((/** @type {any} */ wall) => wall.id === id) : null;
    if (wall) drawMoved(layer, plan, wall, scan.start.pose, explanation.estimates[0].value);
  }
}

/** Draws a wall displaced by `offset_m` along its normal, away from the ranger. */
function drawMoved(layer, { view, palette }, { from, to }, pose, offset_m) {
  const along = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(...along);
  const side = along[0] * (pose.y_m - from[1]) - along[1] * (pose.x_m - from[0]) > 0 ? 1 : -1;
  const [dx, dy] = [(side * offset_m * along[1]) / length, (-side * offset_m * along[0]) / length];
  const c = layer.pen("hypothesis", palette);
  line(c, [from, to].map(([x, y]) => view.px([x + dx, y + dy])));
  const [x, y] = view.px([(from[0] + to[0]) / 2 + dx, (from[1] + to[1]) / 2 + dy]);
  c.setLineDash([]);
  arrow(c, [x, y], Math.atan2(-dy, dx), [8, 0, 4]);
}
