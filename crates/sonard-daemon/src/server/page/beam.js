// The panel of the selected beam: its reading at once, its echoes and the model's paths when they
// have been told.

import { MARKS } from "./verdicts.js";
import * as words from "./words.js";

// Somebody who holds an arrow key down passes over beams.
const PAUSE_MS = 120;
// A beam that is read anew all the time is asked about only so often: the model takes its time.
const ANEW_MS = 2000;

export class BeamPanel {
  /**
   * Calls `onPath(points)` when the path of some sound is to be drawn. `askAbout(ping, signal)` gets the
   * details of a reading; without it whoever has them calls `showDetails`.
   */
  constructor(panel, onPath, askAbout = null) {
    this.panel = panel;
    this.onPath = onPath;
    this.askAbout = askAbout;
    this.request = new AbortController();
    this.facts = document.createElement("div");
    this.details = document.createElement("div");
    this.ping = null;
    this.asking = false;
    this.asked = 0;
  }

  clear() {
    this.request.abort();
    [this.ping, this.asking] = [null, false];
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = "Click a beam on the plan or the residuals, or move the slider with the arrow keys.";
    this.panel.replaceChildren(hint);
  }

  /** Shows a reading; details of the same beam's reading of before stay until those of this one are known. */
  show(ping) {
    const anew = ping.index === this.ping?.index;
    this.ping = ping;
    this.facts.replaceChildren(...reading(ping));
    if (!anew) this.details.replaceChildren();
    this.panel.replaceChildren(this.facts, this.details);
    if (this.askAbout && (!anew || !this.asking)) this.learn(anew ? this.asked + ANEW_MS - performance.now() : 0);
  }

  /** Asks the daemon about the reading, after a pause, and about the one that has come meanwhile. */
  async learn(pause_ms) {
    this.request.abort();
    this.request = new AbortController();
    const { signal } = this.request;
    this.asking = true;
    await new Promise((done) => setTimeout(done, Math.max(PAUSE_MS, pause_ms)));
    if (signal.aborted) return;
    this.asked = performance.now();
    const { scan } = this.ping;
    try {
      const beam = await this.askAbout(this.ping, signal);
      this.onPath(beam.polyline);
      this.showDetails(beam);
    } catch (/** @type {any} */ error) {
      if (!signal.aborted) this.details.replaceChildren(note(`The daemon did not tell more: ${error.message}`));
    }
    if (signal.aborted) return;
    this.asking = false;
    if (this.ping.scan !== scan) this.learn(ANEW_MS);
  }

  /** Echoes and paths; of readings of the model alone, which have no echoes, paths. */
  showDetails(beam) {
    const heard = beam.echoes ? echoes(beam) : [];
    this.details.replaceChildren(...heard, ...this.peaks(beam));
  }

  /** What the model hears; each sound draws its path. */
  peaks(beam) {
    if (beam.lacks) return [note(`No paths: ${beam.lacks}.`)];
    const list = document.createElement("ul");
    list.className = "peaks";
    const peaks = beam.peaks ?? [];
    const drawn = drawnOf(peaks, beam);
    for (const peak of peaks) list.append(this.peak(peak, peak === drawn, list));
    if (!list.children.length) return [heading("What the model hears"), note("nothing that comes near the threshold")];
    return [heading("What the model hears: range, over the threshold, path"), list];
  }

  peak(peak, drawn, list) {
    const item = document.createElement("li");
    const button = item.appendChild(document.createElement("button"));
    button.type = "button";
    button.ariaPressed = String(drawn);
    const texts = [words.metres(peak.range_m), words.decibels(peak.margin_db), words.path(peak.path)];
    for (const text of texts) button.appendChild(document.createElement("span")).textContent = text;
    button.addEventListener("click", () => {
      for (const other of list.querySelectorAll("button")) other.ariaPressed = String(other === button);
      this.onPath(peak.polyline);
    });
    return item;
  }
}

/** Which of the model's sounds the path of a beam's reading is: as many points, each within a millimetre;
 * of several, the one that meets the same in the same order. */
function drawnOf(peaks, { polyline, reading }) {
  const near = (points) => points.every(([x, y], i) => Math.hypot(x - polyline[i][0], y - polyline[i][1]) < 1e-3);
  const same = peaks.filter((peak) => peak.polyline.length === polyline?.length && near(peak.polyline));
  const named = words.path(reading.path ?? reading.sim?.path);
  return same.find((peak) => words.path(peak.path) === named) ?? same[0];
}

/** A reading in one line, as the slider says it. */
export function inWords(ping) {
  const parts = [`beam ${ping.index}${ranger(ping)}, azimuth ${words.degrees(ping.azimuth_deg)}`, MARKS[ping.mark].words];
  if (ping.range_m !== null) parts.push(words.metres(ping.range_m));
  if (ping.sim?.range_m != null) parts.push(`model ${words.metres(ping.sim.range_m)}`);
  return parts.join(", ");
}

const ranger = (ping) => (ping.ranger ? `, ${ping.ranger}` : "");

function place(viewpoint) {
  if (!viewpoint) return "its scan does not say where";
  const { x_m, y_m, direction_deg } = viewpoint;
  return `${x_m.toFixed(3)}, ${y_m.toFixed(3)} m, looking to ${words.degrees(direction_deg)}`;
}

function reading(ping) {
  const title = document.createElement("p");
  title.className = "reading";
  const about = document.createElement("small");
  about.textContent = ` ${MARKS[ping.mark].words}`;
  title.append(ping.range_m === null ? "no range" : words.metres(ping.range_m), about);
  const list = document.createElement("dl");
  list.className = "facts";
  const facts = [
    ["Beam", `${ping.index}${ranger(ping)} at ${words.degrees(ping.azimuth_deg)}`],
    ["Taken from", place(ping.viewpoint)],
    ["Time of flight", ping.tof_us === null ? "–" : `${ping.tof_us.toFixed(1)} µs`],
  ];
  if (ping.sim) {
    facts.push(
      ["Model", ping.sim.range_m === null ? ping.sim.status.replace("_", " ") : words.metres(ping.sim.range_m)],
      ["Residual", words.millimetres(ping.residual_m)],
      ["Over the threshold", ping.sim.margin_db === null ? "–" : words.decibels(ping.sim.margin_db)],
      ["Path", words.path(ping.sim.path)],
    );
  } else if (ping.path) {
    facts.push(["Over the threshold", words.decibels(ping.margin_db)], ["Path", words.path(ping.path)]);
  }
  const crosstalk = ping.crosstalk ?? ping.sim?.crosstalk;
  if (crosstalk) facts.push(["Crosstalk", words.crosstalk(crosstalk)]);
  if (ping.repaired) facts.push(["Line", "fetched again after the line lost it"]);
  words.facts(list, facts);
  return [title, list];
}

function echoes({ echoes }) {
  if (!echoes.length) return [heading("Echoes heard"), note("none")];
  const list = document.createElement("ol");
  list.className = "echoes";
  for (const [i, echo] of echoes.entries()) {
    const time = echo.tof_us === null ? "" : `, ${echo.tof_us.toFixed(1)} µs`;
    list.appendChild(document.createElement("li")).textContent =
      `${i + 1}. ${words.metres(echo.range_m)}${time} (${echo.ticks} ticks)`;
  }
  return [heading("Echoes heard"), list];
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
