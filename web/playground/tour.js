// The tour's card: its steps, and what is said instead where something else is shown.

import { setText } from "../../crates/sonard-daemon/src/server/page/words.js";
import { STEPS } from "./steps.js";

/** @param {string} id */
const byId = (id) => /** @type {any} */ (document.getElementById(id));

export class Tour {
  /** @param {(step: import("./steps.js").Step) => void} onStep */
  constructor(onStep) {
    this.onStep = onStep;
    this.step = -1;
    byId("tour-back").addEventListener("click", () => this.go(this.step - 1));
    byId("tour-next").addEventListener("click", () => this.go(this.step + 1));
  }

  /** @param {number} to */
  go(to) {
    this.step = to;
    this.onStep(STEPS[to]);
    this.say(STEPS[to].title, `${to + 1} of ${STEPS.length}`, STEPS[to].text);
  }

  /**
   * Something else is shown; the tour goes on where it was.
   * @param {string} title
   * @param {string} text
   */
  leave(title, text) {
    this.say(title, this.step + 1 < STEPS.length ? "the tour goes on with Next" : "", text);
  }

  /**
   * @param {string} title
   * @param {string} about
   * @param {string} text
   */
  say(title, about, text) {
    setText(byId("tour-title"), title);
    setText(byId("tour-count"), about);
    setText(byId("tour-text"), text);
    byId("tour-back").disabled = this.step < 1;
    byId("tour-next").disabled = this.step + 1 >= STEPS.length;
  }
}
