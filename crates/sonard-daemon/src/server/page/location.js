// Pose of the shown scan estimated from its readings (`GET /v1/scans/{scan}/location`): listed, drawn on the plan, and
// proposed for the next scan.

import { requestJson } from "./api.js";
import { make } from "./dom.js";
import { rounded } from "./ranger.js";
import { count, degrees, failure, sentences, setText } from "./format.js";

export class Locator {
  /**
   * @param {HTMLElement} section
   * @param {any} plan
   * @param {(change: (draft: any) => void) => void} propose
   */
  constructor(section, plan, propose) {
    this.plan = plan;
    this.propose = propose;
    /** Scan that was or is being located. @type {string | null} */
    this.scan = null;
    /** Scan of the estimate, and the most probable pose. @type {{scan: string, pose: any} | null} */
    this.located = null;
    this.button = make("button", { type: "button", id: "locate", textContent: "Locate" });
    this.use = make("button", { type: "button", id: "use-pose", className: "writes", textContent: "Use this pose", hidden: true });
    this.result = make("span", { id: "located", role: "status", className: "hint" });
    this.causes = make("ul", { id: "causes", className: "hint" });
    section.append(make("p", { className: "row" }, this.button, this.result, this.use), this.causes);
    this.button.addEventListener("click", () => this.locate());
    this.use.addEventListener("click", () => this.proposePose());
    plan.overlays.push(this);
  }

  async locate() {
    const { scan } = this.plan;
    if (!scan || scan.running) return setText(this.result, "Locate takes a complete scan.");
    this.scan = scan.id;
    this.show(null, "Locating …");
    this.button.disabled = true;
    try {
      const { poses, causes, unavailable_reason } = await requestJson(`/v1/scans/${scan.id}/location`);
      if (this.scan !== scan.id) return;
      const pose = nearestOf(poses, scan.start.pose);
      // A pose that explains few readings is not drawn or proposed.
      if (pose && !causes.length) this.show({ scan: scan.id, pose }, poseText(pose, poses.length));
      else this.show(null, unavailable_reason ? sentences(unavailable_reason) : "No pose fits the readings. Possible causes:", causes);
    } catch (/** @type {any} */ error) {
      this.show(null, failure("Not located", error));
    } finally {
      this.button.disabled = false;
    }
  }

  show(located, text, causes = []) {
    this.located = located;
    setText(this.result, text);
    this.causes.replaceChildren(...causes.map((cause) => make("li", { textContent: sentences(cause) })));
    this.use.hidden = !located;
    this.plan.drawOver();
    this.plan.onView();
  }

  /** Forgets the estimate of a scan that is no longer shown. */
  update() {
    if (!this.scan || this.scan === this.plan.scan?.id) return;
    this.scan = null;
    this.show(null, "");
  }

  proposePose() {
    const { x_m, y_m, heading_deg } = this.located.pose;
    this.propose((draft) => {
      draft.pose = { x_m: rounded(x_m, 4), y_m: rounded(y_m, 4), heading_deg: rounded(heading_deg, 2) };
    });
  }

  /** @param {any} layer @param {any} plan */
  drawOver(layer, plan) {
    if (this.located && this.located.scan === plan.scan?.id) plan.drawRobot(this.located.pose, "located", "located");
  }
}

/** Pose nearest to the assumed one among those that are at least half as probable as the best. */
function nearestOf(poses, { x_m, y_m }) {
  const likely = poses.filter(({ probability }) => 2 * probability >= poses[0].probability);
  const distance_m = (pose) => Math.hypot(pose.x_m - x_m, pose.y_m - y_m);
  return likely.reduce((best, pose) => (best && distance_m(best) <= distance_m(pose) ? best : pose), null);
}

function poseText({ x_m, y_m, heading_deg, probability, sigma_x_m, sigma_y_m, sigma_heading_deg, explained }, hypotheses) {
  const sigmas = `±${(1e3 * Math.max(sigma_x_m, sigma_y_m)).toFixed(2)} mm, ±${sigma_heading_deg.toFixed(2)}°`;
  const others = hypotheses > 1 ? `; ${count(hypotheses - 1, "other pose")} possible` : "";
  return `(${x_m.toFixed(3)}, ${y_m.toFixed(3)}) m, heading ${degrees(heading_deg)}, ${sigmas}; probability ${probability.toFixed(2)}, ${(100 * explained).toFixed(0)} % of the readings explained${others}`;
}
