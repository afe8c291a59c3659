// Result of a survey on the floor plan, and texts about it.

import { count } from "./format.js";
import { circle, drawPose, line } from "./layers.js";

const RAD_PER_DEG = Math.PI / 180;
/** Radius of a 95 % region, standard deviations along the larger axis: sqrt(5.99). */
const REGION_SIGMAS = 2.45;
/** Radius at which a region is legible, and maximum distance of a hovered pose, pixels. */
const LEGIBLE_PX = 4, HOVER_PX = 8;
const STAGES = { course: "poses", walls: "walls", alternatives: "alternatives" };

export function drawSurvey(layer, plan, { walls, posts, poses }) {
  const { view, palette } = plan;
  for (const { pieces } of walls) {
    for (const { from_m, to_m, status } of pieces) drawPiece(layer, plan, status, [from_m, to_m]);
  }
  for (const { center_m, radius_m, status } of posts) {
    circle(layer.pen(status, palette), view.px(center_m), radius_m * view.scale);
  }
  const factor = enlargement(poses, view);
  for (const { pose, sigma_m } of poses) {
    const at = view.px([pose.x_m, pose.y_m]);
    drawPose(layer.pen("surveyed", palette), at, -pose.heading_deg * RAD_PER_DEG);
    if (sigma_m) circle(layer.pen("region", palette), at, factor * regionOf(sigma_m) * view.scale);
  }
}

/** Description of the stop at a pixel, if there is one. */
export function describeStop(px, { view }, poses) {
  const at = poses.findIndex(({ pose: { x_m, y_m } }) => {
    const [x, y] = view.px([x_m, y_m]);
    return Math.hypot(x - px[0], y - px[1]) < HOVER_PX;
  });
  if (at < 0) return undefined;
  const { pose, sigma_m } = poses[at];
  const sigma = sigma_m ? `, ±${(1e3 * Math.max(...sigma_m)).toFixed(2)} mm (circle: 95 %, ${enlargement(poses, view)} times enlarged)` : "";
  return `stop ${at + 1}: (${pose.x_m.toFixed(3)}, ${pose.y_m.toFixed(3)}) m${sigma}`;
}

export function progressText({ stage, round, walls, scored_scenes }) {
  const of = round ? `, round ${round}` : "";
  return `Surveying: ${STAGES[stage]}${of}; ${count(walls, "wall")}, ${count(scored_scenes, "floor plan")} tried`;
}

/** `source` is the word for a sweep. */
export function resultText({ walls, posts, poses, arcs, unexplained, alternatives, end }, source) {
  const early = { cancelled: "Ended early: ", budget: "The budget is spent: " }[end] ?? "";
  const others = alternatives.length ? `; ${count(alternatives.length, "other plan")} possible` : "";
  const round = posts.length ? ` and ${count(posts.length, "post")}` : "";
  return `${early}${count(walls.length, "wall")}${round} from ${count(poses.length, source)}, ${arcs - unexplained.length} of ${count(arcs, "arc")} explained${others}`;
}

/** Power of ten by which the regions of poses are enlarged to be legible. */
function enlargement(poses, view) {
  const radii = poses.map(({ sigma_m }) => (sigma_m ? regionOf(sigma_m) : 0)).filter((radius_m) => radius_m > 0);
  const middle_px = (radii.sort((a, b) => a - b)[radii.length >> 1] ?? 1) * view.scale;
  return Math.min(1e4, Math.max(1, 10 ** Math.ceil(Math.log10(LEGIBLE_PX / middle_px))));
}

/** Draws a stretch of wall on a margin, legible on a wall of the scene. */
function drawPiece(layer, { view, palette }, status, ends_m) {
  const points = ends_m.map((at) => view.px(at));
  const c = layer.pen(status, palette);
  [c.strokeStyle, c.lineWidth] = [palette["--panel"], c.lineWidth + 2];
  c.setLineDash([]);
  line(c, points);
  line(layer.pen(status, palette), points);
}

const regionOf = (sigma_m) => REGION_SIGMAS * Math.max(...sigma_m);
