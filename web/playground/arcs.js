// Readings as arcs across the beam: the possible positions of each reflector.

import { MARKS } from "../../crates/sonard-daemon/src/server/page/verdicts.js";

const RAD_PER_DEG = Math.PI / 180;

/**
 * @param {import("../../crates/sonard-daemon/src/server/page/layers.js").Layer} layer
 * @param {any} plan
 * @param {number | null} half_deg half-width of the beam; `null` draws none
 */
export function drawArcs(layer, plan, half_deg) {
  layer.clear(plan.view);
  if (half_deg === null) return;
  const c = layer.pen("arc", plan.palette);
  c.globalAlpha = 0.55;
  for (const ping of plan.readings()) {
    if (!ping.viewpoint || ping.range_m === null) continue;
    const turn = -ping.viewpoint.direction_deg * RAD_PER_DEG;
    c.strokeStyle = plan.palette[MARKS[/** @type {keyof typeof MARKS} */ (ping.mark)].colour];
    c.beginPath();
    c.arc(...plan.view.px([ping.viewpoint.x_m, ping.viewpoint.y_m]), ping.range_m * plan.view.scale, turn - half_deg * RAD_PER_DEG, turn + half_deg * RAD_PER_DEG);
    c.stroke();
  }
  c.globalAlpha = 1;
}
