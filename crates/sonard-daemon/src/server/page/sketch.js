// Readings on the floor plan, each drawn from its own viewpoint.

import { arrow, disc, drawFace, drawSector } from "./layers.js";
import { MARKS, draw } from "./verdicts.js";
import { pointAt } from "./viewpoint.js";

const MARK_PX = 3;
const RAD_PER_DEG = Math.PI / 180;
/** Half-angle of the minimum-range arc of a fixed ranger, degrees. */
const ARC_DEG = 8;
/** Half-width of the transducer symbol, metres. */
const FACE_M = 0.02;
/** Number of readings above which marks of the same kind on the same pixel are drawn once. */
const MAX_OVERDRAWN_READINGS = 5000;

/** Position of a range along a beam, by default of the reading's own range, metres; `null` if unknown. */
export function positionOf({ viewpoint, range_m }, m = range_m) {
  return viewpoint && m !== null ? pointAt(viewpoint, m) : null;
}

export class Sketch {
  /** @param {any} layer @param {any} view @param {any} palette @param {any} scan whose readings are drawn */
  constructor(layer, view, palette, scan) {
    this.layer = layer;
    this.view = view;
    this.palette = palette;
    this.scan = scan;
    /** Kind and pixel of each drawn mark, for large scans. @type {Set<string> | null} */
    this.occupied = scan.beams.size > MAX_OVERDRAWN_READINGS ? new Set() : null;
  }

  /** Draws measured readings above predicted ones. */
  readings(pings) {
    const placed = pings.filter((ping) => ping.viewpoint);
    this.minRangeArcs(placed);
    for (const ping of placed) {
      if (ping.ranger) {
        this.lobe(ping);
        this.transducer(ping);
      }
      if (ping.sim?.range_m != null) this.mark("prediction", ping, ping.sim.range_m);
    }
    // Marks of one kind after the other make a picture of a large scan smaller.
    const ordered = this.occupied ? Object.keys(MARKS).flatMap((name) => placed.filter(({ mark }) => mark === name)) : placed;
    for (const ping of ordered) {
      if (MARKS[ping.mark].shape === "tick") this.tick(ping);
      else this.mark(ping.mark, ping, ping.range_m);
    }
  }

  /** Draws readings of any kind as dots of one pen. */
  dots(pings, pen) {
    const c = this.layer.pen(pen, this.palette);
    for (const ping of pings) {
      const at = positionOf(ping);
      if (!at) continue;
      const px = this.view.px(at);
      if (!this.view.isOutside(px) && this.isFree(pen, px)) disc(c, px, 2);
    }
  }

  mark(mark, ping, range_m) {
    const at = this.view.px(positionOf(ping, range_m));
    const colour = this.palette[MARKS[mark].colour];
    if (!this.view.isOutside(at)) {
      if (this.isFree(mark, at)) draw(this.layer.c, mark, ...at, MARK_PX, colour);
      return;
    }
    if (mark === "prediction") return;
    // Readings outside the view appear as arrows at its edge, in the colour of their mark.
    const { end, turn } = this.ray(ping);
    if (!this.isFree("outside", end)) return;
    const c = this.layer.pen("outside", this.palette);
    c.fillStyle = colour;
    arrow(c, end, turn, [3, 5, 2.4]);
  }

  /** Draws a reading without range at the edge of the view, in the beam's direction. */
  tick(ping) {
    const { end, turn } = this.ray(ping);
    if (this.isFree(ping.mark, end)) draw(this.layer.c, ping.mark, ...end, MARK_PX, this.palette[MARKS[ping.mark].colour], turn);
  }

  /** Draws the minimum range (blanking) as an arc around each transducer, as wide as one step of the sweep. */
  minRangeArcs(pings) {
    const { session, start } = this.scan;
    if (!session || !pings.length) return;
    const radius_px = ((session.sensor.blanking_us * 1e-6 * session.air.sound_speed_m_s) / 2) * this.view.scale;
    const c = this.layer.pen("blanking", this.palette);
    for (const ping of pings) {
      const half = RAD_PER_DEG * (ping.ranger ? ARC_DEG : Math.min(ARC_DEG, start.plan.step_deg / 2));
      const { turn } = this.ray(ping);
      const [x, y] = this.from(ping);
      if (!this.isFree("blanking", [x + radius_px * Math.cos(turn), y + radius_px * Math.sin(turn)])) continue;
      c.beginPath();
      c.arc(x, y, radius_px, turn - half, turn + half);
      c.stroke();
    }
  }

  /** Draws the main lobe of a ranger at rest on its robot, up to its reading or the edge of the view. */
  lobe(ping) {
    const { end, turn } = this.ray(ping);
    const from = this.from(ping);
    const radius = ping.range_m === null ? Math.hypot(end[0] - from[0], end[1] - from[1]) : ping.range_m * this.view.scale;
    const c = this.layer.pen("lobe", this.palette);
    c.globalAlpha = 0.6;
    drawSector(c, from, turn, halfLobe(this.scan.session), radius);
    c.globalAlpha = 1;
  }

  transducer(ping) {
    const c = this.layer.pen("transducer", this.palette);
    drawFace(c, this.from(ping), this.ray(ping).turn, Math.max(3, FACE_M * this.view.scale));
  }

  /** Viewpoint of a reading, pixels. */
  from({ viewpoint: { x_m, y_m } }) {
    return this.view.px([x_m, y_m]);
  }

  /** Point at which a beam leaves the view, pixels, and its direction, radians clockwise from the right. */
  ray(ping) {
    const turn = -ping.viewpoint.direction_deg * RAD_PER_DEG;
    return { end: this.view.border(this.from(ping), turn), turn };
  }

  /** Returns `true`, and marks the pixel as occupied, unless a mark of the kind is already there; always `true` for small scans. */
  isFree(kind, [x, y]) {
    if (!this.occupied) return true;
    const size = this.occupied.size;
    return this.occupied.add(`${kind} ${Math.round(x)} ${Math.round(y)}`).size > size;
  }
}

/** Half angle of the main lobe, radians: asin(0.61 lambda / a) for a piston of radius a, else that of the minimum-range arc. */
function halfLobe(session) {
  const { aperture, frequency_hz } = session?.sensor ?? {};
  if (!aperture?.radius_m) return ARC_DEG * RAD_PER_DEG;
  return Math.asin(Math.min(1, (0.61 * session.air.sound_speed_m_s) / frequency_hz / aperture.radius_m));
}
