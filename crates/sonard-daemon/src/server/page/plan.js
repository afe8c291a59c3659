// The floor plan on four layers: ground (grid, walls), under (the sweep before), marks (readings, drawn as they
// come), and above them what changes with every beam (robot, sweep, selection, path of the sound, lengths).

import { make } from "./dom.js";
import { Gestures } from "./gestures.js";
import { drawGrid, drawScaleBar, drawScene } from "./ground.js";
import { arrow, circle, drawPose, Layer, line, PEN_NAMES } from "./pens.js";
import { place, Sketch } from "./sketch.js";
import { View } from "./view.js";
import { inWorld, offDirection } from "./viewpoint.js";

const HIT_PX = 24;
const TURN = Math.PI / 180;
/** More readings than this are not drawn anew with every frame of a gesture, but moved, and drawn when it rests. */
const MANY = 4000;
const REST_MS = 120;
const LAYERS = ["ground", "under", "marks", "over"];

export class Plan {
  /** Calls `onPick(index)` when somebody clicks at a beam. `words` says what the plan is of. */
  constructor(stage, onPick, words) {
    this.stage = stage;
    this.words = words;
    /** @type {Layer[]} */
    this.layers = [];
    for (const name of LAYERS) this.addLayer(name);
    this.ground = this.layers[0];
    this.under = this.layers[1];
    this.marks = this.layers[2];
    this.over = this.layers[3];
    /** The next frame that draws a moved view, and the rest after which all is drawn. @type {number | null} */
    this.moving = null;
    this.resting = 0;
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
    /** The measuring tool, where there is one. */
    this.measure = null;
    /** What else is drawn, under the readings and over them. @type {{drawUnder?: Function, drawOver?: Function}[]} */
    this.overlays = [];
    this.onView = () => {};
    new ResizeObserver(() => this.resize()).observe(stage);
    const tool = () => (this.measure?.on ? this.measure : null);
    this.gestures = new Gestures(stage, this.over.canvas, this.view, {
      onMove: () => this.moveView(),
      onClick: (px) => (tool() ?? { click: (at) => this.pick(at) }).click(px),
      onHover: (px) => tool()?.hover(px),
      onKey: (event) => tool()?.key(event) || this.key(event),
    });
  }

  /** The layer above all others; of the page's main plan they bear their names. */
  addLayer(name) {
    const picture = name === "over";
    const canvas = make("canvas", { className: name, ...(picture ? { role: "img", ariaLabel: this.words } : { ariaHidden: "true" }) });
    if (this.stage.id) canvas.id = name;
    this.stage.append(canvas);
    this.layers.push(new Layer(canvas));
    return this.layers.at(-1);
  }

  /** Everything anew: another scene, scan, size or style. */
  redraw(palette = this.palette) {
    this.palette = palette;
    if (!this.view.width) return;
    if (!this.held || !this.view.box) this.fit();
    this.drawGround();
    this.drawUnder();
    this.marks.clear(this.view);
    this.drawReadings(this.readings());
    this.drawOver();
    this.onView();
  }

  /** Somebody moved the view: once a frame it is drawn. */
  moveView() {
    this.moving ??= requestAnimationFrame(() => {
      this.moving = null;
      if (this.readings().length + this.beforeReadings().length <= MANY) return this.redraw();
      this.drawGround();
      for (const layer of [this.under, this.marks]) layer.shift(this.view);
      this.drawOver();
      clearTimeout(this.resting);
      this.resting = setTimeout(() => this.redraw(), REST_MS);
    });
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
    this.view.resize(clientWidth, clientHeight);
    for (const layer of this.layers) layer.resize(clientWidth, clientHeight);
    if (this.palette) this.redraw();
  }

  /** Shows the room alone, the readings around it as well, or all. */
  show(what) {
    this.view.show(what);
    this.redraw();
  }

  /** Whether a key was for the plan. @param {KeyboardEvent} event */
  key({ key }) {
    if (key === "0" || key === "Home") this.show(this.view.what);
    else if (key.toLowerCase() === "m" && this.measure) this.measure.toggle();
    else return false;
    return true;
  }

  readings() {
    return this.scan ? [...this.scan.beams.values()] : [];
  }

  /** Of the sweep before, while the next one is under way. */
  beforeReadings() {
    return this.scan?.before ? [...this.scan.before.beams.values()] : [];
  }

  fit() {
    const room = this.corners();
    for (const { center: [x, y], radius_m: r } of this.scene?.cylinders ?? []) room.push([x - r, y - r], [x + r, y + r]);
    const pose = this.scan?.start.pose;
    if (pose) room.push([pose.x_m, pose.y_m]);
    const readings = this.readings();
    for (const { viewpoint } of readings) if (viewpoint) room.push([viewpoint.x_m, viewpoint.y_m]);
    const ends = readings.map((ping) => place(ping)).filter((end) => end !== null);
    // While readings come in, the view only widens, from one scan of a place to the next as well.
    const where = `${this.scene?.sha256} ${JSON.stringify(pose)}`;
    const grow = this.scan?.underWay && where === this.fitted;
    this.fitted = where;
    if (room.length === 1) room.push(...[[-1, -1], [1, 1]].map(([x, y]) => [room[0][0] + x, room[0][1] + y]));
    this.view.fit(room, ends, grow);
  }

