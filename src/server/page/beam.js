// The panel of the selected beam: its reading at once, its echoes and the model's paths when the
// daemon has told them.

import { ask } from "./api.js";
import { MARKS } from "./verdicts.js";
import * as words from "./words.js";

// Somebody who holds an arrow key down passes over beams.
const PAUSE_MS = 120;

export class BeamPanel {
  /** Calls `onPath(points)` when the path of some sound is to be drawn. */
  constructor(panel, onPath) {
    this.panel = panel;
    this.onPath = onPath;
    this.request = new AbortController();
  }

  clear() {
    this.request.abort();
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = "Click a beam on the plan or the residuals, or move the slider with the arrow keys.";
    this.panel.replaceChildren(hint);
  }

  async show(scan, ping) {
    this.request.abort();
    this.request = new AbortController();
    const { signal } = this.request;
    this.panel.replaceChildren(...reading(ping));
    await new Promise((done) => setTimeout(done, PAUSE_MS));
    if (signal.aborted) return;
    try {
      const beam = await ask(`/v1/scans/${scan.id}/beams/${ping.index}`, { signal });
      this.onPath(beam.polyline);
      this.panel.append(...echoes(beam), ...this.humps(beam));
    } catch (error) {
      if (!signal.aborted) this.panel.append(note(`The daemon did not tell more: ${error.message}`));
    }
  }

  /** What the model hears; each sound draws its path. */
  humps(beam) {
    if (beam.lacks) return [note(`No paths: ${beam.lacks}.`)];
    const list = document.createElement("ul");
    list.className = "humps";
    for (const hump of beam.humps ?? []) list.append(this.hump(hump, beam, list));
    if (!list.children.length) return [heading("What the model hears"), note("nothing that comes near the threshold")];
    return [heading("What the model hears: range, over the threshold, path"), list];
  }

  hump(hump, beam, list) {
    const item = document.createElement("li");
    const button = item.appendChild(document.createElement("button"));
    button.type = "button";
    const drawn = JSON.stringify(hump.polyline) === JSON.stringify(beam.polyline);
    button.ariaPressed = String(drawn);
    const texts = [words.metres(hump.range_m), words.decibels(hump.margin_db), words.path(hump.path)];
    for (const text of texts) button.appendChild(document.createElement("span")).textContent = text;
    button.addEventListener("click", () => {
      for (const other of list.querySelectorAll("button")) other.ariaPressed = String(other === button);
      this.onPath(hump.polyline);
    });
    return item;
  }
}

/** A reading in one line, as the slider says it. */
export function inWords(ping) {
  const parts = [`beam ${ping.index}, azimuth ${words.degrees(ping.azimuth_deg)}`, MARKS[ping.mark].words];
  if (ping.range_m !== null) parts.push(words.metres(ping.range_m));
  if (ping.sim?.range_m != null) parts.push(`model ${words.metres(ping.sim.range_m)}`);
  return parts.join(", ");
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
    ["Beam", `${ping.index} at ${words.degrees(ping.azimuth_deg)}`],
    ["Time of flight", ping.tof_us === null ? "–" : `${ping.tof_us.toFixed(1)} µs`],
  ];
  if (ping.sim) {
    facts.push(
      ["Model", ping.sim.range_m === null ? ping.sim.status.replace("_", " ") : words.metres(ping.sim.range_m)],
      ["Residual", words.millimetres(ping.residual_m)],
      ["Over the threshold", ping.sim.margin_db === null ? "–" : words.decibels(ping.sim.margin_db)],
      ["Path", words.path(ping.sim.path)],
    );
  }
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
