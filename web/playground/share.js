// A view as a link: all of it, squeezed, after the `#`. Nothing of it goes to any server.

import { stateFrom } from "./state.js";

/** What a link may unpack to, bytes. */
const MOST_BYTES = 4 << 20;

/** Shows a link to a view, to be copied. @param {object} view */
export async function showLink(view) {
  const dialog = /** @type {HTMLDialogElement} */ (document.getElementById("shared"));
  const address = /** @type {HTMLInputElement} */ (document.getElementById("address"));
  const copy = /** @type {HTMLButtonElement} */ (document.getElementById("copy"));
  address.value = `${location.href.split("#")[0]}#${await pack(view)}`;
  copy.textContent = "Copy";
  copy.onclick = async () => {
    address.select();
    // Browsers that let no page write there copy what is selected.
    await navigator.clipboard?.writeText(address.value).catch(() => document.execCommand("copy"));
    copy.textContent = "Copied";
  };
  dialog.showModal();
  address.select();
}

/** @param {object} view */
async function pack(view) {
  const text = new Blob([JSON.stringify(view)]).stream();
  const bytes = await gather(text.pipeThrough(new CompressionStream("deflate-raw")), MOST_BYTES);
  const letters = Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
  return btoa(letters).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** @param {string} packed */
async function unpack(packed) {
  const letters = atob(packed.replaceAll("-", "+").replaceAll("_", "/"));
  const squeezed = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  return JSON.parse(new TextDecoder().decode(await unsqueeze(squeezed, "deflate-raw", MOST_BYTES)));
}

/**
 * @param {Uint8Array<ArrayBuffer>} bytes
 * @param {CompressionFormat} format
 * @param {number} most
 */
export function unsqueeze(bytes, format, most) {
  return gather(new Blob([bytes]).stream().pipeThrough(new DecompressionStream(format)), most);
}

/**
 * @param {ReadableStream<Uint8Array<ArrayBuffer>>} stream
 * @param {number} most
 */
async function gather(stream, most) {
  const reader = stream.getReader();
  const pieces = [];
  let length = 0;
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > most) throw new RangeError("there is too much in it");
    pieces.push(value);
  }
  return new Uint8Array(await new Blob(pieces).arrayBuffer());
}

/** The view in a link, or `null`. @param {string} packed */
export async function stateFromLink(packed) {
  try {
    return stateFrom(await unpack(packed));
  } catch {
    return null;
  }
}
