// Scans of the logs: list, time line and replay.

import { requestJson } from "./api.js";
import { make } from "./dom.js";
import { Scan } from "./scan.js";
import { TimeLine } from "./timeline.js";
import { clock, count, failure } from "./format.js";

const REFRESH_INTERVAL_MS = 1000;
/** Delay before a scan is loaded while the slider moves. */
const SCRUB_DELAY_MS = 60;
/** Capacity of the cache of loaded scans, and the maximum number of beams of a cached scan. */
const MAX_CACHED = 12, MAX_CACHED_BEAMS = 4000;
/** Scans per request for older ones, scans in the list, and scans in the time line. */
const PAGE = 500, LISTED = 50, MAX_SCANS = 20000;

export class History {
  /** `isRunning(id)` tests for the live scan; `onShow(scan)` is called with the scan to show, `null` for the live one. */
  constructor({ list, line, live, replay, speed }, isRunning, onShow) {
    this.list = list;
    this.live = live;
    this.replay = replay;
    this.speed = speed;
    this.isRunning = isRunning;
    this.onShow = onShow;
    this.shown = null;
    /** Number of the current replay; a change cancels it. */
    this.replayId = 0;
    this.refreshTimer = null;
    this.refreshedAt = -REFRESH_INTERVAL_MS;
    /** Known scans, newest first. @type {any[]} */
    this.scans = [];
    this.more = false;
    /** @type {Map<string, any>} */
    this.cache = new Map();
    this.request = new AbortController();
    this.scrubTimer = 0;
    this.line = new TimeLine(line, isRunning, ({ scan }) => this.scrub(scan), () => this.loadOlder());
    list.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (button) this.show(button.dataset.scan);
    });
    live.addEventListener("click", () => this.showLive());
    replay.addEventListener("click", () => this.play());
  }

  /** Refreshes the list at most once per interval: an array completes several scans per second. */
  refreshSoon() {
    const delay_ms = this.refreshedAt + REFRESH_INTERVAL_MS - performance.now();
    this.refreshTimer ??= setTimeout(() => this.refresh(), Math.max(0, delay_ms));
  }

  async refresh() {
    clearTimeout(this.refreshTimer);
    [this.refreshTimer, this.refreshedAt] = [null, performance.now()];
    // On failure the previous list stays; the status poll reports the cause.
    const scans = await requestJson(`/v1/scans?limit=${LISTED}`).catch(() => null);
    if (scans) this.merge(scans);
  }

  /** Merges the newest scans into the known ones. @param {any[]} scans */
  merge(scans) {
    const newest = new Set(scans.map(({ scan }) => scan));
    // Without an overlap there may be unknown scans between both lists, so the known ones are dropped.
    const overlaps = this.scans.some(({ scan }) => newest.has(scan));
    if (!overlaps) this.more = scans.length === LISTED;
    this.scans = scans.map(summaryOf).concat(overlaps ? this.scans.filter(({ scan }) => !newest.has(scan)) : []).slice(0, MAX_SCANS);
    this.update();
  }

  /** Adds the scan that has just begun. */
  begin({ id, start }) {
    if (this.scans.some(({ scan }) => scan === id)) return;
    this.scans = [{ scan: id, time: start.time, log: undefined, end: null }, ...this.scans].slice(0, MAX_SCANS);
    this.update();
  }

  /** Marks a scan of the list as ended, until the list is read again. */
  end({ scan: id, beams, missing }) {
    const known = this.scans.find(({ scan }) => scan === id);
    if (known) known.end = { beams, missing };
    this.update();
    this.refreshSoon();
  }

  /** Newest complete scan of the list, as a scan without its readings. */
  completed() {
    const known = this.scans.find(({ end }) => end);
    return known ? (this.cache.get(known.scan) ?? { id: known.scan, start: { time: known.time } }) : null;
  }

  async loadOlder() {
    const last = this.scans.at(-1);
    if (!last) return;
    try {
      const older = await requestJson(`/v1/scans?limit=${PAGE}&before=${last.scan}`);
      this.more = older.length === PAGE && this.scans.length + PAGE < MAX_SCANS;
      this.scans = this.scans.concat(older.map(summaryOf));
      this.update();
    } catch (/** @type {any} */ error) {
      this.onShow(this.shown, failure("Older scans not loaded", error));
    }
  }

  /** Name of the log that contains a scan. */
  logOf(id) {
    return this.scans.find(({ scan }) => scan === id)?.log;
  }

  /** Shows a scan once the slider rests. */
  scrub(id) {
    clearTimeout(this.scrubTimer);
    this.scrubTimer = setTimeout(() => this.show(id), this.cache.has(id) ? 0 : SCRUB_DELAY_MS);
  }

  async show(id) {
    this.request.abort();
    this.request = new AbortController();
    const { signal } = this.request;
    try {
      this.shown = await this.get(id, signal);
      if (signal.aborted) return;
      this.replayId++;
      this.update();
      this.onShow(this.shown);
    } catch (/** @type {any} */ error) {
      if (!signal.aborted) this.onShow(this.shown, failure("Scan not loaded", error));
    }
  }

  /** Loads a scan of the log; complete scans are cached. */
  async get(id, signal) {
    const cached = this.cache.get(id);
    if (cached) return cached;
    const scan = Scan.fromJson(await requestJson(`/v1/scans/${id}`, { signal }));
    if (scan.end && scan.beams.size <= MAX_CACHED_BEAMS) this.cache.set(id, scan);
    if (this.cache.size > MAX_CACHED) this.cache.delete(this.cache.keys().next().value);
    return scan;
  }

  showLive() {
    this.request.abort();
    clearTimeout(this.scrubTimer);
    this.shown = null;
    this.replayId++;
    this.update();
    this.onShow(null);
  }

  /** Replays the shown scan, or the newest, at the recorded times. */
  async play() {
    const id = this.shown?.id ?? this.scans[0]?.scan;
    if (!id) return;
    const record = await requestJson(`/v1/scans/${id}`).catch(() => null);
    if (!record?.start || !record.pings.length) return;
    this.shown = new Scan(record.start, record.session);
    [this.shown.running, this.shown.replayed] = [true, true];
    this.update();
    this.onShow(this.shown);
    const replayId = ++this.replayId;
    const started = performance.now();
    const times_ms = replayTimes(record);
    let next = 0;
    const step = (now) => {
      if (replayId !== this.replayId) return;
      const at_ms = (now - started) * Number(this.speed.value);
      while (next < record.pings.length && times_ms[next] <= at_ms) this.shown.add(record.pings[next++]);
      if (next < record.pings.length) return requestAnimationFrame(step);
      [this.shown.running, this.shown.replayed] = [false, false];
      if (record.end) this.shown.finish(record.end);
      this.onShow(this.shown);
    };
    requestAnimationFrame(step);
  }

  /** Updates list and time line. */
  update() {
    this.live.ariaPressed = String(this.shown === null);
    const shown = this.shown?.id ?? null;
    const at = Math.max(0, this.scans.findIndex(({ scan }) => scan === shown));
    // The list holds the scans around the shown one.
    const from = Math.max(0, Math.min(at - LISTED / 2, this.scans.length - LISTED));
    const focus = /** @type {any} */ (document.activeElement);
    const focused = this.list.contains(focus) ? focus.dataset.scan : null;
    this.list.replaceChildren(...this.scans.slice(from, from + LISTED).map((scan) => this.entry(scan, shown)));
    if (focused) this.list.querySelector(`[data-scan="${focused}"]`)?.focus();
    this.line.show(this.scans, shown, this.more);
  }

  entry({ scan, time, end }, shown) {
    const beams = end ? `${count(end.beams, "beam")}${end.missing ? `, ${end.missing} missing` : ""}` : this.isRunning(scan) ? "running" : "incomplete";
    const texts = [clock(time), beams].map((textContent) => make("span", { textContent }));
    const button = make("button", { type: "button", ariaPressed: String(scan === shown) }, ...texts);
    button.dataset.scan = scan;
    return make("li", {}, button);
  }
}

/** Fields of a scan that list and time line use. */
const summaryOf = ({ scan, time, log, end }) => ({ scan, time, log, end: end && { beams: end.beams, missing: end.missing } });

/** Times of the readings after the first one, milliseconds: from the device's clock, else evenly spaced. */
function replayTimes({ session, pings, end }) {
  const tick_hz = session?.device?.tick_hz;
  const ticks = pings.map((ping) => ping.fired_ticks);
  if (tick_hz && ticks.every((tick, i) => tick !== null && tick >= (ticks[i - 1] ?? tick))) {
    return ticks.map((tick) => (1e3 * (tick - ticks[0])) / tick_hz);
  }
  const interval_ms = (1e3 * (end?.duration_s || pings.length / 20)) / pings.length;
  return pings.map((_, i) => i * interval_ms);
}

