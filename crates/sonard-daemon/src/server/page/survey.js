// Survey of an unknown room from the newest scans (`POST /v1/survey`): walls by status and poses with their 95 %
// regions on the plan. The plan found can take the place of the scene, and be saved as a scene file.

import { requestLines } from "./api.js";
import { make } from "./dom.js";
import { save } from "./download.js";
import { circle, drawPose, line } from "./layers.js";
import { count, failure, setText } from "./format.js";

const RAD_PER_DEG = Math.PI / 180;
/** Radius of the 95 % region of a normal distribution in the plane, standard deviations along the larger axis: sqrt(5.99). */
const REGION_SIGMAS = 2.45;
/** Radius at which a region is legible, and maximum distance of a hovered pose, pixels. */
const LEGIBLE_PX = 4, HOVER_PX = 8;
const STAGES = { course: "poses", walls: "walls", alternatives: "alternatives" };

export class Surveyor {
  /**
   * @param {HTMLElement} section
   * @param {any} plan
   * @param {{scans: () => any[], shown: () => any, onPlan: () => void}} page `scans()` returns the known scans, newest
   *   first, `shown()` the shown one of the log; `onPlan` is called when another floor plan is to be shown
   */
  constructor(section, plan, { scans, shown, onPlan }) {
    this.plan = plan;
    this.scans = scans;
    this.shown = shown;
    this.onPlan = onPlan;
    /** Result of the last survey. @type {any} */
    this.found = null;
    /** Floor plan that replaces the scene. @type {any} */
    this.scene = null;
    /** Set while a survey runs. @type {AbortController | null} */
    this.running = null;
    this.number = make("input", { type: "number", id: "survey-scans", min: "2", max: "40", value: "4", inputMode: "numeric" });
    this.start = make("button", { type: "button", id: "survey", textContent: "Survey" });
    this.use = make("button", { type: "button", id: "use-plan", textContent: "Use this plan", ariaPressed: "false", hidden: true });
    this.save = make("button", { type: "button", id: "save-plan", textContent: "Save scene", hidden: true });
    this.clear = make("button", { type: "button", id: "clear-survey", textContent: "Clear", hidden: true });
    this.status = make("span", { id: "surveyed", role: "status", className: "hint" });
    const label = make("label", { htmlFor: "survey-scans", textContent: "Scans up to the shown one" });
    section.className = "writes";
    section.append(make("p", { className: "row" }, this.start, label, this.number, this.status, this.use, this.save, this.clear));
    this.start.addEventListener("click", () => (this.running ? this.running.abort() : this.survey()));
    this.use.addEventListener("click", () => this.setScene(this.scene ? null : this.found.floor_plan));
    this.save.addEventListener("click", () => save(sceneFile(this.found.scene), "survey.json"));
    this.clear.addEventListener("click", () => this.show(null, ""));
    plan.overlays.push(this);
  }

  /** Complete scans up to the shown one, oldest first. */
  chosen() {
    const complete = this.scans().filter(({ end }) => end);
    const first = Math.max(0, complete.findIndex(({ scan }) => scan === this.shown()?.id));
    return complete.slice(first, first + Number(this.number.value)).reverse();
  }

  async survey() {
    const scans = this.chosen().map(({ scan }) => scan);
    if (scans.length < 2) return setText(this.status, "A survey takes two or more complete scans from different places.");
    this.show(null, "Surveying …");
    this.start.textContent = "Cancel";
    this.running = new AbortController();
    const { signal } = this.running;
    try {
      await requestLines("/v1/survey", { method: "POST", body: { scans }, signal }, ({ progress, result }) => {
        if (progress) setText(this.status, progressText(progress));
        if (result) this.show(result, resultText(result));
      });
    } catch (/** @type {any} */ error) {
      this.show(null, signal.aborted ? "Survey cancelled." : failure("Not surveyed", error));
    } finally {
      this.running = null;
      this.start.textContent = "Survey";
    }
  }

  show(found, text) {
    this.found = found;
    this.setScene(null);
    setText(this.status, text);
    this.use.hidden = this.save.hidden = !found?.floor_plan;
    this.clear.hidden = !found;
    this.plan.redraw();
  }

