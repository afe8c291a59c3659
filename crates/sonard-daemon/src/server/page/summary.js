// Live region below the plan's title, read out by screen readers; updated per scan or event, never per beam.

import { count, sentences, setText } from "./format.js";

/** Minimum display time of the result of an action, however fast scans follow each other. */
const RESULT_MS = 3000;

export class Summary {
  constructor(element) {
    this.element = element;
    /** Runs while the result of an action is shown. */
    this.timer = null;
    /** Latest news of the scan, deferred until the timer ends. */
    this.pending = null;
    /** Summary of the last complete scan, which stays while the next one is running. */
    this.last = "";
  }

  /** Shows a text at once. */
  set(text) {
    clearTimeout(this.timer);
    this.timer = null;
    setText(this.element, text);
  }

  /** Shows the result of an action on this page; news of scans is deferred meanwhile. */
  setResult(text) {
    this.set(text);
    this.pending = null;
    this.timer = setTimeout(() => {
      this.timer = null;
      if (this.pending !== null) this.set(this.pending);
    }, RESULT_MS);
  }

  setNews(text) {
    if (this.timer === null) this.set(text);
    else this.pending = text;
  }

  scanStarted(scan) {
    this.setNews(sentences(`Scanning ${count(scan.planned, "beam")}`, this.last && `last scan: ${this.last}`));
  }

  scanEnded(scan) {
    this.last = scan.summary();
    this.setNews(sentences(scan.isStopped ? scan.summary() : `Scan complete: ${scan.summary()}`));
  }

  connectionLost(scan) {
    this.setNews(`Connection lost during this scan (${count(scan.beams.size, "beam")} received).`);
  }

  /** Shows a scan of the log. Running scans are summarized without counts, which are above the plan. */
  showScan(scan) {
    if (scan.replayed) this.set(`Replaying ${count(scan.planned, "beam")}`);
    else if (scan.running) this.scanStarted(scan);
    else this.set(sentences(`${scan.end ? "" : "Incomplete: "}${scan.summary()}`));
  }

  showEvent({ kind, detail }) {
    // Explanations refer to the last scan by its identifier, which users do not see.
    const scanId = /^scan [0-9a-f-]{36}: /;
    if (kind === "explanation") this.setNews(sentences(`last scan: ${this.last || detail.replace(scanId, "")}`, this.last && detail.replace(scanId, "")));
    else this.setNews(`${kind.replaceAll("_", " ")}: ${detail}`);
  }
}