  /** Ends of the scene's walls, metres. */
  corners() {
    return (this.scene?.walls ?? []).flatMap(({ from, to }) => [from, to]);
  }

  /** The end of a wall that is nearest to a pixel, at most so far from it; else the reading; else the point there. */
  snap(px, most_px) {
    const nearestOf = (points) => {
      let [best, nearest] = [null, most_px];
      for (const point of points) {
        const [x, y] = this.view.px(point);
        const off = Math.hypot(x - px[0], y - px[1]);
        if (off < nearest) [best, nearest] = [point, off];
      }
      return best;
    };
    const ends = () => this.readings().map((ping) => place(ping)).filter((end) => end !== null);
    return nearestOf(this.corners()) ?? nearestOf(ends()) ?? this.view.world(px);
  }

  /** Whether a reading is out of the view that the view would widen for. */
  widens(ping) {
    const at = place(ping);
    return at !== null && this.view.wouldGrow(at);
  }

  /** How many readings lie beyond the view, and how many are from a place that is not known. */
  notShown() {
    const readings = this.view.width ? this.readings() : [];
    const ends = readings.map((ping) => place(ping)).filter((end) => end !== null);
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

  /** All layers on another canvas, for a picture. */
  drawOn(c) {
    const own = [this.ground, this.under, this.marks, this.over];
    const all = new Layer(null, c);
    // They lie on one another.
    all.clear = () => {};
    this.ground = this.under = this.marks = this.over = all;
    this.drawGround();
    this.drawUnder();
    this.drawReadings(this.readings());
    this.drawOver();
    [this.ground, this.under, this.marks, this.over] = own;
  }

  sketch(layer, scan = this.scan) {
    return new Sketch(layer, this.view, this.palette, scan);
  }

  drawGround() {
    const { ground, view, palette } = this;
    ground.clear(view);
    drawGrid(ground, view, palette);
    if (this.sceneFits()) drawScene(ground, view, palette, this.scene);
    drawScaleBar(ground, view, palette);
  }

  /** The sweep before fades behind the one that comes in. */
  drawUnder() {
    this.under.clear(this.view);
    const before = this.scan?.before;
    if (before) {
      this.under.c.globalAlpha = 0.45;
      this.sketch(this.under, before).dots(this.beforeReadings(), "before");
      this.under.c.globalAlpha = 1;
    }
    for (const overlay of this.overlays) overlay.drawUnder?.(this.under, this);
  }

  drawReadings(pings) {
    if (this.scan) this.sketch(this.marks).readings(pings);
  }

  drawOver() {
    if (!this.palette) return;
    this.over.clear(this.view);
    if (this.scan) this.drawScan();
    for (const overlay of this.overlays) overlay.drawOver?.(this.over, this);
    this.measure?.draw(this.over, this.palette);
  }

  drawScan() {
    this.drawRobot((this.latest ?? this.readings().at(-1))?.pose ?? this.scan.start.pose);
    if (this.scan.underWay && this.latest?.viewpoint) this.drawRay("newest", this.latest);
    if (!this.selected?.viewpoint) return;
    this.drawRay("direction", this.selected);
    if (this.path) this.drawPath();
    const at = place(this.selected);
    if (at) circle(this.over.pen("selected", this.palette), this.view.px(at), 8);
  }

  /** The robot's body, which the array has, or else the scene. */
  drawRobot(pose, robot = "robot", heading = "pose") {
    const own = this.scan.session?.array?.body?.shape;
    const scenes = this.sceneFits() ? this.scene.robot : null;
    const body = own ? (own.circle ?? { outline: own.outline }) : scenes;
    const world = (point) => this.view.px(inWorld(pose, point));
    if (body) {
      const c = this.over.pen(robot, this.palette);
      if (body.center) circle(c, world(body.center), body.radius_m * this.view.scale);
      else line(c, [...body.outline, body.outline[0]].map(world));
    }
    drawPose(this.over.pen(heading, this.palette), world([0, 0]), -pose.heading_deg * TURN);
  }

  drawRay(pen, ping) {
    const sketch = this.sketch(this.over);
    line(this.over.pen(pen, this.palette), [sketch.from(ping), sketch.ray(ping).end]);
    const { x_m, y_m } = ping.pose ?? this.scan.start.pose;
    const off_m = Math.hypot(ping.viewpoint.x_m - x_m, ping.viewpoint.y_m - y_m);
    if (off_m > 1e-3) sketch.transducer(ping);
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
      const at = place(ping);
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
