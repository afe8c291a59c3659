// Stops a moved ranger or robot at walls and pillars.

/** @import { FloorPlan, Pose } from "./engine.js" */
/** @typedef {[number, number]} Point */

/** Distance that remains between ranger and wall, metres. */
const CLEARANCE_M = 0.005;

/**
 * Pose that a ranger reaches on its way from one pose to another: at an obstacle it slides along, then stops.
 * @param {FloorPlan | null} plan
 * @param {Pose} from
 * @param {Pose} to
 * @returns {Pose}
 */
export function poseWithinWalls(plan, from, to) {
  if (!plan) return to;
  /** @type {Point} */
  let at = [from.x_m, from.y_m];
  /** @type {Point} */
  let goal = [to.x_m, to.y_m];
  for (let slides = 0; slides < 3; slides++) {
    const hit = firstObstacle(plan, at, goal);
    if (!hit) return { ...to, x_m: goal[0], y_m: goal[1] };
    const { share, normal } = hit;
    const [dx, dy] = [goal[0] - at[0], goal[1] - at[1]];
    const before = Math.max(0, share - CLEARANCE_M / Math.abs(dx * normal[0] + dy * normal[1] || 1));
    at = [at[0] + before * dx, at[1] + before * dy];
    // The rest of the way along the obstacle.
    const rest = (1 - before) * (dx * -normal[1] + dy * normal[0]);
    goal = [at[0] - rest * normal[1], at[1] + rest * normal[0]];
  }
  return { ...to, x_m: at[0], y_m: at[1] };
}

/**
 * Share of a straight drive from one pose to another that keeps a distance from all obstacles, 0 to 1.
 * @param {FloorPlan} plan
 * @param {Pose} from
 * @param {Pose} to
 * @param {number} clearance_m
 */
export function freeShare(plan, from, to, clearance_m) {
  const [at, by] = /** @type {[Point, Point]} */ ([[from.x_m, from.y_m], [to.x_m - from.x_m, to.y_m - from.y_m]]);
  const length_m = Math.hypot(...by);
  if (length_m === 0) return 1;
  // An obstacle shortly behind the goal is too near, too.
  const scale = 1 + clearance_m / length_m;
  const hit = firstObstacle(plan, at, [at[0] + scale * by[0], at[1] + scale * by[1]]);
  if (!hit) return 1;
  const across = Math.abs(by[0] * hit.normal[0] + by[1] * hit.normal[1]);
  return Math.min(1, Math.max(0, scale * hit.share - clearance_m / (across || length_m)));
}

/**
 * First obstacle between two points: share of the way to it, and its unit normal.
 * @param {FloorPlan} plan
 * @param {Point} from
 * @param {Point} to
 */
function firstObstacle({ walls, cylinders }, from, to) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  /** @type {{share: number, normal: Point} | null} */
  let first = null;
  const keep = (/** @type {number} */ share, /** @type {Point} */ normal) => {
    if (share >= -1e-9 && share <= 1 && (!first || share < first.share)) first = { share, normal };
  };
  for (const { from: a, to: b } of walls) {
    const [ex, ey] = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(ex, ey);
    const across = dx * ey - dy * ex;
    if (length === 0 || across === 0) continue;
    const share = ((a[0] - from[0]) * ey - (a[1] - from[1]) * ex) / across;
    const along = ((a[0] - from[0]) * dy - (a[1] - from[1]) * dx) / across;
    // Walls end in their joints: a little beyond them, nothing slips through a corner.
    if (along > -CLEARANCE_M / length && along < 1 + CLEARANCE_M / length) keep(share, [-ey / length, ex / length]);
  }
  for (const { center, radius_m } of cylinders) {
    const [cx, cy] = [from[0] - center[0], from[1] - center[1]];
    const [a, b, c] = [dx * dx + dy * dy, cx * dx + cy * dy, cx * cx + cy * cy - radius_m * radius_m];
    const root = Math.sqrt(b * b - a * c);
    if (!(root >= 0) || b >= 0 || a === 0) continue;
    const share = (-b - root) / a;
    keep(share, [(cx + share * dx) / radius_m, (cy + share * dy) / radius_m]);
  }
  return /** @type {{share: number, normal: Point} | null} */ (first);
}
