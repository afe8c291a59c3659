// Card of the tour: its current step, or a text about a view outside the tour.

import { setText } from "../../crates/sonard-daemon/src/server/page/format.js";
import { STEPS } from "./steps.js";

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

export class Tour {
  /** @param {(step: import("./steps.js").Step) => void} onStep */
  constructor(onStep) {
    this.onStep = onStep;
    this.step = -1;
    byId("tour-back").addEventListener("click", () => this.goTo(this.step - 1));
    byId("tour-next").addEventListener("click", () => this.goTo((this.step + 1) % STEPS.length));
  }

  /** @param {number} step */
  goTo(step) {
    this.step = step;
    this.onStep(STEPS[step]);
    this.show(STEPS[step].title, `${step + 1} of ${STEPS.length}`, STEPS[step].text);
  }

  /**
   * Shows a view outside the tour; Next continues with the following step.
   * @param {string} title
   * @param {string} text
   */
  pause(title, text) {
    this.show(title, this.step + 1 < STEPS.length ? "press Next to continue the tour" : "", text);
  }

  /**
   * @param {string} title
   * @param {string} position
   * @param {string} text
   */
  show(title, position, text) {
    setText(byId("tour-title"), title);
    setText(byId("tour-count"), position);
    setText(byId("tour-text"), text);
    byId("tour-back").disabled = this.step < 1;
    setText(byId("tour-next"), this.step + 1 < STEPS.length ? "Next" : "Start again");
  }
}
