// Scans over time: a waterfall of all beams, a row a scan, and the ranges of the selected beam as a series.

import { make } from "./dom.js";
import { upright } from "./pens.js";
import { clock, count, degrees, metres, setText } from "./words.js";

/** Rows that are kept, and columns: beams beyond those share one. */
const ROWS = 200, COLUMNS = 1024;
/** Scans of the log that rows are made of when somebody looks, and the most beams of them. */
const PAST = 40, PAST_BEAMS = 4000;
const ROW_PX = 4, LEFT = 46, RIGHT = 10, FOOT = 18;
const SERIES_PX = 110, TOP = 8;
const FONT = "11px system-ui, sans-serif";
/** From near to far: dark to light, told apart also without colours. */
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

export class Waterfall {
  /**
   * @param {HTMLDetailsElement} details
   * @param {{get: (id: string) => Promise<any>, known: () => any[], onPick: (scan: string, index: number) => void}} uses
   */
  constructor(details, uses) {
    this.uses = uses;
    this.details = details;
    this.canvas = make("canvas", { id: "waterfall", role: "img", ariaLabel: "Ranges of all beams, a row a scan, the newest above" });
    this.series = make("canvas", { id: "series", role: "img", ariaLabel: "Ranges of the selected beam over time" });
    this.told = make("p", { id: "series-now", className: "hint" });
    details.append(make("summary", { textContent: "Scans over time" }), make("p", { className: "ramp hint" }), this.canvas, this.told, this.series);
    /** Newest first. @type {{id: string, time: number, planned: number, ranges: Float32Array, plan: any}[]} */
    this.rows = [];
    this.selected = null;
    this.palette = null;
    this.most_m = 1;
    this.filling = false;
    this.due = null;
    details.addEventListener("toggle", () => this.fill());
    this.canvas.addEventListener("click", (event) => this.pick([event.offsetX, event.offsetY]));
    new ResizeObserver(() => this.redrawSoon()).observe(details);
  }

  /** A scan that begins, or that the log has. @param {any} scan @returns {any} */
  row(scan) {
    const known = this.rows.find(({ id }) => id === scan.id);
    if (known) return known;
    const ranges = new Float32Array(Math.min(COLUMNS, Math.max(1, scan.planned))).fill(NaN);
    const row = { id: scan.id, time: Date.parse(scan.start.time), planned: scan.planned, ranges, plan: scan.start.plan };
    const place = this.rows.findIndex(({ time }) => time <= row.time);
    this.rows.splice(place < 0 ? this.rows.length : place, 0, row);
    this.rows.length = Math.min(this.rows.length, ROWS);
    return row;
  }

  /** @param {any} scan @param {any[]} pings */
  add(scan, pings) {
    const { ranges, planned } = this.row(scan);
    // Silence is a range beyond all others.
    for (const { index, range_m } of pings) ranges[Math.floor((index / planned) * ranges.length)] = range_m ?? Infinity;
    this.redrawSoon();
  }

  select(ping) {
    this.selected = ping;
    this.redrawSoon();
  }

  /** Scans of before, one after the other, while somebody looks. */
  async fill() {
    this.redrawSoon();
    if (this.filling || !this.details.open) return;
    this.filling = true;
    for (const { scan, end } of this.uses.known().slice(0, PAST)) {
      const known = this.rows.some(({ id }) => id === scan);
      if (!this.details.open) break;
      if (known || !end || end.beams > PAST_BEAMS) continue;
      const whole = await this.uses.get(scan).catch(() => null);
      if (whole) this.add(whole, [...whole.beams.values()]);
    }
    this.filling = false;
  }

  /** @param {any} [palette] */
  redrawSoon(palette = this.palette) {
    this.palette = palette;
    if (!this.details.open || !palette) return;
    this.due ??= setTimeout(() => {
      this.due = null;
      this.redraw();
    }, 100);
  }

  redraw() {
    const farthest = this.rows.flatMap(({ ranges }) => ranges.reduce((most, m) => (m > most && m < Infinity ? m : most), 0));
    this.most_m = Math.max(0.5, ...farthest);
    setText(this.details.querySelector(".ramp"), `a row a scan, the newest above; dark is near, light is ${metres(this.most_m)}, empty is silent`);
    const c = this.size(this.canvas, ROW_PX * Math.max(8, this.rows.length) + FOOT);
    this.drawRows(c);
    this.drawSeries(this.size(this.series, SERIES_PX));
  }

  /** The context of a canvas that is made so high. */
  size(canvas, height) {
    canvas.style.height = `${height}px`;
    this.width = canvas.clientWidth;
    [canvas.width, canvas.height] = [Math.round(this.width * devicePixelRatio), Math.round(height * devicePixelRatio)];
    const c = canvas.getContext("2d");
    c.scale(devicePixelRatio, devicePixelRatio);
    [c.font, c.textBaseline] = [FONT, "middle"];
    return c;
  }

