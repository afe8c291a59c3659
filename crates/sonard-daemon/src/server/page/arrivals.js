// Outcome of each predicted arrival at the receiver.

/** @import { Beam, Peak } from "../../../../../web/playground/engine.js" */

/** Longest time from the start of an echo to its crossing of the threshold, microseconds. */
const MAX_RISE_US = 700;
/** Maximum difference of a measured echo from the crossing that it belongs to, metres. */
const MAX_DIFFERENCE_M = 0.04;

/**
 * Times at which the predicted envelope exceeds the threshold after the blanking, microseconds.
 * @param {Beam["trace"]} trace
 * @returns {{from_us: number, to_us: number}[]}
 */
function crossings({ envelope, threshold, step_us, blanking_us }) {
  /** @type {{from_us: number, to_us: number}[]} */
  const found = [];
  envelope.forEach((level, i) => {
    const at_us = i * step_us;
    if (at_us < blanking_us || !(level > threshold[i])) return;
    const last = found.at(-1);
    if (last && at_us - last.to_us <= 1.5 * step_us) last.to_us = at_us;
    else found.push({ from_us: at_us, to_us: at_us });
  });
  return found;
}

/**
 * Outcome of each arrival: blanked, below the threshold, detected as the start of an echo, or merged into the echo before.
 * Echoes are numbered as measured; those of a simulation in their order.
 * @param {Beam} beam
 * @returns {Map<Peak, string>}
 */
export function outcomesOf({ trace, peaks, echoes }) {
  const outcomes = new Map();
  if (!trace || !peaks) return outcomes;
  const spans = crossings(trace);
  const numberOf = (/** @type {number} */ span) => {
    if (!echoes) return `echo ${span + 1}`;
    const at_m = spans[span].from_us * trace.m_per_us;
    const difference_m = (/** @type {{range_m: number | null}} */ echo) => (echo.range_m === null ? Infinity : Math.abs(echo.range_m - at_m));
    const nearest = echoes.reduce((best, echo, i) => (difference_m(echo) < difference_m(echoes[best]) ? i : best), 0);
    return echoes.length && difference_m(echoes[nearest]) < MAX_DIFFERENCE_M ? `echo ${nearest + 1}` : null;
  };
  const claimed = new Set();
  for (const peak of peaks) {
    const span = spans.findIndex(({ from_us, to_us }) => to_us >= peak.tof_us && from_us <= peak.tof_us + MAX_RISE_US);
    if (peak.tof_us < trace.blanking_us) outcomes.set(peak, "blanked");
    else if (peak.margin_db < 0 || span < 0) outcomes.set(peak, "below threshold");
    else {
      const isFirst = !claimed.has(span) && spans[span].from_us >= peak.tof_us - trace.step_us;
      claimed.add(span);
      const number = numberOf(span);
      if (!number) outcomes.set(peak, "expected, not measured");
      else outcomes.set(peak, isFirst ? `detected as ${number}` : `merged into ${number}`);
    }
  }
  return outcomes;
}
