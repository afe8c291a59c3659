// What is shown, and the settings that the model is asked with.

import { textOf } from "./room.js";

/**
 * @typedef {{scene: import("./room.js").SceneFile, pose: import("./engine.js").Pose, sensor: string,
 *   threshold_db: number, gain: "own" | "flat" | "air", reach_m: number, step_deg: number,
 *   engine: import("./engine.js").EngineName, temperature_c: number, humidity_percent: number,
 *   height_m: number | null, beam: number | null, arcs: boolean, compare: boolean, fit: string}} State
 */

/** @returns {Omit<State, "scene" | "pose">} */
export const usual = () => ({
  sensor: "senscomp-6500",
  threshold_db: 0,
  gain: "own",
  reach_m: 5,
  step_deg: 0.9,
  engine: "paths",
  temperature_c: 20,
  humidity_percent: 50,
  height_m: null,
  beam: null,
  arcs: false,
  compare: false,
  fit: "room",
});

/** What the gain is instead of the sensor's own. */
const GAINS = {
  flat: { kind: "compensating", exponent: 0, air: false },
  air: { kind: "compensating", exponent: 0, air: true },
};

/**
 * Settings as the model takes them; `known` has sensors by name, `air` what a log says of the air besides.
 * @param {State} state
 * @param {Map<string, import("./engine.js").Sensor>} known
 * @param {import("./engine.js").Air | null} air
 * @returns {import("./engine.js").Settings}
 */
export function settingsOf(state, known, air) {
  const own = /** @type {import("./engine.js").Sensor} */ (known.get(state.sensor) ?? known.get("senscomp-6500"));
  /** @type {any} */
  const sensor = structuredClone(own);
  if (state.gain !== "own") sensor.gain = GAINS[state.gain];
  if (state.height_m !== null) sensor.mounting = { ...sensor.mounting, z_m: state.height_m };
  const threshold = Math.min(1, Math.max(1e-6, own.threshold * 10 ** (state.threshold_db / 20)));
  // Named poses play no part in readings; walls that are being drawn may run through one.
  const { poses, ...scene } = state.scene;
  return {
    scene: textOf(scene),
    sensor,
    air: { ...air, temperature_c: state.temperature_c, humidity_percent: state.humidity_percent },
    options: {
      max_range_m: Math.min(state.reach_m, own.max_range_m),
      threshold: state.threshold_db === 0 ? null : threshold,
    },
  };
}

/** @param {State} state @returns {import("./engine.js").ScanPlan} */
export const planOf = (state) => ({ from_deg: 0, to_deg: 360, step_deg: state.step_deg, pings_per_stop: 1 });

/**
 * A view from a link: what is strange in it is left out.
 * @param {any} given
 * @returns {State | null}
 */
export function stateFrom(given) {
  const numbers = (/** @type {any} */ pose) => ["x_m", "y_m", "heading_deg"].every((key) => Number.isFinite(pose?.[key]));
  if (typeof given?.scene !== "object" || !given.scene?.materials || !numbers(given.pose)) return null;
  const known = /** @type {any} */ (usual());
  for (const key of Object.keys(known)) {
    const same = typeof given[key] === typeof known[key];
    const maybe = (key === "beam" || key === "height_m") && (given[key] === null || Number.isFinite(given[key]));
    if (same || maybe) known[key] = given[key];
  }
  const { x_m, y_m, heading_deg } = given.pose;
  return { ...known, scene: given.scene, pose: { x_m, y_m, heading_deg } };
}
