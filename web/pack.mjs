// Writes a script that contains the compressed WebAssembly module and the text of its worker.
// Usage: node pack.mjs GLOBAL MODULE.wasm WORKER.js NODE_MODULES [IMPORT...]
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [global, , , modules, ...allowed] = process.argv.slice(2);
const [wasm, worker] = process.argv.slice(3, 5).map((name) => readFileSync(name));
// Its files are a few percent smaller than those of zlib, and are read like them.
const { gzipAsync } = createRequire(`${modules}/`)("@gfx/zopfli");
const imports = WebAssembly.Module.imports(new WebAssembly.Module(wasm)).map(({ module, name }) => `${module}.${name}`).sort();
// Without other imports the module can only compute.
if (String(imports) !== String(allowed)) throw new Error(`the module imports ${imports}, not ${allowed}`);
const compressed = await gzipAsync(wasm, { numiterations: 5 });
const text = { wasm: Buffer.from(compressed).toString("base64"), worker: worker.toString() };
process.stdout.write(`globalThis.${global}=${JSON.stringify(text)};\n`);
