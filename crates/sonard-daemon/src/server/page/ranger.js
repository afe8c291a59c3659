// The ranger's handles: one to drag it by, one to turn it by.

import { Handle } from "./handles.js";

const TURN = Math.PI / 180;
/** How far ahead of the ranger the handle is that turns it, pixels. */
const AHEAD_PX = 52;
const TURN_DEG = 0.9;

export class Ranger {
  /**
   * @param {HTMLElement} stage
   * @param {any} view
   * @param {(pose: import("../../../web/playground/engine.js").Pose) => void} onPose
   * @param {() => void} onDone
   */
  constructor(stage, view, onPose, onDone) {
    this.view = view;
    this.pose = { x_m: 0, y_m: 0, heading_deg: 0 };
    const turn = (/** @type {number} */ deg) => onPose({ ...this.pose, heading_deg: rounded(wrapped(this.pose.heading_deg + deg), 2) });
    const onKey = (/** @type {string} */ key, /** @type {boolean} */ shift) => {
      const ways = { PageUp: 1, PageDown: -1, q: 1, e: -1, Q: 1, E: -1 };
      const way = ways[/** @type {keyof typeof ways} */ (key)];
      if (!way) return false;
      turn(way * TURN_DEG * (shift ? 10 : 1));
      onDone();
      return true;
    };
    this.body = new Handle(stage, {
      name: "Ranger",
      className: "ranger",
      onMove: ([x, y]) => onPose({ ...this.pose, x_m: rounded(x, 4), y_m: rounded(y, 4) }),
      onDone,
      onKey,
    }, view);
    this.nose = new Handle(stage, {
      name: "Heading",
      className: "nose",
      onMove: ([x, y]) => {
        const heading = Math.atan2(y - this.pose.y_m, x - this.pose.x_m) / TURN;
        onPose({ ...this.pose, heading_deg: rounded(wrapped(heading), 1) });
      },
      onDone,
      // Up and left turn it to the left.
      onKey: (key, shift) => {
        const ways = { ArrowLeft: 1, ArrowUp: 1, ArrowRight: -1, ArrowDown: -1 };
        const way = ways[/** @type {keyof typeof ways} */ (key)];
        if (!way) return onKey(key, shift);
        turn(way * TURN_DEG * (shift ? 10 : 1));
        onDone();
        return true;
      },
    }, view);
  }

  /** @param {import("../../../web/playground/engine.js").Pose} pose */
  place(pose) {
    this.pose = pose;
    const { x_m, y_m, heading_deg } = pose;
    this.body.place([x_m, y_m], `Ranger at ${x_m.toFixed(2)}, ${y_m.toFixed(2)} m: arrow keys move, Page Up and Page Down turn`);
    const ahead = AHEAD_PX / this.view.scale;
    const nose = /** @type {[number, number]} */ ([x_m + ahead * Math.cos(heading_deg * TURN), y_m + ahead * Math.sin(heading_deg * TURN)]);
    this.nose.place(nose, `Heading ${heading_deg.toFixed(1)} degrees: arrow keys turn`);
  }
}

/** @param {number} deg */
const wrapped = (deg) => ((deg % 360) + 360) % 360;

/**
 * @param {number} value
 * @param {number} digits
 */
export const rounded = (value, digits) => Number(value.toFixed(digits));
