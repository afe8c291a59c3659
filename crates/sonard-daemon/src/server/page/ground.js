// The lowest layer of the floor plan: grid, scale and scene.

import { circle, line } from "./pens.js";

/** Rooms with more walls than this are drawn without their names. */
const MOST_NAMES = 24;
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

/** In the corner, on a ground of its own. */
export function drawScaleBar({ c }, view, palette) {
  const step = gridStep(64 / view.scale);
  const length = step * view.scale;
  const [x, y] = [12, view.height - 12];
  c.font = `12px ${FONT}`;
  const text = step < 0.01 ? `${Math.round(1000 * step)} mm` : step < 1 ? `${Math.round(100 * step)} cm` : `${step} m`;
  c.setLineDash([]);
  c.fillStyle = palette["--panel"];
  c.fillRect(x - 6, y - 14, length + 20 + c.measureText(text).width, 22);
  c.strokeStyle = c.fillStyle = palette["--quiet"];
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
  if (walls.length <= MOST_NAMES) walls.forEach((wall) => drawName(layer.c, view, palette, wall));
}

/** A wall's name beside its middle, on the side away from the middle of the view. */
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
  const turn = Math.atan2(v - y, u - x);
  c.rotate(Math.abs(turn) > Math.PI / 2 ? turn - Math.sign(turn) * Math.PI : turn);
  c.fillStyle = palette["--quiet"];
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.fillText(id, 0, 0);
  c.restore();
}

/** The round length that is `least` or more: 1, 2 or 5 times a power of ten. */
function gridStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((n) => n * power).find((step) => step >= least);
}
