// One scan in memory: its readings by index, and what is counted of them.

import { markOf } from "./verdicts.js";

export class Scan {
  constructor(start, session = null) {
    this.id = start.scan;
    this.start = start;
    this.session = session;
    this.end = null;
    /** Whether more readings are to come. */
    this.underWay = false;
    this.beams = new Map();
    this.counts = new Map();
    this.added = [];
    const { from_deg, to_deg, step_deg, pings_per_stop } = start.plan;
    /** Beams of the plan, whose end is left out. */
    this.planned = Math.ceil((to_deg - from_deg) / step_deg - 1e-9) * pings_per_stop;
  }

  /** A scan as `GET /v1/scans/{scan}` gives it. */
  static of(whole) {
    const scan = new Scan(whole.start, whole.session);
    whole.pings.forEach((ping) => scan.add(ping));
    if (whole.end) scan.finish(whole.end);
    return scan;
  }

  /** Takes a reading in; one that came before for the same beam gives way. */
  add(ping) {
    const before = this.beams.get(ping.index);
    if (before) this.count(before, -1);
    ping.mark = markOf(ping);
    this.beams.set(ping.index, ping);
    this.count(ping, 1);
    this.added.push(ping);
  }

  finish(end) {
    this.end = end;
    this.underWay = false;
  }

  /** The reading of a beam, or of the nearest one that there is. */
  nearest(index) {
    if (this.beams.has(index)) return this.beams.get(index);
    let best = null;
    for (const ping of this.beams.values()) {
      if (!best || Math.abs(ping.index - index) < Math.abs(best.index - index)) best = ping;
    }
    return best;
  }

  count(ping, by) {
    const add = (name) => this.counts.set(name, (this.counts.get(name) ?? 0) + by);
    add(ping.mark);
    if (ping.sim?.range_m != null) add("model");
  }

  /** Residuals of readings that the model hears too, metres, with their beams. */
  residuals() {
    return [...this.beams.values()].filter((ping) => ping.residual_m !== null);
  }

  /** What a reader should know of the whole, in one sentence or two. */
  inWords() {
    const n = (name) => this.counts.get(name) ?? 0;
    const residuals = this.residuals().map((ping) => Math.abs(ping.residual_m)).sort((a, b) => a - b);
    const parts = [`${this.beams.size} beams`];
    const explained = n("direct") + n("multiple") + n("edge") + n("min_range");
    if (this.counts.get("model")) parts.push(`${explained} readings as the model says`);
    const odd = n("unexplained") + n("silent_unexplained");
    if (odd) parts.push(`${odd} unexplained`);
    if (n("silent")) parts.push(`${n("silent")} silent`);
    if (n("lost")) parts.push(`${n("lost")} without a valid reading`);
    if (residuals.length) {
      parts.push(`median distance ${(1e3 * residuals[residuals.length >> 1]).toFixed(1)} mm`);
    }
    if (this.end?.missing) parts.push(`${this.end.missing} missing`);
    if (this.end?.duration_s) parts.push(`${this.end.duration_s.toFixed(1)} s`);
    return parts.join(", ");
  }
}
