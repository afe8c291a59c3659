// Panel of the selected beam: the reading, then its measured echoes and predicted arrivals once they are loaded.

import { outcomesOf } from "./arrivals.js";
import { MARKS } from "./verdicts.js";
import * as format from "./format.js";

/** Delay before details are requested, so that a held arrow key does not request every beam it passes. */
const REQUEST_DELAY_MS = 120;
/** Minimum interval between requests for the same beam, which the model computes each time. */
const REFRESH_INTERVAL_MS = 2000;

export class BeamPanel {
  /**
   * `onPath(points)` is called with the propagation path to draw. `fetchDetails(ping, signal)` loads the details
   * of a reading; without it the owner calls `showDetails`.
   */
  constructor(panel, onPath, fetchDetails = null) {
    this.panel = panel;
    this.onPath = onPath;
    this.fetchDetails = fetchDetails;
    this.request = new AbortController();
    this.facts = document.createElement("div");
    this.details = document.createElement("div");
    this.ping = null;
    this.loading = false;
    this.requestedAt = 0;
  }

  clear() {
    this.request.abort();
    [this.ping, this.loading] = [null, false];
    this.panel.replaceChildren(note("Click a beam on the plan or the residuals, or move the slider with the arrow keys."));
  }

  /** Shows a reading. Details of the beam's previous reading stay until the new ones are loaded. */
  show(ping) {
    const sameBeam = ping.index === this.ping?.index;
    this.ping = ping;
    this.facts.replaceChildren(...reading(ping));
    // The height stays until the details are loaded, so that what is below does not jump.
    this.panel.style.minHeight = `${this.panel.getBoundingClientRect().height}px`;
    if (!sameBeam) this.details.replaceChildren();
    this.panel.replaceChildren(this.facts, this.details);
    if (this.fetchDetails && (!sameBeam || !this.loading)) {
      this.load(sameBeam ? this.requestedAt + REFRESH_INTERVAL_MS - performance.now() : 0);
    }
  }

  /** Loads the details of the current reading after a delay, and again if another reading arrives meanwhile. */
  async load(delay_ms) {
    this.request.abort();
    this.request = new AbortController();
    const { signal } = this.request;
    this.loading = true;
    await new Promise((done) => setTimeout(done, Math.max(REQUEST_DELAY_MS, delay_ms)));
    if (signal.aborted) return;
    this.requestedAt = performance.now();
    const { scan } = this.ping;
    try {
      const beam = await this.fetchDetails(this.ping, signal);
      this.onPath(beam.polyline);
      this.showDetails(beam);
    } catch (/** @type {any} */ error) {
      if (!signal.aborted) this.details.replaceChildren(note(format.failure("No details", error)));
    }
    if (signal.aborted) return;
    this.loading = false;
    if (this.ping.scan !== scan) this.load(REFRESH_INTERVAL_MS);
  }

  /** Shows measured echoes and predicted arrivals; a simulated reading has no echo list. */
  showDetails(beam) {
    this.details.replaceChildren(...(beam.echoes ? echoes(beam) : []), ...this.arrivals(beam));
    this.panel.style.minHeight = "";
  }

  /** Predicted arrivals; a click on one draws its propagation path. */
  arrivals(beam) {
    if (beam.unavailable_reason) return [note(`No paths: ${beam.unavailable_reason}.`)];
    const list = document.createElement("ul");
    list.className = "peaks";
    const peaks = beam.peaks ?? [];
    const outcomes = outcomesOf(beam);
    const drawn = peakOfReading(peaks, beam);
    for (const peak of peaks) list.append(this.arrival(peak, outcomes.get(peak) ?? "", peak === drawn, list));
    if (!list.children.length) return [heading("Predicted arrivals"), note("no arrival near the threshold")];
    return [heading("Predicted arrivals: half the path length, level above threshold, outcome, path"), list];
  }

  arrival(peak, outcome, drawn, list) {
    const item = document.createElement("li");
    const button = item.appendChild(document.createElement("button"));
    button.type = "button";
    button.ariaPressed = String(drawn);
    const texts = [format.distance(peak.range_m), format.decibels(peak.margin_db), outcome, format.interactions(peak.path)];
    for (const text of texts) button.appendChild(document.createElement("span")).textContent = text;
    button.addEventListener("click", () => {
      for (const sibling of list.querySelectorAll("button")) sibling.ariaPressed = String(sibling === button);
      this.onPath(peak.polyline);
    });
    return item;
  }
}

