// Interpretation results on the floor plan: occupancy map, fitted lines, and features (planes, corners, edges).

import { circle, line } from "./layers.js";

/** Number of grey levels of the map; adjacent cells of equal level are drawn as one rectangle. */
const SHADES = 6;
const LETTERS = { plane: "P", corner: "C", edge: "E", unresolved: "?" };
const FEATURE_PX = 9, LINE_PX = 6;
/** Maximum distance of a line from the wall that it represents, metres. */
const WALL_M = 0.1;
/** Minimum cosine of the angle between both legs at the ranger of a path by way of a corner. */
const RETURNS = 0.9;

/** Cells below zero are free, above zero occupied. @param {number} percent */
const shade = (percent) => (percent < 0 ? 0 : Math.round(((percent - 50) / 50) * SHADES));

/** Draws the free or the occupied cells of a map. @param {any} layer @param {any} plan @param {any} map @param {boolean} occupied */
export function drawMap(layer, { view, palette }, { origin: [x0, y0], resolution_m, width, cells }, occupied) {
  for (let row = 0; row * width < cells.length; row++) {
    for (let from = 0; from < width; ) {
      const at = row * width;
      const now = shade(cells[at + from]);
      let to = from + 1;
      while (to < width && shade(cells[at + to]) === now) to++;
      if (now && now > 0 === occupied) {
        const c = layer.pen(occupied ? "occupied" : "free", palette);
        // Rounded to whole pixels, so that cells neither overlap nor leave gaps.
        const [x, y] = view.px([x0 + from * resolution_m, y0 + (row + 1) * resolution_m]).map(Math.round);
        const [right, low] = view.px([x0 + to * resolution_m, y0 + row * resolution_m]).map(Math.round);
        c.globalAlpha = ((occupied ? 0.5 : 0.3) * Math.abs(now)) / SHADES;
        c.fillRect(x, y, right - x, low - y);
      }
      from = to;
    }
  }
  layer.c.globalAlpha = 1;
}

/** Draws a line on a light edge, which contrasts with the marks. @param {any} layer @param {any} plan @param {any} segment */
export function drawLine(layer, { view, palette }, { from, to, contradiction }) {
  const points = [view.px(from), view.px(to)];
  const c = layer.pen(contradiction ? "unconfirmed" : "found", palette);
  const { strokeStyle, lineWidth } = c;
  [c.strokeStyle, c.lineWidth] = [palette["--panel"], lineWidth + 3];
  line(c, points);
  [c.strokeStyle, c.lineWidth] = [strokeStyle, lineWidth];
  line(c, points);
}

/** @param {any} layer @param {any} plan @param {any} feature */
export function drawFeature(layer, { view, palette }, { kind, at, contradiction }) {
  const px = view.px(at);
  if (view.isOutside(px)) return;
  const c = layer.pen(contradiction ? "contradicted" : "feature", palette);
  const ink = c.fillStyle;
  c.fillStyle = palette["--panel"];
  c.beginPath();
  c.arc(...px, FEATURE_PX, 0, 2 * Math.PI);
  c.fill();
  circle(c, px, FEATURE_PX);
  c.fillStyle = ink;
  [c.font, c.textAlign, c.textBaseline] = ["600 11px system-ui, sans-serif", "center", "middle"];
  c.fillText(`${LETTERS[kind]}${contradiction ? "!" : ""}`, px[0], px[1] + 0.5);
}

/** Text of the feature or line at a pixel, if there is one. @param {any} found @param {Set<string>} enabled @param {any} view @param {number[]} px */
export function describeFinding(found, enabled, view, px) {
  const distance_px = (point) => Math.hypot(...view.px(point).map((value, i) => value - px[i]));
  const feature = enabled.has("features") && found.features.find(({ at }) => distance_px(at) <= FEATURE_PX + 2);
  if (feature) return withContradiction(featureText(feature), feature);
  const segment = enabled.has("lines") && found.lines.find(({ from, to }) => distanceToSegment(px, view.px(from), view.px(to)) <= LINE_PX);
  return segment ? withContradiction(`fitted line, confidence ${segment.confidence.toFixed(2)}`, segment) : undefined;
}

/** Text of the map's cell at a pixel. @param {any} map @param {any} view @param {number[]} px */
export function describeCell({ origin, resolution_m, width, cells }, view, px) {
  const [column, row] = view.world(px).map((m, axis) => Math.floor((m - origin[axis]) / resolution_m));
  const percent = column >= 0 && column < width && row >= 0 ? cells[row * width + column] : undefined;
  return percent >= 0 ? `map: occupied with probability ${(percent / 100).toFixed(2)}` : undefined;
}

const withContradiction = (text, { contradiction }) => (contradiction ? `${text}; ${contradiction}` : text);

function featureText({ kind, confidence, reason }) {
  if (kind !== "unresolved") return `${kind}, probability ${confidence.toFixed(2)}`;
  return `unresolved (${reason.replaceAll("_", " ")}), probability of the best class ${confidence.toFixed(2)}`;
}

/** Marks the findings that contradict the model's prediction for their beams, or the scene. @param {any} found @param {any} scan @param {any} scene */
export function markContradictions(found, scan, scene) {
  for (const feature of found.features) {
    const predicted = feature.kind === "unresolved" ? null : predictedKind(feature.beams, scan);
    if (predicted && predicted !== feature.kind) feature.contradiction = `the model predicts a${predicted === "edge" ? "n" : ""} ${predicted} here`;
  }
  for (const segment of scene ? found.lines : []) {
    /** @type {number[]} */
    const middle = segment.from.map((value, axis) => (value + segment.to[axis]) / 2);
    const nearWall = [segment.from, middle, segment.to].some((point) => scene.walls.some(({ from, to }) => distanceToSegment(point, from, to) < WALL_M));
    if (!nearWall) segment.contradiction = "no wall of the scene here";
  }
}

/** Most frequent kind of the predicted paths of an arc; `null` without predictions. */
function predictedKind([first, last], scan) {
  const votes = new Map();
  for (const { index, sim, viewpoint } of scan?.beams?.values() ?? []) {
    const isWithin = first <= last ? index >= first && index <= last : index >= first || index <= last;
    if (!isWithin || !sim?.path || !viewpoint) continue;
    const kind = kindOf(sim.path, viewpoint);
    votes.set(kind, (votes.get(kind) ?? 0) + 1);
  }
  return [...votes].sort((a, b) => b[1] - a[1])[0]?.[0] ?? null;
}

function kindOf({ kind, order, interactions }, viewpoint) {
  if (kind === "diffracted" && order === 0) return "edge";
  if (kind === "specular" && interactions.length === 1) return "plane";
  return kind === "specular" && interactions.length === 2 && isCornerPath(interactions, viewpoint) ? "corner" : "multiple reflection";
}

/** Returns `true` if the last leg of a path is opposite to its first one. */
function isCornerPath([{ point: a }, { point: b }], { x_m, y_m }) {
  const [u, v] = [a, b].map(([x, y]) => [x - x_m, y - y_m]);
  return (u[0] * v[0] + u[1] * v[1]) / (Math.hypot(...u) * Math.hypot(...v) || 1) > RETURNS;
}

/** @param {number[]} at @param {number[]} from @param {number[]} to */
function distanceToSegment([x, y], [x0, y0], [x1, y1]) {
  const [dx, dy] = [x1 - x0, y1 - y0];
  const along = Math.max(0, Math.min(1, ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(x - x0 - along * dx, y - y0 - along * dy);
}
