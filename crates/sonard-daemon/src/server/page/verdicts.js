// Marks of readings by verdict, and the legend. Labels, shapes and hues follow `sonard plot`.

import { drawSample, penLabel } from "./layers.js";

/** Marks by name: legend label, shape, and colour (custom property of the style sheet). */
export const MARKS = {
  echo: { label: "echo, no prediction", shape: "dot", colour: "--direct" },
  direct: { label: "direct echo", shape: "dot", colour: "--direct" },
  multiple: { label: "multiple reflection", shape: "square", colour: "--multiple" },
  edge: { label: "edge", shape: "triangle", colour: "--edge-mark" },
  min_range: { label: "minimum range", shape: "diamond", colour: "--min-range" },
  unexplained: { label: "disagrees with model", shape: "cross", colour: "--disagrees" },
  no_echo: { label: "no echo", shape: "tick", colour: "--no-echo" },
  missed_echo: { label: "missed echo", shape: "tick", colour: "--disagrees" },
  invalid: { label: "invalid reading", shape: "tick", colour: "--invalid" },
  prediction: { label: "prediction", shape: "ring", colour: "--model" },
};

/** Mark of a reading, from its status and the daemon's verdict. */
export function markOf(ping) {
  const hasRange = ping.range_m !== null && (ping.status === "echo" || ping.status === "min_range");
  if (hasRange && ping.verdict in MARKS) return ping.verdict;
  if (hasRange) return ping.status !== "echo" ? "min_range" : ping.path ? causeOf(ping) : "echo";
  if (ping.status !== "no_echo") return "invalid";
  return ping.verdict === "unexplained" ? "missed_echo" : "no_echo";
}

/** Mark of a simulated reading, by its propagation path. */
function causeOf({ path: { kind, order } }) {
  if (kind === "diffracted") return "edge";
  return order > 1 ? "multiple" : "direct";
}

/** Draws a mark of half-width r at x, y; `direction` is the outward direction of a tick, radians. */
export function draw(c, mark, x, y, r, colour, direction = -Math.PI / 2) {
  c.fillStyle = c.strokeStyle = colour;
  c.beginPath();
  switch (MARKS[mark].shape) {
    case "dot":
      c.arc(x, y, r, 0, 2 * Math.PI);
      return c.fill();
    case "square":
      return c.fillRect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r);
    case "triangle":
      c.moveTo(x, y - 1.3 * r);
      c.lineTo(x + 1.2 * r, y + 0.9 * r);
      c.lineTo(x - 1.2 * r, y + 0.9 * r);
      return c.fill();
    case "diamond":
      c.moveTo(x, y - 1.3 * r);
      c.lineTo(x + 1.3 * r, y);
      c.lineTo(x, y + 1.3 * r);
      c.lineTo(x - 1.3 * r, y);
      return c.fill();
    case "cross":
      c.lineWidth = 1.6;
      c.moveTo(x - r, y - r);
      c.lineTo(x + r, y + r);
      c.moveTo(x + r, y - r);
      c.lineTo(x - r, y + r);
      return c.stroke();
    case "ring":
      c.lineWidth = 1.1;
      c.arc(x, y, 1.35 * r, 0, 2 * Math.PI);
      return c.stroke();
    default:
      c.lineWidth = 1.4;
      c.moveTo(x - 2.5 * r * Math.cos(direction), y - 2.5 * r * Math.sin(direction));
      c.lineTo(x, y);
      return c.stroke();
  }
}

/** Colours of the style sheet by custom property, read on first use; created again when the colour scheme changes. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  return new Proxy({}, {
    /** @param {Record<string, string>} known @param {string} name */
    get(known, name) {
      return (known[name] ??= style.getPropertyValue(name).trim());
    },
  });
}

/** Names of the marks in use, in the order of the legend. @param {Map<string, number>} counts */
export const marksIn = (counts) => Object.keys(MARKS).filter((name) => counts.get(name));

/** Draws a mark's legend symbol, 24 by 16 pixels. */
export function drawMark(c, name, palette) {
  draw(c, name, 12, MARKS[name].shape === "tick" ? 2 : 8, 4, palette[MARKS[name].colour]);
}

/** Updates the legend: marks in use with their counts, then pens in use. */
export function updateLegend(list, counts, pens, palette) {
  const marks = marksIn(counts);
  const names = [...marks, ...pens];
  const same = names.length === list.children.length && names.every((name, i) => list.children[i].dataset.name === name);
  if (!same || list.palette !== palette) {
    list.palette = palette;
    list.replaceChildren(...marks.map((name) => markEntry(name, palette)), ...pens.map((name) => penEntry(name, palette)));
  }
  marks.forEach((name, i) => {
    const text = name === "prediction" ? MARKS[name].label : `${MARKS[name].label} (${counts.get(name)})`;
    const label = list.children[i].lastChild;
    if (label.data !== text) label.data = text;
  });
}

function markEntry(name, palette) {
  return entry(name, (c) => drawMark(c, name, palette), "");
}

function penEntry(name, palette) {
  return entry(name, (c) => drawSample(c, name, palette), penLabel(name));
}

function entry(name, drawSymbol, text) {
  const item = document.createElement("li");
  item.dataset.name = name;
  const sample = item.appendChild(document.createElement("canvas"));
  sample.ariaHidden = "true";
  sample.width = 24 * devicePixelRatio;
  sample.height = 16 * devicePixelRatio;
  const c = sample.getContext("2d");
  c.scale(devicePixelRatio, devicePixelRatio);
  drawSymbol(c);
  item.append(text);
  return item;
}
