// Controls of scanning: take a number of scans, resume the scan mode, stop.

import { requestJson } from "./api.js";
import { count, failure } from "./format.js";

const ON_REQUEST = "on-request";

/** Connects the form; `announce` shows a sentence in the live region. Returns a function that takes status reports. */
export function addControls(form, announce) {
  const { scans, resume, stop } = form.elements;
  let mode = ON_REQUEST;
  const post = async (path, body, done) => {
    try {
      await requestJson(path, { method: "POST", body });
      announce(done);
    } catch (/** @type {any} */ error) {
      announce(failure("Rejected", error));
    }
  };
  const continueMode = () => post("/v1/start", {}, "Scanning resumed.");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const number = scans.value === "" ? null : Number(scans.value);
    if (number !== null) post("/v1/start", { scans: number }, `${count(number, "scan")} requested`);
    else if (mode === ON_REQUEST) announce("Scans are taken on request: enter their number.");
    else continueMode();
  });
  resume.addEventListener("click", continueMode);
  stop.addEventListener("click", () => post("/v1/stop", {}, "Scanning stopped."));
  return (status) => {
    const { paused } = status.scanning;
    mode = status.scanning.mode;
    resume.hidden = mode === ON_REQUEST;
    resume.disabled = !paused;
  };
}
