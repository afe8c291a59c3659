// Entry point of the live page: connects the live stream and the log with plan, residuals, table and panels.

import { enterToken, onToken, reconnectNow, requestJson, subscribe } from "./api.js";
import { BeamPanel, describeReading } from "./beam.js";
import { addControls } from "./control.js";
import { addDownloads } from "./download.js";
import { Explanations } from "./explanations.js";
import { History } from "./history.js";
import { readLink, writeLink } from "./link.js";
import { Locator } from "./location.js";
import { NextScan } from "./next-scan.js";
import { Overlays } from "./overlays.js";
import { Plan } from "./plan.js";
import { Scan } from "./scan.js";
import { pollStatus } from "./status.js";
import { Strip } from "./strip.js";
import { Summary } from "./summary.js";
import { Surveyor } from "./survey.js";
import { BeamTable } from "./table.js";
import { addTools } from "./tools.js";
import { EchoTrace } from "./trace.js";
import { colours, updateLegend } from "./verdicts.js";
import { Waterfall } from "./waterfall.js";
import { clock, count, setText, setUnit } from "./format.js";

const byId = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));
const slider = byId("beam");

let palette = colours();
/** Running or last scan, whichever scan is shown. */
let live = null;
let session = null;
/** Shown scan: `live`, or one of the log. */
let shown = null;
/** Selected reading. */
let selected = null;
let changed = false;
/** Scan whose `scan_start` was missed, and which was therefore requested from the log. */
let missed = null;
/** Set once the address was followed; until then it is not changed. */
let linked = false;
/** Request of the newest scan from the log, and whether to repeat it afterwards. */
let catchingUp = null;
let repeatCatchUp = false;

