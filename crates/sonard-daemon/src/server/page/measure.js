// Length measurement on the floor plan, by two clicks or by keys. Points snap to wall ends and readings.

import { drawLength, line } from "./layers.js";
import { setText } from "./format.js";

/** Snap distance, pixels. */
const SNAP_PX = 9;
const STEP_PX = 10;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const HINT = "Click two points, or place them with arrow keys and Enter. Escape ends.";

export class Measure {
  /**
   * @param {any} plan
   * @param {HTMLElement} output element that shows the length
   * @param {(on: boolean) => void} onToggle
   */
  constructor(plan, output, onToggle) {
    this.plan = plan;
    this.output = output;
    this.onToggle = onToggle;
    this.on = false;
    /** End points placed so far, metres. @type {number[][]} */
    this.ends = [];
    /** Position of the next end point, pixels. @type {number[] | null} */
    this.cursor = null;
  }

  toggle(on = !this.on) {
    [this.on, this.ends, this.cursor] = [on, [], null];
    this.output.hidden = !on;
    setText(this.output, on ? HINT : "");
    this.onToggle(on);
    this.redraw();
  }

  redraw() {
    this.plan.drawOver();
    this.plan.onView();
  }

  /** @param {number[]} px */
  click(px) {
    if (this.ends.length === 2) this.ends = [];
    this.ends.push(this.plan.snap(px, SNAP_PX));
    setText(this.output, this.ends.length === 2 ? this.describe() : "Choose the second point");
    this.redraw();
  }

  /** @param {number[]} px */
  hover(px) {
    this.cursor = px;
    if (this.ends.length === 1) this.redraw();
  }

  /** Handles a key; returns `false` if the key has no meaning here. @param {KeyboardEvent} event */
  key({ key, shiftKey }) {
    const { width, height } = this.plan.view;
    const cursor = this.cursor ?? [width / 2, height / 2];
    const along = KEYS[key];
    if (key === "Escape") this.toggle(false);
    else if (key === "Enter" || key === " ") this.click(cursor);
    else if (along) {
      const step = shiftKey ? 1 : STEP_PX;
      this.cursor = [cursor[0] + step * along[0], cursor[1] + step * along[1]];
      this.redraw();
    } else return false;
    return true;
  }

  /** Length, direction and components as text. */
  describe() {
    const [[x, y], [u, v]] = this.ends;
    const signed = (m) => `${m < 0 ? "−" : "+"}${Math.abs(m).toFixed(3)}`;
    const direction_deg = (Math.atan2(v - y, u - x) * 180) / Math.PI;
    return `${Math.hypot(u - x, v - y).toFixed(4)} m at ${((direction_deg + 360) % 360).toFixed(1)}°: x ${signed(u - x)}, y ${signed(v - y)} m`;
  }

  /** @param {any} layer @param {any} palette */
  draw(layer, palette) {
    const { view } = this.plan;
    const points = this.ends.map((end) => view.px(end));
    if (this.cursor && points.length < 2) points.push(view.px(this.plan.snap(this.cursor, SNAP_PX)));
    if (!this.on || !points.length) return;
    const c = layer.pen("measure", palette);
    const [from, to] = points;
    if (to) drawLength(c, from, to);
    else for (const [dx, dy] of [[8, 0], [0, 8]]) line(c, [[from[0] - dx, from[1] - dy], [from[0] + dx, from[1] + dy]]);
    if (!to) return;
    const [[x, y], [u, v]] = [view.world(from), view.world(to)];
    drawLabel(c, [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2], `${Math.hypot(u - x, v - y).toFixed(3)} m`, palette);
  }
}

/** Draws text on an opaque background. */
function drawLabel(c, [x, y], text, palette) {
  c.font = "600 12px system-ui, sans-serif";
  const half = c.measureText(text).width / 2 + 4;
  const ink = c.fillStyle;
  c.fillStyle = palette["--panel"];
  c.fillRect(x - half, y - 9, 2 * half, 18);
  c.fillStyle = ink;
  [c.textAlign, c.textBaseline] = ["center", "middle"];
  c.fillText(text, x, y);
}
