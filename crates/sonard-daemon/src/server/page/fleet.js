// Fleet page: one card per robot with its state, last scan and problems.

import { requestJson } from "./api.js";
import { make } from "./dom.js";
import { drawGrid, drawScaleBar } from "./ground.js";
import { disc, drawPose, Layer, line } from "./layers.js";
import { colours } from "./verdicts.js";
import { View } from "./view.js";
import * as format from "./format.js";

const POLL_INTERVAL_MS = 1000;
const byId = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));

/** Lamp and text of the states in which a robot sends no report of its own. */
const STATES = {
  not_polled: ["wait", "not polled yet"],
  no_response: ["bad", "offline"],
  rejected: ["bad", "access denied"],
  invalid_response: ["bad", "unreachable"],
  other_robot: ["bad", "different robot at this address"],
};

let palette = colours();
/** @type {Card[]} */
let cards = [];

class Card {
  constructor() {
    this.title = make("h2");
    this.state = make("p", { className: "state" });
    this.problems = make("p", { className: "problems" });
    this.canvas = make("canvas", { role: "img" });
    this.facts = make("dl", { className: "facts" });
    this.item = make("li", {}, this.title, this.state, this.problems, this.canvas, this.facts);
    this.layer = new Layer(this.canvas);
    this.view = new View();
    /** JSON of the drawn scan. */
    this.drawn = "";
    /** @type {any} */
    this.picture = null;
    /** Name, and address of the robot's own page. @type {string | null} */
    this.name = null;
    this.page = null;
    new ResizeObserver(() => this.resize()).observe(this.canvas);
  }

  show(robot) {
    const [lamp, state] = stateOf(robot);
    const name = robot.robot ?? robot.address;
    if (this.name !== name || this.page !== robot.page) {
      [this.name, this.page] = [name, robot.page];
      this.title.replaceChildren(robot.page ? make("a", { href: robot.page, rel: "noreferrer" }, name) : name);
    }
    this.item.dataset.lamp = lamp;
    format.setText(this.state, robot.state === "healthy" ? state : `${state} since ${format.time(robot.since)}`);
    format.setText(this.problems, robot.problems.join("; "));
    this.problems.hidden = robot.problems.length === 0;
    this.item.classList.toggle("stale", !isReporting(robot));
    format.showFacts(this.facts, facts(robot));
    this.draw(robot.report?.last_scan?.picture ?? null, name);
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.view.resize(clientWidth, clientHeight);
    this.layer.resize(clientWidth, clientHeight);
    this.redraw();
  }

  draw(picture, name) {
    const text = JSON.stringify(picture);
    if (text === this.drawn) return;
    [this.drawn, this.picture] = [text, picture];
    this.canvas.hidden = !picture;
    this.canvas.ariaLabel = picture ? `Floor plan: last scan of ${name}, ${format.count(picture.points_m.length, "reading")}` : "No scan";
    this.redraw();
  }

  redraw() {
    if (!this.picture || !this.view.width) return;
    const { layer, view } = this;
    const { pose, points_m, walls_m } = this.picture;
    view.fit([...walls_m.flat(), [pose.x_m, pose.y_m]], points_m, false);
    layer.clear(view);
    drawGrid(layer, view, palette);
    for (const wall of walls_m) line(layer.pen("wall", palette), wall.map((end) => view.px(end)));
    const c = layer.pen("pose", palette);
    drawPose(c, view.px([pose.x_m, pose.y_m]), (-pose.heading_deg * Math.PI) / 180);
    c.fillStyle = palette["--direct"];
    for (const point of points_m) disc(c, view.px(point), 2);
    drawScaleBar(layer, view, palette);
  }
}

/** Returns `true` if the state comes from the robot's own report. */
const isReporting = ({ state }) => state === "healthy" || state === "unhealthy";

/** Lamp and text of a robot. */
function stateOf({ state, report }) {
  if (STATES[state]) return STATES[state];
  const [lamp, text] = format.linkState(report.link);
  return state === "unhealthy" ? ["bad", text] : [lamp, text];
}

function facts(robot) {
  const { report, address, last_report_age_s } = robot;
  if (!report) return [["Address", address]];
  const { scan, last_reading_age_s, last_scan, provenance } = report;
  const share = last_scan?.agree_fraction ?? null;
  const residual_m = last_scan?.median_abs_residual_m ?? null;
  return [
    ["Readings", format.provenanceLabel(provenance) ?? (provenance ? "hardware" : "–")],
    ["Scan", !isReporting(robot) ? "–" : scan ? `${scan.done} of ${format.count(scan.beams, "beam")}` : "none running"],
    ["Last reading", last_reading_age_s === null ? "–" : `${ago(last_reading_age_s + last_report_age_s)} ago`],
    ["Last scan", last_scan ? format.clock(last_scan.ended) : "–"],
    ["Agreement", share === null ? "–" : `${(100 * share).toFixed(0)} %`],
    ["Median residual", residual_m === null ? "–" : `${(1e3 * residual_m).toFixed(1)} mm`],
    ["Missing beams", last_scan ? `${last_scan.missing}` : "–"],
    ["Last contact", `${ago(last_report_age_s)} ago`],
    ["Address", address],
  ];
}

/** Age as text, coarse enough not to change with every poll. */
function ago(s) {
  return s < 5 ? "under 5 s" : s < 120 ? `${s.toFixed(0)} s` : s < 7200 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(0)} h`;
}


function show({ robots }) {
  while (cards.length < robots.length) cards.push(new Card());
  for (const card of cards.splice(robots.length)) card.item.remove();
  robots.forEach((robot, i) => {
    if (!cards[i].item.isConnected) byId("robots").append(cards[i].item);
    cards[i].show(robot);
  });
  format.setText(byId("summary"), summaryText(robots));
}

/** Healthy, offline and faulty robots; a live region that screen readers read when it changes. */
function summaryText(robots) {
  const namesOf = (filter) => robots.filter(filter).map(({ robot, address }) => robot ?? address);
  const healthy = namesOf(({ state }) => state === "healthy").length;
  const parts = [`${healthy} of ${robots.length} healthy`];
  const offline = namesOf(({ state }) => state === "no_response");
  if (offline.length) parts.push(`offline: ${offline.join(", ")}`);
  const faulty = namesOf(({ state }) => state !== "healthy" && state !== "no_response" && state !== "not_polled");
  if (faulty.length) parts.push(`fault: ${faulty.join(", ")}`);
  return parts.join("; ");
}

function showTrouble(text) {
  byId("trouble").hidden = !text;
  format.setText(byId("trouble"), text);
}

async function poll() {
  try {
    show(await requestJson("/v1/fleet", { signal: AbortSignal.timeout(5 * POLL_INTERVAL_MS) }));
    showTrouble("");
  } catch (/** @type {any} */ error) {
    showTrouble(error.status ? format.failure("Rejected", error) : "No connection to the daemon; retrying. Showing the last known state.");
  }
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  palette = colours();
  for (const card of cards) card.redraw();
});

for (;;) {
  if (!document.hidden) await poll();
  await new Promise((done) => setTimeout(done, POLL_INTERVAL_MS));
}
