// Settings of the next scan: current, pending and edited values. Edited settings are previewed by the daemon's model
// before they are applied.

import { requestJson } from "./api.js";
import { make } from "./dom.js";
import { square } from "./layers.js";
import { Ranger, rounded } from "./ranger.js";
import { Scan } from "./scan.js";
import { positionOf } from "./sketch.js";
import { MARKS, marksIn } from "./verdicts.js";
import { count, failure, sentences, setText } from "./format.js";

/** Delay between the last edit and the request of a preview. */
const PREVIEW_DELAY_MS = 120;
/** Rows: label, resource of the API, key, and step of the number field; without a step the field is a list. @type {[string, string, string, string?][]} */
const ROWS = [
  ["x (m)", "pose", "x_m", "0.01"],
  ["y (m)", "pose", "y_m", "0.01"],
  ["Heading (°)", "pose", "heading_deg", "0.9"],
  ["From (°)", "plan", "from_deg", "0.9"],
  ["To (°)", "plan", "to_deg", "0.9"],
  ["Step (°)", "plan", "step_deg", "0.9"],
  ["Pings per step", "plan", "pings_per_stop", "1"],
  ["Temperature (°C)", "air", "temperature_c", "0.5"],
  ["Humidity (%)", "air", "humidity_percent", "5"],
  ["Sensor", "sensor", "name"],
  ["Threshold (relative amplitude)", "sensor", "threshold", "0.0005"],
  ["Threshold slope (dB/m)", "sensor", "threshold_rise_db_per_m", "0.5"],
  ["Gain", "sensor", "gain"],
  ["Blanking (µs)", "sensor", "blanking_us", "20"],
];
/** Labels of the kinds of gain. */
const GAINS = { steps: "stepped (6500)", compensating: "compensates spreading loss (TVG)" };
/** Defaults of sensor parameters that a preset may omit. */
const DEFAULTS = { threshold_rise_db_per_m: 0, integration_us: 0, range_step_m: 0, gain: { kind: "compensating", exponent: 0, air: false } };
/** Range difference below which a previewed beam counts as unchanged, metres. */
const UNCHANGED_M = 1e-4;
const PARTS = ["pose", "plan", "air", "sensor"];
const LABELS = { pose: "Pose", plan: "Sweep", air: "Air", sensor: "Sensor" };
const AIR = ["temperature_c", "humidity_percent", "pressure_kpa"];

export class NextScan {
  /** @param {HTMLElement} section @param {any} plan @param {(text: string) => void} announce */
  constructor(section, plan, announce) {
    this.plan = plan;
    this.announce = announce;
    /** Edited settings by part; `null` unless editing. */
    this.draft = null;
    this.status = null;
    /** Previewed scan. */
    this.scan = null;
    /** Preview of the settings without edits. */
    this.baseline = null;
    /** Built-in sensor presets. @type {any[]} */
    this.presets = [];
    this.previewTimer = 0;
    this.request = new AbortController();
    /** Message why the draft was not applied; shown until the draft changes. */
    this.rejection = "";
    /** Fields without a number. @type {Set<HTMLElement>} */
    this.incomplete = new Set();
    this.build(section);
    plan.overlays.push(this);
  }

