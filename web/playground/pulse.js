// Slow motion of one firing: wave fronts along the predicted paths, and a cursor in the echo trace, at the same time.

import { outcomesOf } from "../../crates/sonard-daemon/src/server/page/arrivals.js";
import { distance, setText } from "../../crates/sonard-daemon/src/server/page/format.js";

/**
 * @import { Beam, Peak } from "./engine.js"
 * @import { EchoTrace } from "../../crates/sonard-daemon/src/server/page/trace.js"
 */

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));
/** Length of the transmitted pulse, microseconds, drawn as a thick part of the path. */
const PULSE_US = 320;
/** Half of a wave front's length, pixels, and its maximum angle at the source, radians. */
const FRONT_PX = 26, MAX_FRONT_RAD = 0.5;
/** Time for which an outcome at the receiver is shown, microseconds. */
const ARRIVED_US = 400;
const STEPS = 1000;

export class Pulse {
  /**
   * @param {any} plan
   * @param {EchoTrace} trace
   * @param {() => void} onStart called before the pulse is shown
   */
  constructor(plan, trace, onStart) {
    this.plan = plan;
    this.trace = trace;
    this.onStart = onStart;
    this.layer = plan.addLayer("fronts");
    /** @type {Beam | null} */
    this.beam = null;
    /** @type {Map<Peak, string>} */
    this.outcomes = new Map();
    /** Time after firing, microseconds; `null` unless the pulse is shown. @type {number | null} */
    this.at_us = null;
    /** Time of the last frame while playing, milliseconds. @type {number | null} */
    this.frame_ms = null;
    byId("pulse-play").addEventListener("click", () => (this.frame_ms === null ? this.play() : this.pause()));
    byId("pulse-time").addEventListener("input", () => {
      this.pause();
      this.goTo((Number(byId("pulse-time").value) / STEPS) * this.end_us);
    });
    byId("pulse-hide").addEventListener("click", () => this.hide());
  }

  /** @param {Beam | null} beam */
  show(beam) {
    this.beam = beam?.trace?.envelope.length ? beam : null;
    this.outcomes = this.beam ? outcomesOf(this.beam) : new Map();
    for (const id of ["pulse-play", "pulse-time"]) byId(id).disabled = !this.beam;
    if (!this.beam) this.hide();
    else if (this.at_us !== null) this.goTo(Math.min(this.at_us, this.end_us));
  }

  get end_us() {
    const trace = this.beam?.trace;
    return trace ? (trace.envelope.length - 1) * trace.step_us : 0;
  }

  play() {
    if (!this.beam) return;
    if (this.at_us === null || this.at_us >= this.end_us) this.goTo(0);
    this.frame_ms = performance.now();
    this.label();
    requestAnimationFrame((now) => this.frame(now));
  }

  pause() {
    this.frame_ms = null;
    this.label();
  }

  hide() {
    this.pause();
    [this.at_us, this.trace.cursor_us] = [null, null];
    byId("pulse-time").value = 0;
    byId("pulse-hide").disabled = true;
    setText(byId("pulse-text"), "");
    this.plan.hasTips = true;
    this.trace.redraw();
    this.redraw();
  }

  /** Draws the fronts, and the legend if other pens are used. */
  redraw() {
    const before = [...this.layer.used].join();
    this.draw();
    if ([...this.layer.used].join() !== before) this.plan.onView();
  }

  label() {
    setText(byId("pulse-play"), this.frame_ms === null ? "Play pulse" : "Pause");
  }

  /** @param {number} now milliseconds */
  frame(now) {
    if (this.frame_ms === null) return;
    // The speed is the number of seconds that a millisecond of flight takes.
    const per_ms = Number(byId("pulse-speed").value);
    const at_us = (this.at_us ?? 0) + Math.max(0, now - this.frame_ms) / per_ms;
    this.frame_ms = now;
    this.goTo(Math.min(at_us, this.end_us));
    if (at_us >= this.end_us) return this.pause();
    requestAnimationFrame((next) => this.frame(next));
  }

  /** @param {number} at_us */
  goTo(at_us) {
    if (this.at_us === null) this.onStart();
    [this.at_us, this.trace.cursor_us, this.plan.hasTips] = [at_us, at_us, false];
    this.plan.tip.hide();
    byId("pulse-time").value = this.end_us ? Math.round((STEPS * at_us) / this.end_us) : 0;
    byId("pulse-hide").disabled = false;
    const text = this.text(at_us);
    setText(byId("pulse-text"), text);
    byId("pulse-time").setAttribute("aria-valuetext", text);
    this.trace.redraw();
    this.redraw();
  }

