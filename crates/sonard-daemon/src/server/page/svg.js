// Canvas-like context that writes SVG; implements the subset of the API that the plan uses.

const RIGHT = { left: "start", center: "middle", right: "end" };
const BASE = { middle: "central", alphabetic: "alphabetic" };

/** Rounds a coordinate to 1/50 pixel. @param {number} value */
const n = (value) => String(Math.round(50 * value) / 50);
/** @param {string} text */
const escaped = (text) => text.replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);

export class SvgContext {
  /** @param {number} width @param {number} height */
  constructor(width, height) {
    this.width = width;
    this.height = height;
    /** Elements; the data of consecutive paths with equal attributes are joined. @type {(string | {open: string, data: string[]})[]} */
    this.parts = [];
    this.path = "";
    /** Full circle that is the whole path. @type {number[] | null} */
    this.circle = null;
    /** @type {object[]} */
    this.saved = [];
    this.measure = new OffscreenCanvas(1, 1).getContext("2d");
    this.fillStyle = this.strokeStyle = "#000000";
    this.lineWidth = 1;
    this.globalAlpha = 1;
    this.lineCap = "butt";
    this.lineJoin = "miter";
    this.font = "12px sans-serif";
    this.textAlign = "left";
    this.textBaseline = "alphabetic";
    /** @type {number[]} */
    this.dash = [];
    this.transform = "";
  }

  /** Text of the SVG file. @param {string} title */
  file(title) {
    const { width, height } = this;
    const head = `<svg xmlns="http://www.w3.org/2000/svg" width="${n(width)}" height="${n(height)}" viewBox="0 0 ${n(width)} ${n(height)}">`;
    return `${head}<title>${escaped(title)}</title>\n${this.parts.map(textOf).join("\n")}\n</svg>\n`;
  }

  /** Draws into a nested viewport, clipped at a box. @param {number[]} box @param {() => void} draw */
  clipped([x, y, width, height], draw) {
    this.parts.push(`<svg x="${n(x)}" y="${n(y)}" width="${n(width)}" height="${n(height)}">`);
    draw();
    this.parts.push("</svg>");
  }

  save() {
    const { fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, textBaseline, dash, transform } = this;
    this.saved.push({ fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, textBaseline, dash, transform });
  }

  restore() {
    Object.assign(this, this.saved.pop());
  }

  /** @param {number} x @param {number} y */
  translate(x, y) {
    this.transform += `translate(${n(x)} ${n(y)})`;
  }

  /** @param {number} turn radians */
  rotate(turn) {
    this.transform += `rotate(${n((turn * 180) / Math.PI)})`;
  }

  /** @param {number[]} dash */
  setLineDash(dash) {
    this.dash = dash;
  }

  beginPath() {
    this.path = "";
    this.circle = null;
  }

  moveTo(x, y) {
    this.path += `M${n(x)} ${n(y)}`;
  }

  lineTo(x, y) {
    this.path += `${this.path ? "L" : "M"}${n(x)} ${n(y)}`;
  }

  /** Arc, clockwise as on a canvas. */
  arc(x, y, r, from, to) {
    const end = (turn) => `${n(x + r * Math.cos(turn))} ${n(y + r * Math.sin(turn))}`;
    const isFullCircle = to - from >= 2 * Math.PI - 1e-9;
    this.circle = isFullCircle && !this.path ? [x, y, r] : null;
    this.path += `${this.path ? "L" : "M"}${end(from)}`;
    // SVG omits an arc whose end equals its start, so a full circle takes two.
    const half = (/** @type {number} */ sign) => `a${n(r)} ${n(r)} 0 0 1 ${n(sign * 2 * r * Math.cos(from))} ${n(sign * 2 * r * Math.sin(from))}`;
    this.path += isFullCircle ? half(-1) + half(1) : `A${n(r)} ${n(r)} 0 ${to - from > Math.PI ? 1 : 0} 1 ${end(to)}`;
  }

  stroke() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.join(" ")}"` : "";
    const join = this.lineJoin === "miter" ? "" : ` stroke-linejoin="${this.lineJoin}"`;
    this.putPath(this.path, `fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}"${dash}${join}`);
  }

  fill() {
    if (!this.circle) return this.putPath(this.path, `fill="${this.fillStyle}"`);
    // The round cap of a line without length is the shortest disc.
    const [x, y, r] = this.circle;
    this.putPath(`M${n(x)} ${n(y)}h0`, `fill="none" stroke="${this.fillStyle}" stroke-width="${n(2 * r)}" stroke-linecap="round"`);
  }

  /** @param {string} data @param {string} attributes */
  putPath(data, attributes) {
    const open = `path ${attributes}${this.placement()}`;
    const last = this.parts.at(-1);
    // Overlaps of translucent parts would change.
    if (typeof last === "object" && last.open === open && this.globalAlpha === 1) last.data.push(data);
    else this.parts.push({ open, data: [data] });
  }

  /** Opacity and transform of the next element. */
  placement() {
    const alpha = this.globalAlpha < 1 ? ` opacity="${this.globalAlpha}"` : "";
    return `${alpha}${this.transform ? ` transform="${this.transform}"` : ""}`;
  }

  fillRect(x, y, width, height) {
    this.putPath(`M${n(x)} ${n(y)}h${n(width)}v${n(height)}h${n(-width)}z`, `fill="${this.fillStyle}"`);
  }

  clearRect() {}

  fillText(text, x, y) {
    const size = /(\d+)px (.*)/.exec(this.font);
    const bold = /^[5-9]00|^bold/.test(this.font) ? ' font-weight="600"' : "";
    const font = `font-family="${escaped(size[2])}" font-size="${size[1]}"${bold}`;
    const place = `x="${n(x)}" y="${n(y)}" text-anchor="${RIGHT[this.textAlign] ?? "start"}" dominant-baseline="${BASE[this.textBaseline] ?? "alphabetic"}"`;
    this.put(`text ${place} ${font} fill="${this.fillStyle}"`, escaped(String(text)));
  }

  measureText(text) {
    this.measure.font = this.font;
    return this.measure.measureText(text);
  }

  /** @param {string} open @param {string} [content] */
  put(open, content) {
    this.parts.push(`<${open}${this.placement()}${content === undefined ? "/>" : `>${content}</text>`}`);
  }
}

/** @param {string | {open: string, data: string[]}} part */
const textOf = (part) => (typeof part === "string" ? part : `<${part.open} d="${part.data.join("")}"/>`);