  build(section) {
    const button = (id, textContent, onClick) => {
      const element = make("button", { type: "button", id, textContent });
      element.addEventListener("click", onClick);
      return element;
    };
    this.editButton = button("change", "Change", () => (this.draft ? this.cancel() : this.edit()));
    this.editButton.ariaPressed = "false";
    this.editButton.classList.add("writes");
    this.applyButton = button("apply", "Apply", () => this.apply());
    this.applyButton.className = "go";
    this.rows = ROWS.map(([label, part, key, step]) => {
      const input = step ? make("input", { type: "number", step }) : make("select");
      const field = Object.assign(input, { id: `next-${key}`, ariaLabel: `${label}, new value` });
      field.addEventListener("input", () => this.readField(part, key, field));
      const cells = [make("td"), make("td"), make("td", { className: "draft" }, field)];
      return { label, part, key, field, row: make("tr", {}, make("th", { scope: "row", textContent: label }), ...cells), cells };
    });
    const head = ["Setting", "Current", "Next scan", "New value"].map((textContent) => make("th", { scope: "col", textContent }));
    head[3].className = "draft";
    this.table = make("table", { id: "next-table" }, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...this.rows.map(({ row }) => row)));
    this.fault = make("tr", { className: "fault", hidden: true }, make("td", { colSpan: 4, id: "next-fault" }));
    this.message = make("p", { id: "next-status", className: "hint", role: "status" });
    this.buttons = make("p", { className: "buttons", hidden: true }, this.applyButton);
    const hint = make("p", { className: "draft hint", textContent: "Drag the robot on the plan, or type values." });
    section.append(hint, this.table, this.message, this.buttons);
    section.querySelector(".head").append(this.editButton);
    this.section = section;
    this.ranger = null;
  }

  /** Updates current and pending values from a status report. */
  update(status) {
    this.status = status;
    const get = (settings, part, key) => (settings[part] ? settings[part][key] : null);
    for (const { part, key, row, cells } of this.rows) {
      const [current, pending] = [get(status, part, key), get(status.pending, part, key)];
      row.hidden = part === "plan" && status.simulation !== null;
      const differs = pending !== null && JSON.stringify(pending) !== JSON.stringify(current);
      setText(cells[0], valueText(current));
      setText(cells[1], differs ? valueText(pending) : "–");
      cells[1].classList.toggle("pending", differs);
    }
  }

  /** Settings of the next scan without edits, by part. */
  upcoming() {
    const { status } = this;
    const parts = Object.fromEntries(PARTS.map((part) => [part, { ...(status.pending[part] ?? status[part]) }]));
    parts.air = Object.fromEntries(AIR.map((key) => [key, parts.air[key]]));
    return parts;
  }

  /** Starts editing, optionally with a proposed change. @param {(draft: any) => void} [change] */
  async edit(change) {
    if (!this.status) return this.announce("No connection to the daemon.");
    this.presets = await requestJson("/v1/sensors").catch(() => []);
    this.draft = this.upcoming();
    this.editButton.ariaPressed = "true";
    this.editButton.textContent = "Cancel";
    this.section.classList.add("changing");
    this.buttons.hidden = false;
    this.ranger ??= new Ranger(this.plan.stage, this.plan.view, (pose) => this.move(pose), () => this.endDrag());
    this.showHandles(true);
    this.baseline = await requestJson("/v1/preview", { method: "POST", body: this.requestsFor(this.draft) }).then(Scan.fromJson, () => null);
    if (!this.draft) return;
    await this.changeDraft(change);
  }

  /** Applies a proposed change to the draft, starting to edit if necessary. @param {(draft: any) => void} change */
  async propose(change) {
    this.section.scrollIntoView({ block: "nearest" });
    if (!this.draft) return this.edit(change);
    await this.changeDraft(change);
  }

  /** Changes the draft and requests its preview. @param {(draft: any) => void} [change] */
  async changeDraft(change) {
    change?.(this.draft);
    this.show();
    this.rejection = "";
    await this.preview();
  }

  cancel() {
    this.request.abort();
    clearTimeout(this.previewTimer);
    [this.draft, this.scan, this.baseline] = [null, null, null];
    this.incomplete.clear();
    this.editButton.ariaPressed = "false";
    this.editButton.textContent = "Change";
    this.section.classList.remove("changing");
    this.buttons.hidden = true;
    this.showHandles(false);
    setText(this.message, "");
    this.clearFault();
    this.plan.held = false;
    this.plan.redraw();
  }

  /** Shows a message below the field of a setting. @param {any} row @param {string} text */
  showFault({ field, row }, text) {
    this.clearFault();
    row.after(this.fault);
    setText(this.fault.firstChild, text);
    this.fault.hidden = false;
    field.ariaInvalid = "true";
    field.setAttribute("aria-describedby", "next-fault");
  }

  clearFault() {
    this.fault.hidden = true;
    for (const { field } of this.rows) {
      field.removeAttribute("aria-invalid");
      field.removeAttribute("aria-describedby");
    }
  }

  /** Shows a rejection at its field; returns the text with the field's label in place of its name. @param {string} what @param {any} error */
  rejectionText(what, error) {
    const [part, name] = (error.field ?? "").split(".");
    const key = name === "preset" ? "name" : name;
    const row = this.rows.find((row) => row.part === part && row.key === key) ?? this.rows.find((row) => row.part === part);
    if (!row) return failure(what, error);
    const labelled = (/** @type {string} */ text) => this.rows.reduce((all, { part: of, key, label }) => (of === part ? all.replaceAll(new RegExp(`\\b${key}\\b`, "g"), label) : all), text);
    const [message, help] = [labelled(error.message), labelled(error.help ?? "")];
    this.showFault(row, sentences(message, help));
    return sentences(`${what}: ${message}`);
  }

  showHandles(shown) {
    for (const handle of [this.ranger?.body, this.ranger?.heading]) if (handle) handle.button.hidden = !shown;
  }

  /** Shows the draft in fields and handles. */
  show() {
    const { sensor } = this.draft;
    const names = [this.upcoming().sensor.name, ...this.presets.map(({ name }) => name)];
    const kinds = [this.base(sensor.name).gain.kind, sensor.gain.kind, "compensating"];
    for (const { part, key, field } of this.rows) {
      if (field.localName === "select") fill(field, key === "name" ? names : kinds);
      const value = this.draft[part][key];
      if (document.activeElement !== field || field.localName === "select") field.value = String(value?.kind ?? value);
    }
    this.ranger.place(this.draft.pose);
  }

  move(pose) {
    this.plan.held = true;
    this.draft.pose = { ...pose, x_m: rounded(pose.x_m, 4), y_m: rounded(pose.y_m, 4) };
    this.show();
    this.previewSoon();
  }

  endDrag() {
    this.plan.held = false;
    this.previewSoon();
  }

  /** Unedited parameters of a sensor: the next scan's sensor, or a preset. @param {string} name */
  base(name) {
    const { sensor } = this.upcoming();
    return name === sensor.name ? sensor : pickParameters(this.presets.find((preset) => preset.name === name), sensor);
  }

  /** Selects another sensor or another kind of gain. */
  readList(key, value) {
    const { draft } = this;
    if (key === "name") draft.sensor = { ...this.base(value) };
    else {
      const { gain } = this.base(draft.sensor.name);
      draft.sensor.gain = gain.kind === value ? gain : { kind: value };
    }
    this.show();
    this.previewSoon();
  }

  readField(part, key, field) {
    if (field.localName === "select") return this.readList(key, field.value);
    if (field.value === "" || !Number.isFinite(field.valueAsNumber)) {
      this.incomplete.add(field);
      this.applyButton.disabled = true;
      return this.showFault(this.rows.find((row) => row.field === field), "Enter a number.");
    }
    this.incomplete.delete(field);
    this.draft[part][key] = field.valueAsNumber;
    this.ranger.place(this.draft.pose);
    this.previewSoon();
  }

  previewSoon() {
    clearTimeout(this.previewTimer);
    this.rejection = "";
    if (!this.incomplete.size) this.clearFault();
    this.previewTimer = setTimeout(() => this.preview(), PREVIEW_DELAY_MS);
  }

  /** Requests a preview of the draft; an earlier request is aborted. */
  async preview() {
    this.request.abort();
    const { signal } = (this.request = new AbortController());
    try {
      const response = await requestJson("/v1/preview", { method: "POST", body: this.requestsFor(this.draft), signal });
      if (signal.aborted) return;
      this.scan = Scan.fromJson(response);
      this.showPreview(`Preview (${count(this.scan.beams.size, "beam")}): ${markCounts(this.scan)}${this.changes()}. Not applied yet.`);
      this.applyButton.disabled = this.incomplete.size > 0;
    } catch (/** @type {any} */ error) {
      if (signal.aborted) return;
      this.scan = null;
      // Settings without a preview, for instance without a scene, can still be applied.
      this.applyButton.disabled = error.status === undefined || this.incomplete.size > 0;
      this.showPreview(this.rejectionText("Preview unavailable", error));
    }
    this.plan.redraw();
  }

  /** Shows a preview's text, unless the draft was rejected meanwhile. @param {string} text */
  showPreview(text) {
    setText(this.message, this.rejection || text);
  }

  /** @param {string} text */
  reject(text) {
    this.rejection = text;
    setText(this.message, text);
  }

  /** Request bodies by part; the sensor's contains only parameters that differ from its current values or preset. @param {any} draft */
  requestsFor({ pose, plan, air, sensor }) {
    const base = this.base(sensor.name);
    const entries = Object.entries(sensor).filter(([key, value]) => JSON.stringify(base[key]) !== JSON.stringify(value));
    const changes = Object.fromEntries(entries);
    if (sensor.name !== this.upcoming().sensor.name) changes.preset = sensor.name;
    const requests = Object.keys(changes).length ? { pose, air, sensor: changes } : { pose, air };
    // An array has no sweep.
    return this.status.simulation ? requests : { ...requests, plan };
  }

  /** Number of beams that the draft changes, as text. */
  changes() {
    const { scan, baseline } = this;
    if (!baseline || baseline.planned !== scan.planned) return "";
    const differs = (a, b) => (a.range_m === null || b.range_m === null ? a.range_m !== b.range_m : Math.abs(a.range_m - b.range_m) > UNCHANGED_M);
    const changed = [...scan.beams.values()].filter((ping) => differs(ping, baseline.beams.get(ping.index))).length;
    return changed ? `; ${count(changed, "beam")} would change` : "";
  }

  /** Sends the parts of the draft that differ from the upcoming settings; the daemon changes all of them or none. */
  async apply() {
    const [upcoming, { draft }] = [this.upcoming(), this];
    const parts = PARTS.filter((part) => JSON.stringify(draft[part]) !== JSON.stringify(upcoming[part]));
    const bodies = this.requestsFor(draft);
    if (!parts.length) return this.reject("No changes to apply.");
    try {
      const body = Object.fromEntries(parts.map((part) => [part, bodies[part]]));
      await requestJson("/v1/settings", { method: "PUT", body });
    } catch (/** @type {any} */ error) {
      return this.reject(this.rejectionText("Nothing changed", error));
    }
    this.cancel();
    const names = parts.map((part) => LABELS[part].toLowerCase());
    this.announce(`Applied: ${names.join(", ")}. Takes effect with the next scan.`);
  }

  drawUnder(layer, plan) {
    if (!this.draft) return;
    this.ranger.place(this.draft.pose);
    if (!this.scan) return;
    const c = layer.pen("preview", plan.palette);
    for (const ping of this.scan.beams.values()) {
      const at = positionOf(ping);
      if (at && !plan.view.isOutside(plan.view.px(at))) square(c, plan.view.px(at), 3.5);
    }
  }
}

/** Numbers of the marks of a previewed scan. */
const markCounts = ({ counts }) => marksIn(counts).map((name) => `${counts.get(name)} ${MARKS[name].label}`).join(", ");

const valueText = (value) =>
  value === null || value === undefined ? "–" : typeof value === "number" ? String(Number(value.toFixed(4))) : (GAINS[value.kind] ?? value);

/** Parameters of a preset under the keys of another sensor. */
const pickParameters = (sensor, like) => Object.fromEntries(Object.keys(like).map((key) => [key, sensor[key] ?? DEFAULTS[key]]));

/** Fills a list with distinct values. @param {HTMLSelectElement} list @param {string[]} values */
function fill(list, values) {
  const all = [...new Set(values)];
  if (all.join() === [...list.options].map(({ value }) => value).join()) return;
  list.replaceChildren(...all.map((value) => new Option(GAINS[value] ?? value, value)));
}
