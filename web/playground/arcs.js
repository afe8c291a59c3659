// Readings as arcs: all that a ranger knows is that something within its beam is so far away.

import { MARKS } from "../../src/server/page/verdicts.js";

const TURN = Math.PI / 180;

/**
 * @param {import("../../src/server/page/pens.js").Layer} layer
 * @param {any} plan
 * @param {number} half_deg half the width of the beam
 */
export function drawArcs(layer, plan, half_deg) {
  layer.clear();
  const { c } = layer;
  c.setLineDash([]);
  c.lineWidth = 1.2;
  c.globalAlpha = 0.55;
  for (const ping of plan.readings()) {
    if (!ping.viewpoint || ping.range_m === null) continue;
    const turn = -ping.viewpoint.direction_deg * TURN;
    c.strokeStyle = plan.palette[MARKS[/** @type {keyof typeof MARKS} */ (ping.mark)].colour];
    c.beginPath();
    c.arc(...plan.from(ping), ping.range_m * plan.view.scale, turn - half_deg * TURN, turn + half_deg * TURN);
    c.stroke();
  }
  c.globalAlpha = 1;
}
