// Handles of the ranger: one moves it, one turns it.

import { Handle } from "./drag-handles.js";

/** @import { Pose } from "../../../../../web/playground/engine.js" */

const RAD_PER_DEG = Math.PI / 180;
/** Distance of the heading handle from the ranger, pixels. */
const HEADING_HANDLE_PX = 52;
/** Rotation per key press, degrees; ten times as much with shift. */
const KEY_STEP_DEG = 0.9;

export class Ranger {
  /**
   * @param {HTMLElement} stage
   * @param {any} view
   * @param {(pose: Pose) => void} onPose
   * @param {() => void} onDone
   */
  constructor(stage, view, onPose, onDone) {
    this.view = view;
    this.pose = { x_m: 0, y_m: 0, heading_deg: 0 };
    const turn = (/** @type {number} */ deg) => onPose({ ...this.pose, heading_deg: rounded(wrapped(this.pose.heading_deg + deg), 2) });
    const onKey = (/** @type {string} */ key, /** @type {boolean} */ shift) => {
      const signs = { PageUp: 1, PageDown: -1, q: 1, e: -1, Q: 1, E: -1 };
      const sign = signs[/** @type {keyof typeof signs} */ (key)];
      if (!sign) return false;
      turn(sign * KEY_STEP_DEG * (shift ? 10 : 1));
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
    this.heading = new Handle(stage, {
      name: "Heading",
      className: "heading",
      onMove: ([x, y]) => {
        const heading = Math.atan2(y - this.pose.y_m, x - this.pose.x_m) / RAD_PER_DEG;
        onPose({ ...this.pose, heading_deg: rounded(wrapped(heading), 1) });
      },
      onDone,
      // Left and up turn counterclockwise.
      onKey: (key, shift) => {
        const signs = { ArrowLeft: 1, ArrowUp: 1, ArrowRight: -1, ArrowDown: -1 };
        const sign = signs[/** @type {keyof typeof signs} */ (key)];
        if (!sign) return onKey(key, shift);
        turn(sign * KEY_STEP_DEG * (shift ? 10 : 1));
        onDone();
        return true;
      },
    }, view);
  }

  /** @param {Pose} pose */
  place(pose) {
    this.pose = pose;
    const { x_m, y_m, heading_deg } = pose;
    this.body.place([x_m, y_m], `Ranger at (${x_m.toFixed(2)}, ${y_m.toFixed(2)}) m: arrow keys move, Page Up and Page Down turn`);
    const [ahead_m, heading] = [HEADING_HANDLE_PX / this.view.scale, heading_deg * RAD_PER_DEG];
    const at = /** @type {[number, number]} */ ([x_m + ahead_m * Math.cos(heading), y_m + ahead_m * Math.sin(heading)]);
    this.heading.place(at, `Heading ${heading_deg.toFixed(1)} degrees: arrow keys turn`);
  }
}

/** @param {number} deg */
const wrapped = (deg) => ((deg % 360) + 360) % 360;

/**
 * @param {number} value
 * @param {number} digits
 */
export const rounded = (value, digits) => Number(value.toFixed(digits));
