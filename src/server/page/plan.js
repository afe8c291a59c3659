// The floor plan on three layers: ground (grid, walls), marks (readings, drawn as they come), and above
// them what changes with every beam (robot, sweep, selection, path of the sound). Every reading is drawn
// from its own viewpoint.

import { drawGrid, drawScaleBar, drawScene } from "./ground.js";
import { arrow, circle, drawFace, drawPose, Layer, line, PEN_NAMES } from "./pens.js";
import { MARKS, draw } from "./verdicts.js";
import { View } from "./view.js";
import { inWorld, offDirection, pointAt } from "./viewpoint.js";

const MARK_PX = 3;
const HIT_PX = 24;
const TURN = Math.PI / 180;
/** Half the angle of an arc that stands for the nearest range of a ranger that does not turn, degrees. */
const ARC_DEG = 8;
/** Half the width of a transducer's face as it is drawn, metres. */
const FACE_M = 0.02;

export class Plan {
  /** Calls `onPick(index)` when somebody clicks at a beam. */
  constructor(stage, onPick) {
    this.stage = stage;
    this.layers = [...stage.querySelectorAll("canvas")].map((canvas) => new Layer(canvas));
    this.ground = this.layers[0];
    this.marks = this.layers[1];
    this.over = this.layers[2];
    this.view = new View();
    /** While somebody drags something the view stays. */
    this.held = false;
    this.scene = null;
    this.scan = null;
    this.selected = null;
    this.latest = null;
    this.path = null;
    this.palette = null;
    /** Scene and pose that the view was fitted to. */
    this.fitted = "";
    this.onPick = onPick;
    new ResizeObserver(() => this.resize()).observe(stage);
    this.over.canvas.addEventListener("click", (event) => this.pick([event.offsetX, event.offsetY]));
  }

  /** Everything anew: another scene, scan, size or style. */
  redraw(palette = this.palette) {
    this.palette = palette;
    if (!this.view.width) return;
    if (!this.held || !this.view.box) this.fit();
    this.ground.clear();
    drawGrid(this.ground, this.view, palette);
    if (this.sceneFits()) drawScene(this.ground, this.view, palette, this.scene);
    drawScaleBar(this.ground, this.view, palette);
    this.marks.clear();
    this.drawReadings(this.readings());
    this.drawOver();
  }

  /** Readings that came since the last frame. */
  addReadings(pings) {
    if (!this.view.width) return;
    this.latest = pings.at(-1) ?? this.latest;
    if (pings.some((ping) => this.widens(ping))) return this.redraw();
    this.drawReadings(pings);
    this.drawOver();
  }

  /** Marks a beam, with the path of its sound once that is known. */
  select(ping, path = null) {
    this.selected = ping;
    this.path = path;
    if (this.view.width) this.drawOver();
  }

  resize() {
    const { clientWidth, clientHeight } = this.stage;
    [this.view.width, this.view.height] = [clientWidth, clientHeight];
    for (const layer of this.layers) layer.resize(clientWidth, clientHeight);
    if (this.palette) this.redraw();
  }

  /** Shows the room alone, the readings around it as well, or all. */
  show(what) {
    [this.view.what, this.view.box] = [what, null];
    this.redraw();
  }

  readings() {
    return this.scan ? [...this.scan.beams.values()] : [];
  }

  fit() {
    const room = [];
    for (const { from, to } of this.scene?.walls ?? []) room.push(from, to);
    for (const { center: [x, y], radius_m: r } of this.scene?.cylinders ?? []) room.push([x - r, y - r], [x + r, y + r]);
    const pose = this.scan?.start.pose;
    if (pose) room.push([pose.x_m, pose.y_m]);
    const readings = this.readings();
    for (const { viewpoint } of readings) if (viewpoint) room.push([viewpoint.x_m, viewpoint.y_m]);
    const ends = readings.map((ping) => this.place(ping)).filter((end) => end !== null);
    // While readings come in, the view only widens, from one scan of a place to the next as well.
    const where = `${this.scene?.sha256} ${JSON.stringify(pose)}`;
    const grow = this.scan?.underWay && where === this.fitted;
    this.fitted = where;
    if (room.length === 1) room.push(...[[-1, -1], [1, 1]].map(([x, y]) => [room[0][0] + x, room[0][1] + y]));
    this.view.fit(room, ends, grow);
  }

  /** Where a range along a beam ends, metres; by itself its reading's. `null` if it is not known. */
  place({ viewpoint, range_m }, m = range_m) {
    return viewpoint && m !== null ? pointAt(viewpoint, m) : null;
  }

  /** Whether a reading is out of the view that the view would widen for. */
  widens(ping) {
    const at = this.place(ping);
    return at !== null && this.view.wouldGrow(at);
  }

  /** How many readings lie beyond the view, and how many are from a place that is not known. */
  notShown() {
    const readings = this.view.width ? this.readings() : [];
    const ends = readings.map((ping) => this.place(ping)).filter((end) => end !== null);
    const beyond = ends.filter((end) => this.view.isBeyond(this.view.px(end))).length;
    return { beyond, unplaced: readings.filter((ping) => !ping.viewpoint).length };
  }

  /** Names of the pens that something is drawn with. */
  pens() {
    return PEN_NAMES.filter((name) => this.layers.some((layer) => layer.used.has(name)));
  }

  /** Whether the scan was taken in the scene that is known. */
  sceneFits() {
    const taken = this.scan?.session?.scene?.sha256;
    return this.scene && (!taken || taken === this.scene.sha256);
  }

