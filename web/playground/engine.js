// The model: requests and answers as JSON through the memory of the WebAssembly module.

/**
 * A reading as the daemon's API tells it, without its path.
 * @typedef {{index: number, azimuth_deg: number, status: string, range_m: number | null, tof_us: number | null,
 *   amplitude?: number, margin_db?: number, residual_m: number | null, verdict: string, mark?: string,
 *   viewpoint: Viewpoint | null, sim?: Sim | null, ranger?: string, pose?: Pose, path?: Path | null}} Reading
 * @typedef {{status: string, range_m: number | null, margin_db: number | null, path?: Path | null}} Sim
 * @typedef {{x_m: number, y_m: number, direction_deg: number}} Viewpoint
 * @typedef {{x_m: number, y_m: number, heading_deg: number}} Pose
 * @typedef {{from_deg: number, to_deg: number, step_deg: number, pings_per_stop: number}} ScanPlan
 * @typedef {{kind: string, order: number, interactions: {kind: string, id: string, point?: number[]}[],
 *   length_m: number}} Path
 * @typedef {{tof_us: number, range_m: number, peak: number, margin_db: number, path: Path,
 *   polyline: [number, number][]}} Peak
 * @typedef {{step_us: number, m_per_us: number, envelope: number[], threshold: number[], blanking_us: number}} Trace
 * @typedef {{range_m: number | null}} Echo
 * @typedef {{reading: Reading, echoes?: Echo[], polyline: [number, number][] | null, peaks: Peak[], trace: Trace}} Beam
 * @typedef {"cone" | "fan" | "paths"} EngineName
 * @typedef {{reflectance: number, roughness: number}} Material
 * @typedef {{name: string, sha256: string, robot: object | null, poses: Record<string, Pose>,
 *   walls: {id: string, from: [number, number], to: [number, number], material: Material}[],
 *   cylinders: {id: string, center: [number, number], radius_m: number, material: Material}[]}} FloorPlan
 * @typedef {{name: string, description: string, threshold: number, max_range_m: number, gain?: object,
 *   aperture: object, frequency_hz: number}} Sensor
 * @typedef {{temperature_c: number, humidity_percent: number, pressure_kpa?: number, sound_speed_m_s?: number}} Air
 * @typedef {{max_range_m?: number | null, threshold?: number | null}} Options
 * @typedef {{scene: string, sensor: string | Sensor, air: Air, options: Options}} Settings
 * @typedef {{time: string | null, pose: Pose | null, plan: ScanPlan | null, readings: number,
 *   provenance: string | null, sensor: Sensor | null, air: Air | null, scene: string | null,
 *   model: {engine: string, max_range_m?: number, threshold?: number} | null}} LoggedScan
 * @typedef {{message: string, help: string, line?: number}} Problem
 */

/** What the model refuses, in its own words. */
export class Refused extends Error {
  /** @param {Problem} problem */
  constructor(problem) {
    super(problem.message);
    this.problem = problem;
  }
}

export class Engine {
  /** @param {BufferSource} bytes */
  static async of(bytes) {
    // The module imports nothing: it reaches neither page nor network, only what it is handed.
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Engine(/** @type {any} */ (instance.exports));
  }

  /**
   * @param {{memory: WebAssembly.Memory, request: (bytes: number) => number, answer: () => number,
   *   answered: () => number}} exports
   */
  constructor(exports) {
    this.exports = exports;
    this.encoder = new TextEncoder();
    this.decoder = new TextDecoder();
  }

  /**
   * The text of an answer.
   * @param {object} request
   */
  text(request) {
    const bytes = this.encoder.encode(JSON.stringify(request));
    const place = this.exports.request(bytes.length);
    new Uint8Array(this.exports.memory.buffer, place, bytes.length).set(bytes);
    const length = this.exports.answer();
    // Memory may have grown, and moved, while the answer was made.
    const answer = new Uint8Array(this.exports.memory.buffer, this.exports.answered(), length);
    const text = this.decoder.decode(answer);
    if (text.startsWith('{"refused":')) throw new Refused(JSON.parse(text).refused);
    return text;
  }

  /** @param {object} request */
  ask(request) {
    return JSON.parse(this.text(request));
  }

  /** @returns {{scenes: {name: string, text: string}[], sensors: Sensor[]}} */
  shipped() {
    return this.ask({ ask: "shipped" });
  }

  /**
   * @param {Settings} settings
   * @returns {{plan: FloorPlan, half_beam_deg: number}}
   */
  set(settings) {
    return this.ask({ ask: "set", settings });
  }

  /**
   * @param {EngineName} engine
   * @param {Pose} pose
   * @param {ScanPlan} plan
   * @param {number | null} measured
   * @returns {{start: object, session: object, beams: number}}
   */
  stand(engine, pose, plan, measured) {
    return this.ask({ ask: "stand", engine, pose, plan, measured });
  }

  /**
   * The text of the next readings: they are many, and are read where they are shown.
   * @param {EngineName} engine
   * @param {number} count
   */
  more(engine, count) {
    return this.text({ ask: "more", engine, count });
  }

  /**
   * @param {EngineName} engine
   * @param {number} index
   */
  beam(engine, index) {
    return this.text({ ask: "beam", engine, index });
  }

  /**
   * @param {string} text
   * @param {Pose} pose
   * @returns {{scans: LoggedScan[]}}
   */
  log(text, pose) {
    return this.ask({ ask: "log", text, pose });
  }
}