  drawRows(c) {
    const across = this.width - LEFT - RIGHT;
    c.imageSmoothingEnabled = false;
    this.rows.forEach((row, i) => {
      const image = new OffscreenCanvas(row.ranges.length, 1);
      const look = image.getContext("2d");
      const data = look.createImageData(row.ranges.length, 1);
      row.ranges.forEach((m, at) => data.data.set(this.colour(m), 4 * at));
      look.putImageData(data, 0, 0);
      c.drawImage(image, LEFT, i * ROW_PX, across, ROW_PX);
    });
    const bottom = ROW_PX * Math.max(8, this.rows.length);
    c.fillStyle = this.palette["--quiet"];
    const [newest] = this.rows;
    if (!newest) return c.fillText("no scan yet", LEFT, 10);
    const { from_deg, to_deg } = newest.plan;
    for (const share of [0, 0.25, 0.5, 0.75, 1]) {
      c.textAlign = share === 1 ? "right" : share === 0 ? "left" : "center";
      c.fillText(degrees(from_deg + share * (to_deg - from_deg)), LEFT + share * across, bottom + FOOT / 2);
    }
    c.textAlign = "right";
    for (let i = 0; i < this.rows.length; i += 10) c.fillText(i ? `−${i}` : "newest", LEFT - 4, i * ROW_PX + 6);
    if (this.selected) upright(c, this.x(this.selected.index, newest.planned), [0, bottom], this.palette["--path"]);
  }

  /** Of a range; nothing is drawn where nothing was measured or heard. @returns {number[]} */
  colour(range_m) {
    if (!(range_m < Infinity)) return [0, 0, 0, 0];
    const at = Math.min(0.9999, range_m / this.most_m) * (RAMP.length - 1);
    const [from, to] = [RAMP[Math.floor(at)], RAMP[Math.floor(at) + 1]];
    return [...from.map((value, i) => value + (at % 1) * (to[i] - value)), 255];
  }

  x(index, planned) {
    return LEFT + ((index + 0.5) / planned) * (this.width - LEFT - RIGHT);
  }

  /** The selected beam's range in each row that has the same plan as the newest. */
  values() {
    const [newest] = this.rows;
    if (!this.selected || !newest) return [];
    const same = this.rows.filter(({ planned }) => planned === newest.planned);
    const value = ({ ranges, planned, time, id }) => ({ id, time, m: ranges[Math.floor((this.selected.index / planned) * ranges.length)] });
    return same.map(value).filter(({ m }) => !Number.isNaN(m)).reverse();
  }

  drawSeries(c) {
    const values = this.values();
    const heard = values.filter(({ m }) => m < Infinity);
    setText(this.told, this.inWords(values, heard));
    if (!heard.length) return;
    const all = heard.map(({ m }) => m);
    const [least, most] = [Math.min(...all), Math.max(...all)];
    const room = Math.max(0.001, 0.1 * (most - least));
    const [low, high] = [least - room, most + room];
    const y = (m) => TOP + ((high - m) / (high - low)) * (SERIES_PX - TOP - FOOT);
    const x = (i) => LEFT + ((i + 0.5) / values.length) * (this.width - LEFT - RIGHT);
    c.strokeStyle = this.palette["--rule"];
    c.fillStyle = this.palette["--quiet"];
    c.textAlign = "right";
    for (const m of [least, most]) {
      c.beginPath();
      c.moveTo(LEFT, y(m));
      c.lineTo(this.width - RIGHT, y(m));
      c.stroke();
      if (m === least || most - least > 0) c.fillText(m.toFixed(4), LEFT - 4, y(m));
    }
    values.forEach(({ m }, i) => {
      c.fillStyle = this.palette[m < Infinity ? "--direct" : "--silent"];
      c.beginPath();
      c.arc(x(i), m < Infinity ? y(m) : SERIES_PX - FOOT - 3, 2.4, 0, 2 * Math.PI);
      c.fill();
    });
    c.fillStyle = this.palette["--quiet"];
    c.textAlign = "left";
    c.fillText(clock(values[0].time), LEFT, SERIES_PX - FOOT / 2);
    c.textAlign = "right";
    if (values.length > 1) c.fillText(clock(values.at(-1).time), this.width - RIGHT, SERIES_PX - FOOT / 2);
  }

  inWords(values, heard) {
    if (!this.selected) return "Select a beam to see its ranges over time.";
    const name = `Beam ${this.selected.index} in ${count(values.length, "scan")}`;
    if (!heard.length) return `${name}: no range.`;
    const mean = heard.reduce((sum, { m }) => sum + m, 0) / heard.length;
    const sigma = Math.sqrt(heard.reduce((sum, { m }) => sum + (m - mean) ** 2, 0) / Math.max(1, heard.length - 1));
    const silent = values.length - heard.length;
    return `${name}: mean ${metres(mean)}, standard deviation ${(1e3 * sigma).toFixed(2)} mm${silent ? `, silent in ${silent}` : ""}.`;
  }

  /** The scan of a row, and the beam of a column. */
  pick([x, y]) {
    const row = this.rows[Math.floor(y / ROW_PX)];
    if (!row) return;
    const share = Math.max(0, Math.min(0.9999, (x - LEFT) / (this.width - LEFT - RIGHT)));
    this.uses.onPick(row.id, Math.floor(share * row.planned));
  }
}
