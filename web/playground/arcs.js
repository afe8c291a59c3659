// Readings as arcs: all that a ranger knows is that something within its beam is so far away.

import { MARKS } from "../../crates/sonard-daemon/src/server/page/verdicts.js";

const TURN = Math.PI / 180;

/**
 * @param {import("../../crates/sonard-daemon/src/server/page/pens.js").Layer} layer
 * @param {any} plan
 * @param {number | null} half_deg half the width of the beam; none are drawn without it
 */
export function drawArcs(layer, plan, half_deg) {
  layer.clear(plan.view);
  if (half_deg === null) return;
  const c = layer.pen("fan", plan.palette);
  c.globalAlpha = 0.55;
  for (const ping of plan.readings()) {
    if (!ping.viewpoint || ping.range_m === null) continue;
    const turn = -ping.viewpoint.direction_deg * TURN;
    c.strokeStyle = plan.palette[MARKS[/** @type {keyof typeof MARKS} */ (ping.mark)].colour];
    c.beginPath();
    c.arc(...plan.view.px([ping.viewpoint.x_m, ping.viewpoint.y_m]), ping.range_m * plan.view.scale, turn - half_deg * TURN, turn + half_deg * TURN);
    c.stroke();
  }
  c.globalAlpha = 1;
}
