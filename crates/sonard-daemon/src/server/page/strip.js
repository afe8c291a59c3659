// Residuals of a scan versus azimuth: measured minus predicted range.

import { make } from "./dom.js";
import { setText } from "./format.js";
import { drawVertical } from "./layers.js";
import { MARKS, draw } from "./verdicts.js";

const LEFT = 46, RIGHT = 10, TOP = 8, BOTTOM = 20;
const SCALES_MM = [5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
const AGREE_MM = 10;
const CAPTION = "measured − predicted (mm) vs azimuth; band ±10 mm; line: selected beam";

export class Strip {
  /** `onPick(index)` is called with the clicked beam. */
  constructor(section, onPick) {
    const canvas = make("canvas", { id: "strip", role: "img" });
    this.title = make("h2", { textContent: "Residual" });
    this.caption = make("p");
    this.text = CAPTION;
    this.section = section;
    section.append(make("div", { className: "head" }, this.title, this.caption), canvas);
    this.c = canvas.getContext("2d");
    this.width = 0;
    this.height = 0;
    this.palette = null;
    /** Full scale, millimetres. */
    this.max_mm = SCALES_MM[0];
    this.scan = null;
    this.selected = null;
    this.onPick = onPick;
    /** Plotted value of a reading, metres, or `null`. @param {any} ping */
    this.valueOf = (ping) => ping.residual_m;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("click", (event) => this.pick(event.offsetX));
  }

  resize() {
    const { canvas } = this.c;
    const scale = devicePixelRatio;
    [this.width, this.height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.round(this.width * scale);
    canvas.height = Math.round(this.height * scale);
    this.c.setTransform(scale, 0, 0, scale, 0, 0);
    if (this.palette) this.redraw();
  }

  redraw(palette = this.palette) {
    this.palette = palette;
    this.section.hidden = this.isEmpty();
    const text = this.rangers ? this.text.replace("azimuth", "ranger") : this.text;
    setText(this.caption, text);
    this.c.canvas.ariaLabel = `${this.title.textContent}: ${text}`;
    if (!this.width) return;
    this.setScale();
    this.c.clearRect(0, 0, this.width, this.height);
    this.drawAxes();
    for (const ping of this.drawn()) this.drawResidual(ping);
    if (this.selected) drawVertical(this.c, this.x(this.selected), [TOP, this.height - BOTTOM], this.palette["--ray"]);
  }

  /** Draws the readings received since the last frame. */
  addReadings(pings) {
    if (!this.width || this.section.hidden) return;
    const fresh = pings.filter((ping) => this.valueOf(ping) !== null);
    if (fresh.some((ping) => Math.abs(1e3 * this.valueOf(ping)) > this.max_mm)) return this.redraw();
    for (const ping of fresh) this.drawResidual(ping);
  }

  /** Returns `true` if the scan's readings have no predictions, as those of a simulation. */
  isEmpty() {
    const isSimulated = this.scan?.session?.provenance === "simulated";
    return isSimulated && ![...this.scan.beams.values()].some(({ sim }) => sim);
  }

  /** Names of an array's rangers, each of which has a column. @returns {string[] | undefined} */
  get rangers() {
    return this.scan?.session?.array?.rangers?.map((ranger) => ranger.id);
  }

  /** Readings with a value. */
  drawn() {
    return [...(this.scan?.beams.values() ?? [])].filter((ping) => this.valueOf(ping) !== null);
  }

  /** Sets the plotted value, by default the residual; takes effect with the next redraw. */
  show(valueOf = (ping) => ping.residual_m, title = "Residual", caption = CAPTION) {
    this.valueOf = valueOf;
    [this.title.textContent, this.text] = [title, caption];
  }

  select(ping) {
    this.selected = ping;
    this.redraw();
  }

  /** Chooses the smallest scale that holds 95 % of the residuals; the others are clipped to its ends. */
  setScale() {
    const sizes = this.drawn().map((ping) => Math.abs(1e3 * this.valueOf(ping))).sort((a, b) => a - b);
    const p95_mm = sizes.length ? sizes[Math.floor(0.95 * (sizes.length - 1))] : 0;
    this.max_mm = SCALES_MM.find((scale) => scale >= p95_mm) ?? SCALES_MM.at(-1);
  }

  get plan() {
    return this.scan?.start.plan ?? { from_deg: 0, to_deg: 360 };
  }

  x({ index, azimuth_deg }) {
    if (this.rangers) return LEFT + ((index + 0.5) / this.scan.planned) * (this.width - LEFT - RIGHT);
    const { from_deg, to_deg } = this.plan;
    const along = (((azimuth_deg - from_deg) % 360) + 360) % 360;
    return LEFT + (along / (to_deg - from_deg)) * (this.width - LEFT - RIGHT);
  }

  y(mm) {
    const share = Math.max(-1, Math.min(1, mm / this.max_mm));
    return TOP + ((1 - share) / 2) * (this.height - TOP - BOTTOM);
  }

  drawAxes() {
    const c = this.c;
    const right = this.width - RIGHT;
    // Ranges agree within this band, or within 1 % of the range if that is more.
    const [top, bottom] = [this.y(AGREE_MM), this.y(-AGREE_MM)];
    c.fillStyle = this.palette["--grid"];
    c.fillRect(LEFT, top, right - LEFT, bottom - top);
    c.strokeStyle = this.palette["--rule"];
    c.fillStyle = this.palette["--muted"];
    c.lineWidth = 1;
    c.font = "11px system-ui, sans-serif";
    c.textAlign = "right";
    c.textBaseline = "middle";
    for (const mm of [-this.max_mm, 0, this.max_mm]) {
      const y = Math.round(this.y(mm)) + 0.5;
      c.beginPath();
      c.moveTo(LEFT, y);
      c.lineTo(right, y);
      c.stroke();
      c.fillText(mm > 0 ? `+${mm}` : mm < 0 ? `−${-mm}` : "0", LEFT - 6, y);
    }
    c.textAlign = "center";
    const { rangers } = this;
    rangers?.forEach((id, index) => c.fillText(id, this.x({ index, azimuth_deg: 0 }), this.height - 7));
    if (rangers) return;
    const { from_deg, to_deg } = this.plan;
    const span = to_deg - from_deg;
    const step = [1, 2, 5, 10, 15, 30, 45, 90].find((step) => span / step <= Math.max(3, (right - LEFT) / 60)) ?? 90;
    for (let deg = Math.ceil(from_deg / step) * step; deg <= to_deg + 1e-9; deg += step) {
      const x = LEFT + ((deg - from_deg) / span) * (right - LEFT);
      c.textAlign = x > right - 12 ? "right" : "center";
      c.fillText(`${deg}°`, x, this.height - 7);
    }
  }

  drawResidual(ping) {
    const mm = 1e3 * this.valueOf(ping);
    const mark = MARKS[ping.mark].shape === "tick" ? "unexplained" : ping.mark;
    draw(this.c, mark, this.x(ping), this.y(mm), 2.2, this.palette[MARKS[mark].colour]);
  }

  pick(x) {
    const pings = [...(this.scan?.beams.values() ?? [])];
    if (!pings.length) return;
    const distance = (ping) => Math.abs(this.x(ping) - x);
    this.onPick(pings.reduce((a, b) => (distance(b) < distance(a) ? b : a)).index);
  }
}
