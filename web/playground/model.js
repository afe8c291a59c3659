// Client of the model's worker, which computes one view at a time.

/**
 * View to show: settings, pose and engines. Measured readings and the selected beam belong to the first engine.
 * @typedef {import("./engine.js").EngineName} EngineName
 * @typedef {{id: number, settings: import("./engine.js").Settings, pose: import("./engine.js").Pose,
 *   plan: import("./engine.js").ScanPlan, engines: EngineName[], measured: number | null, beam: number | null}} View
 */

/** Time after which an unfinished view is replaced by the next one. */
const REPLACE_AFTER_MS = 250;
/** Time without messages after which the worker is restarted if another view waits. */
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
    /** Times of the last view sent and the last message received. */
    this.startedAt = 0;
    this.lastMessageAt = 0;
    this.replaceTimer = 0;
    this.stuckTimer = 0;
    /** View being computed. @type {View | null} */
    this.current = null;
    /** View that waits. @type {View | null} */
    this.next = null;
    /** @type {{text: string, pose: object} | null} */
    this.log = null;
    /** @type {Map<number, {done: (response: any) => void, failed: (problem: any) => void}>} */
    this.pending = new Map();
    this.worker = this.startWorker();
  }

  startWorker() {
    const worker = new Worker(this.address);
    worker.onmessage = ({ data }) => this.handleMessage(data);
    worker.postMessage({ kind: "init", bytes: this.bytes });
    this.lastMessageAt = performance.now();
    return worker;
  }

  /**
   * Shows a view once the current one is done or has taken too long.
   * @param {Omit<View, "id">} view
   */
  show(view) {
    this.next = { id: ++this.id, ...view };
    if (!this.current) return this.send();
    clearTimeout(this.replaceTimer);
    const elapsed_ms = performance.now() - this.startedAt;
    this.replaceTimer = setTimeout(() => this.replace(), Math.max(0, REPLACE_AFTER_MS - elapsed_ms));
  }

  send() {
    clearTimeout(this.replaceTimer);
    [this.current, this.next, this.startedAt] = [this.next, null, performance.now()];
    if (this.current) this.worker.postMessage({ kind: "view", view: this.current });
  }

  replace() {
    if (!this.next) return;
    this.send();
    // A worker that sends nothing is in a long search and is replaced.
    clearTimeout(this.stuckTimer);
    this.stuckTimer = setTimeout(() => {
      if (this.current && this.lastMessageAt <= this.startedAt) this.restart(this.next ?? this.current);
    }, STUCK_MS);
  }

  /** Replaces the worker, reloads the log and shows a view. @param {View | null} view */
  restart(view) {
    this.worker.terminate();
    this.worker = this.startWorker();
    if (this.log) this.worker.postMessage({ kind: "load_log", id: 0, ...this.log });
    [this.current, this.next] = [null, view];
    if (view) this.send();
  }

  /**
   * @param {{kind: string, [key: string]: any}} message
   * @returns {Promise<any>}
   */
  request(message) {
    const id = ++this.id;
    if (message.kind === "load_log") this.log = { text: message.text, pose: message.pose };
    this.worker.postMessage({ ...message, id });
    return new Promise((done, failed) => this.pending.set(id, { done, failed }));
  }

  /** @param {any} message */
  handleMessage(message) {
    this.lastMessageAt = performance.now();
    const request = this.pending.get(message.id);
    if (request) {
      this.pending.delete(message.id);
      return message.kind === "response" ? request.done(message.response) : request.failed(message.problem);
    }
    if (message.id !== this.current?.id) return;
    const finished = message.kind === "done" || message.kind === "error";
    if (finished) this.current = null;
    this.onMessage(message);
    // After a trap the module's memory may be inconsistent.
    if (message.problem?.broken) return this.restart(this.next);
    if (finished && this.next) this.send();
  }
}
