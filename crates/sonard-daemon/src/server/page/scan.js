// One scan in memory: its readings by index, and what is counted of them.

import { markOf } from "./verdicts.js";
import { count } from "./words.js";

/** Verdicts by which a reading, or its silence, is as the model says. */
const EXPLAINED = ["direct", "multiple", "edge", "min_range", "silent"];

export class Scan {
  constructor(start, session = null) {
    this.id = start.scan;
    this.start = start;
    this.session = session;
    this.end = null;
    /** The scan before, while that was shown when this one began. */
    this.before = null;
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
    this.before = null;
    this.underWay = false;
  }

  /** The reading of a beam, or of the scan before until there is one, or of the nearest beam that there is. */
  nearest(index) {
    let best = this.beams.get(index) ?? this.before?.beams.get(index) ?? null;
    if (best) return best;
    for (const ping of this.beams.values()) {
      if (!best || Math.abs(ping.index - index) < Math.abs(best.index - index)) best = ping;
    }
    return best;
  }

  count(ping, by) {
    const add = (name) => this.counts.set(name, (this.counts.get(name) ?? 0) + by);
    add(ping.mark);
    if (EXPLAINED.includes(ping.verdict)) add("explained");
    if (ping.sim?.range_m != null) add("model");
  }

  /** Residuals of readings that the model hears too, metres, with their beams. */
  residuals() {
    return [...this.beams.values()].filter((ping) => ping.residual_m !== null);
  }

  /** What a reader should know of the whole, in one sentence; its counts are sums of the legend's. */
  inWords() {
    const n = (name) => this.counts.get(name) ?? 0;
    const parts = [count(this.beams.size, "beam")];
    if (n("explained")) parts.push(`${n("explained")} as the model says`);
    const odd = n("unexplained") + n("silent_unexplained");
    if (odd) parts.push(`${odd} unexplained${n("silent_unexplained") ? `, ${n("silent_unexplained")} of them silent` : ""}`);
    if (n("lost")) parts.push(`${n("lost")} without a valid reading`);
    const sizes = this.residuals().map((ping) => Math.abs(ping.residual_m)).sort((a, b) => a - b);
    if (sizes.length) parts.push(`median residual ${(1e3 * sizes[sizes.length >> 1]).toFixed(1)} mm`);
    if (this.end?.missing) parts.push(`${this.end.missing} missing`);
    if (this.end?.duration_s) parts.push(`${this.end.duration_s.toFixed(1)} s`);
    return parts.join(", ");
  }
}
