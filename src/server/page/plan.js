// The floor plan on three layers: ground (grid, walls, ranger), marks (readings, drawn as they
// come), and above them what changes with every beam (sweep, selection, path of the sound).

import { MARKS, draw } from "./verdicts.js";

const MARGIN_PX = 26;
const MARK_PX = 3;
const HIT_PX = 24;
const TURN = Math.PI / 180;
/** Rooms with more walls than this are drawn without their names. */
const MOST_NAMES = 24;
const NAME_PX = 11;

export class Plan {
  /** Calls `onPick(index)` when somebody clicks at a beam. */
  constructor(stage, onPick) {
    this.stage = stage;
    [this.ground, this.marks, this.over] = [...stage.querySelectorAll("canvas")].map((canvas) => canvas.getContext("2d"));
    this.scene = null;
    this.scan = null;
    this.fitAll = false;
    this.selected = null;
    this.latest = null;
    this.path = null;
    this.onPick = onPick;
    new ResizeObserver(() => this.resize()).observe(stage);
    this.over.canvas.addEventListener("click", (event) => this.pick(event.offsetX, event.offsetY));
  }

  /** Everything anew: another scene, scan, size or style. */
  redraw(palette = this.palette) {
    this.palette = palette;
    if (!this.width) return;
    this.fit();
    this.clear(this.ground);
    this.drawGrid();
    this.drawScene();
    this.clear(this.marks);
    if (this.scan) for (const ping of this.scan.beams.values()) this.drawReading(ping);
    this.drawOver();
  }

  /** Readings that came since the last frame. */
  addReadings(pings) {
    if (!this.width) return;
    if (this.fitAll && pings.some((ping) => this.isOutside(ping))) return this.redraw();
    pings.forEach((ping) => this.drawReading(ping));
    this.latest = pings.at(-1) ?? this.latest;
    this.drawOver();
  }

  /** Marks a beam, with the path of its sound once that is known. */
  select(ping, path = null) {
    this.selected = ping;
    this.path = path;
    if (this.width) this.drawOver();
  }

  resize() {
    const { clientWidth, clientHeight } = this.stage;
    const scale = devicePixelRatio;
    [this.width, this.height] = [clientWidth, clientHeight];
    for (const layer of [this.ground, this.marks, this.over]) {
      layer.canvas.width = Math.round(clientWidth * scale);
      layer.canvas.height = Math.round(clientHeight * scale);
      layer.setTransform(scale, 0, 0, scale, 0, 0);
    }
    if (this.palette) this.redraw();
  }

  /** The scale and origin that show the room, or all readings as well. */
  fit() {
    const xs = [], ys = [];
    const take = ([x, y]) => (xs.push(x), ys.push(y));
    for (const wall of this.scene?.walls ?? []) [wall.from, wall.to].forEach(take);
    for (const { center: [x, y], radius_m: r } of this.scene?.cylinders ?? []) [[x - r, y - r], [x + r, y + r]].forEach(take);
    const pose = this.scan?.start.pose;
    if (pose) take([pose.x_m, pose.y_m]);
    if (this.scan && (this.fitAll || xs.length < 3)) {
      for (const ping of this.scan.beams.values()) if (ping.range_m !== null) take(this.place(ping, ping.range_m));
    }
    if (xs.length < 2) [[-1, -1], [1, 1]].forEach(([x, y]) => take([x + (pose?.x_m ?? 0), y + (pose?.y_m ?? 0)]));
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    // Ghosts of a room stand outside of it: some of them are shown.
    const around = this.fitAll ? 0.02 : 0.22;
    const [across, up] = [Math.max(right - left, 0.2), Math.max(high - low, 0.2)];
    const room = Math.max(across, up) * around;
    this.scale = Math.min(
      (this.width - 2 * MARGIN_PX) / (across + 2 * room),
      (this.height - 2 * MARGIN_PX) / (up + 2 * room),
    );
    this.x0 = this.width / 2 - (this.scale * (left + right)) / 2;
    this.y0 = this.height / 2 + (this.scale * (low + high)) / 2;
  }

