// Text next to a point of the floor plan. Hidden from screen readers, which read the same text under the plan.

import { make } from "./dom.js";
import { setText } from "./format.js";

/** Distance of the text from the point, pixels. */
const OFFSET_PX = 14;

export class Tip {
  /** @param {HTMLElement} stage */
  constructor(stage) {
    this.stage = stage;
    this.element = make("p", { className: "tip", hidden: true, ariaHidden: "true" });
    stage.append(this.element);
  }

  /** @param {string} text @param {number[]} px */
  show(text, [x, y]) {
    const { element, stage } = this;
    setText(element, text);
    element.hidden = false;
    // To the right of the point and above it, as far as there is room.
    const [width, height] = [element.offsetWidth, element.offsetHeight];
    const left = x + OFFSET_PX + width < stage.clientWidth ? x + OFFSET_PX : Math.max(0, x - OFFSET_PX - width);
    const top = y - OFFSET_PX - height > 0 ? y - OFFSET_PX - height : Math.min(stage.clientHeight - height, y + OFFSET_PX);
    element.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
  }

  hide() {
    this.element.hidden = true;
  }
}
