// Floor plan of a hidden room: readings and surveyed walls, and the true room once it is revealed. Clicks and keys drive the robot.

import { circle, drawPose, line } from "../../crates/sonard-daemon/src/server/page/layers.js";
import { Plan } from "../../crates/sonard-daemon/src/server/page/plan.js";
import { describeStop, drawSurvey } from "../../crates/sonard-daemon/src/server/page/surveyed-plan.js";

const RAD_PER_DEG = Math.PI / 180;
/** Half side of the square around a stop that is in view before any wall is known, metres. */
const AROUND_M = 1;
/** @typedef {"forward" | "back" | "left" | "right" | "sweep"} Action */
/** @type {Record<string, Action>} */
const KEYS = { ArrowUp: "forward", ArrowDown: "back", ArrowLeft: "left", ArrowRight: "right", " ": "sweep" };
export const KEYS_LABEL = "Floor plan: arrow keys drive and turn the robot, space sweeps; with shift, arrow keys pan; plus and minus zoom, 0 fits the view";

export class HiddenPlan extends Plan {
  /**
   * @param {HTMLElement} stage
   * @param {{onTarget: (at: [number, number]) => void, onAction: (action: Action) => void}} callbacks
   */
  constructor(stage, { onTarget, onAction }) {
    super(stage, () => {}, "Floor plan with readings, surveyed walls and poses");
    this.onTarget = onTarget;
    this.onAction = onAction;
    /** @type {any} */
    this.survey = null;
    /** Floor plan of the true room once it is revealed. @type {any} */
    this.truth = null;
    /** Poses of the stops by odometry. @type {import("./engine.js").Pose[]} */
    this.odometry = [];
    this.overlays.push({
      drawUnder: (/** @type {any} */ layer) => this.drawSurveyed(layer),
      describeAt: (/** @type {number[]} */ px) => (this.survey ? describeStop(px, this, this.survey.poses) : undefined),
    });
  }

  /** @param {any} layer */
  drawSurveyed(layer) {
    this.drawTruth(layer);
    for (const { x_m, y_m, heading_deg } of this.odometry) {
      drawPose(layer.pen("odometry", this.palette), this.view.px([x_m, y_m]), -heading_deg * RAD_PER_DEG);
    }
    if (this.survey) drawSurvey(layer, this, this.survey);
  }

  /** Draws the true room as a band, on which the surveyed walls are legible. @param {any} layer */
  drawTruth(layer) {
    if (!this.truth) return;
    const c = layer.pen("truth", this.palette);
    c.globalAlpha = 0.5;
    for (const { from, to } of this.truth.walls) line(c, [this.view.px(from), this.view.px(to)]);
    for (const { center, radius_m } of this.truth.cylinders) circle(c, this.view.px(center), radius_m * this.view.scale);
    c.globalAlpha = 1;
  }

  /** Ends of the true walls once revealed, and of the surveyed ones, metres. */
  corners() {
    const ends = (/** @type {any} */ walls) => (walls ?? []).flatMap((/** @type {any} */ { from, to }) => [from.at_m ?? from, to.at_m ?? to]);
    return [...ends(this.truth?.walls), ...ends(this.survey?.walls)];
  }

  /** Ends of the walls; before any is known, squares around the stops. */
  extent() {
    const corners = this.corners();
    if (corners.length) return corners;
    return this.odometry.flatMap(({ x_m, y_m }) => [[x_m - AROUND_M, y_m - AROUND_M], [x_m + AROUND_M, y_m + AROUND_M]]);
  }

  /** A click is a target of the robot. @param {number[]} px */
  pick(px) {
    this.onTarget(this.view.world(px));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const action = KEYS[event.key];
    if (!action || event.shiftKey) return super.key(event);
    this.onAction(action);
    return true;
  }
}
