// Start and stop.

import { ask } from "./api.js";

/** `say` shows a sentence to everybody, also to those who listen. */
export function control(form, stop, say) {
  const order = async (path, body, done) => {
    try {
      await ask(path, { method: "POST", body });
      say(done);
    } catch (/** @type {any} */ error) {
      say(error.status ? `Refused: ${error.message}. ${error.help}` : "The daemon does not answer.");
    }
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const scans = Number(form.elements.scans.value);
    order("/v1/start", { scans }, scans === 1 ? "One scan asked for." : `${scans} scans asked for.`);
  });
  stop.addEventListener("click", () => order("/v1/stop", {}, "Stopped: no scan begins until the next start."));
}
