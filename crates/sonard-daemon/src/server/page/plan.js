// Floor plan on five layers: ground (grid, walls), under (previous scan, overlays), marks (readings, drawn as they
// arrive), above (findings), and over (robot, current beam, selection, propagation path, lengths), which changes with
// every beam.

import { describeReading } from "./beam.js";
import { make } from "./dom.js";
import { Gestures } from "./gestures.js";
import { drawGrid, drawScaleBar, drawScene } from "./ground.js";
import { arrow, circle, drawPose, Layer, line, PEN_NAMES } from "./layers.js";
import { positionOf, Sketch } from "./sketch.js";
import { Tip } from "./tip.js";
import { View } from "./view.js";
import { angleOffAxis, robotToWorld } from "./viewpoint.js";

/** Maximum distance of a clicked and of a hovered reading, pixels. */
const HIT_PX = 24, HOVER_PX = 12;
const RAD_PER_DEG = Math.PI / 180;
/** Number of readings above which a gesture moves the layers and redraws them only after it rests. */
const MAX_REDRAWN_READINGS = 4000;
const REST_MS = 120;
const LAYERS = ["ground", "under", "marks", "above", "over"];

export class Plan {
  /** `onPick(index)` is called with the clicked beam; `label` is the accessible name of the plan. */
  constructor(stage, onPick, label) {
    this.stage = stage;
    this.label = label;
    /** @type {Layer[]} */
    this.layers = [];
    for (const name of LAYERS) this.addLayer(name);
    this.ground = this.layers[0];
    this.under = this.layers[1];
    this.marks = this.layers[2];
    this.above = this.layers[3];
    this.over = this.layers[4];
    this.tip = new Tip(stage);
    /** Reading whose tip is shown while the pointer is over nothing else. */
    this.tipped = null;
    /** Cleared while something else moves on the plan. */
    this.hasTips = true;
    /** Frame in which the tip of a hovered point is shown. @type {number | null} */
    this.hovering = null;
    /** Frame in which a moved view is drawn. @type {number | null} */
    this.moving = null;
    /** Timer of the full redraw after a gesture. */
    this.resting = 0;
    this.view = new View();
    /** Suspends automatic fitting while a handle is dragged. */
    this.held = false;
    this.scene = null;
    /** Surveyed floor plan that replaces the scene. */
    this.surveyed = null;
    this.scan = null;
    this.selected = null;
    this.latest = null;
    this.path = null;
    this.palette = null;
    /** Key of the scene and pose that the view was fitted to. */
    this.fitted = "";
    this.onPick = onPick;
    /** Measuring tool, if the page has one. */
    this.measure = null;
    /**
     * Objects that draw below or above the readings, and that describe what they drew at a pixel: `describeAt`
     * before the readings, `describeUnder` after them.
     * @type {{drawUnder?: Function, drawAbove?: Function, drawOver?: Function, describeAt?: Function, describeUnder?: Function}[]}
     */
    this.overlays = [];
    this.onView = () => {};
    new ResizeObserver(() => this.resize()).observe(stage);
    const tool = () => (this.measure?.on ? this.measure : null);
    this.gestures = new Gestures(stage, this.over.canvas, this.view, {
      onMove: () => this.moveView(),
      onClick: (px) => (tool() ?? { click: (at) => this.pick(at) }).click(px),
      onHover: (px) => (tool() ?? this).hover(px),
      onLeave: () => this.leave(),
      onKey: (event) => tool()?.key(event) || this.key(event),
    });
  }

  /** Adds a layer on top of the others. Layers of the page's main plan have their name as the element's id. */
  addLayer(name) {
    const isTop = name === "over";
    const canvas = make("canvas", { className: name, ...(isTop ? { role: "img", ariaLabel: this.label } : { ariaHidden: "true" }) });
    if (this.stage.id) canvas.id = name;
    this.stage.append(canvas);
    this.layers.push(new Layer(canvas));
    return this.layers.at(-1);
  }

  /** Redraws all layers after a change of scene, scan, size or style. */
  redraw(palette = this.palette) {
    this.palette = palette;
    if (!this.view.width) return;
    if (!this.held || !this.view.box) this.fit();
    this.drawGround();
    this.drawUnder();
    this.marks.clear(this.view);
    this.drawReadings(this.readings());
    this.drawAbove();
    this.drawOver();
    this.showTip();
    this.onView();
  }

  /** Redraws a moved view, at most once per frame. */
  moveView() {
    this.moving ??= requestAnimationFrame(() => {
      this.moving = null;
      if (this.readings().length + this.previousReadings().length <= MAX_REDRAWN_READINGS) return this.redraw();
      this.drawGround();
      for (const layer of [this.under, this.marks, this.above]) layer.shift(this.view);
      this.drawOver();
      this.showTip();
      clearTimeout(this.resting);
      this.resting = setTimeout(() => this.redraw(), REST_MS);
    });
  }

