// Writes a script that contains the compressed WebAssembly module and the text of its worker.
// Usage: node pack.mjs MODULE.wasm WORKER.js NODE_MODULES
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [wasm, worker] = process.argv.slice(2, 4).map((name) => readFileSync(name));
// Its files are a few percent smaller than those of zlib, and are read like them.
const { gzipAsync } = createRequire(`${process.argv[4]}/`)("@gfx/zopfli");
const imports = WebAssembly.Module.imports(new WebAssembly.Module(wasm));
// Without imports the module can only compute.
if (imports.length > 0) throw new Error(`the module imports ${JSON.stringify(imports)}`);
const compressed = await gzipAsync(wasm, { numiterations: 5 });
const text = { wasm: Buffer.from(compressed).toString("base64"), worker: worker.toString() };
process.stdout.write(`globalThis.SONARD_MODEL=${JSON.stringify(text)};\n`);