const label = "Floor plan with the readings of the scan. The table of beams lists the same readings.";
export const plan = new Plan(byId("stage"), select, label);
addTools(plan, () => (changed = true));
const strip = new Strip(byId("residuals"), select);
const table = new BeamTable(byId("table"));
/** Details of the selected beam. */
let beam = null;
const panel = new BeamPanel(byId("beam-panel"), showPath, async ({ scan, index }, signal) => {
  beam = await requestJson(`/v1/scans/${scan}/beams/${index}`, { signal });
  return beam;
});
// An arrival picked in the trace is selected in the list.
const trace = new EchoTrace(byId("trace"), (peak) => byId("beam-panel").querySelectorAll(".peaks button")[beam.peaks.indexOf(peak)]?.click());
const summary = new Summary(byId("summary"));
const history = new History(
  { list: byId("scans-list"), line: byId("scan-line"), live: byId("live"), replay: byId("replay"), speed: byId("speed") },
  (id) => live?.id === id && live.running,
  (scan, error) => {
    show(scan ?? live);
    if (error) summary.set(error);
    else if (shown) summary.showScan(shown);
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
const announce = (text) => summary.setResult(text);
const updateControls = addControls(byId("control"), announce);
const overlays = new Overlays(byId("overlays"), plan, strip, { announce, completed: () => history.completed() });
const nextScan = new NextScan(byId("next"), plan, announce);
const explanations = new Explanations(byId("hypotheses"), plan, {
  show: (id) => history.show(id),
  propose: (change) => nextScan.propose(change),
});
const locator = new Locator(byId("location"), plan, (change) => nextScan.propose(change));
const surveyor = new Surveyor(byId("surveys"), plan, {
  scans: () => history.scans,
  shown: () => history.shown,
  onPlan: () => loadScene(),
});
addDownloads(byId("downloads"), plan, {
  scan: () => shown,
  log: (id) => history.logOf(id),
  beam: async () => (selected ? waterfall.csv() : null),
  announce,
});

/** Shows a scan, or redraws the shown one. */
function show(scan) {
  const isOther = scan?.id !== shown?.id;
  shown = scan;
  for (const view of [plan, strip, table]) view.scan = scan;
  if (scan && !scan.replayed) waterfall.add(scan, [...scan.beams.values()]);
  if (scan) scan.added = [];
  plan.latest = null;
  if (isOther) keepSelection();
  overlays.update();
  explanations.redraw();
  locator.update();
  redraw();
  loadScene();
  keepLink();
}

/** Puts the shown scan, unless it is the live one, and the selected beam into the address. */
function keepLink() {
  if (linked) writeLink(history.shown?.id ?? null, selected?.index ?? null);
}

/** Shows the scan and the beam of the address. */
async function followLink() {
  const { scan, beam } = readLink();
  if (scan && scan !== history.shown?.id) await history.show(scan);
  // Before the first address was followed, a past scan was chosen on the page.
  else if (!scan && history.shown && linked) history.showLive();
  if (beam !== null && beam !== selected?.index) select(beam);
  linked = true;
}

/** Keeps the selected beam in another scan. Its previous reading stays until the running scan replaces it. */
function keepSelection() {
  if (!selected) return;
  const ping = shown?.beams.get(selected.index);
  if (ping) selectReading(ping);
  else if (!shown?.running || selected.index >= shown.planned) deselect();
  else updateSelectionText();
}

function redraw() {
  plan.redraw(palette);
  strip.redraw(palette);
  trace.redraw(palette);
  history.line.redraw(palette);
  waterfall.redrawSoon(palette);
  table.redraw();
  updateTexts();
}

/** Draws the readings received since the last frame. */
function frame() {
  if (shown?.added.length) {
    const added = shown.added.splice(0);
    for (const view of [plan, strip, table]) view.addReadings(added);
    waterfall.add(shown, added);
    const updated = selected && added.findLast((ping) => ping.index === selected.index);
    if (updated && updated !== selected) selectReading(updated);
    changed = true;
  }
  if (changed) updateTexts();
  changed = false;
  requestAnimationFrame(frame);
}

/** Updates the texts around the plan. */
function updateTexts() {
  updateLegend(byId("legend"), shown?.counts ?? new Map(), plan.pens(), palette);
  const { outside, unplaced } = plan.hiddenCounts();
  const parts = [];
  if (outside) parts.push(`${count(outside, "reading")} outside the view (arrows at the edge)`);
  if (unplaced) parts.push(`${count(unplaced, "reading")} not drawn: position unknown`);
  setText(byId("out-of-view"), parts.join("; "));
  const progress = byId("progress");
  progress.hidden = !shown?.running;
  if (!shown) return setText(byId("scan-label"), "no scan yet");
  progress.max = shown.planned;
  progress.value = shown.beams.size;
  const when = shown === live && shown.running ? "live" : clock(shown.start.time);
  setText(byId("scan-label"), `${when} · ${shown.beams.size} of ${count(shown.planned, "beam")}`);
  const sceneMissing = shown.session?.scene && !plan.sceneFits();
  byId("stage").title = sceneMissing ? `No walls drawn: the scene ${shown.session.scene.name} of this scan is not in its log.` : "";
  slider.max = Math.max(0, shown.planned - 1);
  slider.disabled = shown.beams.size === 0 && !shown.previous;
}

function select(index) {
  const ping = shown?.nearest(index);
  if (ping) selectReading(ping);
}

function selectReading(ping) {
  // The path of the beam's previous reading stays until the new one is loaded.
  const same = selected?.index === ping.index && JSON.stringify(selected.viewpoint) === JSON.stringify(ping.viewpoint);
  const path = same ? plan.path : null;
  selected = ping;
  keepLink();
  slider.value = ping.index;
  updateSelectionText();
  plan.select(ping, path);
  strip.select(ping);
  table.select(ping);
  waterfall.select(ping);
  panel.show(ping);
  changed = true;
}

/** Draws a propagation path and marks its arrival in the echo trace. */
function showPath(path) {
  byId("trace").hidden = !beam?.trace;
  plan.select(selected, path);
  const key = JSON.stringify(path);
  trace.show(beam?.trace ? beam : null, beam?.peaks?.find(({ polyline }) => JSON.stringify(polyline) === key) ?? null);
  changed = true;
}

function updateSelectionText() {
  const text = `${describeReading(selected)}${selected.scan === shown.id ? "" : ", previous scan"}`;
  slider.setAttribute("aria-valuetext", text);
  setText(byId("beam-label"), text);
}

function deselect() {
  selected = null;
  keepLink();
  slider.value = 0;
  slider.removeAttribute("aria-valuetext");
  setText(byId("beam-label"), "none selected");
  plan.select(null);
  strip.selected = null;
  waterfall.select(null);
  trace.show(null);
  byId("trace").hidden = true;
  panel.clear();
  changed = true;
}

/** Creates the scan that starts, with the last one as its previous scan. */
function startScan(start) {
  const scan = new Scan(start, session);
  scan.running = true;
  if (live?.planned === scan.planned) scan.previous = live;
  if (live) live.previous = null;
  return scan;
}

/** Handles a record of the live stream. */
export function handleRecord(record) {
  switch (record.type) {
    case "session":
      session = record;
      loadScene();
      break;
    case "scan_start":
      live = startScan(record);
      history.begin(live);
      if (history.shown === null) {
        show(live);
        summary.scanStarted(live);
      }
      break;
    case "ping":
      if (live?.id === record.scan) live.add(record);
      else if (missed !== record.scan) {
        missed = record.scan;
        catchUp();
      }
      break;
    case "scan_end":
      if (live?.id !== record.scan) break;
      live.finish(record);
      changed = true;
      if (shown === live) {
        // The view may shrink now: while the scan was running it only grew.
        overlays.redraw();
        summary.scanEnded(live);
      }
      history.end(record);
      break;
    case "event":
      summary.showEvent(record);
      break;
    case "dropped":
      // The page read too slowly; the log has the dropped readings.
      catchUp();
      break;
  }
}

/** Reads from the log what the stream missed; repeated once if called again meanwhile. */
function catchUp() {
  repeatCatchUp = catchingUp !== null;
  catchingUp ??= readNewest().finally(() => {
    catchingUp = null;
    if (repeatCatchUp) catchUp();
  });
}

/** Reads the newest scan from the log and merges it with the readings of the stream. */
async function readNewest() {
  await Promise.all([loadScene(), history.refresh()]);
  const newest = history.scans[0]?.scan;
  if (!newest) {
    linked = true;
    return;
  }
  const requests = Promise.all([requestJson(`/v1/scans/${newest}`), requestJson("/v1/status")]);
  const [record, status] = await requests.catch(() => []);
  if (!record?.start) return;
  const streamed = live;
  session ??= record.session;
  if (streamed) streamed.session ??= session;
  // A scan that started while the log was read is newer than the log's.
  if (streamed && streamed.id !== newest && Date.parse(streamed.start.time) > Date.parse(record.start.time)) return;
  session = record.session ?? session;
  live = Scan.fromJson(record);
  if (streamed?.id === newest) {
    // Readings streamed while the log was read.
    for (const ping of streamed.beams.values()) if (!live.beams.has(ping.index)) live.add(ping);
    if (streamed.end && !live.end) live.finish(streamed.end);
  }
  // A scan without end may also be left over from a killed daemon.
  live.running = !live.end && status.scan?.scan === live.id;
  if (live.end) summary.last = live.summary();
  if (history.shown === null) {
    show(live);
    summary.showScan(live);
  }
  if (!linked) await followLink();
}

/** Loads the scene of the shown scan: the current one, or the one in the scan's log. */
async function loadScene() {
  const scan = shown;
  plan.surveyed = surveyor.scene;
  if (surveyor.scene) return setScene(surveyor.scene);
  const recorded = scan?.session?.scene?.sha256;
  if (recorded && recorded === plan.scene?.sha256) return;
  const unknown = (error) => (error.status === 404 ? null : undefined);
  let scene = await requestJson("/v1/scene").catch(unknown);
  if (recorded && scene?.sha256 !== recorded) scene = (await requestJson(`/v1/scans/${scan.id}/scene`).catch(unknown)) ?? scene;
  if (scene === undefined || scan !== shown || scene?.sha256 === plan.scene?.sha256) return;
  setScene(scene);
}

function setScene(scene) {
  plan.scene = scene;
  changed = true;
  setText(byId("floor-title"), scene ? `Floor plan: ${scene.name}` : "Floor plan");
  plan.redraw(palette);
}

slider.addEventListener("input", () => select(Number(slider.value)));
slider.addEventListener("focus", () => {
  if (!selected && shown?.beams.size) select(Number(slider.value));
});
byId("unit").addEventListener("change", (event) => {
  setUnit(event.currentTarget.value);
  if (selected) selectReading(selected);
  redraw();
});
byId("unlock").addEventListener("click", enterToken);
onToken(updateAccess);
addEventListener("hashchange", followLink);
byId("fit").addEventListener("change", (event) => {
  plan.show(event.currentTarget.value);
  changed = true;
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  palette = colours();
  redraw();
});

/** Shows the controls that this client may use. */
async function updateAccess() {
  const access = await requestJson("/v1/access").catch(() => null);
  if (access) document.body.dataset.write = access.write;
}

updateTexts();
updateAccess();
let connected = true;
let version = null;
pollStatus((status, health) => {
  // Another version of the daemon serves another page.
  if (version && status && status.sonard !== version) location.reload();
  version ??= status?.sonard;
  // After a restart of the daemon the log may have new scans, even if the stream did not break.
  if (status && !connected) {
    reconnectNow();
    catchUp();
    updateAccess();
  }
  connected = status !== null;
  if (status) {
    nextScan.update(status);
    updateControls(status);
  }
  if (health) explanations.update(health);
});
subscribe("/v1/live/records?format=sse&verdicts=true", handleRecord, (streaming) => {
  if (streaming) return catchUp();
  // The state of the scan is unknown until the stream is back.
  if (live?.running && shown === live) summary.connectionLost(live);
  if (live) live.running = false;
  plan.drawOver();
  changed = true;
});
requestAnimationFrame(frame);
