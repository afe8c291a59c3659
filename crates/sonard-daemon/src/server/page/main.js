// Puts the page together: the live scan or a past one on plan, strip, table and panel.

import { ask, follow, hurry } from "./api.js";
import { BeamPanel, inWords } from "./beam.js";
import { control } from "./control.js";
import { downloads } from "./download.js";
import { Explanations } from "./explanations.js";
import { History } from "./history.js";
import { Next } from "./next.js";
import { Overlays } from "./overlays.js";
import { Plan } from "./plan.js";
import { Scan } from "./scan.js";
import { watch } from "./status.js";
import { Strip } from "./strip.js";
import { Summary } from "./summary.js";
import { BeamTable } from "./table.js";
import { addTools } from "./tools.js";
import { EchoTrace } from "./trace.js";
import { colours, legend } from "./verdicts.js";
import { Waterfall } from "./waterfall.js";
import { clock, count, setText } from "./words.js";

const byId = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));
const slider = byId("beam");

let palette = colours();
/** The scan under way or the last one, whatever is shown. */
let live = null;
let session = null;
/** What is shown: `live`, or one of the logs. */
let shown = null;
let selected = null;
let changed = false;
/** A scan whose beginning was not heard, and which the log was asked for. */
let unheard = null;
let catching = null;
let again = false;

const words = "Floor plan with the readings of the scan; the table of beams has the same in words";
export const plan = new Plan(byId("stage"), select, words);
addTools(plan, () => (changed = true));
const strip = new Strip(byId("residuals"), select);
const table = new BeamTable(byId("table"));
/** What the daemon told last of the selected beam. */
let beam = null;
const panel = new BeamPanel(byId("beam-panel"), showPath, async ({ scan, index }, signal) => {
  beam = await ask(`/v1/scans/${scan}/beams/${index}`, { signal });
  return beam;
});
// A sound that is chosen in the trace is chosen in the list, too.
const trace = new EchoTrace(byId("trace"), (peak) => byId("beam-panel").querySelectorAll(".peaks button")[beam.peaks.indexOf(peak)]?.click());
const summary = new Summary(byId("summary"));
const history = new History(
  { list: byId("scans-list"), line: byId("scan-line"), live: byId("live"), replay: byId("replay"), speed: byId("speed") },
  (scan, trouble) => {
    show(scan ?? live);
    if (trouble) summary.say(trouble);
    else if (shown) summary.shows(shown);
  },
);
const waterfall = new Waterfall(byId("over-time"), {
  get: (id) => history.get(id),
  known: () => history.scans,
  onPick: async (id, index) => {
    await history.show(id);
    select(index);
  },
});
const say = (text) => summary.answer(text);
control(byId("control"), byId("stop"), say);
const overlays = new Overlays(byId("overlays"), plan, strip, say);
const next = new Next(byId("next"), plan, say);
const explanations = new Explanations(byId("better"), plan, {
  show: (id) => history.show(id),
  propose: (change) => next.propose(change),
});
downloads(byId("downloads"), plan, { scan: () => shown, log: (id) => history.logOf(id), say });

/** Shows a scan, or the same one anew. */
function show(scan) {
  const another = scan?.id !== shown?.id;
  shown = scan;
  for (const view of [plan, strip, table]) view.scan = scan;
  if (scan && !scan.replayed) waterfall.add(scan, [...scan.beams.values()]);
  if (scan) scan.added = [];
  plan.latest = null;
  if (another) keepSelection();
  overlays.tell();
  explanations.mark();
  redraw();
  loadScene();
}

/** The selected beam stays selected in another scan. Until that has read it, its reading of before stays. */
function keepSelection() {
  if (!selected) return;
  const ping = shown?.beams.get(selected.index);
  if (ping) choose(ping);
  else if (!shown?.underWay || selected.index >= shown.planned) deselect();
  else tellSelected();
}

