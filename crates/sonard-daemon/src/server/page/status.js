// Status and health of the daemon, polled once per second while the page is visible.

import { requestJson } from "./api.js";
import * as format from "./format.js";

const POLL_INTERVAL_MS = 1000;
/** Time of the last successful poll. */
let lastContact = null;
const byId = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));

/** Polls forever; `onStatus` receives status and health, or `null` if the daemon does not respond. */
export async function pollStatus(onStatus) {
  for (;;) {
    if (!document.hidden) await poll(onStatus);
    await new Promise((done) => setTimeout(done, POLL_INTERVAL_MS));
  }
}

async function poll(onStatus) {
  try {
    const signal = AbortSignal.timeout(5 * POLL_INTERVAL_MS);
    const [status, health] = await Promise.all([requestJson("/v1/status", { signal }), requestJson("/v1/health", { signal })]);
    lastContact = new Date();
    show(status, health);
    onStatus(status, health);
  } catch (/** @type {any} */ error) {
    showLost(error);
    onStatus(null);
  }
}

function show(status, health) {
  const [lamp, text] = format.linkState(status.link.state);
  setLamp(byId("link"), lamp, text);
  showProvenance(status.provenance);
  const { air, plan, pose } = status;
  const age = air.age_s === null ? "" : `, ${air.age_s.toFixed(0)} s old`;
  format.showFacts(byId("conditions"), [
    ["Air", `${air.temperature_c.toFixed(1)} °C${air.stale ? " STALE" : ""}${age}, ${air.humidity_percent.toFixed(0)} %, ${air.sound_speed_m_s.toFixed(2)} m/s`],
    status.simulation ? ["Array", array(status.simulation)] : ["Sweep", azimuths(plan)],
    ["Pose", poseText(pose)],
    ["Mode", mode(status.scanning)],
    ...pending(status.pending),
    ...restart(status.configuration),
  ]);
  showTrouble(trouble(status));
  showHealth(status, health);
}

const poseText = ({ x_m, y_m, heading_deg }) => `(${x_m.toFixed(3)}, ${y_m.toFixed(3)}) m, heading ${heading_deg}°`;

function azimuths({ from_deg, to_deg, step_deg, pings_per_stop }) {
  return `${from_deg}° to ${to_deg}°, step ${step_deg}°${pings_per_stop > 1 ? `, ${pings_per_stop} pings per step` : ""}`;
}

function array({ array, readings, driving }) {
  return `${array}, ${format.count(readings.length, "ranger")}${driving ? ", driving" : ""}`;
}

/** Settings that take effect with the next scan. */
function pending({ plan, pose, scene, air, setup }) {
  const parts = [];
  if (plan) parts.push(`sweep ${azimuths(plan)}`);
  if (pose) parts.push(`pose ${poseText(pose)}`);
  if (scene) parts.push(`scene ${scene.name}`);
  if (air) parts.push(`air ${air.temperature_c.toFixed(1)} °C`);
  if (setup) parts.push("sensor, model or motion");
  return parts.length > 0 ? [["Next scan", parts.join("; ")]] : [];
}

/** Keys of a changed configuration that need a restart. */
const restart = ({ needs_restart }) => (needs_restart.length ? [["After a restart", needs_restart.join(", ")]] : []);

function mode({ mode, paused, requested, next_in_s }) {
  const parts = [];
  if (requested) parts.push(`${format.count(requested, "scan")} requested`);
  if (!paused && next_in_s !== null && next_in_s > 0) parts.push(`next in ${next_in_s.toFixed(0)} s`);
  return [`${mode.replaceAll("_", " ").replaceAll("-", " ")}${paused ? " (paused)" : ""}`, ...parts].join(", ");
}

/** Problems that need attention. Contains no countdown, because screen readers read every change. */
function trouble({ link, log, configuration }) {
  const [lamp, text] = format.linkState(link.state);
  const parts = [];
  if (lamp === "bad") parts.push(`Ranger: ${text}`, link.error);
  if (log.error) parts.push(`Log: ${log.error}`, "Scanning is suspended until the log is writable");
  if (configuration.error) parts.push(`Configuration rejected: ${configuration.error}`);
  return format.sentences(...parts);
}

function showHealth(status, health) {
  const { line, scans, clock } = health;
  const text = health.healthy ? "Healthy" : `Problems: ${health.reasons.join("; ")}`;
  setLamp(byId("healthy"), health.healthy ? "good" : "bad", text);
  const device = status.device;
  const quantity = (figure, unit, digits = 1) => (figure === null ? "–" : `${figure.toFixed(digits)} ${unit}`);
  // A simulation has neither a port nor a clock.
  const ofDevice = (/** @type {string[][]} */ ...facts) => (status.simulation ? [] : facts);
  format.showFacts(byId("health"), [
    ["Device", device ? `${device.serial}, firmware ${device.firmware}` : status.simulation ? "none (simulation)" : "–"],
    ...ofDevice(["Port", port(status.link)]),
    ["Scans", `${scans.completed} completed, ${scans.stopped} stopped, ${scans.failed} failed`],
    ["Beams", `${scans.beams} measured, ${scans.missing} missing`],
    ...ofDevice(
      ["Serial link", `${format.count(line.crc_errors, "checksum error")}, ${format.count(line.framing_errors, "framing error")}`],
      ["Repairs", `${format.count(line.retries, "repeated request")}, ${line.repaired} readings re-requested`],
      ["Losses", `${format.count(line.losses, "disconnect")}, ${format.count(scans.restarts, "device reset")}`],
      ["Clock", `${quantity(clock.drift_ppm, "ppm")} drift, ${quantity(clock.sigma_us, "µs")} sigma`],
    ),
    ["Log", status.log.file ? `${status.log.file.split("/").at(-1)}, ${status.log.waiting} queued` : "–"],
    ["Records", `${status.log.written} written, ${status.log.synced} synced`],
    ["Clients", `${status.subscribers.now}, ${status.subscribers.dropped_readings} readings dropped`],
    ["Version", `${status.sonard}, up ${uptime(status.uptime_s)}`],
  ]);
}

const port = ({ port, retry_in_s }) => (retry_in_s === null ? port || "–" : `${port}, next try in ${retry_in_s.toFixed(1)} s`);
const uptime = (s) => (s < 120 ? `${s.toFixed(0)} s` : s < 7200 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(1)} h`);

function showProvenance(name) {
  const badge = byId("provenance");
  const text = format.provenanceLabel(name);
  badge.hidden = !text;
  format.setText(badge, text ?? "");
}

function showLost(error) {
  setLamp(byId("link"), "bad", "daemon not responding");
  setLamp(byId("healthy"), "bad", `Daemon not responding${lastContact ? ` since ${format.time(lastContact)}` : ""}`);
  showTrouble(error.status ? format.failure("Rejected", error) : "No connection to the daemon; retrying. Showing the last known state.");
}

function showTrouble(text) {
  const element = byId("trouble");
  element.hidden = !text;
  format.setText(element, text);
}

function setLamp(element, lamp, text) {
  if (element.dataset.lamp !== lamp) element.dataset.lamp = lamp;
  format.setText(element, text);
}
