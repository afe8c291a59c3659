// Interpretation results on the floor plan: occupancy map, fitted lines, and features (planes, corners, edges).

import { circle, line } from "./layers.js";

/** Number of grey levels of the map; adjacent cells of equal level are drawn as one rectangle. */
const SHADES = 6;
const LETTERS = { plane: "P", corner: "C", edge: "E", unresolved: "?" };

/** @param {any} layer @param {any} plan @param {any} found @param {Set<string>} enabled */
export function drawFindings(layer, plan, found, enabled) {
  if (enabled.has("map") && found.map) drawMap(layer, plan, found.map);
  if (enabled.has("lines")) for (const segment of found.lines) drawLine(layer, plan, segment);
}

/** Draws features above the readings, so that their letters stay legible. @param {any} layer @param {any} plan @param {any} found */
export function drawFeatures(layer, plan, found) {
  for (const feature of found.features) drawFeature(layer, plan, feature);
}

function drawMap(layer, { view, palette }, { origin: [x0, y0], resolution_m, width, cells }) {
  // Below zero: free; above zero: occupied.
  const shade = (percent) => (percent < 0 ? 0 : Math.round(((percent - 50) / 50) * SHADES));
  for (let row = 0; row * width < cells.length; row++) {
    for (let from = 0; from < width; ) {
      const at = row * width;
      const now = shade(cells[at + from]);
      let to = from + 1;
      while (to < width && shade(cells[at + to]) === now) to++;
      if (now) {
        const c = layer.pen(now > 0 ? "occupied" : "free", palette);
        // Rounded to whole pixels, so that cells neither overlap nor leave gaps.
        const [x, y] = view.px([x0 + from * resolution_m, y0 + (row + 1) * resolution_m]).map(Math.round);
        const [right, low] = view.px([x0 + to * resolution_m, y0 + row * resolution_m]).map(Math.round);
        c.globalAlpha = ((now > 0 ? 0.6 : 0.3) * Math.abs(now)) / SHADES;
        c.fillRect(x, y, right - x, low - y);
      }
      from = to;
    }
  }
  layer.c.globalAlpha = 1;
}

function drawLine(layer, { view, palette }, { from, to, confidence }) {
  const c = layer.pen("found", palette);
  c.globalAlpha = 0.45 + 0.5 * confidence;
  line(c, [view.px(from), view.px(to)]);
  c.globalAlpha = 1;
}

function drawFeature(layer, { view, palette }, { kind, at }) {
  const px = view.px(at);
  if (view.isOutside(px)) return;
  const c = layer.pen("feature", palette);
  const ink = c.fillStyle;
  c.fillStyle = palette["--panel"];
  c.beginPath();
  c.arc(...px, 9, 0, 2 * Math.PI);
  c.fill();
  circle(c, px, 9);
  c.fillStyle = ink;
  [c.font, c.textAlign, c.textBaseline] = ["600 11px system-ui, sans-serif", "center", "middle"];
  c.fillText(LETTERS[kind], px[0], px[1] + 0.5);
}