  px([x, y]) {
    return [this.x0 + this.scale * x, this.y0 - this.scale * y];
  }

  /** Where a range along a beam ends, metres. */
  place(ping, range_m) {
    const { x_m, y_m, heading_deg } = this.scan.start.pose;
    const direction = (heading_deg + ping.azimuth_deg) * TURN;
    return [x_m + range_m * Math.cos(direction), y_m + range_m * Math.sin(direction)];
  }

  clear(layer) {
    layer.clearRect(0, 0, this.width, this.height);
  }

  /** How many readings lie beyond the view. */
  beyond() {
    if (!this.width || !this.scan) return 0;
    return [...this.scan.beams.values()].filter((ping) => this.isOutside(ping)).length;
  }

  isOutside(ping) {
    if (ping.range_m === null) return false;
    const [x, y] = this.px(this.place(ping, ping.range_m));
    return this.isBeyond(x, y);
  }

  isBeyond(x, y) {
    return x < 2 || y < 2 || x > this.width - 2 || y > this.height - 2;
  }

  drawGrid() {
    const c = this.ground;
    const step = gridStep(64 / this.scale);
    c.strokeStyle = this.palette["--grid"];
    c.lineWidth = 1;
    c.beginPath();
    for (let i = Math.ceil(-this.x0 / this.scale / step); this.x0 + i * step * this.scale < this.width; i++) {
      const x = Math.round(this.x0 + i * step * this.scale) + 0.5;
      c.moveTo(x, 0);
      c.lineTo(x, this.height);
    }
    for (let i = Math.ceil((this.y0 - this.height) / this.scale / step); this.y0 - i * step * this.scale > 0; i++) {
      const y = Math.round(this.y0 - i * step * this.scale) + 0.5;
      c.moveTo(0, y);
      c.lineTo(this.width, y);
    }
    c.stroke();
    this.drawScaleBar(step);
  }

  drawScaleBar(step) {
    const c = this.ground;
    const length = step * this.scale;
    const [x, y] = [12, this.height - 12];
    c.strokeStyle = c.fillStyle = this.palette["--quiet"];
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(x, y - 4);
    c.lineTo(x, y);
    c.lineTo(x + length, y);
    c.lineTo(x + length, y - 4);
    c.stroke();
    c.font = "12px system-ui, sans-serif";
    c.fillText(step < 1 ? `${Math.round(100 * step)} cm` : `${step} m`, x + length + 7, y + 1);
  }

  drawScene() {
    const c = this.ground;
    c.strokeStyle = this.palette["--wall"];
    c.lineWidth = 2;
    c.lineCap = "round";
    for (const wall of this.sceneFits() ? this.scene.walls : []) {
      c.setLineDash(wall.material.roughness > 0 ? [4, 4] : []);
      this.line(c, [wall.from, wall.to]);
    }
    c.setLineDash([]);
    if (this.sceneFits() && this.scene.walls.length <= MOST_NAMES) this.scene.walls.forEach((wall) => this.drawName(wall));
    for (const { center, radius_m } of this.sceneFits() ? this.scene.cylinders : []) this.circle(c, center, radius_m);
    if (!this.scan) return;
    if (this.sceneFits()) this.drawRobot(c);
    this.drawRanger(c);
  }

  /** A wall's name beside its middle, on the side away from the middle of the view. */
  drawName({ id, from, to }) {
    const c = this.ground;
    const [[x, y], [u, v]] = [this.px(from), this.px(to)];
    const length = Math.hypot(u - x, v - y);
    c.font = `${NAME_PX}px system-ui, sans-serif`;
    if (length < c.measureText(id).width) return;
    let [nx, ny] = [(v - y) / length, (x - u) / length];
    const [mx, my] = [(x + u) / 2, (y + v) / 2];
    if (nx * (this.width / 2 - mx) + ny * (this.height / 2 - my) > 0) [nx, ny] = [-nx, -ny];
    c.save();
    c.translate(mx + NAME_PX * nx, my + NAME_PX * ny);
    const turn = Math.atan2(v - y, u - x);
    c.rotate(Math.abs(turn) > Math.PI / 2 ? turn - Math.sign(turn) * Math.PI : turn);
    c.fillStyle = this.palette["--quiet"];
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.fillText(id, 0, 0);
    c.restore();
  }

