// A view as a link: compressed into the fragment, which browsers do not send to servers.

/** Maximum decompressed size of a link, bytes. */
const MAX_BYTES = 4 << 20;
/** Maximum decompressed size of a module, bytes. */
const MAX_MODULE_BYTES = 16 << 20;

/** Shows the link to a view in a dialog. @param {object} view */
export async function showLink(view) {
  const dialog = /** @type {HTMLDialogElement} */ (document.getElementById("shared"));
  const address = /** @type {HTMLInputElement} */ (document.getElementById("address"));
  const copy = /** @type {HTMLButtonElement} */ (document.getElementById("copy"));
  address.value = `${location.href.split("#")[0]}#${await pack(view)}`;
  copy.textContent = "Copy";
  copy.onclick = async () => {
    address.select();
    // Where the page may not write to the clipboard, the selection is copied.
    await navigator.clipboard?.writeText(address.value).catch(() => document.execCommand("copy"));
    copy.textContent = "Copied";
  };
  dialog.showModal();
  address.select();
}

/** @param {object} view */
export async function pack(view) {
  const text = new Blob([JSON.stringify(view)]).stream();
  const bytes = await readAll(text.pipeThrough(new CompressionStream("deflate-raw")), MAX_BYTES);
  const letters = Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
  return btoa(letters).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** @param {string} packed */
async function unpack(packed) {
  const letters = atob(packed.replaceAll("-", "+").replaceAll("_", "/"));
  const compressed = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  return JSON.parse(new TextDecoder().decode(await decompress(compressed, "deflate-raw", MAX_BYTES)));
}

/** Bytes of a WebAssembly module that a script contains, compressed, as base64. @param {string} packed */
export async function moduleBytes(packed) {
  const compressed = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  return (await decompress(compressed, "gzip", MAX_MODULE_BYTES)).buffer;
}

/**
 * @param {Uint8Array<ArrayBuffer>} bytes
 * @param {CompressionFormat} format
 * @param {number} max_bytes
 */
function decompress(bytes, format, max_bytes) {
  return readAll(new Blob([bytes]).stream().pipeThrough(new DecompressionStream(format)), max_bytes);
}

/**
 * @param {ReadableStream<Uint8Array<ArrayBuffer>>} stream
 * @param {number} max_bytes
 */
async function readAll(stream, max_bytes) {
  const reader = stream.getReader();
  const pieces = [];
  let length = 0;
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > max_bytes) throw new RangeError("decompressed data exceeds the limit");
    pieces.push(value);
  }
  return new Uint8Array(await new Blob(pieces).arrayBuffer());
}

/**
 * Returns the view in a link, or `null` if the link is invalid.
 * @template T
 * @param {string} packed
 * @param {(value: any) => T | null} parse
 */
export async function stateFromLink(packed, parse) {
  try {
    return parse(await unpack(packed));
  } catch {
    return null;
  }
}
