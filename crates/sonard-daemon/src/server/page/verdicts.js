// What each reading is drawn as, and the legend. The words, shapes and hues are those of `sonard plot`.

import { drawSample, penWords } from "./pens.js";

/** Marks by name: words of the legend, shape, and the style's colour. */
export const MARKS = {
  echo: { words: "echo, no model", shape: "dot", colour: "--direct" },
  direct: { words: "direct echo", shape: "dot", colour: "--direct" },
  multiple: { words: "multiple reflection", shape: "square", colour: "--multiple" },
  edge: { words: "edge", shape: "triangle", colour: "--edge-mark" },
  min_range: { words: "minimum range", shape: "diamond", colour: "--min-range" },
  unexplained: { words: "unexplained", shape: "cross", colour: "--unexplained" },
  silent: { words: "silent", shape: "tick", colour: "--silent" },
  silent_unexplained: { words: "silent, model hears", shape: "tick", colour: "--unexplained" },
  lost: { words: "no valid reading", shape: "tick", colour: "--lost" },
  model: { words: "model", shape: "ring", colour: "--model" },
};

/** The mark of a reading, by the verdict that the daemon gave. */
export function markOf(ping) {
  const heard = ping.range_m !== null && (ping.status === "echo" || ping.status === "min_range");
  if (heard) return ping.verdict in MARKS ? ping.verdict : ping.status === "echo" ? "echo" : "min_range";
  if (ping.status !== "no_echo") return "lost";
  return ping.verdict === "unexplained" ? "silent_unexplained" : "silent";
}

/** Draws a mark of half-width r at x, y; `direction` is the way outward of a tick, radians. */
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

/** The style's colours, by name; read anew when the style changes. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  return new Proxy({}, {
    /** @param {Record<string, string>} known @param {string} name */
    get(known, name) {
      return (known[name] ??= style.getPropertyValue(name).trim());
    },
  });
}

/** Names of the marks that occur, in the order of the legend. @param {Map<string, number>} counts */
export const marksIn = (counts) => Object.keys(MARKS).filter((name) => counts.get(name));

/** A mark as the legend shows it, in a field of 24 by 16 pixels. */
export function drawMark(c, name, palette) {
  draw(c, name, 12, MARKS[name].shape === "tick" ? 2 : 8, 4, palette[MARKS[name].colour]);
}

/** Fills the legend with the marks that occur and their numbers, and with the pens that are drawn with. */
export function legend(list, counts, pens, palette) {
  const marks = marksIn(counts);
  const names = [...marks, ...pens];
  const same = names.length === list.children.length && names.every((name, i) => list.children[i].dataset.sign === name);
  if (!same || list.palette !== palette) {
    list.palette = palette;
    list.replaceChildren(...marks.map((name) => markEntry(name, palette)), ...pens.map((name) => penEntry(name, palette)));
  }
  marks.forEach((name, i) => {
    const text = name === "model" ? MARKS[name].words : `${MARKS[name].words} (${counts.get(name)})`;
    const label = list.children[i].lastChild;
    if (label.data !== text) label.data = text;
  });
}

function markEntry(name, palette) {
  return entry(name, (c) => drawMark(c, name, palette), "");
}

function penEntry(name, palette) {
  return entry(name, (c) => drawSample(c, name, palette), penWords(name));
}

function entry(name, sign, text) {
  const item = document.createElement("li");
  item.dataset.sign = name;
  const sample = item.appendChild(document.createElement("canvas"));
  sample.ariaHidden = "true";
  sample.width = 24 * devicePixelRatio;
  sample.height = 16 * devicePixelRatio;
  const c = sample.getContext("2d");
  c.scale(devicePixelRatio, devicePixelRatio);
  sign(c);
  item.append(text);
  return item;
}
