// Toolbar of the floor plan: zoom, fit, measure.

import { Measure } from "./measure.js";
import { make } from "./dom.js";

const KEYS = "arrow keys pan, plus and minus zoom, 0 fits the view, M measures";

/** Adds the toolbar to a plan; `onMove` is called after each change of the view. */
export function addTools(plan, onMove) {
  const { stage, view } = plan;
  const middle = () => [view.width / 2, view.height / 2];
  const zoom = (factor) => {
    view.zoom(factor, middle());
    plan.moveView();
  };
  const button = (text, name, onClick) => {
    const element = make("button", { type: "button", textContent: text, ariaLabel: name, title: name });
    element.addEventListener("click", onClick);
    return element;
  };
  const fit = button("Fit", "Fit the view", () => plan.show(view.mode));
  const ruler = button("Measure", "Measure a length", () => plan.measure.toggle());
  const output = make("output", { className: "measured", hidden: true });
  const bar = make("div", { className: "tools" }, button("+", "Zoom in", () => zoom(1.5)), button("−", "Zoom out", () => zoom(1 / 1.5)), fit, ruler);
  bar.role = "toolbar";
  bar.ariaLabel = "View of the plan";
  stage.append(bar, output);
  ruler.ariaPressed = "false";
  plan.measure = new Measure(plan, output, (on) => {
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
