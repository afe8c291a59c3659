// Survey of an unknown room from the newest scans (`POST /v1/survey`), which can take the place of the scene.

import { requestLines } from "./api.js";
import { make } from "./dom.js";
import { save } from "./download.js";
import { failure, setText } from "./format.js";
import { describeStop, drawSurvey, progressText, resultText } from "./surveyed-plan.js";

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
        if (result) this.show(result, resultText(result.survey, "scan"));
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
    if (this.found) drawSurvey(layer, plan, this.found.survey);
  }

  describeAt(px, plan) {
    return this.found ? describeStop(px, plan, this.found.survey.poses) : undefined;
  }
}

const sceneFile = (scene) => new Blob([`${JSON.stringify(scene, null, 2)}\n`], { type: "application/json" });
