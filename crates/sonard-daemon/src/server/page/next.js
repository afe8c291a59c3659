// The next scan: what is in force, what is pending, and what somebody is about to change. The model says what the
// next scan would be before anything is changed.

import { ask } from "./api.js";
import { make } from "./dom.js";
import { square } from "./pens.js";
import { Ranger, rounded } from "./ranger.js";
import { Scan } from "./scan.js";
import { place } from "./sketch.js";
import { MARKS, marksIn } from "./verdicts.js";
import { count, setText } from "./words.js";

/** Somebody who drags is not answered before so long a rest, milliseconds. */
const REST_MS = 120;
/** Rows: words, the part of the order that it is in, key, and step of the field; none of a list. @type {[string, string, string, string?][]} */
const ROWS = [
  ["x m", "pose", "x_m", "0.01"],
  ["y m", "pose", "y_m", "0.01"],
  ["Heading °", "pose", "heading_deg", "0.9"],
  ["From °", "plan", "from_deg", "0.9"],
  ["To °", "plan", "to_deg", "0.9"],
  ["Every °", "plan", "step_deg", "0.9"],
  ["Pings a stop", "plan", "pings_per_stop", "1"],
  ["Air °C", "air", "temperature_c", "0.5"],
  ["Humidity %", "air", "humidity_percent", "5"],
  ["Sensor", "sensor", "name"],
  ["Threshold", "sensor", "threshold", "0.0005"],
  ["Rise dB/m", "sensor", "threshold_rise_db_per_m", "0.5"],
  ["Gain", "sensor", "gain"],
  ["Blanking µs", "sensor", "blanking_us", "20"],
];
/** Kinds of gain. */
const KINDS = { steps: "in steps", compensating: "as it spreads" };
/** What a sensor's data leave out. */
const LEFT_OUT = { threshold_rise_db_per_m: 0, integration_us: 0, range_step_m: 0, gain: { kind: "compensating", exponent: 0, air: false } };
/** Ranges that differ by less are the same, metres. */
const SAME_M = 1e-4;
const PARTS = ["pose", "plan", "air", "sensor"];
const AIR = ["temperature_c", "humidity_percent", "pressure_kpa"];

export class Next {
  /** @param {HTMLElement} section @param {any} plan @param {(text: string) => void} say */
  constructor(section, plan, say) {
    this.plan = plan;
    this.say = say;
    /** What would be ordered, by part; `null` while nobody changes anything. */
    this.draft = null;
    this.status = null;
    this.scan = null;
    /** What is expected where nothing is changed. */
    this.unchanged = null;
    /** Sensors that come with the program. @type {any[]} */
    this.presets = [];
    this.due = 0;
    this.request = new AbortController();
    /** Why this draft was not taken in, in words; said until the draft changes. */
    this.refusal = "";
    this.build(section);
    plan.overlays.push(this);
  }

