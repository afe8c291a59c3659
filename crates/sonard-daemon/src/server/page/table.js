// The readings as a table, made only while somebody looks at it.

import { make } from "./dom.js";
import { MARKS } from "./verdicts.js";
import { setText } from "./words.js";

const WORDS = "Table of beams";
const COLUMNS = ["Beam", "Azimuth °", "Range m", "Model m", "Residual mm", "Verdict"];
/** More rows than this nobody reads, and no browser likes. */
const MOST_ROWS = 4000;
const cell = (figure, digits) => (figure === null || figure === undefined ? "–" : figure.toFixed(digits));

export class BeamTable {
  constructor(details) {
    this.details = details;
    this.body = make("tbody");
    const head = make("tr", {}, ...COLUMNS.map((textContent) => make("th", { scope: "col", textContent })));
    const scroll = make("div", { className: "scroll", role: "region", ariaLabel: WORDS, tabIndex: 0 });
    scroll.append(make("table", {}, make("thead", {}, head), this.body));
    this.more = make("p", { className: "hint" });
    details.append(make("summary", { textContent: WORDS }), scroll, this.more);
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
      if (this.rows.size >= MOST_ROWS && !this.rows.has(ping.index)) continue;
      const row = makeRow(ping);
      const before = this.rows.get(ping.index);
      if (before) before.replaceWith(row);
      else fresh.append(row);
      this.rows.set(ping.index, row);
    }
    this.body.append(fresh);
    const left = this.scan.beams.size - this.rows.size;
    setText(this.more, left > 0 ? `${left} more are in the scan's file.` : "");
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
