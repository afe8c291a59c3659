// State of the page, and its conversion to settings of the model.

import { textOf } from "./room.js";

/**
 * @typedef {{scene: import("./room.js").SceneFile, pose: import("./engine.js").Pose, sensor: string,
 *   threshold_db: number, gain: "own" | "flat" | "air", reach_m: number, step_deg: number,
 *   engine: import("./engine.js").EngineName, temperature_c: number, humidity_percent: number,
 *   height_m: number | null, beam: number | null, arcs: boolean, compare: boolean, fit: string}} State
 */

/** @returns {Omit<State, "scene" | "pose">} */
export const defaultState = () => ({
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

/** Gains that replace the sensor's own. */
const GAINS = {
  flat: { kind: "compensating", exponent: 0, air: false },
  air: { kind: "compensating", exponent: 0, air: true },
};

/**
 * Converts the state to settings of the model; `known` has sensors by name, `air` has further parameters of a log's air.
 * @param {State} state
 * @param {Map<string, import("./engine.js").Sensor>} known
 * @param {import("./engine.js").Air | null} air
 * @returns {import("./engine.js").Settings}
 */
export function settingsOf(state, known, air) {
  const preset = /** @type {import("./engine.js").Sensor} */ (known.get(state.sensor) ?? known.get("senscomp-6500"));
  /** @type {any} */
  const sensor = structuredClone(preset);
  if (state.gain !== "own") sensor.gain = GAINS[state.gain];
  if (state.height_m !== null) sensor.mounting = { ...sensor.mounting, z_m: state.height_m };
  const threshold = Math.min(1, Math.max(1e-6, preset.threshold * 10 ** (state.threshold_db / 20)));
  // Named poses do not affect readings, and a wall being drawn may pass through one, which the model would reject.
  const { poses, ...scene } = state.scene;
  return {
    scene: textOf(scene),
    sensor,
    air: { ...air, temperature_c: state.temperature_c, humidity_percent: state.humidity_percent },
    options: {
      max_range_m: Math.min(state.reach_m, preset.max_range_m),
      threshold: state.threshold_db === 0 ? null : threshold,
    },
  };
}

/** @param {State} state @returns {import("./engine.js").ScanPlan} */
export const planOf = (state) => ({ from_deg: 0, to_deg: 360, step_deg: state.step_deg, pings_per_stop: 1 });

/**
 * Parses the view of a link; entries of the wrong type are replaced by defaults.
 * @param {any} value
 * @returns {State | null}
 */
export function parseState(value) {
  const isPose = (/** @type {any} */ pose) => ["x_m", "y_m", "heading_deg"].every((key) => Number.isFinite(pose?.[key]));
  if (typeof value?.scene !== "object" || !value.scene?.materials || !isPose(value.pose)) return null;
  const state = /** @type {any} */ (defaultState());
  for (const key of Object.keys(state)) {
    const sameType = typeof value[key] === typeof state[key];
    const nullable = (key === "beam" || key === "height_m") && (value[key] === null || Number.isFinite(value[key]));
    if (sameType || nullable) state[key] = value[key];
  }
  const { x_m, y_m, heading_deg } = value.pose;
  return { ...state, scene: value.scene, pose: { x_m, y_m, heading_deg } };
}