  build(section) {
    const button = (id, textContent, doing) => {
      const made = make("button", { type: "button", id, textContent });
      made.addEventListener("click", doing);
      return made;
    };
    this.change = button("change", "Change", () => (this.draft ? this.leave() : this.enter()));
    this.change.ariaPressed = "false";
    this.apply = button("apply", "Apply", () => this.order());
    this.apply.className = "go";
    this.rows = ROWS.map(([words, part, key, step]) => {
      const kind = step ? make("input", { type: "number", step }) : make("select");
      const field = Object.assign(kind, { id: `next-${key}`, ariaLabel: `${words}, to be changed` });
      field.addEventListener("input", () => this.type(part, key, field));
      const cells = [make("td"), make("td"), make("td", { className: "draft" }, field)];
      return { part, key, field, row: make("tr", {}, make("th", { scope: "row", textContent: words }), ...cells), cells };
    });
    const head = ["Setting", "In force", "Pending", "Change to"].map((textContent) => make("th", { scope: "col", textContent }));
    head[3].className = "draft";
    this.table = make("table", { id: "next-table" }, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...this.rows.map(({ row }) => row)));
    this.told = make("p", { id: "next-now", className: "hint", role: "status" });
    this.buttons = make("p", { className: "buttons", hidden: true }, this.apply);
    section.append(this.table, this.told, this.buttons);
    section.querySelector(".head").append(this.change);
    this.section = section;
    this.ranger = null;
  }

  /** What the daemon says is in force and pending. */
  tell(status) {
    this.status = status;
    const of = (from, part, key) => (from[part] ? from[part][key] : null);
    for (const { part, key, row, cells } of this.rows) {
      const [now, then] = [of(status, part, key), of(status.pending, part, key)];
      row.hidden = part === "plan" && status.simulation !== null;
      const differs = then !== null && JSON.stringify(then) !== JSON.stringify(now);
      setText(cells[0], figure(now));
      setText(cells[1], differs ? figure(then) : "–");
      cells[1].classList.toggle("pending", differs);
    }
  }

  /** What the next scan is taken by, by part. */
  coming() {
    const { status } = this;
    const parts = Object.fromEntries(PARTS.map((part) => [part, { ...(status.pending[part] ?? status[part]) }]));
    parts.air = Object.fromEntries(AIR.map((key) => [key, parts.air[key]]));
    return parts;
  }

  /** Begins to change, with what somebody proposes. @param {(draft: any) => void} [change] */
  async enter(change) {
    if (!this.status) return this.say("The daemon does not answer.");
    this.presets = await ask("/v1/sensors").catch(() => []);
    this.draft = this.coming();
    this.change.ariaPressed = "true";
    this.change.textContent = "Leave";
    this.section.classList.add("changing");
    this.buttons.hidden = false;
    this.ranger ??= new Ranger(this.plan.stage, this.plan.view, (pose) => this.move(pose), () => this.settle());
    this.showHandles(true);
    this.unchanged = await ask("/v1/preview", { method: "POST", body: this.orderOf(this.draft) }).then(Scan.of, () => null);
    if (!this.draft) return;
    await this.redraft(change);
  }

  /** Changes what is about to be changed, or begins with it. @param {(draft: any) => void} change */
  async propose(change) {
    this.section.scrollIntoView({ block: "nearest" });
    if (!this.draft) return this.enter(change);
    await this.redraft(change);
  }

  /** Shows what becomes of the draft. @param {(draft: any) => void} [change] */
  async redraft(change) {
    change?.(this.draft);
    this.show();
    this.refusal = "";
    await this.preview();
  }

  leave() {
    this.request.abort();
    clearTimeout(this.due);
    [this.draft, this.scan, this.unchanged] = [null, null, null];
    this.change.ariaPressed = "false";
    this.change.textContent = "Change";
    this.section.classList.remove("changing");
    this.buttons.hidden = true;
    this.showHandles(false);
    setText(this.told, "");
    this.plan.held = false;
    this.plan.redraw();
  }

  showHandles(shown) {
    for (const handle of [this.ranger?.body, this.ranger?.nose]) if (handle) handle.button.hidden = !shown;
  }

  /** Fields and handles to what is in the draft. */
  show() {
    const { sensor } = this.draft;
    const names = [this.coming().sensor.name, ...this.presets.map(({ name }) => name)];
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

  settle() {
    this.plan.held = false;
    this.previewSoon();
  }

  /** The sensor that figures are given for: that of the next scan, or a preset. @param {string} name */
  base(name) {
    const { sensor } = this.coming();
    return name === sensor.name ? sensor : figures(this.presets.find((preset) => preset.name === name), sensor);
  }

  /** Another sensor, or another kind of gain. */
  choose(key, value) {
    const { draft } = this;
    if (key === "name") draft.sensor = { ...this.base(value) };
    else {
      const own = this.base(draft.sensor.name).gain;
      draft.sensor.gain = own.kind === value ? own : { kind: value };
    }
    this.show();
    this.previewSoon();
  }

  type(part, key, field) {
    if (field.localName === "select") return this.choose(key, field.value);
    if (field.value === "" || !Number.isFinite(field.valueAsNumber)) return;
    this.draft[part][key] = field.valueAsNumber;
    this.ranger.place(this.draft.pose);
    this.previewSoon();
  }

  previewSoon() {
    clearTimeout(this.due);
    this.refusal = "";
    this.due = setTimeout(() => this.preview(), REST_MS);
  }

  /** Asks the model; the answer to the last question counts. */
  async preview() {
    this.request.abort();
    const { signal } = (this.request = new AbortController());
    try {
      const whole = await ask("/v1/preview", { method: "POST", body: this.orderOf(this.draft), signal });
      if (signal.aborted) return;
      this.scan = Scan.of(whole);
      this.previewed(`The model expects ${expected(this.scan)}${this.effect()}. Nothing is changed until it is applied.`);
      this.apply.disabled = false;
    } catch (/** @type {any} */ error) {
      if (signal.aborted) return;
      this.scan = null;
      // What can't be previewed, as for want of a scene, can be ordered all the same.
      this.apply.disabled = error.status === undefined;
      this.previewed(error.status ? `No preview: ${error.message}. ${error.help}` : "No preview: the daemon does not answer.");
    }
    this.plan.redraw();
  }

  /** Says what a preview shows, unless the draft was refused while it was on its way. @param {string} words */
  previewed(words) {
    setText(this.told, this.refusal || words);
  }

  /** @param {string} words */
  refuse(words) {
    this.refusal = words;
    setText(this.told, words);
  }

  /** What is said to the daemon, by part; of a sensor what differs from the one that it has or from the preset. @param {any} draft */
  orderOf({ pose, plan, air, sensor }) {
    const base = this.base(sensor.name);
    const entries = Object.entries(sensor).filter(([key, value]) => JSON.stringify(base[key]) !== JSON.stringify(value));
    const order = Object.fromEntries(entries);
    if (sensor.name !== this.coming().sensor.name) order.preset = sensor.name;
    const rest = Object.keys(order).length ? { pose, air, sensor: order } : { pose, air };
    // An array's rangers are fixed.
    return this.status.simulation ? rest : { ...rest, plan };
  }

  /** How many beams read otherwise than if nothing were changed, in words. */
  effect() {
    const { scan, unchanged } = this;
    if (!unchanged || unchanged.planned !== scan.planned) return "";
    const differs = (one, other) => one.range_m === null || other.range_m === null ? one.range_m !== other.range_m : Math.abs(one.range_m - other.range_m) > SAME_M;
    const others = [...scan.beams.values()].filter((ping) => differs(ping, unchanged.beams.get(ping.index))).length;
    return others ? `, ${others} of them otherwise than if nothing is changed` : "";
  }

  /** Orders what differs from what the next scan is taken by. */
  async order() {
    const [now, { draft }] = [this.coming(), this];
    const parts = PARTS.filter((part) => JSON.stringify(draft[part]) !== JSON.stringify(now[part]));
    const bodies = this.orderOf(draft);
    if (!parts.length) return this.refuse("There is nothing to apply: it is as the next scan is taken.");
    for (const part of parts) {
      try {
        await ask(`/v1/${part}`, { method: "PUT", body: bodies[part] });
      } catch (/** @type {any} */ error) {
        return this.refuse(error.status ? `Refused, the ${part}: ${error.message}. ${error.help}` : "The daemon does not answer.");
      }
    }
    this.leave();
    this.say(`Taken in: ${parts.join(", ")}. It counts from the next scan on.`);
  }

  drawUnder(layer, plan) {
    if (!this.draft) return;
    this.ranger.place(this.draft.pose);
    const c = layer.pen("preview", plan.palette);
    for (const ping of this.scan?.beams.values() ?? []) {
      const at = place(ping);
      if (at && !plan.view.isBeyond(plan.view.px(at))) square(c, plan.view.px(at), 3.5);
    }
  }
}

/** What a previewed scan would read. */
function expected({ beams, counts }) {
  const parts = marksIn(counts).map((name) => `${counts.get(name)} ${MARKS[name].words}`);
  return `${count(beams.size, "beam")}: ${parts.join(", ")}`;
}

const figure = (value) =>
  value === null || value === undefined ? "–" : typeof value === "number" ? String(Number(value.toFixed(4))) : (KINDS[value.kind] ?? value);

/** Those figures of a sensor's data that another one's are told by. */
const figures = (sensor, like) => Object.fromEntries(Object.keys(like).map((key) => [key, sensor[key] ?? LEFT_OUT[key]]));

/** The entries of a list, each once. @param {HTMLSelectElement} list @param {string[]} values */
function fill(list, values) {
  const all = [...new Set(values)];
  if (all.join() === [...list.options].map(({ value }) => value).join()) return;
  list.replaceChildren(...all.map((value) => new Option(KINDS[value] ?? value, value)));
}
