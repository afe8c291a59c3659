// Client of the daemon's HTTP API: authorized requests, and a live stream that reconnects.

import { sentences } from "./format.js";

const TOKEN_KEY = "sonard-token";
const MIN_BACKOFF_MS = 500;
const MAX_BACKOFF_MS = 5000;
/** Timeout of the live stream, which sends a keep-alive every 15 s. */
const STREAM_TIMEOUT_MS = 40000;

/** Error response of the daemon, with its message and advice. */
export class ApiError extends Error {
  constructor(status, problem) {
    super(problem.error);
    this.status = status;
    this.help = problem.help;
    /** Setting at fault, such as `sensor.blanking_us`. @type {string | undefined} */
    this.field = problem.field;
  }
}

/** Ends the current back-off. */
let retryNow = () => {};
/** Open token dialog, shared by all requests that wait for it. */
let prompt = null;
/** Whether the last token dialog was cancelled; reads then fail without another dialog. */
let cancelled = false;

/** Called after a token was entered. */
let tokenEntered = () => {};
/** @param {() => void} listener */
export const onToken = (listener) => (tokenEntered = listener);

/** Prompts for the token until it is valid, or the dialog is cancelled. */
export async function enterToken() {
  let why = "starting scans and changing settings takes the token of server.token_file";
  while (await promptForToken({ message: why })) {
    const { write } = await requestJson("/v1/access");
    if (write === "yes") return;
    why = "the token is wrong";
  }
}

/** @typedef {{method?: string, body?: object, signal?: AbortSignal}} Request */

/** Returns the JSON of a response; opens the token dialog on 401. @param {string} path @param {Request} [request] */
export const requestJson = async (path, request = {}) => (await fetchAuthorized(path, request)).json();

/** Calls `onLine` with each line of a JSON Lines response. @param {string} path @param {Request} request @param {(line: any) => void} onLine */
export async function requestLines(path, request, onLine) {
  const response = await fetchAuthorized(path, request);
  await readLines(response.body, (line) => onLine(JSON.parse(line)));
}

/** Returns the body of a response as a file. @param {string} path @returns {Promise<Blob>} */
export const requestFile = async (path) => (await fetchAuthorized(path, {})).blob();

/** @param {string} path @param {Request} request */
async function fetchAuthorized(path, { method = "GET", body, signal } = {}) {
  for (;;) {
    const token = storedToken();
    const response = await send(path, { method, body, signal });
    if (response.ok || (path === "/v1/health" && response.status === 503)) return response;
    const error = await errorOf(response);
    // Another request has prompted for the token meanwhile.
    if (error.status === 401 && storedToken() !== token) continue;
    const needsToken = error.status === 401 && (method !== "GET" || !cancelled);
    if (!needsToken || !(await promptForToken(error))) throw error;
  }
}

/** Follows an event stream forever, reconnecting with back-off; `onState` receives `true` on connect and `false` on loss. */
export async function subscribe(path, onLine, onState) {
  let backoff_ms = MIN_BACKOFF_MS;
  for (;;) {
    const stop = new AbortController();
    try {
      const response = await send(path, { signal: stop.signal });
      if (!response.ok) throw await errorOf(response);
      backoff_ms = MIN_BACKOFF_MS;
      onState(true);
      await readEvents(response.body, onLine, stop);
    } catch (/** @type {any} */ error) {
      if (error instanceof ApiError && error.status === 401 && !cancelled) await promptForToken(error);
    }
    onState(false);
    await new Promise((/** @type {(value?: any) => void} */ done) => {
      retryNow = done;
      setTimeout(done, backoff_ms);
    });
    backoff_ms = Math.min(2 * backoff_ms, MAX_BACKOFF_MS);
  }
}

/** Reconnects the stream without waiting for the back-off. */
export const reconnectNow = () => retryNow();

const storedToken = () => sessionStorage.getItem(TOKEN_KEY);

/** @param {string} path @param {Request} request */
function send(path, { method = "GET", body, signal } = {}) {
  /** @type {Record<string, string>} */
  const headers = {};
  const token = storedToken();
  if (token) headers.Authorization = `Bearer ${token}`;
  if (body !== undefined) headers["Content-Type"] = "application/json";
  const text = body === undefined ? undefined : JSON.stringify(body);
  return fetch(path, { method, headers, body: text, signal, cache: "no-store" });
}

async function errorOf(response) {
  const problem = await response.json().catch(() => ({}));
  return new ApiError(response.status, { error: response.statusText, help: "", ...problem });
}

/** Reads server-sent events; aborts `stop` if none arrives in time. */
async function readEvents(body, onLine, stop) {
  let timeout = 0;
  const wait = () => {
    clearTimeout(timeout);
    timeout = setTimeout(() => stop.abort(), STREAM_TIMEOUT_MS);
  };
  wait();
  const onEvent = (line) => line.startsWith("data: ") && onLine(JSON.parse(line.slice(6)));
  await readLines(body, onEvent, wait).finally(() => clearTimeout(timeout));
}

/** Calls `onLine` with each complete line of a body, and `onPart` after each part of it. */
async function readLines(body, onLine, onPart = () => {}) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    onPart();
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    for (const line of lines) onLine(line);
  }
}

/** Opens the token dialog, or joins the open one; resolves to `true` if a token was entered. */
function promptForToken(error) {
  prompt ??= showDialog(error).finally(() => (prompt = null));
  return prompt;
}

function showDialog(error) {
  const [dialog, input] = ["token", "token-text"].map((id) => /** @type {any} */ (document.getElementById(id)));
  document.getElementById("token-why").textContent = sentences(error.message);
  input.value = "";
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((done) => {
    dialog.addEventListener(
      "close",
      () => {
        const entered = dialog.returnValue === "ok" && input.value.trim() !== "";
        if (entered) sessionStorage.setItem(TOKEN_KEY, input.value.trim());
        input.value = "";
        cancelled = !entered;
        if (entered) tokenEntered();
        done(entered);
      },
      { once: true },
    );
  });
}
