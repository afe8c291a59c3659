// The page's side of the model: one worker, which is asked for one view at a time.

/**
 * What is to be shown: settings, where the ranger stands, and by which engines; the first one is the
 * one that a log's readings and the selected beam are of.
 * @typedef {import("./engine.js").EngineName} EngineName
 * @typedef {{id: number, settings: import("./engine.js").Settings, pose: import("./engine.js").Pose,
 *   plan: import("./engine.js").ScanPlan, engines: EngineName[], measured: number | null, beam: number | null}} View
 */

/** A view that is not done by then gives way to the next one. */
const PATIENCE_MS = 250;
/** A search that is silent for so long is given up with its worker when something else is wanted. */
const STUCK_MS = 4000;

export class Model {
  /**
   * @param {ArrayBuffer} bytes of the WebAssembly module
   * @param {string} script of the worker
   * @param {(message: any) => void} onMessage
   */
  constructor(bytes, script, onMessage) {
    this.bytes = bytes;
    this.address = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.onMessage = onMessage;
    this.id = 0;
    this.began = 0;
    this.heard = 0;
    this.waiting = 0;
    this.watching = 0;
    /** @type {View | null} */
    this.busy = null;
    /** @type {View | null} */
    this.next = null;
    /** @type {{text: string, pose: object} | null} */
    this.log = null;
    /** @type {Map<number, {done: (answer: any) => void, failed: (problem: any) => void}>} */
    this.questions = new Map();
    this.worker = this.start();
  }

  start() {
    const worker = new Worker(this.address);
    worker.onmessage = ({ data }) => this.take(data);
    worker.postMessage({ kind: "begin", bytes: this.bytes });
    this.heard = performance.now();
    return worker;
  }

  /**
   * Shows a view as soon as the one before is done, or has taken long.
   * @param {Omit<View, "id">} view
   */
  show(view) {
    this.next = { id: ++this.id, ...view };
    if (!this.busy) return this.send();
    clearTimeout(this.waiting);
    const since = performance.now() - this.began;
    this.waiting = setTimeout(() => this.overtake(), Math.max(0, PATIENCE_MS - since));
  }

  send() {
    clearTimeout(this.waiting);
    [this.busy, this.next, this.began] = [this.next, null, performance.now()];
    if (this.busy) this.worker.postMessage({ kind: "view", view: this.busy });
  }

  overtake() {
    if (!this.next) return;
    this.send();
    this.watch();
  }

  /** A worker that does not answer is deep in a search: another one takes its place. */
  watch() {
    clearTimeout(this.watching);
    this.watching = setTimeout(() => {
      if (!this.busy || this.heard > this.began) return;
      this.restart();
    }, STUCK_MS);
  }

  restart() {
    this.worker.terminate();
    this.worker = this.start();
    const view = this.next ?? this.busy;
    if (this.log) this.worker.postMessage({ kind: "log", id: 0, ...this.log });
    [this.busy, this.next] = [null, view];
    this.send();
  }

  /**
   * @param {{kind: string, [key: string]: any}} question
   * @returns {Promise<any>}
   */
  ask(question) {
    const id = ++this.id;
    if (question.kind === "log") this.log = { text: question.text, pose: question.pose };
    this.worker.postMessage({ ...question, id });
    return new Promise((done, failed) => this.questions.set(id, { done, failed }));
  }

  /** @param {any} message */
  take(message) {
    this.heard = performance.now();
    const question = this.questions.get(message.id);
    if (question) {
      this.questions.delete(message.id);
      return message.kind === "answer" ? question.done(message.answer) : question.failed(message.problem);
    }
    if (message.id !== this.busy?.id) return;
    const over = message.kind === "done" || message.kind === "refused";
    if (over) this.busy = null;
    this.onMessage(message);
    if (message.problem?.broken) return this.broken();
    if (over && this.next) this.send();
  }

  /** After a breakdown the module's memory is not to be trusted. */
  broken() {
    const next = this.next;
    this.worker.terminate();
    this.worker = this.start();
    if (this.log) this.worker.postMessage({ kind: "log", id: 0, ...this.log });
    [this.busy, this.next] = [null, next];
    if (next) this.send();
  }
}
