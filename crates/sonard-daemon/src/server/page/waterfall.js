// Scans over time: waterfall of all beams, one row per scan, and the ranges of the selected beam as a series.

import { make } from "./dom.js";
import { drawVertical } from "./layers.js";
import { clock, count, degrees, distance, distanceFigure, setText, time as timeOfDay } from "./format.js";

/** Maximum numbers of rows and columns; adjacent beams share a column if a scan has more. */
const MAX_ROWS = 200, MAX_COLUMNS = 1024;
/** Scans loaded from the log when the section is opened, and the maximum number of beams of such a scan. */
const MAX_LOADED = 40, MAX_LOADED_BEAMS = 4000;
const ROW_PX = 4, LEFT = 62, RIGHT = 10, FOOT = 18, BAR = 18;
/** Least distance of two times at the left, and width of the colour bar, pixels. */
const TIME_PX = 14, BAR_PX = 120;
const SERIES_PX = 110, TOP = 8;
const FONT = "11px system-ui, sans-serif";
/** Viridis, from near (dark) to far (light); monotonic in lightness, so it needs no colour vision. */
const COLOUR_MAP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

export class Waterfall {
  /**
   * @param {HTMLDetailsElement} details
   * @param {{get: (id: string) => Promise<any>, known: () => any[], onPick: (scan: string, index: number) => void}} callbacks
   */
  constructor(details, callbacks) {
    this.callbacks = callbacks;
    this.details = details;
    this.canvas = make("canvas", { id: "waterfall", role: "img", ariaLabel: "Ranges of all beams, one row per scan, newest on top" });
    this.series = make("canvas", { id: "series", role: "img", ariaLabel: "Ranges of the selected beam over time" });
    this.caption = make("p", { className: "hint" });
    this.label = make("p", { id: "series-label", className: "hint" });
    details.append(make("summary", { textContent: "Scans over time" }), this.caption, this.canvas, this.label, this.series);
    /** Newest first. @type {{id: string, time: number, planned: number, ranges: Float32Array, plan: any, rangers?: string[]}[]} */
    this.rows = [];
    this.selected = null;
    this.palette = null;
    /** Range at the light end of the colour map, metres. */
    this.max_m = 1;
    this.loading = false;
    this.redrawTimer = null;
    details.addEventListener("toggle", () => this.load());
    this.canvas.addEventListener("click", (event) => this.pick([event.offsetX, event.offsetY]));
    new ResizeObserver(() => this.redrawSoon()).observe(details);
  }

  /** Row of a scan, inserted by time if missing. @param {any} scan @returns {any} */
  row(scan) {
    const existing = this.rows.find(({ id }) => id === scan.id);
    if (existing) return existing;
    const ranges = new Float32Array(Math.min(MAX_COLUMNS, Math.max(1, scan.planned))).fill(NaN);
    const rangers = scan.session?.array?.rangers?.map((ranger) => ranger.id);
    const row = { id: scan.id, time: Date.parse(scan.start.time), planned: scan.planned, ranges, plan: scan.start.plan, rangers };
    const at = this.rows.findIndex(({ time }) => time <= row.time);
    this.rows.splice(at < 0 ? this.rows.length : at, 0, row);
    this.rows.length = Math.min(this.rows.length, MAX_ROWS);
    return row;
  }

  /** @param {any} scan @param {any[]} pings */
  add(scan, pings) {
    const { ranges, planned } = this.row(scan);
    // A reading without echo is stored as infinity, a missing one as NaN.
    for (const { index, range_m } of pings) ranges[Math.floor((index / planned) * ranges.length)] = range_m ?? Infinity;
    this.redrawSoon();
  }

  select(ping) {
    this.selected = ping;
    this.redrawSoon();
  }

  /** Loads past scans one after the other while the section is open, or for a file. */
  async load(forFile = false) {
    this.redrawSoon();
    if ((this.loading && !forFile) || !(forFile || this.details.open)) return;
    this.loading = true;
    for (const { scan: id, end } of this.callbacks.known().slice(0, MAX_LOADED)) {
      if (!forFile && !this.details.open) break;
      if (this.rows.some((row) => row.id === id) || !end || end.beams > MAX_LOADED_BEAMS) continue;
      const scan = await this.callbacks.get(id).catch(() => null);
      if (scan) this.add(scan, [...scan.beams.values()]);
    }
    this.loading = false;
  }

  /** @param {any} [palette] */
  redrawSoon(palette = this.palette) {
    this.palette = palette;
    if (!this.details.open || !palette) return;
    this.redrawTimer ??= setTimeout(() => {
      this.redrawTimer = null;
      this.redraw();
    }, 100);
  }

