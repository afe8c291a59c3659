// What the daemon says of itself, once a second while somebody looks.

import { ask } from "./api.js";
import * as words from "./words.js";

const EVERY_MS = 1000;
/** When it answered last. */
let answered = null;
const byId = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));

/** Asks for ever; `onStatus` gets status and health each time, or `null` when there is no answer. */
export async function watch(onStatus) {
  for (;;) {
    if (!document.hidden) await look(onStatus);
    await new Promise((done) => setTimeout(done, EVERY_MS));
  }
}

async function look(onStatus) {
  try {
    const signal = AbortSignal.timeout(5 * EVERY_MS);
    const [status, health] = await Promise.all([ask("/v1/status", { signal }), ask("/v1/health", { signal })]);
    answered = new Date();
    show(status, health);
    onStatus(status, health);
  } catch (/** @type {any} */ error) {
    showLost(error);
    onStatus(null);
  }
}

function show(status, health) {
  const [lamp, text] = words.state(status.link.state);
  setLamp(byId("link"), lamp, text);
  showProvenance(status.provenance);
  const { air, plan, pose } = status;
  const age = air.age_s === null ? "" : `, ${air.age_s.toFixed(0)} s old`;
  words.facts(byId("conditions"), [
    ["Air", `${air.temperature_c.toFixed(1)} °C${air.stale ? " STALE" : ""}${age}, ${air.humidity_percent.toFixed(0)} %, ${air.sound_speed_m_s.toFixed(2)} m/s`],
    status.simulation ? ["Array", array(status.simulation)] : ["Plan", azimuths(plan)],
    ["Pose", `${pose.x_m.toFixed(3)}, ${pose.y_m.toFixed(3)} m, ${pose.heading_deg}°`],
    ["Scans", mode(status.scanning)],
    ...pending(status.pending),
    ...restart(status.configuration),
  ]);
  showTrouble(trouble(status));
  showHealth(status, health);
}

function azimuths({ from_deg, to_deg, step_deg, pings_per_stop }) {
  return `${from_deg}° to ${to_deg}°, every ${step_deg}°${pings_per_stop > 1 ? `, ${pings_per_stop} pings` : ""}`;
}

function array({ array, readings, driving }) {
  return `${array}, ${words.count(readings.length, "ranger")}${driving ? ", driving" : ""}`;
}

/** What counts from the next scan on, if anything does. */
function pending({ plan, pose, scene, air, setup }) {
  const parts = [];
  if (plan) parts.push(`plan ${azimuths(plan)}`);
  if (pose) parts.push(`pose ${pose.x_m.toFixed(3)}, ${pose.y_m.toFixed(3)} m, ${pose.heading_deg}°`);
  if (scene) parts.push(`scene ${scene.name}`);
  if (air) parts.push(`air ${air.temperature_c.toFixed(1)} °C`);
  if (setup) parts.push("sensor, model or motion");
  return parts.length > 0 ? [["From the next scan on", parts.join("; ")]] : [];
}

/** Keys of a changed configuration that wait. */
const restart = ({ needs_restart }) => (needs_restart.length ? [["After a restart", needs_restart.join(", ")]] : []);

function mode({ mode, paused, requested, next_in_s }) {
  const parts = [mode.replaceAll("_", " ").replaceAll("-", " ")];
  if (paused) parts.push("stopped");
  if (requested) parts.push(`${requested} asked for`);
  if (!paused && next_in_s !== null && next_in_s > 0) parts.push(`next in ${next_in_s.toFixed(0)} s`);
  return parts.join(", ");
}

/** What a person should know about, if anything; read out once, so without a countdown. */
function trouble({ link, log, configuration }) {
  const [lamp, text] = words.state(link.state);
  const parts = [];
  if (lamp === "bad") parts.push(`Ranger: ${text}. ${link.trouble ?? ""}`);
  if (log.error) parts.push(`Log: ${log.error}. No scan begins until it can be written.`);
  if (configuration.error) parts.push(`The configuration was refused: ${configuration.error}`);
  return parts.join(" ");
}

function showHealth(status, health) {
  const { line, scans, clock } = health;
  const text = health.healthy ? "All is well." : `Not well: ${health.reasons.join("; ")}.`;
  setLamp(byId("healthy"), health.healthy ? "good" : "bad", text);
  const device = status.device;
  const parts = (figure, unit, digits = 1) => (figure === null ? "–" : `${figure.toFixed(digits)} ${unit}`);
  words.facts(byId("health"), [
    ["Device", device ? `${device.serial}, firmware ${device.firmware}` : status.simulation ? "none: the model plays" : "–"],
    ["Port", port(status.link)],
    ["Scans in all", `${scans.completed} whole, ${scans.stopped} stopped, ${scans.failed} given up`],
    ["Beams in all", `${scans.beams} measured, ${scans.missing} missing`],
    ["Line", `${line.crc_errors} checksum errors, ${line.framing_errors} framing errors`],
    ["Repairs", `${line.retries} retries, ${line.repaired} readings fetched again`],
    ["Losses", `${line.losses} of the link, ${scans.restarts} restarts survived`],
    ["Clock", `${parts(clock.drift_ppm, "ppm")} drift, ${parts(clock.sigma_us, "µs")} sigma`],
    ["Log", status.log.file ? `${status.log.file.split("/").at(-1)}, ${status.log.waiting} waiting` : "–"],
    ["Records", `${status.log.written} written, ${status.log.synced} on the disk`],
    ["Clients", `${status.subscribers.now}, ${status.subscribers.dropped_readings} readings dropped`],
    ["Running", `sonard ${status.sonard}, ${running(status.uptime_s)}`],
  ]);
}

const port = ({ port, retry_in_s }) => (retry_in_s === null ? port || "–" : `${port}, next try in ${retry_in_s.toFixed(1)} s`);
const running = (s) => (s < 120 ? `${s.toFixed(0)} s` : s < 7200 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(1)} h`);

function showProvenance(name) {
  const badge = byId("provenance");
  const text = words.provenance(name);
  badge.hidden = !text;
  words.setText(badge, text ?? "");
}

function showLost(error) {
  setLamp(byId("link"), "bad", "daemon not answering");
  const since = answered ? ` since ${answered.toLocaleTimeString()}` : "";
  setLamp(byId("healthy"), "bad", `The daemon is not answering${since}.`);
  const refused = error.status ? `The daemon refuses: ${error.message}. ${error.help}` : "";
  showTrouble(refused || "The daemon does not answer. Trying again; what is shown is what was known last.");
}

function showTrouble(text) {
  const place = byId("trouble");
  place.hidden = !text;
  words.setText(place, text);
}

function setLamp(element, lamp, text) {
  if (element.dataset.lamp !== lamp) element.dataset.lamp = lamp;
  words.setText(element, text);
}
