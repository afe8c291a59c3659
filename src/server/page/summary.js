// What is said: in a line under the plan, read out by screen readers. Never once a beam.

import { setText } from "./words.js";

export class Summary {
  constructor(place) {
    this.place = place;
  }

  say(text) {
    setText(this.place, text);
  }

  began(scan) {
    this.say(`A scan of ${scan.planned} beams began.`);
  }

  ended(scan) {
    this.say(`Scan over: ${scan.inWords()}.`);
  }

  shows(scan) {
    const course = scan.end ? "" : scan.underWay ? "Under way: " : "Not ended: ";
    this.say(`${course}${scan.inWords()}.`);
  }

  event({ kind, detail }) {
    this.say(`${kind.replaceAll("_", " ")}: ${detail}`);
  }
}
