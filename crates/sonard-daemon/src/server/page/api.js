// The daemon's API: requests with the token, and the live stream that mends itself.

const TOKEN = "sonard-token";
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
// The stream shows a sign of life every 15 s.
const SILENCE_MS = 40000;

/** An answer that is not the one hoped for, in the daemon's own words. */
export class Refused extends Error {
  constructor(status, problem) {
    super(problem.error);
    this.status = status;
    this.help = problem.help;
  }
}

let wake = () => {};
let asking = null;
let declined = false;

/** @typedef {{method?: string, body?: object, signal?: AbortSignal}} Request */

/** The JSON of an answer; asks for the token where one is wanted. @param {string} path @param {Request} [request] */
export const ask = async (path, request = {}) => (await answerTo(path, request)).json();

/** An answer as a file. @param {string} path @returns {Promise<Blob>} */
export const askFile = async (path) => (await answerTo(path, {})).blob();

/** @param {string} path @param {Request} request */
async function answerTo(path, { method = "GET", body, signal } = {}) {
  for (;;) {
    const response = await send(path, { method, body, signal });
    if (response.ok || (path === "/v1/health" && response.status === 503)) return response;
    const refused = await refusal(response);
    const wants = refused.status === 401 && (method !== "GET" || !declined);
    if (!wants || !(await askToken(refused))) throw refused;
  }
}

/** Follows a stream of events for ever; `onState` hears whether it is there. */
export async function follow(path, onLine, onState) {
  let wait = FIRST_WAIT_MS;
  for (;;) {
    const stop = new AbortController();
    try {
      const response = await send(path, { signal: stop.signal });
      if (!response.ok) throw await refusal(response);
      wait = FIRST_WAIT_MS;
      onState(true);
      await readEvents(response.body, onLine, stop);
    } catch (/** @type {any} */ error) {
      if (error instanceof Refused && error.status === 401 && !declined) await askToken(error);
    }
    onState(false);
    await new Promise((/** @type {(value?: any) => void} */ done) => {
      wake = done;
      setTimeout(done, wait);
    });
    wait = Math.min(2 * wait, LONGEST_WAIT_MS);
  }
}

/** Tries the stream again at once: the daemon is known to be back. */
export const hurry = () => wake();

/** @param {string} path @param {Request} request */
function send(path, { method = "GET", body, signal } = {}) {
  /** @type {Record<string, string>} */
  const headers = {};
  const token = sessionStorage.getItem(TOKEN);
  if (token) headers.Authorization = `Bearer ${token}`;
  if (body !== undefined) headers["Content-Type"] = "application/json";
  const text = body === undefined ? undefined : JSON.stringify(body);
  return fetch(path, { method, headers, body: text, signal, cache: "no-store" });
}

async function refusal(response) {
  const problem = await response.json().catch(() => ({}));
  return new Refused(response.status, { error: problem.error ?? response.statusText, help: problem.help ?? "" });
}

async function readEvents(body, onLine, stop) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const silence = setTimeout(() => stop.abort(), SILENCE_MS);
    const { value, done } = await reader.read().finally(() => clearTimeout(silence));
    if (done) return;
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    for (const line of lines) if (line.startsWith("data: ")) onLine(JSON.parse(line.slice(6)));
  }
}

/** Asks for the token, once however many requests want it; whether there is one now. */
function askToken(refused) {
  asking ??= showDialog(refused).finally(() => (asking = null));
  return asking;
}

function showDialog(refused) {
  const [dialog, input] = ["token", "token-text"].map((id) => /** @type {any} */ (document.getElementById(id)));
  document.getElementById("token-why").textContent = `The daemon says: ${refused.message}.`;
  input.value = "";
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((done) => {
    dialog.addEventListener(
      "close",
      () => {
        const given = dialog.returnValue === "use" && input.value.trim() !== "";
        if (given) sessionStorage.setItem(TOKEN, input.value.trim());
        input.value = "";
        declined = !given;
        done(given);
      },
      { once: true },
    );
  });
}
