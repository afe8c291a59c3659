// What was found in a scan, on the floor plan: occupancy, fitted lines, and planes, corners and edges.

import { circle, line } from "./pens.js";

/** Shades of the map; cells of one shade beside each other are drawn as one. */
const SHADES = 6;
const LETTERS = { plane: "P", corner: "C", edge: "E", unresolved: "?" };

/** @param {any} layer @param {any} plan @param {any} found @param {Set<string>} wanted */
export function drawFindings(layer, plan, found, wanted) {
  if (wanted.has("map") && found.map) drawMap(layer, plan, found.map);
  if (wanted.has("lines")) for (const one of found.lines) drawLine(layer, plan, one);
}

/** Above the readings: their letters are to be read. @param {any} layer @param {any} plan @param {any} found */
export function drawFeatures(layer, plan, found) {
  for (const one of found.features) drawFeature(layer, plan, one);
}

function drawMap(layer, { view, palette }, { origin: [x0, y0], resolution_m, width, cells }) {
  // From free, below zero, to occupied.
  const shade = (percent) => (percent < 0 ? 0 : Math.round(((percent - 50) / 50) * SHADES));
  for (let row = 0; row * width < cells.length; row++) {
    for (let from = 0; from < width; ) {
      const at = row * width;
      const now = shade(cells[at + from]);
      let to = from + 1;
      while (to < width && shade(cells[at + to]) === now) to++;
      if (now) {
        const c = layer.pen(now > 0 ? "occupied" : "free", palette);
        // On whole pixels: cells neither overlap nor leave gaps.
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
  if (view.isBeyond(px)) return;
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
