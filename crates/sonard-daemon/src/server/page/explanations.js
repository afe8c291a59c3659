// What the readings of the last scan would be better explained by, as the daemon says: in words, on the plan where it
// is a wall or a pose, and as a scan that the model can be asked for.

import { make } from "./dom.js";
import { arrow, line } from "./pens.js";
import { rounded } from "./ranger.js";
import * as words from "./words.js";

const ZERO_C = 273.15;

/** @typedef {{change: string, estimates: {name: string, value: number, sigma: number}[], gain: number, explains: number}} Explanation */

export class Explanations {
  /**
   * @param {HTMLElement} section
   * @param {any} plan
   * @param {{show: (scan: string) => void, propose: (change: (draft: any) => void) => void}} uses
   */
  constructor(section, plan, uses) {
    this.section = section;
    this.plan = plan;
    this.uses = uses;
    /** What the daemon said last, of which scan. @type {{scan: string, explanations: Explanation[]}} */
    this.told = { scan: "", explanations: [] };
    /** Which change is drawn. @type {string | null} */
    this.chosen = null;
    this.list = make("ul", { id: "better-list", className: "peaks" });
    this.hint = make("p", { className: "hint", textContent: "± is one standard deviation, gain the logarithm of how much likelier all readings become." });
    this.preview = make("button", { type: "button", id: "better-preview", textContent: "Preview", hidden: true });
    this.preview.addEventListener("click", () => this.propose());
    section.append(make("h3", { textContent: "What would explain the last scan better" }), this.list, make("p", { className: "row" }, this.preview, this.hint));
    plan.overlays.push(this);
  }

  /** Takes up what the daemon says of the last scan. @param {any} health */
  tell({ fit }) {
    const told = { scan: fit?.scan ?? "", explanations: fit?.explanations ?? [] };
    if (JSON.stringify(told) === JSON.stringify(this.told)) return;
    this.told = told;
    if (!this.explanation()) this.chosen = null;
    this.section.hidden = told.explanations.length === 0;
    this.list.replaceChildren(...told.explanations.map((one) => make("li", {}, this.entry(one))));
    this.mark();
  }

  /** @param {Explanation} one */
  entry(one) {
    const button = make("button", { type: "button" });
    button.dataset.change = one.change;
    const by = one.estimates.map(words.estimate).join(", ");
    const texts = [`${one.change.replaceAll("_", " ")} by ${by}`, `explains ${one.explains} readings more`, `gain ${one.gain.toFixed(0)}`];
    for (const textContent of texts) button.append(make("span", { textContent }));
    button.addEventListener("click", () => {
      this.chosen = this.chosen === one.change ? null : one.change;
      if (this.chosen && !this.scan()) this.uses.show(this.told.scan);
      this.mark();
    });
    return button;
  }

  mark() {
    for (const button of this.list.querySelectorAll("button")) button.ariaPressed = String(button.dataset.change === this.chosen);
    this.preview.hidden = !this.proposal();
    this.plan.drawOver();
    this.plan.onView();
  }

  /** The one that is chosen, if it is still told. @returns {Explanation | undefined} */
  explanation() {
    return this.told.explanations.find(({ change }) => change === this.chosen);
  }

  /** The scan that it is of, while it or the next one is shown. */
  scan() {
    return [this.plan.scan, this.plan.scan?.before].find((scan) => scan?.id === this.told.scan);
  }

  /** Where the robot would stand, of a change of that. */
  pose() {
    const [one, scan] = [this.explanation(), this.scan()];
    if (!one || !scan) return null;
    const by = Object.fromEntries(one.estimates.map(({ name, value }) => [name, value]));
    const pose = { ...scan.start.pose };
    const moved = ["x_m", "y_m", "heading_deg"].filter((key) => key in by);
    for (const key of moved) pose[key] += by[key];
    return moved.length ? pose : null;
  }

  /** What the model can be asked about: the chosen change in what the next scan is taken by. */
  proposal() {
    const one = this.explanation();
    if (!one) return null;
    const of = (/** @type {string} */ name) => one.estimates.find((estimate) => estimate.name === name)?.value;
    const [pose, percent, db] = [this.pose(), of("percent"), of("threshold_db")];
    if (!pose && percent === undefined && db === undefined) return null;
    return (/** @type {any} */ draft) => {
      if (pose) draft.pose = { x_m: rounded(pose.x_m, 4), y_m: rounded(pose.y_m, 4), heading_deg: rounded(pose.heading_deg, 2) };
      // The speed of sound grows with the root of the absolute temperature.
      if (percent !== undefined) draft.air.temperature_c = rounded((draft.air.temperature_c + ZERO_C) * (1 + percent / 100) ** 2 - ZERO_C, 2);
      if (db !== undefined) draft.sensor.threshold = rounded(draft.sensor.threshold * 10 ** (db / 20), 6);
    };
  }

  propose() {
    const change = this.proposal();
    if (change) this.uses.propose(change);
  }

  /** @param {any} layer @param {any} plan */
  drawOver(layer, plan) {
    const [one, scan] = [this.explanation(), this.scan()];
    if (!one || !scan) return;
    const pose = this.pose();
    if (pose) plan.drawRobot(pose, "better", "better");
    const id = one.change.startsWith("wall ") && one.change.slice("wall ".length);
    const wall = plan.sceneFits() ? plan.scene.walls.find((/** @type {any} */ wall) => wall.id === id) : null;
    if (wall) drawMoved(layer, plan, wall, scan.start.pose, one.estimates[0].value);
  }
}

/** A wall where it would be: by so much away from where the ranger is. */
function drawMoved(layer, { view, palette }, { from, to }, pose, offset_m) {
  const along = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(...along);
  const side = along[0] * (pose.y_m - from[1]) - along[1] * (pose.x_m - from[0]) > 0 ? 1 : -1;
  const [dx, dy] = [(side * offset_m * along[1]) / length, (-side * offset_m * along[0]) / length];
  const c = layer.pen("better", palette);
  line(c, [from, to].map(([x, y]) => view.px([x + dx, y + dy])));
  const [x, y] = view.px([(from[0] + to[0]) / 2 + dx, (from[1] + to[1]) / 2 + dy]);
  c.setLineDash([]);
  arrow(c, [x, y], Math.atan2(-dy, dx), [8, 0, 4]);
}
