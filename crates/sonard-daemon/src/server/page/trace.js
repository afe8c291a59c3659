// The echo trace of a beam, as an oscilloscope would show it: envelope and threshold against range, in decibels.

import { arrow, upright } from "./pens.js";

const LEFT = 44, RIGHT = 10, TOP = 18, BOTTOM = 24;
const TOP_DB = 6, LEAST_DB = -60;
const STEPS_M = [0.05, 0.1, 0.2, 0.5, 1, 2, 5];
const HIT_PX = 20;
const FONT = "11px system-ui, sans-serif";

export class EchoTrace {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(peak: import("../../../web/playground/engine.js").Peak) => void} onPick
   */
  constructor(canvas, onPick) {
    this.canvas = canvas;
    this.c = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.width = 0;
    this.height = 0;
    /** @type {import("../../../web/playground/engine.js").Beam | null} */
    this.beam = null;
    /** @type {import("../../../web/playground/engine.js").Peak | null} */
    this.chosen = null;
    /** @type {Record<string, string> | null} */
    this.palette = null;
    this.onPick = onPick;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("click", (event) => this.pick(event.offsetX));
  }

  /**
   * @param {import("../../../web/playground/engine.js").Beam | null} beam
   * @param {import("../../../web/playground/engine.js").Peak | null} chosen
   */
  show(beam, chosen = null) {
    [this.beam, this.chosen] = [beam, chosen];
    this.redraw();
  }

  resize() {
    const scale = devicePixelRatio;
    [this.width, this.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.canvas.width = Math.round(this.width * scale);
    this.canvas.height = Math.round(this.height * scale);
    this.c.setTransform(scale, 0, 0, scale, 0, 0);
    this.redraw();
  }

  redraw(palette = this.palette) {
    this.palette = palette;
    if (!this.width || !palette) return;
    this.c.clearRect(0, 0, this.width, this.height);
    this.drawAxes(palette);
    if (!this.beam) return;
    const { trace, peaks, reading } = this.beam;
    this.drawBlanking(palette, trace);
    this.drawLine(trace.threshold, palette["--min-range"], [5, 4]);
    this.drawLine(trace.envelope, palette["--direct"], []);
    for (const peak of peaks) this.drawPeak(palette, peak);
    for (const echo of this.beam.echoes ?? []) this.drawEcho(palette, echo);
    if (reading.range_m !== null) this.drawRange(reading.range_m, palette["--wall"]);
    this.drawWords(palette);
  }

  get until_m() {
    const trace = this.beam?.trace;
    return trace ? Math.max(trace.envelope.length - 1, 1) * trace.step_us * trace.m_per_us || 1 : 1;
  }

  /** @param {number} m */
  x(m) {
    return LEFT + (m / this.until_m) * (this.width - LEFT - RIGHT);
  }

  /** @param {number} level of amplitude */
  y(level) {
    const db = level > 0 ? Math.max(LEAST_DB, Math.min(TOP_DB, 20 * Math.log10(level))) : LEAST_DB;
    return TOP + ((TOP_DB - db) / (TOP_DB - LEAST_DB)) * (this.height - TOP - BOTTOM);
  }

  /** @param {Record<string, string>} palette */
  drawAxes(palette) {
    const { c } = this;
    const right = this.width - RIGHT;
    c.setLineDash([]);
    c.lineWidth = 1;
    c.font = FONT;
    c.textBaseline = "middle";
    c.textAlign = "right";
    c.strokeStyle = palette["--grid"];
    c.fillStyle = palette["--quiet"];
    for (const db of [0, -20, -40, -60]) {
      const y = Math.round(this.y(10 ** (db / 20))) + 0.5;
      c.beginPath();
      c.moveTo(LEFT, y);
      c.lineTo(right, y);
      c.stroke();
      c.fillText(db ? `−${-db}` : "0 dB", LEFT - 5, y);
    }
    const step = STEPS_M.find((m) => this.until_m / m <= Math.max(2, (right - LEFT) / 52)) ?? 5;
    c.textAlign = "center";
    for (let i = 0; i * step <= this.until_m + 1e-9; i++) {
      const [x, m] = [this.x(i * step), i * step];
      if (x < right - 14) c.fillText(String(Number(m.toFixed(2))), x, this.height - 10);
    }
    c.textAlign = "right";
    c.fillText("m", right, this.height - 10);
  }

  /**
   * @param {Record<string, string>} palette
   * @param {import("../../../web/playground/engine.js").Trace} trace
   */
  drawBlanking(palette, trace) {
    const { c } = this;
    const end = Math.min(this.x(trace.blanking_us * trace.m_per_us), this.width - RIGHT);
    c.fillStyle = palette["--grid"];
    c.fillRect(LEFT, TOP, end - LEFT, this.height - TOP - BOTTOM);
    if (end - LEFT < 40) return;
    c.fillStyle = palette["--quiet"];
    c.textAlign = "left";
    c.fillText("deaf", LEFT + 4, this.height - BOTTOM - 8);
  }

  /**
   * @param {number[]} levels
   * @param {string} colour
   * @param {number[]} dash
   */
  drawLine(levels, colour, dash) {
    const { c } = this;
    const across = (this.width - LEFT - RIGHT) / Math.max(1, levels.length - 1);
    c.strokeStyle = colour;
    c.lineWidth = 1.4;
    c.setLineDash(dash);
    c.beginPath();
    levels.forEach((level, i) => c.lineTo(LEFT + i * across, this.y(level)));
    c.stroke();
    c.setLineDash([]);
  }

  /**
   * @param {Record<string, string>} palette
   * @param {import("../../../web/playground/engine.js").Peak} peak
   */
  drawPeak(palette, peak) {
    const { c } = this;
    const x = this.x(peak.range_m);
    if (x > this.width - RIGHT) return;
    const chosen = peak === this.chosen;
    c.fillStyle = palette[chosen ? "--path" : "--quiet"];
    const half = chosen ? 5 : 3;
    c.beginPath();
    c.moveTo(x, this.height - BOTTOM);
    c.lineTo(x - half, this.height - BOTTOM + 2 * half);
    c.lineTo(x + half, this.height - BOTTOM + 2 * half);
    c.fill();
  }

  /** @param {number} range_m @param {string} colour */
  drawRange(range_m, colour) {
    const x = this.x(range_m);
    if (x <= this.width - RIGHT) upright(this.c, x, [TOP, this.height - BOTTOM], colour);
  }

  /** What the ranger's comparator told, above the trace. @param {Record<string, string>} palette @param {{range_m: number | null}} echo */
  drawEcho(palette, { range_m }) {
    const x = range_m === null ? Infinity : this.x(range_m);
    if (x > this.width - RIGHT) return;
    this.c.fillStyle = palette["--ray"];
    arrow(this.c, [x, TOP + 4], Math.PI / 2, [5, 4, 4]);
  }

  /** What each line is. @param {Record<string, string>} palette */
  drawWords(palette) {
    const { c } = this;
    const words = [
      ["envelope", "--direct"],
      ["threshold", "--min-range"],
      ["reading", "--wall"],
    ];
    if (this.beam?.echoes?.length) words.push(["echoes", "--ray"]);
    c.textAlign = "left";
    let x = LEFT;
    for (const [text, colour] of words) {
      c.fillStyle = palette[colour];
      c.fillRect(x, 8, 12, 2);
      c.fillStyle = palette["--quiet"];
      c.fillText(text, x + 16, 9);
      x += 28 + c.measureText(text).width;
    }
  }

  /** @param {number} x */
  pick(x) {
    const off = (/** @type {import("../../../web/playground/engine.js").Peak} */ peak) => Math.abs(this.x(peak.range_m) - x);
    const nearest = (this.beam?.peaks ?? []).reduce(
      (one, other) => (one && off(one) <= off(other) ? one : other),
      /** @type {import("../../../web/playground/engine.js").Peak | null} */ (null),
    );
    if (nearest && off(nearest) <= HIT_PX) this.onPick(nearest);
  }
}