  redraw() {
    const farthest = this.rows.flatMap(({ ranges }) => ranges.reduce((max, m) => (m > max && m < Infinity ? m : max), 0));
    this.max_m = Math.max(0.5, ...farthest);
    const known = this.callbacks.known().length;
    setText(this.caption, `${this.rows.length} of ${count(known, "scan")}, one row each, newest on top; blank: no echo`);
    const c = this.size(this.canvas, ROW_PX * Math.max(8, this.rows.length) + FOOT + BAR);
    this.drawRows(c);
    this.drawSeries(this.size(this.series, SERIES_PX));
  }

  /** Sets the height of a canvas and returns its context. */
  size(canvas, height) {
    canvas.style.height = `${height}px`;
    this.width = canvas.clientWidth;
    [canvas.width, canvas.height] = [Math.round(this.width * devicePixelRatio), Math.round(height * devicePixelRatio)];
    const c = canvas.getContext("2d");
    c.scale(devicePixelRatio, devicePixelRatio);
    [c.font, c.textBaseline] = [FONT, "middle"];
    return c;
  }

  /** Azimuths of all rows, degrees. */
  span() {
    const plans = this.rows.map(({ plan }) => plan);
    return [Math.min(...plans.map(({ from_deg }) => from_deg)), Math.max(...plans.map(({ to_deg }) => to_deg))];
  }

  /** Left and right end of a row, pixels: a ranger of an array has a column, another scan its azimuths. @param {any} row */
  extent({ plan, rangers }) {
    const [from_deg, to_deg] = rangers ? [plan.from_deg, plan.to_deg] : this.span();
    const px = (deg) => LEFT + ((deg - from_deg) / (to_deg - from_deg)) * (this.width - LEFT - RIGHT);
    return [px(plan.from_deg), px(plan.to_deg)];
  }

  drawRows(c) {
    c.imageSmoothingEnabled = false;
    let next = 0;
    this.rows.forEach((row, i) => {
      const image = new OffscreenCanvas(row.ranges.length, 1);
      const look = image.getContext("2d");
      const data = look.createImageData(row.ranges.length, 1);
      row.ranges.forEach((m, at) => data.data.set(this.colour(m), 4 * at));
      look.putImageData(data, 0, 0);
      const [from, to] = this.extent(row);
      c.drawImage(image, from, i * ROW_PX, to - from, ROW_PX);
      if (i * ROW_PX < next) return;
      next = i * ROW_PX + TIME_PX;
      [c.fillStyle, c.textAlign] = [this.palette["--muted"], "right"];
      c.fillText(timeOfDay(row.time), LEFT - 4, i * ROW_PX + 6);
    });
    const bottom = ROW_PX * Math.max(8, this.rows.length);
    c.fillStyle = this.palette["--muted"];
    const [newest] = this.rows;
    c.textAlign = "left";
    if (!newest) return c.fillText("no scan yet", LEFT, 10);
    this.drawAxis(c, newest, bottom + FOOT / 2);
    this.drawColourBar(c, bottom + FOOT);
    if (this.selected) drawVertical(c, this.x(newest), [0, bottom], this.palette["--path"]);
  }

  /** Labels the columns with azimuths, or with the rangers of an array. */
  drawAxis(c, newest, y) {
    const across = this.width - LEFT - RIGHT;
    c.textAlign = "center";
    newest.rangers?.forEach((id, i) => c.fillText(id, LEFT + ((i + 0.5) / newest.rangers.length) * across, y));
    if (newest.rangers) return;
    const [from_deg, to_deg] = this.span();
    for (const share of [0, 0.25, 0.5, 0.75, 1]) {
      c.textAlign = share === 1 ? "right" : share === 0 ? "left" : "center";
      c.fillText(degrees(from_deg + share * (to_deg - from_deg)), LEFT + share * across, y);
    }
  }

  drawColourBar(c, top) {
    const gradient = c.createLinearGradient(LEFT, 0, LEFT + BAR_PX, 0);
    COLOUR_MAP.forEach((colour, i) => gradient.addColorStop(i / (COLOUR_MAP.length - 1), `rgb(${colour})`));
    c.fillStyle = gradient;
    c.fillRect(LEFT, top + 4, BAR_PX, 8);
    c.fillStyle = this.palette["--muted"];
    c.textAlign = "right";
    c.fillText("range 0", LEFT - 4, top + 9);
    c.textAlign = "left";
    c.fillText(distance(this.max_m), LEFT + BAR_PX + 5, top + 9);
  }

  /** Colour of a range; transparent if the reading is missing or without echo. @returns {number[]} */
  colour(range_m) {
    if (!(range_m < Infinity)) return [0, 0, 0, 0];
    const at = Math.min(0.9999, range_m / this.max_m) * (COLOUR_MAP.length - 1);
    const [from, to] = [COLOUR_MAP[Math.floor(at)], COLOUR_MAP[Math.floor(at) + 1]];
    return [...from.map((value, i) => value + (at % 1) * (to[i] - value)), 255];
  }

