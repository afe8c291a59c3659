// Course of a robot through a hidden room: true poses, poses by odometry, and those that a survey corrects.

import { Scan } from "../../crates/sonard-daemon/src/server/page/scan.js";
import { markOf } from "../../crates/sonard-daemon/src/server/page/verdicts.js";

/** @import { Pose } from "./engine.js" */

/**
 * @typedef {{truth: Pose, odometry: Pose}} Place
 * @typedef {{azimuth_deg: number, status: string, range_m: number | null}} Reading
 * @typedef {{kind: string, seed: number, scene: import("./room.js").SceneFile | null, start: Pose | null,
 *   stops: Place[], robot: Place | null, moves: number}} CourseState
 */

const RAD_PER_DEG = Math.PI / 180;
/** Step of the sweeps' azimuths, degrees. */
const STEP_DEG = 1.8;
/** Verdicts by the cause of a reading in a survey. */
const VERDICTS = { first: "direct", multiple: "multiple", edge: "edge", no_range: "no_echo", unexplained: "unexplained" };
/** Maximum seed of a room. */
export const MAX_SEED = 1e6;
export const KINDS = ["any", "rectangle", "oblique", "cut", "l", "box", "posts"];

/** Direction in degrees, more than -180 and up to 180. @param {number} deg */
export const wrapped = (deg) => 180 - ((((180 - deg) % 360) + 360) % 360);

/** Pose after a move in the frame of another pose. @param {Pose} from @param {Pose} by @returns {Pose} */
export function compose(from, by) {
  const [c, s] = [Math.cos(from.heading_deg * RAD_PER_DEG), Math.sin(from.heading_deg * RAD_PER_DEG)];
  return {
    x_m: from.x_m + c * by.x_m - s * by.y_m,
    y_m: from.y_m + s * by.x_m + c * by.y_m,
    heading_deg: wrapped(from.heading_deg + by.heading_deg),
  };
}

/** Pose in the frame of another pose. @param {Pose} from @param {Pose} to @returns {Pose} */
export function relative(from, to) {
  const [c, s] = [Math.cos(from.heading_deg * RAD_PER_DEG), Math.sin(from.heading_deg * RAD_PER_DEG)];
  const [dx, dy] = [to.x_m - from.x_m, to.y_m - from.y_m];
  return { x_m: c * dx + s * dy, y_m: c * dy - s * dx, heading_deg: wrapped(to.heading_deg - from.heading_deg) };
}

/**
 * Best known pose of a pose by odometry: moved with the last surveyed stop up to `last`.
 * @param {Pose} odometry
 * @param {Place[]} stops
 * @param {any} survey
 * @param {number} [last]
 */
export function corrected(odometry, stops, survey, last = stops.length - 1) {
  const at = Math.min(last, (survey?.poses.length ?? 0) - 1);
  return at < 0 ? odometry : compose(survey.poses[at].pose, relative(stops[at].odometry, odometry));
}

/**
 * Readings of all sweeps at the best known poses, with their causes where a survey has them.
 * @param {Place[]} stops
 * @param {Reading[][]} sweeps
 * @param {any} survey
 * @param {Pose} robot best known pose of the robot
 */
export function scanOfSweeps(stops, sweeps, survey, robot) {
  const plan = { from_deg: 0, to_deg: 360, step_deg: STEP_DEG, pings_per_stop: 1 };
  const scan = /** @type {any} */ (new Scan({ scan: "course", pose: robot, plan }));
  sweeps.forEach((readings, stop) => {
    const { x_m, y_m, heading_deg } = corrected(stops[stop].odometry, stops, survey, stop);
    const causes = survey?.causes[stop];
    readings.forEach(({ azimuth_deg, status, range_m }, index) => {
      const verdict = status === "min_range" ? "min_range" : VERDICTS[/** @type {keyof typeof VERDICTS} */ (causes?.[index])];
      const viewpoint = { x_m, y_m, direction_deg: heading_deg + azimuth_deg };
      const ping = { index, azimuth_deg, status, range_m, verdict, viewpoint, residual_m: null, mark: "" };
      ping.mark = markOf(ping);
      scan.beams.set(scan.beams.size, ping);
      scan.count(ping, 1);
    });
  });
  return scan;
}

/** @returns {CourseState} */
export const newCourse = (kind = "any", seed = 1) => ({ kind, seed, scene: null, start: null, stops: [], robot: null, moves: 0 });

/** Room of a course as the module takes it. @param {CourseState} course */
export function roomOf({ kind, seed, scene, start }) {
  if (scene) return { drawn: { scene: JSON.stringify(scene), start } };
  return { random: { kind: kind === "any" ? null : kind, seed } };
}

/**
 * Parses the course of a link; entries of the wrong type are replaced by defaults.
 * @param {any} value
 * @returns {CourseState | null}
 */
export function parseCourse(value) {
  if (typeof value !== "object" || value === null) return null;
  const isSeed = Number.isInteger(value.seed) && value.seed >= 0 && value.seed <= MAX_SEED;
  const course = newCourse(KINDS.includes(value.kind) ? value.kind : "any", isSeed ? value.seed : 1);
  const start = poseFrom(value.start);
  if (value.scene?.materials && start) [course.scene, course.start] = [value.scene, start];
  else if (!isSeed) return null;
  if (Array.isArray(value.stops)) course.stops = value.stops.map(placeFrom);
  course.robot = placeFrom(value.robot);
  // A course with an invalid stop is not the one that was shared.
  if (course.stops.includes(null)) return null;
  if (Number.isInteger(value.moves) && value.moves >= 0) course.moves = value.moves;
  return course;
}

/** @param {any} value @returns {Place | null} */
function placeFrom(value) {
  const [truth, odometry] = [poseFrom(value?.truth), poseFrom(value?.odometry)];
  return truth && odometry && { truth, odometry };
}

/** @param {any} value @returns {Pose | null} */
function poseFrom(value) {
  const { x_m, y_m, heading_deg } = value ?? {};
  return [x_m, y_m, heading_deg].every(Number.isFinite) ? { x_m, y_m, heading_deg } : null;
}
