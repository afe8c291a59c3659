// Writes a script that contains the compressed WebAssembly module and the text of its worker.
// Usage: node pack.mjs MODULE.wasm WORKER.js
import { readFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const [wasm, worker] = process.argv.slice(2).map((name) => readFileSync(name));
const imports = WebAssembly.Module.imports(new WebAssembly.Module(wasm));
// Without imports the module can only compute.
if (imports.length > 0) throw new Error(`the module imports ${JSON.stringify(imports)}`);
const text = { wasm: gzipSync(wasm, { level: 9 }).toString("base64"), worker: worker.toString() };
process.stdout.write(`globalThis.SONARD_MODEL=${JSON.stringify(text)};\n`);
