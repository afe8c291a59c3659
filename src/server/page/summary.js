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
    this.say(scan.end ? `${scan.inWords()}.` : `A scan of ${scan.planned} beams that has not ended.`);
  }

  event({ kind, detail }) {
    this.say(`${kind.replaceAll("_", " ")}: ${detail}`);
  }
}
