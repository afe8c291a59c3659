// The buttons on the floor plan: zoom, fit, measure.

import { Measure } from "./measure.js";
import { make } from "./dom.js";

const KEYS = "arrow keys move it, plus and minus zoom, 0 fits it, M measures";

/** Puts them on the stage of a plan. `onMove` hears of every other view. */
export function addTools(plan, onMove) {
  const { stage, view } = plan;
  const middle = () => [view.width / 2, view.height / 2];
  const zoom = (factor) => {
    view.zoom(factor, middle());
    plan.moveView();
  };
  const button = (text, name, doing) => {
    const made = make("button", { type: "button", textContent: text, ariaLabel: name, title: name });
    made.addEventListener("click", doing);
    return made;
  };
  const fit = button("Fit", "Fit the view", () => plan.show(view.what));
  const ruler = button("Measure", "Measure a length", () => plan.measure.toggle());
  const told = make("output", { className: "measured", hidden: true });
  const bar = make("div", { className: "tools" }, button("+", "Zoom in", () => zoom(1.5)), button("−", "Zoom out", () => zoom(1 / 1.5)), fit, ruler);
  bar.role = "toolbar";
  bar.ariaLabel = "View of the plan";
  stage.append(bar, told);
  ruler.ariaPressed = "false";
  plan.measure = new Measure(plan, told, (on) => {
    ruler.ariaPressed = String(on);
    stage.classList.toggle("measuring", on);
  });
  stage.tabIndex = 0;
  stage.role = "application";
  stage.ariaLabel = `Floor plan: ${KEYS}`;
  plan.onView = () => {
    stage.classList.toggle("moved", view.moved);
    fit.disabled = !view.moved;
    onMove();
  };
  plan.onView();
}
