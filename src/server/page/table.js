// The readings as a table, made only while somebody looks at it.

import { MARKS } from "./verdicts.js";

const cell = (figure, digits) => (figure === null || figure === undefined ? "–" : figure.toFixed(digits));

export class BeamTable {
  constructor(details) {
    this.details = details;
    this.body = details.querySelector("tbody");
    this.rows = new Map();
    this.scan = null;
    details.addEventListener("toggle", () => this.redraw());
  }

  redraw() {
    this.rows.clear();
    this.body.replaceChildren();
    if (this.scan) this.addReadings([...this.scan.beams.values()]);
  }

  addReadings(pings) {
    if (!this.details.open) return;
    const fresh = document.createDocumentFragment();
    for (const ping of pings) {
      const row = makeRow(ping);
      const before = this.rows.get(ping.index);
      if (before) before.replaceWith(row);
      else fresh.append(row);
      this.rows.set(ping.index, row);
    }
    this.body.append(fresh);
  }

  select(ping) {
    this.body.querySelector("[aria-current]")?.removeAttribute("aria-current");
    this.rows.get(ping?.index)?.setAttribute("aria-current", "true");
  }
}

function makeRow(ping) {
  const row = document.createElement("tr");
  const head = row.appendChild(document.createElement("th"));
  head.scope = "row";
  head.textContent = ping.index;
  const residual_mm = ping.residual_m === null ? null : 1e3 * ping.residual_m;
  for (const text of [
    cell(ping.azimuth_deg, 1), cell(ping.range_m, 4), cell(ping.sim?.range_m, 4), cell(residual_mm, 1), MARKS[ping.mark].words,
  ]) {
    row.appendChild(document.createElement("td")).textContent = text;
  }
  return row;
}
