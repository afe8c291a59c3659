// Downloads: the scan (JSON, CSV), its log (JSON Lines), a beam over time (CSV), and the floor plan (PNG, SVG).

import { requestFile } from "./api.js";
import { renderPng, renderSvg } from "./picture.js";
import { clock, count, failure, provenanceLabel } from "./format.js";

/**
 * @param {HTMLElement} place with a button for each kind
 * @param {any} plan
 * @param {{scan: () => any, log: (scan: string) => string | undefined, beam: () => Promise<string | null>, announce: (text: string) => void}} callbacks
 */
export function addDownloads(place, plan, { scan, log, beam, announce }) {
  const kinds = {
    scan: async ({ id }) => [await requestFile(`/v1/scans/${id}`), "json"],
    csv: async (shown) => [csvFile(scanCsv(shown)), "csv"],
    beam: async () => {
      const text = await beam();
      if (text === null) throw new Error("no beam is selected");
      return [csvFile(text), "csv"];
    },
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
      const name = kind === "log" ? log(shown.id) : `${kind === "beam" ? "beam-over-time" : stem(shown)}.${extension}`;
      save(blob, name);
      announce(`${name}: ${size(blob.size)}.`);
    } catch (/** @type {any} */ error) {
      announce(failure("Download failed", error));
    }
  });
}

const csvFile = (/** @type {string} */ text) => new Blob([text], { type: "text/csv" });

/** Readings as CSV; empty where a value is missing. */
function scanCsv({ beams }) {
  const head = "beam,ranger,azimuth_deg,status,range_m,tof_us,predicted_m,residual_m,verdict,x_m,y_m,direction_deg";
  const lines = [...beams.values()].sort((a, b) => a.index - b.index).map((ping) => {
    const { x_m, y_m, direction_deg } = ping.viewpoint ?? {};
    const { index, ranger, azimuth_deg, status, range_m, tof_us, sim, residual_m, verdict } = ping;
    return [index, ranger, azimuth_deg, status, range_m, tof_us, sim?.range_m, residual_m, verdict, x_m, y_m, direction_deg].join();
  });
  return `${head}\n${lines.join("\n")}\n`;
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

/** Saves a file by the browser. @param {Blob} blob @param {string} name */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const size = (bytes) => (bytes < 1e6 ? `${Math.ceil(bytes / 1000)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
