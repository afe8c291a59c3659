// Controls of sensor, air and walls; each sets one value of the state and shows it with its unit.

import { decibels } from "../../crates/sonard-daemon/src/server/page/format.js";

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

/** @typedef {import("./state.js").State} State */

/** Sliders by id: key of the state, and text of its value. @type {Record<string, [keyof State, (value: number) => string]>} */
const NUMBERS = {
  threshold: ["threshold_db", (db) => (db === 0 ? "default" : decibels(db).replace(".0", ""))],
  reach: ["reach_m", (m) => `${m.toFixed(1)} m`],
  temperature: ["temperature_c", (c) => `${c} °C`.replace("-", "−")],
  humidity: ["humidity_percent", (percent) => `${percent} %`],
};

export class Controls {
  /**
   * @param {State} state
   * @param {(changes: Partial<State>) => void} onChange
   */
  constructor(state, onChange) {
    this.state = state;
    this.onChange = onChange;
    for (const [id, [key]] of Object.entries(NUMBERS)) {
      byId(id).addEventListener("input", () => this.change({ [key]: Number(byId(id).value) }));
    }
    byId("step").addEventListener("change", () => this.change({ step_deg: Number(byId("step").value) }));
    for (const id of ["sensor", "engine", "gain"]) {
      byId(id).addEventListener("change", () => this.change({ [id]: byId(id).value }));
    }
    byId("material").addEventListener("change", () => this.show(this.state));
    for (const key of ["reflectance", "roughness"]) {
      byId(key).addEventListener("input", () => this.setWalls(key, Number(byId(key).value)));
    }
    byId("use-3d").addEventListener("change", () => this.setHeights());
    for (const id of ["ceiling", "height"]) byId(id).addEventListener("input", () => this.setHeights());
  }

  /** @param {Partial<State>} changes */
  change(changes) {
    this.onChange(changes);
  }

  /**
   * Changes the selected material, or all.
   * @param {string} key
   * @param {number} value
   */
  setWalls(key, value) {
    const scene = structuredClone(this.state.scene);
    const selected = byId("material").value;
    for (const [name, material] of Object.entries(scene.materials)) {
      if (selected === "" || selected === name) /** @type {any} */ (material)[key] = value;
    }
    this.change({ scene });
  }

  setHeights() {
    const scene = structuredClone(this.state.scene);
    if (!byId("use-3d").checked) {
      delete scene.floor_z_m;
      delete scene.ceiling_z_m;
      for (const thing of [...(scene.walls ?? []), ...(scene.cylinders ?? [])]) delete thing.z_m;
      return this.change({ scene, height_m: null });
    }
    scene.floor_z_m ??= 0;
    const floor = scene.floor_z_m;
    scene.ceiling_z_m = floor + Number(byId("ceiling").value);
    const max_m = scene.ceiling_z_m - 0.05;
    this.change({ scene, height_m: Math.min(max_m, floor + Number(byId("height").value)) });
  }

  /** @param {State} state */
  show(state) {
    this.state = state;
    for (const [id, [key, format]] of Object.entries(NUMBERS)) {
      const value = Number(state[key]);
      setValue(id, value);
      setLabel(id, format(value));
    }
    for (const id of /** @type {const} */ (["sensor", "engine", "gain"])) setValue(id, state[id]);
    setValue("step", state.step_deg);
    this.showMaterials(state.scene);
    this.showHeights(state);
  }

  /** @param {import("./room.js").SceneFile} scene */
  showMaterials(scene) {
    const names = Object.keys(scene.materials);
    const list = byId("material");
    if (list.dataset.names !== names.join()) {
      list.dataset.names = names.join();
      const selected = list.value;
      const entries = names.length === 1 ? names : ["", ...names];
      list.replaceChildren(...entries.map((name) => new Option(name || "all materials", names.length === 1 ? "" : name)));
      if (names.includes(selected)) list.value = selected;
    }
    const material = scene.materials[list.value || names[0]];
    for (const key of /** @type {const} */ (["reflectance", "roughness"])) {
      setValue(key, material?.[key] ?? 0);
      setLabel(key, (material?.[key] ?? 0).toFixed(2));
    }
  }

  /** @param {State} state */
  showHeights({ scene, height_m }) {
    const has3d = scene.floor_z_m !== undefined || scene.ceiling_z_m !== undefined;
    byId("use-3d").checked = has3d;
    byId("heights").hidden = !has3d;
    if (!has3d) return;
    const floor = scene.floor_z_m ?? 0;
    const ceiling = (scene.ceiling_z_m ?? floor + 2.4) - floor;
    setValue("ceiling", ceiling);
    setLabel("ceiling", `${ceiling.toFixed(1)} m`);
    const height = height_m === null ? ceiling / 2 : height_m - floor;
    setValue("height", height);
    setLabel("height", `${height.toFixed(2)} m`);
  }
}

/**
 * @param {string} id
 * @param {string | number} value
 */
function setValue(id, value) {
  if (document.activeElement !== byId(id) || byId(id).value !== String(value)) byId(id).value = String(value);
}

/**
 * @param {string} id
 * @param {string} text
 */
function setLabel(id, text) {
  const output = byId(id).nextElementSibling;
  if (output.textContent !== text) output.textContent = text;
  byId(id).setAttribute("aria-valuetext", text);
}
