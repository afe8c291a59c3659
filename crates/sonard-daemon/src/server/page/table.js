// Table of readings, filled only while it is open.

import { make } from "./dom.js";
import { MARKS } from "./verdicts.js";
import { distanceFigure, setText, unitName } from "./format.js";

const TITLE = "Table of beams";
const columns = () => ["Beam", "Azimuth (°)", `Range (${unitName()})`, `Predicted (${unitName()})`, "Residual (mm)", "Verdict"];
/** Maximum number of rows, to keep the page responsive. */
const MAX_ROWS = 4000;
const cell = (figure, digits) => (figure === null || figure === undefined ? "–" : figure.toFixed(digits));

export class BeamTable {
  constructor(details) {
    this.details = details;
    this.body = make("tbody");
    this.heads = columns().map((textContent) => make("th", { scope: "col", textContent }));
    const head = make("tr", {}, ...this.heads);
    const scroll = make("div", { className: "scroll", role: "region", ariaLabel: TITLE, tabIndex: 0 });
    scroll.append(make("table", {}, make("thead", {}, head), this.body));
    this.more = make("p", { className: "hint" });
    details.append(make("summary", { textContent: TITLE }), scroll, this.more);
    this.rows = new Map();
    this.scan = null;
    details.addEventListener("toggle", () => this.redraw());
  }

  redraw() {
    columns().forEach((text, i) => setText(this.heads[i], text));
    this.rows.clear();
    this.body.replaceChildren();
    if (this.scan) this.addReadings([...this.scan.beams.values()]);
  }

  addReadings(pings) {
    if (!this.details.open) return;
    const fresh = document.createDocumentFragment();
    for (const ping of pings) {
      if (this.rows.size >= MAX_ROWS && !this.rows.has(ping.index)) continue;
      const row = makeRow(ping);
      const previous = this.rows.get(ping.index);
      if (previous) previous.replaceWith(row);
      else fresh.append(row);
      this.rows.set(ping.index, row);
    }
    this.body.append(fresh);
    const left = this.scan.beams.size - this.rows.size;
    setText(this.more, left > 0 ? `${left.toLocaleString("en")} more rows: download the scan` : "");
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
    cell(ping.azimuth_deg, 1), distanceFigure(ping.range_m), distanceFigure(ping.sim?.range_m), cell(residual_mm, 1), MARKS[ping.mark].label,
  ]) {
    row.appendChild(document.createElement("td")).textContent = text;
  }
  return row;
}
