// Downloads: the scan (JSON), its log (JSON Lines), and the floor plan (PNG, SVG).

import { requestFile } from "./api.js";
import { renderPng, renderSvg } from "./picture.js";
import { clock, count, failure, provenanceLabel } from "./format.js";

/**
 * @param {HTMLElement} place with a button for each kind
 * @param {any} plan
 * @param {{scan: () => any, log: (scan: string) => string | undefined, announce: (text: string) => void}} callbacks
 */
export function addDownloads(place, plan, { scan, log, announce }) {
  const kinds = {
    scan: async ({ id }) => [await requestFile(`/v1/scans/${id}`), "json"],
    log: async ({ id }) => [await requestFile(`/v1/logs/${log(id)}`), "jsonl"],
    png: async (shown) => [await renderPng(plan, captionOf(plan, shown)), "png"],
    svg: async (shown) => [renderSvg(plan, captionOf(plan, shown)), "svg"],
  };
  place.addEventListener("click", async (event) => {
    const button = /** @type {any} */ (event.target).closest("button");
    const [kind, shown] = [button?.dataset.kind, scan()];
    if (!kind) return;
    if (!shown) return announce("There is no scan yet.");
    try {
      const [blob, extension] = await kinds[kind](shown);
      const name = kind === "log" ? log(shown.id) : `${stem(shown)}.${extension}`;
      save(blob, name);
      announce(`${name}: ${size(blob.size)}.`);
    } catch (/** @type {any} */ error) {
      announce(failure("Download failed", error));
    }
  });
}

/** File name that sorts by time. */
const stem = ({ start, id }) => `scan-${start.time.slice(0, 19).replace(/[-:]/g, "")}-${id.slice(0, 8)}`;

function captionOf(plan, shown) {
  const { session, start, beams, counts } = shown;
  const { x_m, y_m, heading_deg } = start.pose;
  const title = session?.scene?.name ?? plan.scene?.name ?? "no scene";
  const about = `${clock(start.time)}, ${count(beams.size, "beam")}, position (${x_m.toFixed(3)}, ${y_m.toFixed(3)}) m, heading ${heading_deg}°`;
  return { title, about, badge: provenanceLabel(session?.provenance), counts };
}

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const size = (bytes) => (bytes < 1e6 ? `${Math.ceil(bytes / 1000)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
