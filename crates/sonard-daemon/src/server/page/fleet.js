// All robots that this daemon asks: a card each, with its state, its last scan and what is wrong.

import { ask } from "./api.js";
import { make } from "./dom.js";
import { drawGrid, drawScaleBar } from "./ground.js";
import { disc, drawPose, Layer, line } from "./pens.js";
import { colours } from "./verdicts.js";
import { View } from "./view.js";
import * as words from "./words.js";

const EVERY_MS = 1000;
const byId = (/** @type {string} */ id) => /** @type {any} */ (document.getElementById(id));

/** Lamp and words of how a robot is, where it does not say itself. */
const STATES = {
  unasked: ["wait", "not asked yet"],
  silent: ["bad", "silent"],
  refusing: ["bad", "refuses to answer"],
  strange: ["bad", "no daemon answers there"],
  other_robot: ["bad", "another robot answers"],
};

let palette = colours();
/** @type {Card[]} */
let cards = [];

class Card {
  constructor() {
    this.title = make("h2");
    this.state = make("p", { className: "state" });
    this.wrong = make("p", { className: "wrong" });
    this.canvas = make("canvas", { role: "img" });
    this.facts = make("dl", { className: "facts" });
    this.item = make("li", {}, this.title, this.state, this.wrong, this.canvas, this.facts);
    this.layer = new Layer(this.canvas);
    this.view = new View();
    /** The scan that is drawn, as JSON. */
    this.drawn = "";
    /** @type {any} */
    this.picture = null;
    /** Name, and address of its own page. @type {string | null} */
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
    words.setText(this.state, robot.state === "well" ? state : `${state}, ${since(robot.since)}`);
    words.setText(this.wrong, robot.wrong.join("; "));
    this.wrong.hidden = robot.wrong.length === 0;
    this.item.classList.toggle("old", !isHeard(robot));
    words.facts(this.facts, facts(robot));
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
    this.canvas.ariaLabel = picture ? `Floor plan: the last scan of ${name}, ${words.count(picture.points_m.length, "reading")}` : "No scan";
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

/** Whether it says itself how it is. */
const isHeard = ({ state }) => state === "well" || state === "not_well";

/** What the robot says of its ranger, if it was heard just now. */
function stateOf({ state, report }) {
  if (STATES[state]) return STATES[state];
  const [lamp, text] = words.state(report.link);
  return state === "not_well" ? ["bad", text] : [lamp, text];
}

function facts(robot) {
  const { report, address, heard_s } = robot;
  if (!report) return [["Asked at", address]];
  const { scan, last_reading_age_s, last_scan, provenance } = report;
  const share = last_scan?.agree_fraction ?? null;
  const off_m = last_scan?.median_abs_residual_m ?? null;
  return [
    ["Readings", words.provenance(provenance) ?? (provenance ? "hardware" : "–")],
    ["Scan", !isHeard(robot) ? "–" : scan ? `${scan.done} of ${words.count(scan.beams, "beam")}` : "none under way"],
    ["Last reading", last_reading_age_s === null ? "–" : `${ago(last_reading_age_s + heard_s)} ago`],
    ["Last scan", last_scan ? words.clock(last_scan.ended) : "–"],
    ["Agreement", share === null ? "–" : `${(100 * share).toFixed(0)} %, half within ${(1e3 * off_m).toFixed(0)} mm`],
    ["Missing beams", last_scan ? `${last_scan.missing}` : "–"],
    ["Heard", `${ago(heard_s)} ago, at ${address}`],
  ];
}

/** An age in seconds, in words that do not change with every look. */
function ago(s) {
  return s < 5 ? "under 5 s" : s < 120 ? `${s.toFixed(0)} s` : s < 7200 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(0)} h`;
}

const since = (time) => `since ${new Date(time).toLocaleTimeString(undefined, { hour12: false })}`;

function show({ robots }) {
  while (cards.length < robots.length) cards.push(new Card());
  for (const card of cards.splice(robots.length)) card.item.remove();
  robots.forEach((robot, i) => {
    if (!cards[i].item.isConnected) byId("robots").append(cards[i].item);
    cards[i].show(robot);
  });
  words.setText(byId("summary"), inWords(robots));
}

/** Who is well and who is not; read out when it changes. */
function inWords(robots) {
  const named = (wanted) => robots.filter(wanted).map(({ robot, address }) => robot ?? address);
  const well = named(({ state }) => state === "well").length;
  const parts = [`${well} of ${words.count(robots.length, "robot")} well`];
  const silent = named(({ state }) => state === "silent");
  if (silent.length) parts.push(`silent: ${silent.join(", ")}`);
  const others = named(({ state }) => state !== "well" && state !== "silent" && state !== "unasked");
  if (others.length) parts.push(`not well: ${others.join(", ")}`);
  return parts.join("; ");
}

function showTrouble(text) {
  byId("trouble").hidden = !text;
  words.setText(byId("trouble"), text);
}

async function look() {
  try {
    show(await ask("/v1/fleet", { signal: AbortSignal.timeout(5 * EVERY_MS) }));
    showTrouble("");
  } catch (/** @type {any} */ error) {
    showTrouble(error.status ? `The daemon refuses: ${error.message}. ${error.help}` : "The daemon that asks the robots does not answer. What is shown is what was known last.");
  }
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  palette = colours();
  for (const card of cards) card.redraw();
});

for (;;) {
  if (!document.hidden) await look();
  await new Promise((done) => setTimeout(done, EVERY_MS));
}