  /** Shows the plan found in place of the scene, or the scene again. */
  setScene(scene) {
    if (this.scene === scene) return;
    this.scene = scene;
    this.use.ariaPressed = String(scene !== null);
    this.use.textContent = scene ? "Use the scene" : "Use this plan";
    this.onPlan();
  }

  /** @param {any} layer @param {any} plan */
  drawUnder(layer, plan) {
    if (!this.found) return;
    const { walls, posts, poses } = this.found.survey;
    for (const { pieces } of walls) {
      for (const { from_m, to_m, status } of pieces) {
        drawPiece(layer, plan, status, [from_m, to_m]);
      }
    }
    for (const { center_m, radius_m, status } of posts) {
      circle(layer.pen(status, plan.palette), plan.view.px(center_m), radius_m * plan.view.scale);
    }
    const factor = this.enlargement();
    for (const { pose, sigma_m } of poses) {
      const at = plan.view.px([pose.x_m, pose.y_m]);
      drawPose(layer.pen("surveyed", plan.palette), at, -pose.heading_deg * RAD_PER_DEG);
      if (sigma_m) circle(layer.pen("region", plan.palette), at, factor * regionOf(sigma_m) * plan.view.scale);
    }
  }

  /** Power of ten by which the regions of poses are enlarged to be legible. */
  enlargement() {
    const radii = this.found.survey.poses.map(({ sigma_m }) => (sigma_m ? regionOf(sigma_m) : 0)).filter((radius_m) => radius_m > 0);
    const middle_px = (radii.sort((a, b) => a - b)[radii.length >> 1] ?? 1) * this.plan.view.scale;
    return Math.min(1e4, Math.max(1, 10 ** Math.ceil(Math.log10(LEGIBLE_PX / middle_px))));
  }

  describeAt(px, plan) {
    const poses = this.found?.survey.poses ?? [];
    const at = poses.findIndex(({ pose: { x_m, y_m } }) => {
      const [x, y] = plan.view.px([x_m, y_m]);
      return Math.hypot(x - px[0], y - px[1]) < HOVER_PX;
    });
    if (at < 0) return undefined;
    const { pose, sigma_m } = poses[at];
    const sigma = sigma_m ? `, ±${(1e3 * Math.max(...sigma_m)).toFixed(2)} mm (circle: 95 %, ${this.enlargement()} times enlarged)` : "";
    return `stop ${at + 1}: (${pose.x_m.toFixed(3)}, ${pose.y_m.toFixed(3)}) m${sigma}`;
  }
}

/** Draws a stretch of wall on a margin, so that its dashes are legible on a wall of the scene. */
function drawPiece(layer, { view, palette }, status, ends_m) {
  const points = ends_m.map((at) => view.px(at));
  const c = layer.pen(status, palette);
  [c.strokeStyle, c.lineWidth] = [palette["--panel"], c.lineWidth + 2];
  c.setLineDash([]);
  line(c, points);
  line(layer.pen(status, palette), points);
}

const regionOf = (sigma_m) => REGION_SIGMAS * Math.max(...sigma_m);

function progressText({ stage, round, walls, scored_scenes }) {
  const of = round ? `, round ${round}` : "";
  return `Surveying: ${STAGES[stage]}${of}; ${count(walls, "wall")}, ${count(scored_scenes, "floor plan")} tried`;
}

function resultText({ survey: { walls, posts, poses, arcs, unexplained, alternatives, end } }) {
  const early = { cancelled: "Ended early: ", budget: "The budget is spent: " }[end] ?? "";
  const others = alternatives.length ? `; ${count(alternatives.length, "other plan")} possible` : "";
  const round = posts.length ? ` and ${count(posts.length, "post")}` : "";
  return `${early}${count(walls.length, "wall")}${round} from ${count(poses.length, "scan")}, ${arcs - unexplained.length} of ${count(arcs, "arc")} explained${others}`;
}

const sceneFile = (scene) => new Blob([`${JSON.stringify(scene, null, 2)}\n`], { type: "application/json" });
