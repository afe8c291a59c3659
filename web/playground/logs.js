// Opened log: its scans, each with the room, sensor, air and model it was recorded with.

import { count } from "../../crates/sonard-daemon/src/server/page/format.js";

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

/** Name of the log's sensor in the list of sensors. */
const LOG_SENSOR = "from the log";

/** @typedef {import("./engine.js").LoggedScan} LoggedScan */

export class Logs {
  /**
   * @param {Map<string, import("./engine.js").Sensor>} sensors
   * @param {{onShow: (changes: Partial<import("./state.js").State>) => void, onSensors: () => void,
   *   onClose: () => void}} callbacks
   */
  constructor(sensors, callbacks) {
    this.sensors = sensors;
    this.callbacks = callbacks;
    /** Number of the shown scan. @type {number | null} */
    this.scan = null;
    /** @type {LoggedScan[]} */
    this.scans = [];
    byId("logged-scan").addEventListener("change", () => this.show(Number(byId("logged-scan").value)));
    byId("close-log").addEventListener("click", () => {
      this.close();
      callbacks.onClose();
    });
  }

  /** @param {LoggedScan[]} scans */
  open(scans) {
    this.scans = scans;
    const label = (/** @type {LoggedScan} */ scan, /** @type {number} */ i) => `${i + 1} of ${scans.length}: ${count(scan.readings, "reading")}`;
    byId("logged-scan").replaceChildren(...scans.map((scan, i) => new Option(label(scan, i), String(i))));
    byId("logged").hidden = false;
    byId("step").disabled = true;
    this.show(0);
  }

  /** @param {number} number */
  show(number) {
    this.scan = number;
    const { scene, pose, sensor, air, model } = this.scans[number];
    /** @type {any} */
    const changes = { gain: "own", height_m: null, beam: 0, engine: "paths", threshold_db: 0 };
    if (sensor) {
      this.sensors.set(LOG_SENSOR, sensor);
      this.callbacks.onSensors();
      Object.assign(changes, { sensor: LOG_SENSOR, reach_m: model?.max_range_m ?? sensor.max_range_m });
      if (model?.threshold) changes.threshold_db = 20 * Math.log10(model.threshold / sensor.threshold);
    }
    if (model && ["paths", "fan", "cone"].includes(model.engine)) changes.engine = model.engine;
    if (scene) changes.scene = JSON.parse(scene);
    if (pose) changes.pose = pose;
    if (air) Object.assign(changes, { temperature_c: air.temperature_c, humidity_percent: air.humidity_percent });
    this.callbacks.onShow(changes);
  }

  /** Air of the shown scan, with parameters that have no control. */
  get air() {
    return this.scan === null ? null : this.scans[this.scan].air;
  }

  /** Closes the log and removes its sensor from the list. */
  close() {
    [this.scan, this.scans] = [null, []];
    byId("logged").hidden = true;
    byId("step").disabled = false;
    if (this.sensors.delete(LOG_SENSOR)) this.callbacks.onSensors();
  }
}
