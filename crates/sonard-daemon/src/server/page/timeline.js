// Time line of the logs: one bar per scan, and a slider.

import { clock, count, setText } from "./format.js";
import { make } from "./dom.js";

/** Distance between the ends of a slider and the centre of its thumb, pixels. */
const INSET = 8;
const HEIGHT = 40, FOOT = 14;
const LABEL_PX = 74;
const FONT = "11px system-ui, sans-serif";

export class TimeLine {
  /**
   * @param {HTMLElement} place
   * @param {(id: string) => boolean} isRunning
   * @param {(scan: any) => void} onScrub
   * @param {() => void} onOlder
   */
  constructor(place, isRunning, onScrub, onOlder) {
    this.isRunning = isRunning;
    this.canvas = make("canvas", { id: "time-line", ariaHidden: "true" });
    this.slider = make("input", { type: "range", id: "scrub", min: "0", max: "0", step: "1", ariaLabel: "Scan, from the oldest to the newest", disabled: true });
    this.label = make("output", { id: "scrub-label", textContent: "no scan yet" });
    this.older = make("button", { type: "button", id: "older", textContent: "Load older", disabled: true });
    place.append(this.canvas, this.slider, make("p", {}, this.label, this.older));
    /** Oldest first. @type {any[]} */
    this.scans = [];
    this.shown = null;
    this.more = false;
    this.palette = null;
    this.slider.addEventListener("input", () => {
      const scan = this.scans[this.slider.value];
      this.updateLabel(scan);
      if (scan) onScrub(scan);
    });
    this.older.addEventListener("click", onOlder);
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
  }

  /** @param {any[]} scans newest first @param {string | null} shown id of the shown scan; `null` for the live one @param {boolean} more set if the log may have older scans */
  show(scans, shown, more) {
    this.scans = scans.toReversed();
    this.shown = shown;
    this.slider.max = Math.max(0, scans.length - 1);
    this.slider.disabled = scans.length === 0;
    this.older.disabled = !more;
    this.more = more;
    const at = shown === null ? scans.length - 1 : this.scans.findIndex(({ scan }) => scan === shown);
    this.slider.value = at < 0 ? 0 : at;
    this.updateLabel(this.scans[at]);
    this.redraw();
  }

  updateLabel(scan) {
    if (!scan) return setText(this.label, this.scans.length ? "scan not in the list" : "no scan yet");
    const at = this.scans.indexOf(scan) + 1;
    const text = `scan ${at} of ${this.scans.length}${this.more ? " loaded" : ""}, ${clock(scan.time)}, ${scan.end ? count(scan.end.beams, "beam") : this.isRunning(scan.scan) ? "running" : "incomplete"}`;
    setText(this.label, text);
    this.slider.setAttribute("aria-valuetext", text);
  }

  redraw(palette = this.palette) {
    this.palette = palette;
    const { canvas, scans } = this;
    const width = canvas.clientWidth;
    if (!palette || !width) return;
    [canvas.width, canvas.height] = [Math.round(width * devicePixelRatio), Math.round(HEIGHT * devicePixelRatio)];
    const c = canvas.getContext("2d");
    c.scale(devicePixelRatio, devicePixelRatio);
    const along = Math.max(1, scans.length - 1);
    const x = (i) => INSET + (i / along) * (width - 2 * INSET);
    const thick = Math.max(1, Math.min(6, (width - 2 * INSET) / along - 1));
    this.drawTimes(c, x, width);
    let last = -1;
    scans.forEach((scan, i) => {
      // The first of several scans on the same pixel is drawn.
      if (Math.round(x(i)) === last && scan.scan !== this.shown) return;
      last = Math.round(x(i));
      const isComplete = scan.end && scan.end.missing === 0;
      const share = scan.end ? scan.end.beams / Math.max(1, scan.end.beams + scan.end.missing) : 0.5;
      const high = Math.max(0.15, share) * (HEIGHT - FOOT - 4);
      c.fillStyle = palette[scan.scan === this.shown ? "--path" : isComplete ? "--direct" : scan.end ? "--disagrees" : "--wait"];
      c.fillRect(x(i) - thick / 2, HEIGHT - FOOT - high, thick, high);
    });
  }

  /** Draws time labels, with the date where it changes, as far as there is room. */
  drawTimes(c, x, width) {
    c.fillStyle = this.palette["--muted"];
    [c.font, c.textBaseline] = [FONT, "alphabetic"];
    let [free, day] = [0, ""];
    this.scans.forEach(({ time }, i) => {
      const at = x(i);
      if (at < free || at > width - LABEL_PX / 2) return;
      const when = new Date(time);
      const date = when.toLocaleDateString(undefined, { month: "short", day: "numeric" });
      const hour = when.toLocaleTimeString(undefined, { hour: "2-digit", minute: "2-digit", second: "2-digit", hour12: false });
      c.textAlign = at < LABEL_PX / 2 ? "left" : "center";
      c.fillText(date === day ? hour : `${date}, ${hour}`, at, HEIGHT - 2);
      free = at + (date === day ? LABEL_PX : 2 * LABEL_PX);
      day = date;
    });
  }
}
