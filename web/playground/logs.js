// A log that was opened: its scans, each with room, sensor, air and model as it was taken in.

import { count } from "../../crates/sonard-daemon/src/server/page/words.js";

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

/** What the log's own sensor is called. */
const OF_LOG = "of the log";

/** @typedef {import("./engine.js").LoggedScan} LoggedScan */

export class Logs {
  /**
   * @param {Map<string, import("./engine.js").Sensor>} sensors
   * @param {{onShow: (changes: Partial<import("./state.js").State>) => void, onSensors: () => void,
   *   onClose: () => void}} uses
   */
  constructor(sensors, uses) {
    this.sensors = sensors;
    this.uses = uses;
    /** Number of the scan that is shown. @type {number | null} */
    this.scan = null;
    /** @type {LoggedScan[]} */
    this.scans = [];
    byId("logged-scan").addEventListener("change", () => this.show(Number(byId("logged-scan").value)));
    byId("close-log").addEventListener("click", () => {
      this.close();
      uses.onClose();
    });
  }

  /** @param {LoggedScan[]} scans */
  open(scans) {
    this.scans = scans;
    const words = (/** @type {LoggedScan} */ one, /** @type {number} */ i) => `${i + 1} of ${scans.length}: ${count(one.readings, "reading")}`;
    byId("logged-scan").replaceChildren(...scans.map((one, i) => new Option(words(one, i), String(i))));
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
      this.sensors.set(OF_LOG, sensor);
      this.uses.onSensors();
      Object.assign(changes, { sensor: OF_LOG, reach_m: model?.max_range_m ?? sensor.max_range_m });
      if (model?.threshold) changes.threshold_db = 20 * Math.log10(model.threshold / sensor.threshold);
    }
    if (model && ["paths", "fan", "cone"].includes(model.engine)) changes.engine = model.engine;
    if (scene) changes.scene = JSON.parse(scene);
    if (pose) changes.pose = pose;
    if (air) Object.assign(changes, { temperature_c: air.temperature_c, humidity_percent: air.humidity_percent });
    this.uses.onShow(changes);
  }

  /** The air of the scan that is shown, for what the controls don't have. */
  get air() {
    return this.scan === null ? null : this.scans[this.scan].air;
  }

  /** Whether one was open, whose sensor is gone. */
  close() {
    [this.scan, this.scans] = [null, []];
    byId("logged").hidden = true;
    byId("step").disabled = false;
    if (this.sensors.delete(OF_LOG)) this.uses.onSensors();
  }
}