  /** What was read stands above what the model says. */
  drawReadings(pings) {
    const placed = pings.filter((ping) => ping.viewpoint);
    for (const ping of placed) {
      this.drawNearest(ping);
      if (ping.ranger) this.drawTransducer(this.marks, ping);
      if (ping.sim?.range_m != null) this.drawAt("model", ping, ping.sim.range_m);
    }
    for (const ping of placed) {
      if (MARKS[ping.mark].shape === "tick") this.drawSilence(ping);
      else this.drawAt(ping.mark, ping, ping.range_m);
    }
  }

  drawAt(mark, ping, range_m) {
    const at = this.view.px(this.place(ping, range_m));
    if (!this.view.isBeyond(at)) return draw(this.marks.c, mark, ...at, MARK_PX, this.palette[MARKS[mark].colour]);
    if (mark === "model") return;
    // Beyond the view: an arrow on its border says that there is something, in the colour of its mark.
    const c = this.marks.pen("beyond", this.palette);
    c.fillStyle = this.palette[MARKS[mark].colour];
    const { end, turn } = this.ray(ping);
    arrow(c, end, turn, [3, 5, 2.4]);
  }

  /** On the border of the view, in the beam's direction. */
  drawSilence(ping) {
    const { end, turn } = this.ray(ping);
    draw(this.marks.c, ping.mark, ...end, MARK_PX, this.palette[MARKS[ping.mark].colour], turn);
  }

  /** Nothing nearer is heard: a piece of arc round the transducer, as wide as one step of the plan. */
  drawNearest(ping) {
    const { session, start } = this.scan;
    if (!session) return;
    const near_m = (session.sensor.blanking_us * 1e-6 * session.air.sound_speed_m_s) / 2;
    const half_deg = ping.ranger ? ARC_DEG : Math.min(ARC_DEG, start.plan.step_deg / 2);
    const c = this.marks.pen("blanking", this.palette);
    const { turn } = this.ray(ping);
    c.beginPath();
    c.arc(...this.from(ping), near_m * this.view.scale, turn - half_deg * TURN, turn + half_deg * TURN);
    c.stroke();
  }

  drawTransducer(layer, ping) {
    const c = layer.pen("face", this.palette);
    drawFace(c, this.from(ping), this.ray(ping).turn, Math.max(3, FACE_M * this.view.scale));
  }

  /** Where a reading was taken, pixels. */
  from({ viewpoint: { x_m, y_m } }) {
    return this.view.px([x_m, y_m]);
  }

  /** Where a beam leaves the view, pixels, and its direction there, radians clockwise from the right. */
  ray(ping) {
    const turn = -ping.viewpoint.direction_deg * TURN;
    return { end: this.view.border(this.from(ping), turn), turn };
  }

  drawOver() {
    this.over.clear();
    if (!this.scan || !this.palette) return;
    this.drawRobot((this.latest ?? this.readings().at(-1))?.pose ?? this.scan.start.pose);
    if (this.scan.underWay && this.latest?.viewpoint) this.drawRay("newest", this.latest);
    if (!this.selected?.viewpoint) return;
    this.drawRay("direction", this.selected);
    if (this.path) this.drawPath();
    const at = this.place(this.selected);
    if (at) circle(this.over.pen("selected", this.palette), this.view.px(at), 8);
  }

  /** The robot's body, which the array has, or else the scene. */
  drawRobot(pose) {
    const own = this.scan.session?.array?.body?.shape;
    const scenes = this.sceneFits() ? this.scene.robot : null;
    const body = own ? (own.circle ?? { outline: own.outline }) : scenes;
    const world = (point) => this.view.px(inWorld(pose, point));
    if (body) {
      const c = this.over.pen("robot", this.palette);
      if (body.center) circle(c, world(body.center), body.radius_m * this.view.scale);
      else line(c, [...body.outline, body.outline[0]].map(world));
    }
    drawPose(this.over.pen("pose", this.palette), world([0, 0]), -pose.heading_deg * TURN);
  }

  drawRay(pen, ping) {
    const from = this.from(ping);
    line(this.over.pen(pen, this.palette), [from, this.ray(ping).end]);
    const { x_m, y_m } = ping.pose ?? this.scan.start.pose;
    const off_m = Math.hypot(ping.viewpoint.x_m - x_m, ping.viewpoint.y_m - y_m);
    if (off_m > 1e-3) this.drawTransducer(this.over, ping);
  }

  /** The path of the sound, with an arrow on each of its legs. */
  drawPath() {
    const points = this.path.map((point) => this.view.px(point));
    const c = this.over.pen("path", this.palette);
    c.lineJoin = "round";
    line(c, points);
    for (let i = 1; i < points.length; i++) {
      const [[x, y], [u, v]] = [points[i - 1], points[i]];
      if (Math.hypot(u - x, v - y) < 24) continue;
      arrow(c, [x + 0.55 * (u - x), y + 0.55 * (v - y)], Math.atan2(v - y, u - x), [6, 4, 4]);
    }
  }

  /** The beam nearest to a click: by its mark, else by its direction. */
  pick([x, y]) {
    let [best, nearest] = [null, HIT_PX];
    for (const ping of this.readings()) {
      const at = this.place(ping);
      if (!at) continue;
      const [u, v] = this.view.px(at);
      const distance = Math.hypot(u - x, v - y);
      if (distance < nearest) [best, nearest] = [ping, distance];
    }
    best ??= this.towards(this.view.world([x, y]));
    if (best) this.onPick(best.index);
  }

  towards(point) {
    const off = ({ viewpoint }) => (viewpoint ? offDirection(viewpoint, point) : Infinity);
    return this.readings().reduce((one, other) => (one && off(one) <= off(other) ? one : other), null);
  }
}
