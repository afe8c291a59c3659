// The floor plan as a picture to keep: title, plan, legend, and what a reader must know of the readings.

import { drawSample, penWords } from "./pens.js";
import { SvgContext } from "./svg.js";
import { drawMark, marksIn, MARKS } from "./verdicts.js";

const MARGIN = 16, HEAD = 46, ROW = 22;
const FONT = "system-ui, sans-serif";
/** Pixels of a PNG for one on the screen. */
const SHARP = 2;

/** @typedef {{title: string, about: string, badge: string | undefined, counts: Map<string, number>}} Words */

/** @param {any} plan @param {Words} words @returns {Blob} */
export function svgOf(plan, words) {
  const probe = new OffscreenCanvas(1, 1).getContext("2d");
  const [width, height] = size(plan, words, probe);
  const c = new SvgContext(width, height);
  draw(plan, words, c, [width, height]);
  return new Blob([c.file(`${words.title}, ${words.about}`)], { type: "image/svg+xml" });
}

/** @param {any} plan @param {Words} words @returns {Promise<Blob>} */
export function pngOf(plan, words) {
  const canvas = new OffscreenCanvas(1, 1);
  const [width, height] = size(plan, words, canvas.getContext("2d"));
  [canvas.width, canvas.height] = [Math.round(SHARP * width), Math.round(SHARP * height)];
  const c = canvas.getContext("2d");
  c.scale(SHARP, SHARP);
  draw(plan, words, c, [width, height]);
  return canvas.convertToBlob({ type: "image/png" });
}

function size(plan, words, c) {
  const { width, height } = plan.view;
  return [width + 2 * MARGIN, HEAD + height + MARGIN + ROW * rows(plan, words, c).length + MARGIN / 2];
}

function draw(plan, words, c, [width, height]) {
  const { palette, view } = plan;
  c.fillStyle = palette["--panel"];
  c.fillRect(0, 0, width, height);
  [c.textBaseline, c.textAlign, c.fillStyle] = ["alphabetic", "left", palette["--ink"]];
  c.font = `600 15px ${FONT}`;
  c.fillText(words.title, MARGIN, 22);
  c.font = `12px ${FONT}`;
  c.fillStyle = palette["--quiet"];
  c.fillText(words.about, MARGIN, 39);
  if (words.badge) {
    [c.textAlign, c.fillStyle, c.font] = ["right", palette["--wait"], `600 13px ${FONT}`];
    c.fillText(words.badge, width - MARGIN, 22);
  }
  within(c, [MARGIN, HEAD, view.width, view.height], () => plan.drawOn(c));
  c.setLineDash([]);
  [c.strokeStyle, c.lineWidth] = [palette["--rule"], 1];
  box(c, MARGIN, HEAD, view.width, view.height);
  drawLegend(c, plan, words, HEAD + view.height + MARGIN);
}

/** @param {any} c @param {number[]} frame @param {() => void} drawIn */
function within(c, frame, drawIn) {
  if (c instanceof SvgContext) return c.within(frame, drawIn);
  c.save();
  c.beginPath();
  c.rect(...frame);
  c.clip();
  c.translate(frame[0], frame[1]);
  drawIn();
  c.restore();
}

function box(c, x, y, width, height) {
  c.beginPath();
  for (const [dx, dy] of [[0, 0], [width, 0], [width, height], [0, height], [0, 0]]) c.lineTo(x + dx, y + dy);
  c.stroke();
}

/** Entries of the legend in rows that are as wide as the plan. */
function rows(plan, { counts }, c) {
  c.font = `12px ${FONT}`;
  const marks = marksIn(counts).map((name) => ({ name, text: `${MARKS[name].words}${name === "model" ? "" : ` (${counts.get(name)})`}`, mark: true }));
  const pens = plan.pens().map((name) => ({ name, text: penWords(name), mark: false }));
  const [all, lines] = [[...marks, ...pens], [[]]];
  let x = 0;
  for (const entry of all) {
    const width = 46 + c.measureText(entry.text).width;
    if (x + width > plan.view.width && x > 0) {
      lines.push([]);
      x = 0;
    }
    lines.at(-1).push({ ...entry, x });
    x += width;
  }
  return lines;
}

function drawLegend(c, plan, words, top) {
  rows(plan, words, c).forEach((row, i) => {
    for (const { name, text, mark, x } of row) {
      c.save();
      c.translate(MARGIN + x, top + i * ROW - 4);
      if (mark) drawMark(c, name, plan.palette);
      else drawSample(c, name, plan.palette);
      c.setLineDash([]);
      [c.font, c.fillStyle, c.textAlign, c.textBaseline] = [`12px ${FONT}`, plan.palette["--ink"], "left", "middle"];
      c.fillText(text, 28, 8);
      c.restore();
    }
  });
}
