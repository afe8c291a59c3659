// Module of surveys, loaded when it is needed: a worker for rooms and sweeps, and one for the running survey.

import { ModelError } from "./engine.js";
import { moduleBytes } from "./share.js";

/**
 * Loads the script with the packed module.
 * @param {string} address
 * @returns {Promise<{wasm: string, worker: string}>}
 */
function loadScript(address) {
  return new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = address;
    script.onload = () => done(/** @type {any} */ (globalThis).SONARD_SURVEY);
    script.onerror = () => failed(new Error(`${address} cannot be loaded`));
    document.head.append(script);
  });
}

export class SurveyModule {
  /** @param {string} address of the script with the packed module */
  static async load(address) {
    const { wasm, worker } = await loadScript(address);
    return new SurveyModule(await moduleBytes(wasm), worker);
  }

  /**
   * @param {ArrayBuffer} bytes
   * @param {string} script
   */
  constructor(bytes, script) {
    const address = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.quick = new Client(bytes, address);
    this.surveyor = new Client(bytes, address);
  }

  /** @param {object} request */
  request(request) {
    return this.quick.request(request);
  }

  /**
   * Runs a survey; rejects with an `AbortError` once it is cancelled.
   * @param {object[]} sweeps
   * @param {(progress: any) => void} onProgress
   */
  survey(sweeps, onProgress) {
    this.surveyor.onProgress = onProgress;
    return this.surveyor.request({ type: "survey", sweeps });
  }

  /** Ends the running survey, if there is one. */
  cancel() {
    if (this.surveyor.pending.size) this.surveyor.restart();
  }
}

/** Worker with the requests that it has not answered. */
class Client {
  /**
   * @param {ArrayBuffer} bytes of the WebAssembly module
   * @param {string} address of the worker's script
   */
  constructor(bytes, address) {
    this.bytes = bytes;
    this.address = address;
    this.id = 0;
    /** @type {Map<number, {done: (response: any) => void, failed: (error: any) => void}>} */
    this.pending = new Map();
    this.onProgress = (/** @type {any} */ _progress) => {};
    this.worker = this.start();
  }

  start() {
    const worker = new Worker(this.address);
    worker.onmessage = ({ data }) => this.handleMessage(data);
    worker.postMessage({ bytes: this.bytes });
    return worker;
  }

  /** Replaces the worker; pending requests are rejected. */
  restart() {
    this.worker.terminate();
    this.worker = this.start();
    for (const { failed } of this.pending.values()) failed(new DOMException("cancelled", "AbortError"));
    this.pending.clear();
  }

  /**
   * @param {object} request
   * @returns {Promise<any>}
   */
  request(request) {
    const id = ++this.id;
    this.worker.postMessage({ id, request });
    return new Promise((done, failed) => this.pending.set(id, { done, failed }));
  }

  /** @param {any} message */
  handleMessage({ progress, id, response, problem }) {
    if (progress) return this.onProgress(progress);
    const request = this.pending.get(id);
    this.pending.delete(id);
    if (!problem) return request?.done(response);
    request?.failed(new ModelError(problem));
    // After a trap the module's memory may be inconsistent.
    if (problem.broken) this.restart();
  }
}
