// Text of figures and records, with units.

/** Units of distances: number per metre, and decimals. */
const UNITS = { m: [1, 4], cm: [100, 2], in: [1 / 0.0254, 3] };
let unit = "m";

export const setUnit = (/** @type {string} */ name) => (unit = name);
export const unitName = () => unit;
/** Converts metres to the chosen unit. @param {number} m */
export const inUnit = (m) => m * UNITS[unit][0];
/** Number of a distance without its unit. @param {number | null | undefined} m */
export const distanceFigure = (m) => (m === null || m === undefined ? "–" : inUnit(m).toFixed(UNITS[unit][1] - (m < 10 ? 0 : 1)));
export const distance = (m) => (m === null || m === undefined ? "–" : `${distanceFigure(m)} ${unit}`);
export function millimetres(m) {
  if (m === null || m === undefined) return "–";
  const size = Math.abs(1e3 * m).toFixed(1);
  return `${size === "0.0" ? "" : m < 0 ? "−" : "+"}${size} mm`;
}
export const degrees = (deg) => `${(deg.toFixed(1) === "-0.0" ? 0 : deg).toFixed(1)}°`;
export const decibels = (db) => `${db < 0 ? "−" : "+"}${Math.abs(db).toFixed(1)} dB`;

/** A number with its noun in singular or plural. */
export const count = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`;

export const clock = (time) =>
  new Date(time).toLocaleString(undefined, {
    month: "short", day: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit", hour12: false,
  });

export const time = (time) => new Date(time).toLocaleTimeString(undefined, { hour12: false });

/** Parts as sentences: each begins with a capital and ends with a full stop. @param {(string | undefined)[]} parts */
export const sentences = (...parts) =>
  parts.filter((part) => part).map((part) => `${part[0].toUpperCase()}${part.slice(1)}`.replace(/(?<![.?!])$/, ".")).join(" ");

/** Sentences for a failed request: what failed, the daemon's message and its advice. @param {string} what @param {any} error */
export function failure(what, error) {
  const offline = error instanceof TypeError || error.name === "TimeoutError";
  return sentences(`${what}: ${offline ? "no connection to the daemon" : error.message}`, error.help);
}

const isEdge = ({ kind }) => kind === "diffraction";

/** Interactions along a propagation path, in order. */
export const interactions = (path) =>
  path.interactions.map((interaction) => (isEdge(interaction) ? `edge ${interaction.id}` : interaction.id)).join(", ") || "direct";

/** Description of a propagation path. */
export function pathLabel(path) {
  if (!path) return "no arrival near the threshold";
  if (!path.interactions.length) return "direct";
  const kind = path.kind === "scattered" ? "scattering" : path.interactions.every(isEdge) ? "diffraction" : "reflection";
  return `${kind} at ${interactions(path)}`;
}

export function crosstalkLabel({ ranger, before_us }) {
  return before_us === 0 ? `pulse of ${ranger}, fired simultaneously` : `pulse of ${ranger}, fired ${before_us / 1000} ms earlier`;
}

const STATES = {
  opening: ["wait", "opening the port"],
  identifying: ["wait", "identifying"],
  homing: ["wait", "homing"],
  ready: ["good", "ready"],
  scanning: ["good", "scanning"],
  absent: ["bad", "ranger absent"],
  busy: ["bad", "port busy"],
  forbidden: ["bad", "permission denied"],
  not_answering: ["bad", "ranger not responding"],
  wrong_firmware: ["bad", "wrong firmware"],
  wrong_device: ["bad", "wrong device"],
  lost: ["bad", "link lost"],
  fault: ["bad", "fault"],
  emergency_stop: ["bad", "emergency stop"],
  awaiting_start: ["bad", "awaiting start"],
  stopped: ["bad", "stopped"],
};

/** Lamp and text of a link state. */
export const linkState = (name) => STATES[name] ?? ["bad", name];

const PROVENANCES = {
  mock: "MOCK, not hardware",
  emulator: "EMULATOR, not hardware",
  simulated: "SIMULATED",
  imported: "IMPORTED",
  replay: "REPLAY",
};

/** Badge for readings that were not measured by hardware; `undefined` for hardware. */
export const provenanceLabel = (name) => PROVENANCES[name];

/** Estimated change of a parameter with its standard deviation, in the format of `sonard status`. */
export function estimateText({ name, value, sigma }) {
  const by = (figure, unit, digits, axis = "") =>
    `${axis}${figure < 0 ? "−" : "+"}${Math.abs(figure).toFixed(digits)} ${unit} ± `;
  switch (name) {
    case "x_m":
    case "y_m":
    case "offset_m":
      return `${by(1e3 * value, "mm", 0, name === "offset_m" ? "" : `${name[0]} `)}${(1e3 * sigma).toFixed(1)}`;
    case "heading_deg":
      return `${by(value, "degrees", 2)}${sigma.toFixed(2)}`;
    case "threshold_db":
      return `${by(value, "dB", 1)}${sigma.toFixed(1)}`;
    default: {
      const warmer_c = 5.86 * value;
      return `${by(value, "%", 2)}${sigma.toFixed(2)} (air ${warmer_c < 0 ? "−" : "+"}${Math.abs(warmer_c).toFixed(1)} °C)`;
    }
  }
}

/** Shows name-value pairs in a description list; unchanged entries are not touched. */
export function showFacts(list, entries) {
  const rows = list.children;
  entries.forEach(([name, text], i) => {
    let row = rows[i];
    if (!row) {
      row = list.appendChild(document.createElement("div"));
      row.append(document.createElement("dt"), document.createElement("dd"));
    }
    setText(row.firstChild, name);
    setText(row.lastChild, text);
  });
  while (rows.length > entries.length) list.lastChild.remove();
}

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