/** Arrival whose path is the reading's: as many vertices, each within a millimetre. If several match, the one
 * with the same interactions in the same order is returned. */
function peakOfReading(peaks, { polyline, reading }) {
  const isNear = (points) => points.every(([x, y], i) => Math.hypot(x - polyline[i][0], y - polyline[i][1]) < 1e-3);
  const matches = peaks.filter((peak) => peak.polyline.length === polyline?.length && isNear(peak.polyline));
  const label = format.pathLabel(reading.path ?? reading.sim?.path);
  return matches.find((peak) => format.pathLabel(peak.path) === label) ?? matches[0];
}

/** One-line description of a reading, as shown next to the slider and read out by screen readers. */
export function describeReading(ping) {
  const parts = [`beam ${ping.index}${ranger(ping)}, azimuth ${format.degrees(ping.azimuth_deg)}`, MARKS[ping.mark].label];
  if (ping.range_m !== null) parts.push(format.distance(ping.range_m));
  if (ping.sim?.range_m != null) parts.push(`predicted ${format.distance(ping.sim.range_m)}`);
  return parts.join(", ");
}

const ranger = (ping) => (ping.ranger ? `, ${ping.ranger}` : "");

function viewpointFacts(viewpoint) {
  if (!viewpoint) return [["Position", "unknown (not in the log)"]];
  const { x_m, y_m, direction_deg } = viewpoint;
  return [["Position", `(${x_m.toFixed(3)}, ${y_m.toFixed(3)}) m`], ["Beam direction", format.degrees(direction_deg)]];
}

function reading(ping) {
  const title = document.createElement("p");
  title.className = "reading";
  const about = document.createElement("small");
  about.textContent = ` ${MARKS[ping.mark].label}`;
  title.append(ping.range_m === null ? "no range" : format.distance(ping.range_m), about);
  const list = document.createElement("dl");
  list.className = "facts";
  const facts = [
    ["Beam", `${ping.index}${ranger(ping)} at ${format.degrees(ping.azimuth_deg)}`],
    ...viewpointFacts(ping.viewpoint),
    ["Time of flight", ping.tof_us === null ? "–" : `${ping.tof_us.toFixed(1)} µs`],
  ];
  if (ping.sim) {
    facts.push(
      ["Predicted range", ping.sim.range_m === null ? ping.sim.status.replace("_", " ") : format.distance(ping.sim.range_m)],
      ["Residual", format.millimetres(ping.residual_m)],
      ["Level above threshold", ping.sim.margin_db === null ? "–" : format.decibels(ping.sim.margin_db)],
      ...pathFacts(ping.sim.path),
    );
  } else if (ping.path) {
    facts.push(["Level above threshold", format.decibels(ping.margin_db)], ...pathFacts(ping.path));
  }
  const crosstalk = ping.crosstalk ?? ping.sim?.crosstalk;
  if (crosstalk) facts.push(["Crosstalk", format.crosstalkLabel(crosstalk)]);
  if (ping.repaired) facts.push(["Serial link", "reading re-requested after a line error"]);
  format.showFacts(list, facts);
  return [title, list];
}

/** Path and half its length, which is less than the range: an echo is detected after its start. */
const pathFacts = (path) => [
  ["Half the path length", format.distance(path ? path.length_m / 2 : null)],
  ["Path", format.pathLabel(path)],
];

function echoes({ echoes }) {
  if (!echoes.length) return [heading("Measured echoes"), note("none")];
  const list = document.createElement("ol");
  list.className = "echoes";
  for (const [i, echo] of echoes.entries()) {
    const time = echo.tof_us === null ? "" : `, ${echo.tof_us.toFixed(1)} µs`;
    list.appendChild(document.createElement("li")).textContent =
      `${i + 1}. ${format.distance(echo.range_m)}${time} (${echo.ticks} ticks)`;
  }
  return [heading("Measured echoes"), list];
}

function heading(text) {
  const element = document.createElement("h3");
  element.textContent = text;
  return element;
}

function note(text) {
  const element = document.createElement("p");
  element.className = "hint";
  element.textContent = text;
  return element;
}
