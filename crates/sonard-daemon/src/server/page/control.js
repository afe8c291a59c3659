// Start and stop buttons.

import { requestJson } from "./api.js";
import { count, failure } from "./format.js";

/** Connects the form and the stop button; `announce` shows a sentence in the live region. */
export function addControls(form, stop, announce) {
  const post = async (path, body, done) => {
    try {
      await requestJson(path, { method: "POST", body });
      announce(done);
    } catch (/** @type {any} */ error) {
      announce(failure("Rejected", error));
    }
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const scans = Number(form.elements.scans.value);
    post("/v1/start", { scans }, `${count(scans, "scan")} requested`);
  });
  stop.addEventListener("click", () => post("/v1/stop", {}, "Scanning stopped."));
}
