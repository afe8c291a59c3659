// The residuals of a scan against azimuth, measured minus model.

import { make } from "./dom.js";
import { upright } from "./pens.js";
import { MARKS, draw } from "./verdicts.js";

const LEFT = 46, RIGHT = 10, TOP = 8, BOTTOM = 20;
const SCALES_MM = [5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
const AGREE_MM = 10;
const WORDS = "measured minus model in mm, against azimuth; shaded where 10 mm or less; the upright line is the selected beam";

export class Strip {
  /** Calls `onPick(index)` when somebody clicks at a beam. */
  constructor(section, onPick) {
    const canvas = make("canvas", { id: "strip", role: "img", ariaLabel: `Residual: ${WORDS}` });
    this.title = make("h2", { textContent: "Residual" });
    this.words = make("p", { textContent: WORDS });
    section.append(make("div", { className: "head" }, this.title, this.words), canvas);
    this.c = canvas.getContext("2d");
    this.width = 0;
    this.height = 0;
    this.palette = null;
    /** The largest residual that the scale shows, millimetres. */
    this.most = SCALES_MM[0];
    this.scan = null;
    this.selected = null;
    this.onPick = onPick;
    /** Metres to be drawn of a reading, or `null`. @param {any} ping */
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
    if (!this.width) return;
    this.setScale();
    this.c.clearRect(0, 0, this.width, this.height);
    this.drawAxes();
    for (const ping of this.drawn()) this.drawResidual(ping);
    if (this.selected) upright(this.c, this.x(this.selected.azimuth_deg), [TOP, this.height - BOTTOM], this.palette["--ray"]);
  }

  /** Readings that came since the last frame. */
  addReadings(pings) {
    if (!this.width) return;
    const fresh = pings.filter((ping) => this.valueOf(ping) !== null);
    if (fresh.some((ping) => Math.abs(1e3 * this.valueOf(ping)) > this.most)) return this.redraw();
    for (const ping of fresh) this.drawResidual(ping);
  }

  /** Readings that have something to be drawn. */
  drawn() {
    return [...(this.scan?.beams.values() ?? [])].filter((ping) => this.valueOf(ping) !== null);
  }

  /** From the next time on it is drawn, shows something else of readings, with a title and words; the residual without. */
  show(valueOf = (ping) => ping.residual_m, title = "Residual", words = WORDS) {
    this.valueOf = valueOf;
    [this.title.textContent, this.words.textContent] = [title, words];
    this.c.canvas.ariaLabel = `${title}: ${words}`;
  }

  select(ping) {
    this.selected = ping;
    this.redraw();
  }

  /** The scale that nineteen of twenty residuals fit in; the others are drawn at its end. */
  setScale() {
    const sizes = this.drawn().map((ping) => Math.abs(1e3 * this.valueOf(ping))).sort((a, b) => a - b);
    const wanted = sizes.length ? sizes[Math.floor(0.95 * (sizes.length - 1))] : 0;
    this.most = SCALES_MM.find((scale) => scale >= wanted) ?? SCALES_MM.at(-1);
  }

  get plan() {
    return this.scan?.start.plan ?? { from_deg: 0, to_deg: 360 };
  }

  x(azimuth_deg) {
    const { from_deg, to_deg } = this.plan;
    const along = (((azimuth_deg - from_deg) % 360) + 360) % 360;
    return LEFT + (along / (to_deg - from_deg)) * (this.width - LEFT - RIGHT);
  }

  y(mm) {
    const share = Math.max(-1, Math.min(1, mm / this.most));
    return TOP + ((1 - share) / 2) * (this.height - TOP - BOTTOM);
  }

  drawAxes() {
    const c = this.c;
    const right = this.width - RIGHT;
    // Within this band ranges agree (or within 1 % of the range, if that is more).
    const [top, bottom] = [this.y(AGREE_MM), this.y(-AGREE_MM)];
    c.fillStyle = this.palette["--grid"];
    c.fillRect(LEFT, top, right - LEFT, bottom - top);
    c.strokeStyle = this.palette["--rule"];
    c.fillStyle = this.palette["--quiet"];
    c.lineWidth = 1;
    c.font = "11px system-ui, sans-serif";
    c.textAlign = "right";
    c.textBaseline = "middle";
    for (const mm of [-this.most, 0, this.most]) {
      const y = Math.round(this.y(mm)) + 0.5;
      c.beginPath();
      c.moveTo(LEFT, y);
      c.lineTo(right, y);
      c.stroke();
      c.fillText(mm > 0 ? `+${mm}` : mm < 0 ? `−${-mm}` : "0", LEFT - 6, y);
    }
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
    draw(this.c, mark, this.x(ping.azimuth_deg), this.y(mm), 2.2, this.palette[MARKS[mark].colour]);
  }

  pick(x) {
    const pings = [...(this.scan?.beams.values() ?? [])];
    if (!pings.length) return;
    const off = (ping) => Math.abs(this.x(ping.azimuth_deg) - x);
    this.onPick(pings.reduce((one, other) => (off(other) < off(one) ? other : one)).index);
  }
}