  /** Whether the scan was taken in the scene that is known. */
  sceneFits() {
    const taken = this.scan?.session?.scene?.sha256;
    return this.scene && (!taken || taken === this.scene.sha256);
  }

  drawRobot(c) {
    const robot = this.scene.robot;
    if (!robot) return;
    const { x_m, y_m, heading_deg } = this.scan.start.pose;
    const [cos, sin] = [Math.cos(heading_deg * TURN), Math.sin(heading_deg * TURN)];
    const world = ([x, y]) => [x_m + cos * x - sin * y, y_m + sin * x + cos * y];
    c.strokeStyle = this.palette["--edge"];
    c.lineWidth = 1.5;
    if (robot.center) return this.circle(c, world(robot.center), robot.radius_m);
    this.line(c, [...robot.outline, robot.outline[0]].map(world));
  }

  drawRanger(c) {
    const { x_m, y_m, heading_deg } = this.scan.start.pose;
    const [x, y] = this.px([x_m, y_m]);
    const direction = -heading_deg * TURN;
    c.fillStyle = c.strokeStyle = this.palette["--ink"];
    c.lineWidth = 1.5;
    c.beginPath();
    c.arc(x, y, 4, 0, 2 * Math.PI);
    c.moveTo(x, y);
    c.lineTo(x + 15 * Math.cos(direction), y + 15 * Math.sin(direction));
    c.stroke();
    const near = this.scan.session && (this.scan.session.sensor.blanking_us * 1e-6 * this.scan.session.air.sound_speed_m_s) / 2;
    if (!near) return;
    c.strokeStyle = this.palette["--min-range"];
    c.setLineDash([4, 4]);
    c.lineWidth = 1;
    this.circle(c, [x_m, y_m], near);
    c.setLineDash([]);
  }

  drawReading(ping) {
    const c = this.marks;
    if (ping.sim?.range_m != null) this.drawAt(c, "model", ping, ping.sim.range_m);
    if (MARKS[ping.mark].shape === "tick") return this.drawRim(c, ping.mark, ping);
    this.drawAt(c, ping.mark, ping, ping.range_m);
  }

  drawAt(c, mark, ping, range_m) {
    const [x, y] = this.px(this.place(ping, range_m));
    if (this.isBeyond(x, y)) {
      if (mark !== "model") this.drawBeyond(c, mark, ping);
      return;
    }
    draw(c, mark, x, y, MARK_PX, this.palette[MARKS[mark].colour]);
  }

  /** On the border of the view, in the beam's direction. */
  drawRim(c, mark, ping) {
    const rim = this.rim(ping);
    if (!rim) return;
    draw(c, mark, ...rim.at, MARK_PX, this.palette[MARKS[mark].colour], rim.direction);
  }

  /** Beyond the view: an arrow on its border says that there is something. */
  drawBeyond(c, mark, ping) {
    const rim = this.rim(ping);
    if (!rim) return;
    const [x, y] = rim.at;
    const [dx, dy] = [Math.cos(rim.direction), Math.sin(rim.direction)];
    c.fillStyle = this.palette[MARKS[mark].colour];
    c.beginPath();
    c.moveTo(x + 3 * dx, y + 3 * dy);
    c.lineTo(x - 5 * dx - 2.4 * dy, y - 5 * dy + 2.4 * dx);
    c.lineTo(x - 5 * dx + 2.4 * dy, y - 5 * dy - 2.4 * dx);
    c.fill();
  }