  /** Horizontal place of the selected beam in a row, pixels. */
  x(row) {
    const [from, to] = this.extent(row);
    return from + ((this.indexIn(row) + 0.5) / row.planned) * (to - from);
  }

  /** Index of the selected beam's ranger or azimuth in a row; `NaN` if the row has none such. */
  indexIn({ plan, planned, rangers }) {
    const { index, azimuth_deg } = this.selected;
    if (rangers) return index < planned ? index : NaN;
    const { from_deg, step_deg, pings_per_stop } = plan;
    const along_deg = (((azimuth_deg - from_deg) % 360) + 360) % 360;
    const stop = Math.round(along_deg / step_deg);
    const isAtStop = Math.abs(along_deg - stop * step_deg) < 0.05;
    const at = stop * pings_per_stop + (index % pings_per_stop);
    return isAtStop && at < planned ? at : NaN;
  }

  /** Range of the selected beam in each row that has its azimuth, oldest first. */
  values() {
    if (!this.selected) return [];
    const value = (row) => ({ id: row.id, time: row.time, m: row.ranges[Math.floor((this.indexIn(row) / row.planned) * row.ranges.length)] });
    return this.rows.map(value).filter(({ m }) => m !== undefined && !Number.isNaN(m)).reverse();
  }

  drawSeries(c) {
    const values = this.values();
    const ranges = values.map(({ m }) => m).filter((m) => m < Infinity);
    setText(this.label, this.seriesText(values, ranges));
    this.series.style.visibility = ranges.length ? "" : "hidden";
    if (!ranges.length) return;
    const [min, max] = [Math.min(...ranges), Math.max(...ranges)];
    const margin = Math.max(0.001, 0.1 * (max - min));
    const [low, high] = [min - margin, max + margin];
    const y = (m) => TOP + ((high - m) / (high - low)) * (SERIES_PX - TOP - FOOT);
    const x = (i) => LEFT + ((i + 0.5) / values.length) * (this.width - LEFT - RIGHT);
    c.strokeStyle = this.palette["--rule"];
    c.fillStyle = this.palette["--muted"];
    c.textAlign = "right";
    for (const m of [min, max]) {
      c.beginPath();
      c.moveTo(LEFT, y(m));
      c.lineTo(this.width - RIGHT, y(m));
      c.stroke();
      if (m === min || max - min > 0) c.fillText(distanceFigure(m), LEFT - 4, y(m));
    }
    values.forEach(({ m }, i) => {
      c.fillStyle = this.palette[m < Infinity ? "--direct" : "--no-echo"];
      c.beginPath();
      c.arc(x(i), m < Infinity ? y(m) : SERIES_PX - FOOT - 3, 2.4, 0, 2 * Math.PI);
      c.fill();
    });
    c.fillStyle = this.palette["--muted"];
    c.textAlign = "left";
    c.fillText(clock(values[0].time), LEFT, SERIES_PX - FOOT / 2);
    c.textAlign = "right";
    if (values.length > 1) c.fillText(clock(values.at(-1).time), this.width - RIGHT, SERIES_PX - FOOT / 2);
  }

  seriesText(values, ranges) {
    if (!this.selected) return "Select a beam to see its ranges over time.";
    const name = `Beam ${this.selected.ranger ?? this.selected.index} in ${count(values.length, "scan")}`;
    if (!ranges.length) return `${name}: no range.`;
    const mean_m = ranges.reduce((sum, m) => sum + m, 0) / ranges.length;
    const sigma_m = Math.sqrt(ranges.reduce((sum, m) => sum + (m - mean_m) ** 2, 0) / Math.max(1, ranges.length - 1));
    const without = values.length - ranges.length;
    return `${name}: mean ${distance(mean_m)}, standard deviation ${(1e3 * sigma_m).toFixed(2)} mm${without ? `, no echo in ${without}` : ""}.`;
  }

  /** Picks the scan of a row and the beam of a column. */
  pick([x, y]) {
    const row = this.rows[Math.floor(y / ROW_PX)];
    if (!row) return;
    const [from, to] = this.extent(row);
    const share = (x - from) / (to - from);
    if (share >= 0 && share < 1) this.callbacks.onPick(row.id, Math.floor(share * row.planned));
  }

  /** Ranges of the selected beam over time as CSV. Loads past scans first. */
  async csv() {
    await this.load(true);
    const azimuth_deg = this.selected.azimuth_deg;
    const lines = this.values().map(({ id, time, m }) => [id, new Date(time).toISOString(), azimuth_deg, m < Infinity ? Number(m.toFixed(5)) : ""].join());
    return `scan,time,azimuth_deg,range_m\n${lines.join("\n")}\n`;
  }
}
