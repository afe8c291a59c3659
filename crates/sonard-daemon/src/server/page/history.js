// The scans of the logs: a list, a time line through them, and the replay of one.

import { ask } from "./api.js";
import { make } from "./dom.js";
import { Scan } from "./scan.js";
import { TimeLine } from "./timeline.js";
import { clock, count } from "./words.js";

const REFRESH_MS = 1000;
/** Somebody who scrubs passes over scans. */
const PAUSE_MS = 60;
/** Scans that were looked at and are kept, and the most beams that they may have. */
const KEPT = 12, KEPT_BEAMS = 4000;
/** Scans of a page of older ones, of the list, and that are known at all. */
const PAGE = 500, LISTED = 50, MOST = 20000;

export class History {
  /** Calls `onShow(scan)` with a scan to show, `onShow(null)` for the live one. */
  constructor({ list, line, live, replay, speed }, onShow) {
    this.list = list;
    this.live = live;
    this.replay = replay;
    this.speed = speed;
    this.onShow = onShow;
    this.shown = null;
    this.playing = 0;
    this.due = null;
    this.refreshed = -REFRESH_MS;
    /** What is known of the scans, newest first. @type {any[]} */
    this.scans = [];
    this.more = false;
    /** @type {Map<string, any>} */
    this.kept = new Map();
    this.request = new AbortController();
    this.pause = 0;
    this.line = new TimeLine(line, ({ scan }) => this.scrub(scan), () => this.loadOlder());
    list.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (button) this.show(button.dataset.scan);
    });
    live.addEventListener("click", () => this.showLive());
    replay.addEventListener("click", () => this.play());
  }

  /** An array's scans are over several times a second: the list follows at its own pace. */
  refreshSoon() {
    const wait = this.refreshed + REFRESH_MS - performance.now();
    this.due ??= setTimeout(() => this.refresh(), Math.max(0, wait));
  }

  async refresh() {
    clearTimeout(this.due);
    [this.due, this.refreshed] = [null, performance.now()];
    // The list of before is better than none; the status says what is wrong.
    const scans = await ask(`/v1/scans?limit=${LISTED}`).catch(() => null);
    if (scans) this.takeIn(scans);
  }

  /** The newest scans, and what was known of others. @param {any[]} scans */
  takeIn(scans) {
    const newest = new Set(scans.map(({ scan }) => scan));
    // Where nothing of the list before is in the new one, there may be others between them.
    const joins = this.scans.some(({ scan }) => newest.has(scan));
    if (!joins) this.more = scans.length === LISTED;
    this.scans = scans.map(brief).concat(joins ? this.scans.filter(({ scan }) => !newest.has(scan)) : []).slice(0, MOST);
    this.mark();
  }

  async loadOlder() {
    const last = this.scans.at(-1);
    if (!last) return;
    try {
      const older = await ask(`/v1/scans?limit=${PAGE}&before=${last.scan}`);
      this.more = older.length === PAGE && this.scans.length + PAGE < MOST;
      this.scans = this.scans.concat(older.map(brief));
      this.mark();
    } catch (/** @type {any} */ error) {
      this.onShow(this.shown, `Older scans can't be listed: ${error.message}. ${error.help ?? ""}`);
    }
  }

  /** The log that a scan is in. */
  logOf(id) {
    return this.scans.find(({ scan }) => scan === id)?.log;
  }

  /** Shows a scan once the slider rests. */
  scrub(id) {
    clearTimeout(this.pause);
    this.pause = setTimeout(() => this.show(id), this.kept.has(id) ? 0 : PAUSE_MS);
  }

  async show(id) {
    this.request.abort();
    this.request = new AbortController();
    const { signal } = this.request;
    try {
      this.shown = await this.get(id, signal);
      if (signal.aborted) return;
      this.playing++;
      this.mark();
      this.onShow(this.shown);
    } catch (/** @type {any} */ error) {
      if (!signal.aborted) this.onShow(this.shown, `The scan can't be shown: ${error.message}. ${error.help ?? ""}`);
    }
  }

  /** A scan of the log; those that are over are kept for a while. */
  async get(id, signal) {
    const known = this.kept.get(id);
    if (known) return known;
    const scan = Scan.of(await ask(`/v1/scans/${id}`, { signal }));
    if (scan.end && scan.beams.size <= KEPT_BEAMS) this.kept.set(id, scan);
    if (this.kept.size > KEPT) this.kept.delete(this.kept.keys().next().value);
    return scan;
  }

  showLive() {
    this.request.abort();
    clearTimeout(this.pause);
    this.shown = null;
    this.playing++;
    this.mark();
    this.onShow(null);
  }

  /** Shows the readings of the chosen scan as they came; of the newest if none is chosen. */
  async play() {
    const id = this.shown?.id ?? this.scans[0]?.scan;
    if (!id) return;
    const whole = await ask(`/v1/scans/${id}`).catch(() => null);
    if (!whole?.start || !whole.pings.length) return;
    this.shown = new Scan(whole.start, whole.session);
    [this.shown.underWay, this.shown.replayed] = [true, true];
    this.mark();
    this.onShow(this.shown);
    const turn = ++this.playing;
    const began = performance.now();
    const dues = schedule(whole);
    let next = 0;
    const step = (now) => {
      if (turn !== this.playing) return;
      const at = (now - began) * Number(this.speed.value);
      while (next < whole.pings.length && dues[next] <= at) this.shown.add(whole.pings[next++]);
      if (next < whole.pings.length) return requestAnimationFrame(step);
      [this.shown.underWay, this.shown.replayed] = [false, false];
      if (whole.end) this.shown.finish(whole.end);
      this.onShow(this.shown);
    };
    requestAnimationFrame(step);
  }

  /** What is shown, in list and time line. */
  mark() {
    this.live.ariaPressed = String(this.shown === null);
    const shown = this.shown?.id ?? null;
    const at = Math.max(0, this.scans.findIndex(({ scan }) => scan === shown));
    // Of many scans the list has those around the one that is shown.
    const from = Math.max(0, Math.min(at - LISTED / 2, this.scans.length - LISTED));
    const focus = /** @type {any} */ (document.activeElement);
    const focused = this.list.contains(focus) ? focus.dataset.scan : null;
    this.list.replaceChildren(...this.scans.slice(from, from + LISTED).map((scan) => entry(scan, shown)));
    if (focused) this.list.querySelector(`[data-scan="${focused}"]`)?.focus();
    this.line.show(this.scans, shown, this.more);
  }
}

/** What the list needs of a scan. */
const brief = ({ scan, time, log, end }) => ({ scan, time, log, end: end && { beams: end.beams, missing: end.missing } });

/** When each reading is due after the first, milliseconds: by the device's clock, else evenly. */
function schedule({ session, pings, end }) {
  const tick_hz = session?.device?.tick_hz;
  const ticks = pings.map((ping) => ping.fired_ticks);
  if (tick_hz && ticks.every((tick, i) => tick !== null && tick >= (ticks[i - 1] ?? tick))) {
    return ticks.map((tick) => (1e3 * (tick - ticks[0])) / tick_hz);
  }
  const each = (1e3 * (end?.duration_s || pings.length / 20)) / pings.length;
  return pings.map((_, i) => i * each);
}

function entry({ scan, time, end }, shown) {
  const beams = end ? `${count(end.beams, "beam")}${end.missing ? `, ${end.missing} missing` : ""}` : "not ended";
  const texts = [clock(time), beams].map((textContent) => make("span", { textContent }));
  const button = make("button", { type: "button", ariaPressed: String(scan === shown) }, ...texts);
  button.dataset.scan = scan;
  return make("li", {}, button);
}