  rim(ping) {
    const { x_m, y_m, heading_deg } = this.scan.start.pose;
    const [x, y] = this.px([x_m, y_m]);
    const direction = -(heading_deg + ping.azimuth_deg) * TURN;
    const [dx, dy] = [Math.cos(direction), Math.sin(direction)];
    if (x < 0 || y < 0 || x > this.width || y > this.height) return null;
    const until = (at, along, most) => (along > 1e-9 ? (most - at) / along : along < -1e-9 ? -at / along : Infinity);
    const inset = 3;
    const length = Math.min(until(x, dx, this.width), until(y, dy, this.height)) - inset;
    return { at: [x + length * dx, y + length * dy], direction };
  }

  drawOver() {
    const c = this.over;
    this.clear(c);
    if (!this.scan) return;
    if (this.scan.underWay && this.latest) this.drawRay(c, this.latest, this.palette["--quiet"], [2, 5]);
    if (!this.selected) return;
    this.drawRay(c, this.selected, this.palette["--ray"], [6, 4]);
    if (this.path) this.drawPath(c);
    const { range_m } = this.selected;
    if (range_m === null) return;
    const [x, y] = this.px(this.place(this.selected, range_m));
    c.strokeStyle = this.palette["--ray"];
    c.lineWidth = 2;
    c.beginPath();
    c.arc(x, y, 8, 0, 2 * Math.PI);
    c.stroke();
  }

  drawRay(c, ping, colour, dash) {
    const rim = this.rim(ping);
    if (!rim) return;
    const { x_m, y_m } = this.scan.start.pose;
    c.strokeStyle = colour;
    c.lineWidth = 1.2;
    c.setLineDash(dash);
    c.beginPath();
    c.moveTo(...this.px([x_m, y_m]));
    c.lineTo(...rim.at);
    c.stroke();
    c.setLineDash([]);
  }

  /** The path of the sound, with an arrow on each of its legs. */
  drawPath(c) {
    const points = this.path.map((point) => this.px(point));
    c.strokeStyle = c.fillStyle = this.palette["--path"];
    c.lineWidth = 1.8;
    c.lineJoin = "round";
    c.beginPath();
    points.forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.stroke();
    for (let i = 1; i < points.length; i++) {
      const [[x, y], [u, v]] = [points[i - 1], points[i]];
      if (Math.hypot(u - x, v - y) < 24) continue;
      const turn = Math.atan2(v - y, u - x);
      c.save();
      c.translate(x + 0.55 * (u - x), y + 0.55 * (v - y));
      c.rotate(turn);
      c.beginPath();
      c.moveTo(6, 0);
      c.lineTo(-4, 4);
      c.lineTo(-4, -4);
      c.fill();
      c.restore();
    }
  }

  line(c, points) {
    c.beginPath();
    points.forEach((point, i) => (i ? c.lineTo(...this.px(point)) : c.moveTo(...this.px(point))));
    c.stroke();
  }

  circle(c, center, radius_m) {
    c.beginPath();
    c.arc(...this.px(center), radius_m * this.scale, 0, 2 * Math.PI);
    c.stroke();
  }

  /** The beam nearest to a click: by its mark, else by its direction. */
  pick(x, y) {
    if (!this.scan?.beams.size) return;
    let best = null;
    let nearest = HIT_PX;
    for (const ping of this.scan.beams.values()) {
      if (ping.range_m === null) continue;
      const [u, v] = this.px(this.place(ping, ping.range_m));
      const distance = Math.hypot(u - x, v - y);
      if (distance < nearest) [best, nearest] = [ping, distance];
    }
    this.onPick((best ?? this.towards(x, y)).index);
  }

  towards(x, y) {
    const { x_m, y_m, heading_deg } = this.scan.start.pose;
    const [u, v] = this.px([x_m, y_m]);
    const wanted = Math.atan2(v - y, x - u) / TURN - heading_deg;
    const off = (ping) => Math.abs(((((ping.azimuth_deg - wanted) % 360) + 540) % 360) - 180);
    return [...this.scan.beams.values()].reduce((one, other) => (off(other) < off(one) ? other : one));
  }
}

/** The round length that is `least` or more: 1, 2 or 5 times a power of ten. */
function gridStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((n) => n * power).find((step) => step >= least);
}