function redraw() {
  plan.redraw(palette);
  strip.redraw(palette);
  trace.redraw(palette);
  history.line.redraw(palette);
  waterfall.redrawSoon(palette);
  table.redraw();
  tell();
}

/** Takes up what came in since the last frame. */
function frame() {
  if (shown?.added.length) {
    const added = shown.added.splice(0);
    for (const view of [plan, strip, table]) view.addReadings(added);
    waterfall.add(shown, added);
    const anew = selected && added.findLast((ping) => ping.index === selected.index);
    if (anew && anew !== selected) choose(anew);
    changed = true;
  }
  if (changed) tell();
  changed = false;
  requestAnimationFrame(frame);
}

/** The texts around the plan. */
function tell() {
  legend(byId("legend"), shown?.counts ?? new Map(), plan.pens(), palette);
  const { beyond, unplaced } = plan.notShown();
  const parts = [];
  if (beyond) parts.push(`${count(beyond, "reading")} beyond the view: arrows on its border`);
  if (unplaced) parts.push(`${count(unplaced, "reading")} from an unknown place: not drawn`);
  setText(byId("beyond"), parts.join("; "));
  const progress = byId("progress");
  progress.hidden = !shown?.underWay;
  if (!shown) return setText(byId("which"), "no scan yet");
  progress.max = shown.planned;
  progress.value = shown.beams.size;
  const when = shown === live && shown.underWay ? "live" : clock(shown.start.time);
  setText(byId("which"), `${when} · ${shown.beams.size} of ${count(shown.planned, "beam")}`);
  const other = shown.session?.scene && !plan.sceneFits();
  byId("stage").title = other ? `Taken in the scene ${shown.session.scene.name}, which its log does not hold: no walls are drawn` : "";
  slider.max = Math.max(0, shown.planned - 1);
  slider.disabled = shown.beams.size === 0 && !shown.before;
}

function select(index) {
  const ping = shown?.nearest(index);
  if (ping) choose(ping);
}

function choose(ping) {
  // The path of the reading before is that of this one, until the daemon says otherwise.
  const same = selected?.index === ping.index && JSON.stringify(selected.viewpoint) === JSON.stringify(ping.viewpoint);
  const path = same ? plan.path : null;
  selected = ping;
  slider.value = ping.index;
  tellSelected();
  plan.select(ping, path);
  strip.select(ping);
  table.select(ping);
  waterfall.select(ping);
  panel.show(ping);
  changed = true;
}

/** Draws the path of a sound, and its place in the echo trace. */
function showPath(path) {
  byId("trace").hidden = !beam?.trace;
  plan.select(selected, path);
  const same = JSON.stringify(path);
  trace.show(beam?.trace ? beam : null, beam?.peaks?.find(({ polyline }) => JSON.stringify(polyline) === same) ?? null);
  changed = true;
}

function tellSelected() {
  const text = `${inWords(selected)}${selected.scan === shown.id ? "" : ", in the scan before"}`;
  slider.setAttribute("aria-valuetext", text);
  setText(byId("beam-now"), text);
}

function deselect() {
  selected = null;
  slider.value = 0;
  slider.removeAttribute("aria-valuetext");
  setText(byId("beam-now"), "none selected");
  plan.select(null);
  strip.selected = null;
  waterfall.select(null);
  trace.show(null);
  byId("trace").hidden = true;
  panel.clear();
  changed = true;
}

/** A scan that begins, and the one before it for what it has not read yet. */
function begin(start) {
  const scan = new Scan(start, session);
  scan.underWay = true;
  if (live?.planned === scan.planned) scan.before = live;
  if (live) live.before = null;
  return scan;
}

