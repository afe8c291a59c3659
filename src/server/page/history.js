// The scans of the logs, and the replay of one of them.

import { ask } from "./api.js";
import { Scan } from "./scan.js";
import { clock, count } from "./words.js";

const REFRESH_MS = 1000;

export class History {
  /** Calls `onShow(scan)` with a scan to show, `onShow(null)` for the live one. */
  constructor({ list, live, replay, speed }, onShow) {
    Object.assign(this, { list, live, replay, speed, onShow });
    this.shown = null;
    this.playing = 0;
    [this.due, this.refreshed] = [null, -REFRESH_MS];
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
    try {
      const scans = await ask("/v1/scans");
      const focused = this.list.contains(document.activeElement) ? document.activeElement.dataset.scan : null;
      this.list.replaceChildren(...scans.map(entry));
      this.mark();
      if (focused) this.list.querySelector(`[data-scan="${focused}"]`)?.focus();
    } catch {
      // The list of before is better than none; the status says what is wrong.
    }
  }

  async show(id) {
    try {
      const whole = await ask(`/v1/scans/${id}`);
      this.shown = Scan.of(whole);
      this.playing++;
      this.mark();
      this.onShow(this.shown);
    } catch (error) {
      this.onShow(this.shown, `The scan can't be shown: ${error.message}. ${error.help ?? ""}`);
    }
  }

  showLive() {
    this.shown = null;
    this.playing++;
    this.mark();
    this.onShow(null);
  }

  /** Shows the readings of the chosen scan as they came; of the newest if none is chosen. */
  async play() {
    const id = this.shown?.id ?? this.list.querySelector("button")?.dataset.scan;
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

  mark() {
    this.live.ariaPressed = String(this.shown === null);
    for (const button of this.list.querySelectorAll("button")) {
      button.ariaPressed = String(button.dataset.scan === this.shown?.id);
    }
  }
}

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

function entry(scan) {
  const item = document.createElement("li");
  const button = item.appendChild(document.createElement("button"));
  button.type = "button";
  button.dataset.scan = scan.scan;
  const beams = scan.end ? `${count(scan.end.beams, "beam")}${scan.end.missing ? `, ${scan.end.missing} missing` : ""}` : "not ended";
  for (const text of [clock(scan.time), beams]) button.appendChild(document.createElement("span")).textContent = text;
  return item;
}
