// Bottom layer of the floor plan: grid, scale bar and scene.

import { circle, line } from "./layers.js";

/** Maximum number of walls whose names are drawn. */
const MAX_NAMES = 24;
const NAME_PX = 11;
const FONT = "system-ui, sans-serif";

export function drawGrid(layer, view, palette) {
  const { c } = layer;
  const step = gridStep(64 / view.scale);
  c.setLineDash([]);
  c.strokeStyle = palette["--grid"];
  c.lineWidth = 1;
  c.beginPath();
  const [left, top] = view.world([0, 0]);
  for (let i = Math.ceil(left / step); ; i++) {
    const x = Math.round(view.px([i * step, 0])[0]) + 0.5;
    if (x > view.width) break;
    c.moveTo(x, 0);
    c.lineTo(x, view.height);
  }
  for (let i = Math.floor(top / step); ; i--) {
    const y = Math.round(view.px([0, i * step])[1]) + 0.5;
    if (y > view.height) break;
    c.moveTo(0, y);
    c.lineTo(view.width, y);
  }
  c.stroke();
}

/** Draws the scale bar in the lower left corner, on an opaque background. */
export function drawScaleBar({ c }, view, palette) {
  const step = gridStep(64 / view.scale);
  const length = step * view.scale;
  const [x, y] = [12, view.height - 12];
  c.font = `12px ${FONT}`;
  const text = step < 0.01 ? `${Math.round(1000 * step)} mm` : step < 1 ? `${Math.round(100 * step)} cm` : `${step} m`;
  c.setLineDash([]);
  c.fillStyle = palette["--panel"];
  c.fillRect(x - 6, y - 14, length + 20 + c.measureText(text).width, 22);
  c.strokeStyle = c.fillStyle = palette["--muted"];
  c.lineWidth = 1.5;
  line(c, [[x, y - 4], [x, y], [x + length, y], [x + length, y - 4]]);
  c.textAlign = "left";
  c.textBaseline = "alphabetic";
  c.fillText(text, x + length + 7, y + 1);
}

export function drawScene(layer, view, palette, { walls, cylinders }) {
  for (const { from, to, material } of walls) {
    line(layer.pen(material.roughness > 0 ? "rough" : "wall", palette), [view.px(from), view.px(to)]);
  }
  for (const { center, radius_m, material } of cylinders) {
    circle(layer.pen(material.roughness > 0 ? "rough" : "wall", palette), view.px(center), radius_m * view.scale);
  }
  layer.c.setLineDash([]);
  if (walls.length <= MAX_NAMES) walls.forEach((wall) => drawName(layer.c, view, palette, wall));
}

/** Draws a wall's name next to its midpoint, on the side facing away from the centre of the view. */
function drawName(c, view, palette, { id, from, to }) {
  const [[x, y], [u, v]] = [view.px(from), view.px(to)];
  const length = Math.hypot(u - x, v - y);
  c.font = `${NAME_PX}px ${FONT}`;
  if (length < c.measureText(id).width) return;
  let [nx, ny] = [(v - y) / length, (x - u) / length];
  const [mx, my] = [(x + u) / 2, (y + v) / 2];
  if (nx * (view.width / 2 - mx) + ny * (view.height / 2 - my) > 0) [nx, ny] = [-nx, -ny];
  c.save();
  c.translate(mx + NAME_PX * nx, my + NAME_PX * ny);
  const angle = Math.atan2(v - y, u - x);
  c.rotate(Math.abs(angle) > Math.PI / 2 ? angle - Math.sign(angle) * Math.PI : angle);
  c.fillStyle = palette["--muted"];
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.fillText(id, 0, 0);
  c.restore();
}

/** Smallest length of at least `min` that is 1, 2 or 5 times a power of ten. */
function gridStep(min) {
  const power = 10 ** Math.floor(Math.log10(min));
  return [1, 2, 5, 10].map((n) => n * power).find((step) => step >= min);
}
