// Readings drawn on the floor plan, each from its own viewpoint.

import { arrow, disc, drawFace } from "./pens.js";
import { MARKS, draw } from "./verdicts.js";
import { pointAt } from "./viewpoint.js";

const MARK_PX = 3;
const TURN = Math.PI / 180;
/** Half the angle of an arc that stands for the nearest range of a ranger that does not turn, degrees. */
const ARC_DEG = 8;
/** Half the width of a transducer's face as it is drawn, metres. */
const FACE_M = 0.02;
/** Of more readings than this, those that would lie on one another are drawn once. */
const MANY = 5000;

/** Where a range along a beam ends, metres; by itself its reading's. `null` if it is not known. */
export function place({ viewpoint, range_m }, m = range_m) {
  return viewpoint && m !== null ? pointAt(viewpoint, m) : null;
}

export class Sketch {
  /** @param {any} layer @param {any} view @param {any} palette @param {any} scan whose readings are drawn */
  constructor(layer, view, palette, scan) {
    this.layer = layer;
    this.view = view;
    this.palette = palette;
    this.scan = scan;
    /** What was drawn where, of many readings. @type {Set<string> | null} */
    this.taken = scan.beams.size > MANY ? new Set() : null;
  }

  /** What was read stands above what the model says. */
  readings(pings) {
    const placed = pings.filter((ping) => ping.viewpoint);
    this.nearest(placed);
    for (const ping of placed) {
      if (ping.ranger) this.transducer(ping);
      if (ping.sim?.range_m != null) this.mark("model", ping, ping.sim.range_m);
    }
    for (const ping of placed) {
      if (MARKS[ping.mark].shape === "tick") this.silence(ping);
      else this.mark(ping.mark, ping, ping.range_m);
    }
  }

  /** Readings as dots of a pen, whatever they are. */
  dots(pings, pen) {
    const c = this.layer.pen(pen, this.palette);
    for (const ping of pings) {
      const at = place(ping);
      if (!at) continue;
      const px = this.view.px(at);
      if (!this.view.isBeyond(px) && this.isFree(pen, px)) disc(c, px, 2);
    }
  }

  mark(mark, ping, range_m) {
    const at = this.view.px(place(ping, range_m));
    const colour = this.palette[MARKS[mark].colour];
    if (!this.view.isBeyond(at)) {
      if (this.isFree(mark, at)) draw(this.layer.c, mark, ...at, MARK_PX, colour);
      return;
    }
    if (mark === "model") return;
    // Beyond the view: an arrow on its border says that there is something, in the colour of its mark.
    const { end, turn } = this.ray(ping);
    if (!this.isFree("beyond", end)) return;
    const c = this.layer.pen("beyond", this.palette);
    c.fillStyle = colour;
    arrow(c, end, turn, [3, 5, 2.4]);
  }

  /** On the border of the view, in the beam's direction. */
  silence(ping) {
    const { end, turn } = this.ray(ping);
    if (this.isFree(ping.mark, end)) draw(this.layer.c, ping.mark, ...end, MARK_PX, this.palette[MARKS[ping.mark].colour], turn);
  }

  /** Nothing nearer is heard: a piece of arc round each transducer, as wide as one step of the plan. */
  nearest(pings) {
    const { session, start } = this.scan;
    if (!session || !pings.length) return;
    const near_px = ((session.sensor.blanking_us * 1e-6 * session.air.sound_speed_m_s) / 2) * this.view.scale;
    const c = this.layer.pen("blanking", this.palette);
    for (const ping of pings) {
      const half = TURN * (ping.ranger ? ARC_DEG : Math.min(ARC_DEG, start.plan.step_deg / 2));
      const { turn } = this.ray(ping);
      const [x, y] = this.from(ping);
      if (!this.isFree("blanking", [x + near_px * Math.cos(turn), y + near_px * Math.sin(turn)])) continue;
      c.beginPath();
      c.arc(x, y, near_px, turn - half, turn + half);
      c.stroke();
    }
  }

  transducer(ping) {
    const c = this.layer.pen("face", this.palette);
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

  /** Whether nothing of the kind was drawn there; of few readings always. */
  isFree(kind, [x, y]) {
    if (!this.taken) return true;
    const before = this.taken.size;
    return this.taken.add(`${kind} ${Math.round(x)} ${Math.round(y)}`).size > before;
  }
}
