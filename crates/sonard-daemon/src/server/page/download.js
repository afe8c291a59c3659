// Scan, log and picture as files.

import { askFile } from "./api.js";
import { pngOf, svgOf } from "./picture.js";
import { clock, count, provenance } from "./words.js";

/**
 * @param {HTMLElement} place with a button for each kind
 * @param {any} plan
 * @param {{scan: () => any, log: (scan: string) => string | undefined, say: (text: string) => void}} uses
 */
export function downloads(place, plan, { scan, log, say }) {
  const kinds = {
    scan: async ({ id }) => [await askFile(`/v1/scans/${id}`), "json"],
    log: async ({ id }) => [await askFile(`/v1/logs/${log(id)}`), "jsonl"],
    png: async (shown) => [await pngOf(plan, wordsOf(plan, shown)), "png"],
    svg: async (shown) => [svgOf(plan, wordsOf(plan, shown)), "svg"],
  };
  place.addEventListener("click", async (event) => {
    const button = /** @type {any} */ (event.target).closest("button");
    const [kind, shown] = [button?.dataset.kind, scan()];
    if (!kind) return;
    if (!shown) return say("There is no scan yet.");
    try {
      const [blob, ending] = await kinds[kind](shown);
      const name = kind === "log" ? log(shown.id) : `${stem(shown)}.${ending}`;
      save(blob, name);
      say(`${name}: ${size(blob.size)}.`);
    } catch (/** @type {any} */ error) {
      say(`It can't be downloaded: ${error.message}. ${error.help ?? ""}`);
    }
  });
}

/** A name that sorts by time. */
const stem = ({ start, id }) => `scan-${start.time.slice(0, 19).replace(/[-:]/g, "")}-${id.slice(0, 8)}`;

function wordsOf(plan, shown) {
  const { session, start, beams, counts } = shown;
  const { x_m, y_m, heading_deg } = start.pose;
  const title = session?.scene?.name ?? plan.scene?.name ?? "no scene";
  const about = `${clock(start.time)}, ${count(beams.size, "beam")} from ${x_m.toFixed(3)}, ${y_m.toFixed(3)} m, heading ${heading_deg}°`;
  return { title, about, badge: provenance(session?.provenance), counts };
}

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const size = (bytes) => (bytes < 1e6 ? `${Math.ceil(bytes / 1000)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
