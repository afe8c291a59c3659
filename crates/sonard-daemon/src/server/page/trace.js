// Echo trace of a beam: predicted envelope and detection threshold (dB) versus range, with measured echoes.

import { arrow, drawVertical, line } from "./layers.js";
import { inUnit, unitName } from "./format.js";

/** @import { Beam, Peak, Trace } from "../../../../../web/playground/engine.js" */

const LEFT = 44, RIGHT = 10, TOP = 18, BOTTOM = 24;
const MAX_DB = 6, MIN_DB = -60;
const HIT_PX = 20;
const FONT = "11px system-ui, sans-serif";

export class EchoTrace {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(peak: Peak) => void} onPick
   */
  constructor(canvas, onPick) {
    this.canvas = canvas;
    this.c = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.width = 0;
    this.height = 0;
    /** @type {Beam | null} */
    this.beam = null;
    /** @type {Peak | null} */
    this.selected = null;
    /** @type {Record<string, string> | null} */
    this.palette = null;
    /** Time after firing up to which the trace is emphasized, microseconds; `null` for all of it. @type {number | null} */
    this.cursor_us = null;
    this.onPick = onPick;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("click", (event) => this.pick(event.offsetX));
  }

  /**
   * @param {Beam | null} beam
   * @param {Peak | null} selected
   */
  show(beam, selected = null) {
    [this.beam, this.selected] = [beam, selected];
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
    if (this.cursor_us !== null) this.drawCursor(palette, this.cursor_us * trace.m_per_us);
    for (const peak of peaks) this.drawPeak(palette, peak);
    for (const echo of this.beam.echoes ?? []) this.drawEcho(palette, echo);
    if (reading.range_m !== null) this.drawRange(reading.range_m, palette["--wall"]);
    this.drawLegend(palette);
  }

  get max_m() {
    const trace = this.beam?.trace;
    return trace ? Math.max(trace.envelope.length - 1, 1) * trace.step_us * trace.m_per_us || 1 : 1;
  }

  /** @param {number} m */
  x(m) {
    return LEFT + (m / this.max_m) * (this.width - LEFT - RIGHT);
  }

  /** @param {number} level of amplitude */
  y(level) {
    const db = level > 0 ? Math.max(MIN_DB, Math.min(MAX_DB, 20 * Math.log10(level))) : MIN_DB;
    return TOP + ((MAX_DB - db) / (MAX_DB - MIN_DB)) * (this.height - TOP - BOTTOM);
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
    c.fillStyle = palette["--muted"];
    for (const db of [0, -20, -40, -60]) {
      const y = Math.round(this.y(10 ** (db / 20))) + 0.5;
      c.beginPath();
      c.moveTo(LEFT, y);
      c.lineTo(right, y);
      c.stroke();
      c.fillText(db ? `−${-db}` : "0 dB", LEFT - 5, y);
    }
    const max = inUnit(this.max_m);
    const step = niceStep(max / Math.max(2, (right - LEFT) / 52));
    c.textAlign = "center";
    for (let i = 0; i * step <= max + 1e-9; i++) {
      const x = this.x((i * step * this.max_m) / max);
      if (x < right - 14) c.fillText(String(Number((i * step).toFixed(2))), x, this.height - 10);
    }
    c.textAlign = "right";
    c.fillText(unitName(), right, this.height - 10);
  }

  /**
   * @param {Record<string, string>} palette
   * @param {Trace} trace
   */
  drawBlanking(palette, trace) {
    const { c } = this;
    const end = Math.min(this.x(trace.blanking_us * trace.m_per_us), this.width - RIGHT);
    c.fillStyle = palette["--grid"];
    c.fillRect(LEFT, TOP, end - LEFT, this.height - TOP - BOTTOM);
    if (end - LEFT < 60) return;
    c.fillStyle = palette["--muted"];
    c.textAlign = "left";
    c.fillText("blanking", LEFT + 4, TOP + 8);
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
   * @param {Peak} peak
   */
  drawPeak(palette, peak) {
    const { c } = this;
    const x = this.x(peak.range_m);
    if (x > this.width - RIGHT) return;
    const selected = peak === this.selected;
    c.fillStyle = palette[selected ? "--path" : "--muted"];
    const half = selected ? 5 : 3;
    c.beginPath();
    c.moveTo(x, this.height - BOTTOM);
    c.lineTo(x - half, this.height - BOTTOM + 2 * half);
    c.lineTo(x + half, this.height - BOTTOM + 2 * half);
    c.fill();
  }

  /** Fades what is to come. @param {Record<string, string>} palette @param {number} range_m */
  drawCursor(palette, range_m) {
    const [x, right] = [this.x(range_m), this.width - RIGHT];
    [this.c.fillStyle, this.c.globalAlpha] = [palette["--panel"], 0.72];
    if (x < right) this.c.fillRect(x, TOP, right - x, this.height - TOP - BOTTOM);
    this.c.globalAlpha = 1;
    drawVertical(this.c, Math.min(x, right), [TOP, this.height - BOTTOM], palette["--path"]);
  }

  /** @param {number} range_m @param {string} colour */
  drawRange(range_m, colour) {
    const x = this.x(range_m);
    if (x <= this.width - RIGHT) drawVertical(this.c, x, [TOP, this.height - BOTTOM], colour);
  }

  /** Draws an echo measured by the comparator, above the trace. @param {Record<string, string>} palette @param {{range_m: number | null}} echo */
  drawEcho(palette, { range_m }) {
    const x = range_m === null ? Infinity : this.x(range_m);
    if (x > this.width - RIGHT) return;
    this.c.fillStyle = palette["--ray"];
    arrow(this.c, [x, TOP + 4], Math.PI / 2, [5, 4, 4]);
  }

  /** Draws the legend with the symbols of the plot. @param {Record<string, string>} palette */
  drawLegend(palette) {
    const { c } = this;
    const across = (/** @type {number} */ x, /** @type {number[]} */ dash) => {
      c.setLineDash(dash);
      c.lineWidth = 1.4;
      line(c, [[x, 9], [x + 14, 9]]);
      c.setLineDash([]);
    };
    /** @type {[string, string, (x: number, colour: string) => void][]} */
    const entries = [
      ["envelope", "--direct", (x) => across(x, [])],
      ["threshold", "--min-range", (x) => across(x, [5, 4])],
      ["reading", "--wall", (x, colour) => drawVertical(c, x + 7, [3, 15], colour)],
      ["arrival", "--muted", (x) => arrow(c, [x + 7, 9], -Math.PI / 2, [3, 3, 3])],
    ];
    if (this.beam?.echoes?.length) entries.push(["echo", "--ray", (x) => arrow(c, [x + 7, 9], Math.PI / 2, [5, 4, 4])]);
    let x = 8;
    for (const [text, name, drawSymbol] of entries) {
      c.strokeStyle = c.fillStyle = palette[name];
      drawSymbol(x, palette[name]);
      [c.fillStyle, c.textAlign] = [palette["--muted"], "left"];
      c.fillText(text, x + 17, 9);
      x += 27 + c.measureText(text).width;
    }
  }

  /** @param {number} x */
  pick(x) {
    const distance = (/** @type {Peak} */ peak) => Math.abs(this.x(peak.range_m) - x);
    const nearest = (this.beam?.peaks ?? []).reduce(
      (a, b) => (a && distance(a) <= distance(b) ? a : b),
      /** @type {Peak | null} */ (null),
    );
    if (nearest && distance(nearest) <= HIT_PX) this.onPick(nearest);
  }
}

/** Least step of the series 1, 2, 5 that is at least `min`. @param {number} min */
function niceStep(min) {
  const decade = 10 ** Math.floor(Math.log10(min));
  return (/** @type {number} */ ([1, 2, 5, 10].find((factor) => factor * decade >= min - 1e-12)) ?? 10) * decade;
}
