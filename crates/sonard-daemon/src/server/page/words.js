// Figures and records in words, with their units.

export const metres = (m) => (m === null || m === undefined ? "–" : `${m.toFixed(m < 10 ? 4 : 3)} m`);
export function millimetres(m) {
  if (m === null || m === undefined) return "–";
  const size = Math.abs(1e3 * m).toFixed(1);
  return `${size === "0.0" ? "" : m < 0 ? "−" : "+"}${size} mm`;
}
export const degrees = (deg) => `${deg.toFixed(1)}°`;
export const decibels = (db) => `${db < 0 ? "−" : "+"}${Math.abs(db).toFixed(1)} dB`;

/** A number of things, in words. */
export const count = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`;

export const clock = (time) =>
  new Date(time).toLocaleString(undefined, {
    month: "short", day: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit", hour12: false,
  });

export function path(record) {
  if (!record) return "nothing came near";
  const met = record.interactions.map(({ kind, id }) => (kind === "diffraction" ? `edge ${id}` : id));
  return (record.kind === "scattered" ? "scattered by " : "") + (met.join(", ") || "straight");
}

export function crosstalk({ ranger, before_us }) {
  return before_us === 0 ? `sound of ${ranger}, fired at once` : `sound of ${ranger}, fired ${before_us / 1000} ms before`;
}

const STATES = {
  opening: ["wait", "opening the port"],
  identifying: ["wait", "asking the device who it is"],
  homing: ["wait", "homing"],
  ready: ["good", "ready"],
  scanning: ["good", "scanning"],
  absent: ["bad", "ranger absent"],
  busy: ["bad", "port busy"],
  forbidden: ["bad", "port forbidden"],
  not_answering: ["bad", "ranger not answering"],
  wrong_firmware: ["bad", "wrong firmware"],
  wrong_device: ["bad", "wrong device"],
  lost: ["bad", "link lost"],
  fault: ["bad", "fault"],
  emergency_stop: ["bad", "emergency stop"],
  awaiting_start: ["bad", "awaiting start"],
  stopped: ["bad", "stopped"],
};

/** Lamp and words of a state of the link. */
export const state = (name) => STATES[name] ?? ["bad", name];

const PROVENANCES = {
  mock: "MOCK, not hardware",
  emulator: "EMULATOR, not hardware",
  simulated: "SIMULATED",
  imported: "IMPORTED",
  replay: "REPLAY",
};

/** What a reader must know about readings that no ranger made; nothing for hardware. */
export const provenance = (name) => PROVENANCES[name];

/** A value that a change would have, with its standard deviation and the words of `sonard status`. */
export function estimate({ name, value, sigma }) {
  const by = (figure, unit, digits, along = "") =>
    `${along}${figure < 0 ? "−" : "+"}${Math.abs(figure).toFixed(digits)} ${unit} ± `;
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

/** The facts of a list, each a name and a text; only what changed is touched. */
export function facts(list, entries) {
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
