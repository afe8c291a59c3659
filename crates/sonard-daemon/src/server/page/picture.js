// Export of the floor plan as a picture: title, plan, legend, and provenance of the readings.

import { drawSample, penLabel } from "./layers.js";
import { SvgContext } from "./svg.js";
import { drawMark, marksIn, MARKS } from "./verdicts.js";

const MARGIN = 16, HEAD = 46, ROW = 22;
const FONT = "system-ui, sans-serif";
/** PNG pixels per screen pixel. */
const PNG_SCALE = 2;

/** @typedef {{title: string, about: string, badge: string | undefined, counts: Map<string, number>}} Caption */

/** @param {any} plan @param {Caption} caption @returns {Blob} */
export function renderSvg(plan, caption) {
  const probe = new OffscreenCanvas(1, 1).getContext("2d");
  const [width, height] = size(plan, caption, probe);
  const c = new SvgContext(width, height);
  draw(plan, caption, c, [width, height]);
  return new Blob([c.file(`${caption.title}, ${caption.about}`)], { type: "image/svg+xml" });
}

/** @param {any} plan @param {Caption} caption @returns {Promise<Blob>} */
export function renderPng(plan, caption) {
  const canvas = new OffscreenCanvas(1, 1);
  const [width, height] = size(plan, caption, canvas.getContext("2d"));
  [canvas.width, canvas.height] = [Math.round(PNG_SCALE * width), Math.round(PNG_SCALE * height)];
  const c = canvas.getContext("2d");
  c.scale(PNG_SCALE, PNG_SCALE);
  draw(plan, caption, c, [width, height]);
  return canvas.convertToBlob({ type: "image/png" });
}

function size(plan, caption, c) {
  const { width, height } = plan.view;
  return [width + 2 * MARGIN, HEAD + height + MARGIN + ROW * rows(plan, caption, c).length + MARGIN / 2];
}

function draw(plan, caption, c, [width, height]) {
  const { palette, view } = plan;
  c.fillStyle = palette["--panel"];
  c.fillRect(0, 0, width, height);
  [c.textBaseline, c.textAlign, c.fillStyle] = ["alphabetic", "left", palette["--ink"]];
  c.font = `600 15px ${FONT}`;
  c.fillText(caption.title, MARGIN, 22);
  c.font = `12px ${FONT}`;
  c.fillStyle = palette["--muted"];
  c.fillText(caption.about, MARGIN, 39);
  if (caption.badge) {
    [c.textAlign, c.fillStyle, c.font] = ["right", palette["--wait"], `600 13px ${FONT}`];
    c.fillText(caption.badge, width - MARGIN, 22);
  }
  clipped(c, [MARGIN, HEAD, view.width, view.height], () => plan.drawOn(c));
  c.setLineDash([]);
  [c.strokeStyle, c.lineWidth] = [palette["--rule"], 1];
  box(c, MARGIN, HEAD, view.width, view.height);
  drawLegend(c, plan, caption, HEAD + view.height + MARGIN);
}

/** @param {any} c @param {number[]} frame @param {() => void} drawIn */
function clipped(c, frame, drawIn) {
  if (c instanceof SvgContext) return c.clipped(frame, drawIn);
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

/** Legend entries, wrapped into rows of the plan's width. */
function rows(plan, { counts }, c) {
  c.font = `12px ${FONT}`;
  const marks = marksIn(counts).map((name) => ({ name, text: `${MARKS[name].label}${name === "prediction" ? "" : ` (${counts.get(name)})`}`, mark: true }));
  const pens = plan.pens().map((name) => ({ name, text: penLabel(name), mark: false }));
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

function drawLegend(c, plan, caption, top) {
  rows(plan, caption, c).forEach((row, i) => {
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