/** Takes in a record of the stream. */
export function take(record) {
  switch (record.type) {
    case "session":
      session = record;
      loadScene();
      break;
    case "scan_start":
      live = begin(record);
      if (history.shown === null) {
        show(live);
        summary.began(live);
      }
      break;
    case "ping":
      if (live?.id === record.scan) live.add(record);
      else if (unheard !== record.scan) {
        unheard = record.scan;
        catchUp();
      }
      break;
    case "scan_end":
      if (live?.id !== record.scan) break;
      live.finish(record);
      changed = true;
      if (shown === live) {
        // A view that was kept wide for readings that did not come again shrinks now.
        overlays.redraw();
        summary.ended(live);
      }
      history.refreshSoon();
      break;
    case "event":
      summary.event(record);
      break;
    case "dropped":
      // This page was too slow: the log has what it missed.
      catchUp();
      break;
  }
}

/** Gets from the log what was not heard live; asked while it does, it does so once more. */
function catchUp() {
  again = catching !== null;
  catching ??= readNewest().finally(() => {
    catching = null;
    if (again) catchUp();
  });
}

/** All of the newest scan so far. */
async function readNewest() {
  await Promise.all([loadScene(), history.refresh()]);
  const newest = history.scans[0]?.scan;
  if (!newest) return;
  const asked = Promise.all([ask(`/v1/scans/${newest}`), ask("/v1/status")]);
  const [whole, status] = await asked.catch(() => []);
  if (!whole?.start) return;
  const heard = live;
  // A scan that began while the log was read is newer than what was read.
  if (heard && heard.id !== newest && Date.parse(heard.start.time) > Date.parse(whole.start.time)) return;
  session = whole.session ?? session;
  live = Scan.of(whole);
  if (heard?.id === newest) {
    // What came by the stream while the log was read.
    for (const ping of heard.beams.values()) if (!live.beams.has(ping.index)) live.add(ping);
    if (heard.end && !live.end) live.finish(heard.end);
  }
  // One that a killed daemon left in the log has no end and is not under way either.
  live.underWay = !live.end && status.scan?.scan === live.id;
  if (history.shown === null) {
    show(live);
    summary.shows(live);
  }
}

/** The floor plan of the scan shown: of the scene in force, or of the one in its log. */
async function loadScene() {
  const scan = shown;
  const taken = scan?.session?.scene?.sha256;
  if (taken && taken === plan.scene?.sha256) return;
  const unknown = (error) => (error.status === 404 ? null : undefined);
  let scene = await ask("/v1/scene").catch(unknown);
  if (taken && scene?.sha256 !== taken) scene = (await ask(`/v1/scans/${scan.id}/scene`).catch(unknown)) ?? scene;
  if (scene === undefined || scan !== shown || scene?.sha256 === plan.scene?.sha256) return;
  plan.scene = scene;
  changed = true;
  setText(byId("floor-title"), scene ? `Floor plan: ${scene.name}` : "Floor plan");
  plan.redraw(palette);
}

slider.addEventListener("input", () => select(Number(slider.value)));
slider.addEventListener("focus", () => {
  if (!selected && shown?.beams.size) select(Number(slider.value));
});
byId("fit").addEventListener("change", (event) => {
  plan.show(event.currentTarget.value);
  changed = true;
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  palette = colours();
  redraw();
});

tell();
let answered = true;
let version = null;
watch((status, health) => {
  // Another version of the daemon brings its own page.
  if (version && status && status.sonard !== version) location.reload();
  version ??= status?.sonard;
  // A daemon that is back after a restart has news, whether or not the stream noticed.
  if (status && !answered) {
    hurry();
    catchUp();
  }
  answered = status !== null;
  if (status) next.tell(status);
  if (health) explanations.tell(health);
});
follow("/v1/live/records?format=sse&verdicts=true", take, (there) => {
  if (there) return catchUp();
  // Whether its scan goes on, the daemon says when it is back.
  if (live?.underWay && shown === live) summary.lost(live);
  if (live) live.underWay = false;
  plan.drawOver();
  changed = true;
});
requestAnimationFrame(frame);