  /** Time, distance of the front, and state of the receiver. @param {number} at_us */
  text(at_us) {
    const { trace, peaks } = /** @type {Beam} */ (this.beam);
    const travelled = distance(2 * at_us * trace.m_per_us);
    const arrived = peaks.filter(({ tof_us }) => at_us >= tof_us && at_us < tof_us + ARRIVED_US);
    const news = arrived.map((peak) => `echo by ${peak.path.interactions.map(({ id }) => id).join(", ")}: ${this.outcomes.get(peak) ?? ""}`);
    return [`${(at_us / 1000).toFixed(2)} ms, path ${travelled}`, this.receiver(at_us), ...news].join("; ");
  }

  /** @param {number} at_us */
  receiver(at_us) {
    const { blanking_us, envelope, threshold, step_us } = /** @type {Beam} */ (this.beam).trace;
    if (at_us < blanking_us) return "receiver blanked";
    const i = Math.min(envelope.length - 1, Math.round(at_us / step_us));
    return envelope[i] > threshold[i] ? "signal above threshold" : "signal below threshold";
  }

  /** Draws the wave front of each arrival that is on its way. */
  draw() {
    const { layer, plan, beam, at_us } = this;
    if (!plan.view.width) return;
    layer.clear(plan.view);
    if (at_us === null || !beam || !plan.palette) return;
    const travelled_m = 2 * at_us * beam.trace.m_per_us;
    const body_m = 2 * PULSE_US * beam.trace.m_per_us;
    for (const peak of beam.peaks) {
      if (travelled_m - body_m < peak.path.length_m) this.drawFront(peak, travelled_m, body_m);
    }
  }

  /** @param {Peak} peak @param {number} travelled_m @param {number} body_m */
  drawFront(peak, travelled_m, body_m) {
    const { layer, plan } = this;
    const isDetected = (this.outcomes.get(peak) ?? "").includes("echo");
    const c = layer.pen(isDetected ? "front" : "faint", plan.palette);
    const [from_m, to_m] = [Math.max(0, travelled_m - body_m), Math.min(travelled_m, peak.path.length_m)];
    const points = partOf(peak.polyline, from_m, to_m);
    if (points.length < 2) return;
    const px = points.map((point) => plan.view.px(point));
    const width = c.lineWidth;
    [c.globalAlpha, c.lineWidth] = [0.3, 7];
    c.beginPath();
    for (const [x, y] of px) c.lineTo(x, y);
    c.stroke();
    [c.globalAlpha, c.lineWidth] = [1, width];
    if (travelled_m > peak.path.length_m) return;
    // A reflected front is a circle around the mirror image of the source.
    const [[x0, y0], [x, y]] = px.slice(-2);
    const [turn, radius] = [Math.atan2(y - y0, x - x0), travelled_m * plan.view.scale];
    if (radius < 1) return;
    const half = Math.min(MAX_FRONT_RAD, FRONT_PX / radius);
    c.beginPath();
    c.arc(x - radius * Math.cos(turn), y - radius * Math.sin(turn), radius, turn - half, turn + half);
    c.stroke();
  }
}

/**
 * Part of a line between two lengths along it, metres.
 * @param {[number, number][]} polyline
 * @param {number} from_m
 * @param {number} to_m
 * @returns {[number, number][]}
 */
function partOf(polyline, from_m, to_m) {
  /** @type {[number, number][]} */
  const part = [];
  let done_m = 0;
  for (let i = 1; i < polyline.length; i++) {
    const [[x0, y0], [x1, y1]] = [polyline[i - 1], polyline[i]];
    const length_m = Math.hypot(x1 - x0, y1 - y0);
    const at = (/** @type {number} */ m) => /** @type {[number, number]} */ ([x0 + ((m - done_m) / length_m) * (x1 - x0), y0 + ((m - done_m) / length_m) * (y1 - y0)]);
    if (length_m > 0 && from_m < done_m + length_m && to_m > done_m) {
      if (!part.length) part.push(at(Math.max(from_m, done_m)));
      part.push(at(Math.min(to_m, done_m + length_m)));
    }
    done_m += length_m;
  }
  return part;
}
