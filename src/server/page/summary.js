// What is said: in a line under the plan, read out by screen readers. Never once a beam.

import { count, setText } from "./words.js";

export class Summary {
  constructor(place) {
    this.place = place;
  }

  say(text) {
    setText(this.place, text);
  }

  began(scan) {
    this.say(`A scan of ${count(scan.planned, "beam")} is under way.`);
  }

  ended(scan) {
    this.say(`Scan over: ${scan.inWords()}.`);
  }

  /** The daemon is gone, and with it what it might say of the scan. */
  lost(scan) {
    this.say(`Heard last of the scan: ${scan.inWords()}. Whether it goes on is not known.`);
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
    if (kind === "explanation") this.say(`The last scan is ${detail.replace(of, "")}.`);
    else this.say(`${kind.replaceAll("_", " ")}: ${detail}`);
  }
}
