// Bindings of the WebAssembly module: requests and responses are JSON in its memory.

/**
 * Reading in the format of the daemon's API, without its path.
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

/** Request rejected by the model. */
export class ModelError extends Error {
  /** @param {Problem} problem */
  constructor(problem) {
    super(problem.message);
    this.problem = problem;
  }
}

/** Problem of a failed request; a broken module must be loaded again. @param {any} error */
export function problemOf(error) {
  if (error instanceof ModelError) return error.problem;
  return { message: `Model failure: ${error.message}`, help: "reload the page", broken: true };
}

export class Engine {
  /**
   * Loads a module, which can reach neither page nor network: it imports nothing, or the observer of a survey alone.
   * @param {BufferSource} bytes
   * @param {{onProgress: (progress: any) => void, isOver: () => boolean}} [observer]
   */
  static async load(bytes, observer) {
    /** @type {any} */
    let exports;
    const report_progress = (/** @type {number} */ address, /** @type {number} */ length) => {
      const text = new TextDecoder().decode(new Uint8Array(exports.memory.buffer, address, length));
      observer.onProgress(JSON.parse(text));
    };
    const is_survey_over = () => Number(observer.isOver());
    const { instance } = await WebAssembly.instantiate(bytes, observer ? { page: { report_progress, is_survey_over } } : {});
    exports = instance.exports;
    return new Engine(exports);
  }

  /**
   * @param {{memory: WebAssembly.Memory, request_buffer: (bytes: number) => number, handle_request: () => number,
   *   response: () => number}} exports
   */
  constructor(exports) {
    this.exports = exports;
    this.encoder = new TextEncoder();
    this.decoder = new TextDecoder();
  }

  /**
   * Sends a request and returns the response as text.
   * @param {object} request
   */
  requestText(request) {
    const bytes = this.encoder.encode(JSON.stringify(request));
    const address = this.exports.request_buffer(bytes.length);
    new Uint8Array(this.exports.memory.buffer, address, bytes.length).set(bytes);
    const length = this.exports.handle_request();
    // `memory.buffer` is a new object if the memory grew meanwhile.
    const response = new Uint8Array(this.exports.memory.buffer, this.exports.response(), length);
    const text = this.decoder.decode(response);
    if (text.startsWith('{"error":')) throw new ModelError(JSON.parse(text).error);
    return text;
  }

  /** @param {object} request */
  request(request) {
    return JSON.parse(this.requestText(request));
  }

  /** @returns {{scenes: {name: string, text: string}[], sensors: Sensor[]}} */
  listPresets() {
    return this.request({ type: "list_presets" });
  }

  /**
   * @param {Settings} settings
   * @returns {{plan: FloorPlan, half_beam_deg: number}}
   */
  configure(settings) {
    return this.request({ type: "configure", settings });
  }

  /**
   * @param {EngineName} engine
   * @param {Pose} pose
   * @param {ScanPlan} plan
   * @param {number | null} measured
   * @returns {{start: object, session: object, beams: number}}
   */
  startSweep(engine, pose, plan, measured) {
    return this.request({ type: "start_sweep", engine, pose, plan, measured });
  }

  /**
   * Returns the next readings as text, which the page parses.
   * @param {EngineName} engine
   * @param {number} count
   */
  nextReadings(engine, count) {
    return this.requestText({ type: "next_readings", engine, count });
  }

  /**
   * @param {EngineName} engine
   * @param {number} index
   */
  beam(engine, index) {
    return this.requestText({ type: "beam", engine, index });
  }

  /**
   * @param {string} text
   * @param {Pose} pose
   * @returns {{scans: LoggedScan[]}}
   */
  loadLog(text, pose) {
    return this.request({ type: "load_log", text, pose });
  }
}
