// What is said: in a line under the plan, read out by screen readers. Never once a beam.

import { count, setText } from "./words.js";

/** For so long an answer stands, however fast scans follow each other. */
const ANSWER_MS = 3000;

export class Summary {
  constructor(place) {
    this.place = place;
    this.timer = null;
    this.news = null;
  }

  say(text) {
    clearTimeout(this.timer);
    this.timer = null;
    setText(this.place, text);
  }

  /** What came of something that was asked for on this page; news of scans waits behind it. */
  answer(text) {
    this.say(text);
    this.news = null;
    this.timer = setTimeout(() => {
      this.timer = null;
      if (this.news !== null) this.say(this.news);
    }, ANSWER_MS);
  }

  tell(text) {
    if (this.timer === null) this.say(text);
    else this.news = text;
  }

  began(scan) {
    this.tell(`A scan of ${count(scan.planned, "beam")} is under way.`);
  }

  ended(scan) {
    this.tell(`Scan over: ${scan.inWords()}.`);
  }

  /** The daemon is gone, and with it what it might say of the scan. */
  lost(scan) {
    this.tell(`Heard last of the scan: ${scan.inWords()}. Whether it goes on is not known.`);
  }

  /** Counts of a scan under way would be out of date at once: they stand above the plan. */
  shows(scan) {
    if (scan.replayed) this.say(`Replay of a scan of ${count(scan.planned, "beam")}.`);
    else if (scan.underWay) this.began(scan);
    else this.say(`${scan.end ? "" : "Not ended: "}${scan.inWords()}.`);
  }

  event({ kind, detail }) {
    // An explanation is of the last scan, which nobody knows by its id.
    const of = /^scan [0-9a-f-]{36}: /;
    if (kind === "explanation") this.tell(`The last scan is ${detail.replace(of, "")}.`);
    else this.tell(`${kind.replaceAll("_", " ")}: ${detail}`);
  }
}