  /** Draws the readings received since the last frame. */
  addReadings(pings) {
    if (!this.view.width) return;
    this.latest = pings.at(-1) ?? this.latest;
    if (pings.some((ping) => this.growsFor(ping))) return this.redraw();
    this.drawReadings(pings);
    this.drawOver();
  }

  /** Marks a beam, and its propagation path if that is loaded. */
  select(ping, path = null) {
    this.selected = ping;
    this.path = path;
    this.showTip(ping);
    if (this.view.width) this.drawOver();
  }

  resize() {
    const { clientWidth, clientHeight } = this.stage;
    this.view.resize(clientWidth, clientHeight);
    for (const layer of this.layers) layer.resize(clientWidth, clientHeight);
    if (this.palette) this.redraw();
  }

  /** Fits the view: "room", "near" (room and readings around it) or "all". */
  show(mode) {
    this.view.show(mode);
    this.redraw();
  }

  /** Handles a key; returns `false` if the key has no meaning here. @param {KeyboardEvent} event */
  key({ key }) {
    if (key === "0" || key === "Home") this.show(this.view.mode);
    else if (key.toLowerCase() === "m" && this.measure) this.measure.toggle();
    else return false;
    return true;
  }

  readings() {
    return this.scan ? [...this.scan.beams.values()] : [];
  }

  /** Readings of the previous scan while the next one is running. */
  previousReadings() {
    return this.scan?.previous ? [...this.scan.previous.beams.values()] : [];
  }

  fit() {
    const room = this.extent();
    for (const { center: [x, y], radius_m: r } of this.scene?.cylinders ?? []) room.push([x - r, y - r], [x + r, y + r]);
    const pose = this.scan?.start.pose;
    if (pose) room.push([pose.x_m, pose.y_m]);
    const readings = this.readings();
    for (const { viewpoint } of readings) if (viewpoint) room.push([viewpoint.x_m, viewpoint.y_m]);
    const ends = readings.map((ping) => positionOf(ping)).filter((end) => end !== null);
    // While readings arrive the view only grows, also from one scan to the next at the same pose.
    const key = `${this.scene?.sha256} ${JSON.stringify(pose)}`;
    const grow = this.scan?.running && key === this.fitted;
    this.fitted = key;
    if (room.length === 1) room.push(...[[-1, -1], [1, 1]].map(([x, y]) => [room[0][0] + x, room[0][1] + y]));
    this.view.fit(room, ends, grow);
  }

  /** Points of the room that the view is fitted to, metres. */
  extent() {
    return this.corners();
  }

  /** End points of the scene's walls, metres. */
  corners() {
    return (this.scene?.walls ?? []).flatMap(({ from, to }) => [from, to]);
  }

  /** Snaps a pixel to the nearest wall end within `max_px`, else to the nearest reading; returns world coordinates, metres. */
  snap(px, max_px) {
    const nearestOf = (points) => {
      let [best, nearest_px] = [null, max_px];
      for (const point of points) {
        const [x, y] = this.view.px(point);
        const distance_px = Math.hypot(x - px[0], y - px[1]);
        if (distance_px < nearest_px) [best, nearest_px] = [point, distance_px];
      }
      return best;
    };
    const ends = () => this.readings().map((ping) => positionOf(ping)).filter((end) => end !== null);
    return nearestOf(this.corners()) ?? nearestOf(ends()) ?? this.view.world(px);
  }

  /** Returns `true` if the view has to grow for a reading. */
  growsFor(ping) {
    const at = positionOf(ping);
    return at !== null && this.view.wouldGrow(at);
  }

  /** Numbers of readings outside the view, and of readings whose viewpoint is unknown. */
  hiddenCounts() {
    const readings = this.view.width ? this.readings() : [];
    const ends = readings.map((ping) => positionOf(ping)).filter((end) => end !== null);
    const outside = ends.filter((end) => this.view.isOutside(this.view.px(end))).length;
    return { outside, unplaced: readings.filter((ping) => !ping.viewpoint).length };
  }

  /** Names of the pens in use. */
  pens() {
    return PEN_NAMES.filter((name) => this.layers.some((layer) => layer.used.has(name)));
  }

  /** Returns `true` if the loaded scene is the one that the scan was recorded in, or a surveyed one. */
  sceneFits() {
    if (this.surveyed) return true;
    const recorded = this.scan?.session?.scene?.sha256;
    return this.scene && (!recorded || recorded === this.scene.sha256);
  }

