// One scan in memory: readings by beam index, and their counts.

import { markOf } from "./verdicts.js";
import { count } from "./format.js";

/** Verdicts of readings, or missing echoes, that agree with the model. */
const AGREEING = ["direct", "multiple", "edge", "min_range", "no_echo"];

export class Scan {
  constructor(start, session = null) {
    this.id = start.scan;
    this.start = start;
    this.session = session;
    this.end = null;
    /** Previous scan, kept while this one is running. */
    this.previous = null;
    /** Set while more readings are expected. */
    this.running = false;
    this.beams = new Map();
    this.counts = new Map();
    this.added = [];
    const { from_deg, to_deg, step_deg, pings_per_stop } = start.plan;
    /** Number of beams of the plan, whose `to_deg` is exclusive. */
    this.planned = Math.ceil((to_deg - from_deg) / step_deg - 1e-9) * pings_per_stop;
  }

  /** Converts the response of `GET /v1/scans/{scan}`. */
  static fromJson({ start, session, pings, end }) {
    const scan = new Scan(start, session);
    pings.forEach((ping) => scan.add(ping));
    if (end) scan.finish(end);
    return scan;
  }

  /** Adds a reading, replacing an earlier one of the same beam. */
  add(ping) {
    const replaced = this.beams.get(ping.index);
    if (replaced) this.count(replaced, -1);
    ping.mark = markOf(ping);
    this.beams.set(ping.index, ping);
    this.count(ping, 1);
    this.added.push(ping);
  }

  finish(end) {
    this.end = end;
    this.previous = null;
    this.running = false;
  }

  /** Reading of a beam: from this scan, else from the previous one, else of the nearest measured beam. */
  nearest(index) {
    let best = this.beams.get(index) ?? this.previous?.beams.get(index) ?? null;
    if (best) return best;
    for (const ping of this.beams.values()) {
      if (!best || Math.abs(ping.index - index) < Math.abs(best.index - index)) best = ping;
    }
    return best;
  }

  count(ping, by) {
    const add = (name) => this.counts.set(name, (this.counts.get(name) ?? 0) + by);
    add(ping.mark);
    if (AGREEING.includes(ping.verdict)) add("agreeing");
    if (ping.sim?.range_m != null) add("prediction");
  }

  /** Readings with a residual: those with both a measured and a predicted range. */
  residuals() {
    return [...this.beams.values()].filter((ping) => ping.residual_m !== null);
  }

  /** A scan stopped on request lacks its remaining beams; a failed one logs them as lost. */
  get isStopped() {
    return this.end?.missing > 0 && this.beams.size < this.planned;
  }

  /** Summary of the scan in one sentence; its counts are sums of the legend's. */
  summary() {
    const n = (name) => this.counts.get(name) ?? 0;
    const parts = [this.isStopped ? `stopped at ${this.beams.size} of ${count(this.planned, "beam")}` : count(this.beams.size, "beam")];
    if (n("agreeing")) parts.push(`${n("agreeing")} agree with the model`);
    const disagreeing = n("unexplained") + n("missed_echo");
    if (disagreeing) parts.push(`${disagreeing} disagree with the model${n("missed_echo") ? `, ${n("missed_echo")} of them without echo` : ""}`);
    if (n("invalid")) parts.push(`${n("invalid")} without a valid reading`);
    const sizes = this.residuals().map((ping) => Math.abs(ping.residual_m)).sort((a, b) => a - b);
    if (sizes.length) parts.push(`median residual ${(1e3 * sizes[sizes.length >> 1]).toFixed(1)} mm`);
    if (this.end?.missing && !this.isStopped) parts.push(`${this.end.missing} missing`);
    if (this.end?.duration_s) parts.push(`${this.end.duration_s.toFixed(1)} s`);
    return parts.join(", ");
  }
}
