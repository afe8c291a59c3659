// Links to a scan and a beam: the fragment `#scan=ID&beam=N` of the page's address.

/** Delay of an update, because browsers limit their number. */
const WRITE_DELAY_MS = 300;
let timer = 0;

/** Scan and beam of the address; `null` where it has none. @returns {{scan: string | null, beam: number | null}} */
export function readLink() {
  const parameters = new URLSearchParams(location.hash.slice(1));
  const beam = Number.parseInt(parameters.get("beam") ?? "", 10);
  return { scan: parameters.get("scan"), beam: beam >= 0 ? beam : null };
}

/** Puts scan and beam into the address without a new entry of the browser's history. @param {string | null} scan @param {number | null} beam */
export function writeLink(scan, beam) {
  clearTimeout(timer);
  timer = setTimeout(() => {
    const parameters = new URLSearchParams();
    if (scan) parameters.set("scan", scan);
    if (beam !== null) parameters.set("beam", String(beam));
    const hash = String(parameters);
    if (location.hash.slice(1) !== hash) history.replaceState(null, "", hash ? `#${hash}` : location.pathname);
  }, WRITE_DELAY_MS);
}