  /** Draws all layers on one canvas context, for a picture. */
  drawOn(c) {
    const own = [this.ground, this.under, this.marks, this.above, this.over];
    const all = new Layer(null, c);
    // The shared context accumulates the layers.
    all.clear = () => {};
    this.ground = this.under = this.marks = this.above = this.over = all;
    this.drawGround();
    this.drawUnder();
    this.drawReadings(this.readings());
    this.drawAbove();
    this.drawOver();
    [this.ground, this.under, this.marks, this.above, this.over] = own;
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

  /** Draws the previous scan, faded, and the overlays below the readings. */
  drawUnder() {
    this.under.clear(this.view);
    const previous = this.scan?.previous;
    if (previous) {
      this.under.c.globalAlpha = 0.45;
      this.sketch(this.under, previous).dots(this.previousReadings(), "previous");
      this.under.c.globalAlpha = 1;
    }
    for (const overlay of this.overlays) overlay.drawUnder?.(this.under, this);
  }

  drawReadings(pings) {
    if (this.scan) this.sketch(this.marks).readings(pings);
  }

  drawAbove() {
    this.above.clear(this.view);
    for (const overlay of this.overlays) overlay.drawAbove?.(this.above, this);
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
    if (this.scan.running && this.latest?.viewpoint) this.drawRay("newest", this.latest);
    if (!this.selected?.viewpoint) return;
    this.drawRay("direction", this.selected);
    if (this.path) this.drawPath();
    const at = positionOf(this.selected);
    if (at) circle(this.over.pen("selected", this.palette), this.view.px(at), 8);
  }

  /** Draws the robot's body, as defined by the array or else by the scene, with its pose. */
  drawRobot(pose, robot = "robot", heading = "pose") {
    const ofArray = this.scan.session?.array?.body?.shape;
    const ofScene = this.sceneFits() ? this.scene.robot : null;
    const body = ofArray ? (ofArray.circle ?? { outline: ofArray.outline }) : ofScene;
    const toPixels = (point) => this.view.px(robotToWorld(pose, point));
    if (body) {
      const c = this.over.pen(robot, this.palette);
      if (body.center) circle(c, toPixels(body.center), body.radius_m * this.view.scale);
      else line(c, [...body.outline, body.outline[0]].map(toPixels));
    }
    drawPose(this.over.pen(heading, this.palette), toPixels([0, 0]), -pose.heading_deg * RAD_PER_DEG);
  }

  drawRay(pen, ping) {
    const sketch = this.sketch(this.over);
    line(this.over.pen(pen, this.palette), [sketch.from(ping), sketch.ray(ping).end]);
    const { x_m, y_m } = ping.pose ?? this.scan.start.pose;
    const offset_m = Math.hypot(ping.viewpoint.x_m - x_m, ping.viewpoint.y_m - y_m);
    if (offset_m > 1e-3) sketch.transducer(ping);
  }

  /** Draws the propagation path, with an arrow on each leg. */
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

  /** Picks the beam whose mark is nearest to a click, else the one whose direction is. */
  pick(px) {
    const best = this.readingAt(px, HIT_PX) ?? this.beamTowards(this.view.world(px));
    if (best) this.onPick(best.index);
  }

  /** Reading whose mark is nearest to a pixel, within `max_px`. */
  readingAt([x, y], max_px) {
    let [best, nearest_px] = [null, max_px];
    for (const ping of this.readings()) {
      const at = positionOf(ping);
      if (!at) continue;
      const [u, v] = this.view.px(at);
      const distance_px = Math.hypot(u - x, v - y);
      if (distance_px < nearest_px) [best, nearest_px] = [ping, distance_px];
    }
    return best;
  }

  /** Shows what is drawn at a pixel, at most once per frame. */
  hover(px) {
    cancelAnimationFrame(this.hovering);
    this.hovering = requestAnimationFrame(() => {
      const textFrom = (/** @type {"describeAt" | "describeUnder"} */ how) => this.overlays.map((overlay) => overlay[how]?.(px, this)).find((text) => text);
      const textOfReading = () => {
        const reading = this.readingAt(px, HOVER_PX);
        return reading ? describeReading(reading) : undefined;
      };
      const text = textFrom("describeAt") ?? textOfReading() ?? textFrom("describeUnder");
      if (text) this.tip.show(text, px);
      else this.showTip();
    });
  }

  leave() {
    cancelAnimationFrame(this.hovering);
    this.showTip();
  }

  /** Shows the value of a reading next to its mark, until another one is given; `null` hides it. */
  showTip(ping = this.tipped) {
    this.tipped = ping;
    const at = ping && this.scan && this.hasTips && !this.measure?.on && this.view.width ? positionOf(ping) : null;
    const px = at && this.view.px(at);
    if (px && !this.view.isOutside(px)) this.tip.show(describeReading(ping), px);
    else this.tip.hide();
  }

  beamTowards(point) {
    const deviation = ({ viewpoint }) => (viewpoint ? angleOffAxis(viewpoint, point) : Infinity);
    return this.readings().reduce((a, b) => (a && deviation(a) <= deviation(b) ? a : b), null);
  }
}
