// Draws what Foxglove Studio shows of a mock's live scan: node picture.mjs PROGRAM LAYOUT PICTURE
//
// Serves this folder with the packages in it, and drives Chromium by its driver.

import { execFile, spawn } from "node:child_process";
import { once } from "node:events";
import fs from "node:fs";
import http from "node:http";
import os from "node:os";
import path from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";

const [program, layout, picture] = process.argv.slice(2);
const ROOT = path.dirname(fileURLToPath(import.meta.url));
const SIZE = { width: 1200, height: 750 };
const PLACE = ["--scene", "simple-room", "--pose", "fig9"];
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm" };

const started = [];
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "studio-"));

/** Starts a program that says where it listens; gives the port. */
function start(name, args, says) {
  // What Chromium leaves behind goes with the folder.
  const child = spawn(name, args, { env: { ...process.env, TMPDIR: folder } });
  started.push(child);
  return new Promise((resolve, reject) => {
    let said = "";
    const hear = (bytes) => {
      said += bytes;
      const port = says.exec(said)?.[1];
      if (port) resolve(port);
    };
    child.stdout.on("data", hear);
    child.stderr.on("data", hear);
    child.on("error", reject);
    child.on("exit", () => reject(new Error(`${name} ended: ${said}`)));
  });
}

/** Serves the page with its packages, and the layout; gives the origin. */
async function serve() {
  const server = http.createServer((request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    const file = pathname === "/layout.json" ? layout : path.join(ROOT, pathname);
    const stream = fs.createReadStream(file);
    stream.on("open", () => response.setHeader("Content-Type", TYPES[path.extname(file)] ?? "application/octet-stream"));
    stream.on("error", () => response.writeHead(404).end());
    stream.pipe(response);
  });
  await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
  return `http://localhost:${server.address().port}`;
}

/** Opens a window of Chromium; gives what sends commands to its driver. */
async function browser() {
  const port = await start("chromedriver", ["--port=0"], /successfully on port (\d+)/);
  let session = `http://127.0.0.1:${port}/session`;
  const send = async (method, command, body) => {
    const answer = await fetch(session + command, { method, body: body && JSON.stringify(body) });
    const { value } = await answer.json();
    if (value?.error) throw new Error(value.message);
    return value;
  };
  const args = ["--headless=new", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader", "--hide-scrollbars"];
  // Chromium's sandbox refuses to run as root.
  if (process.getuid() === 0) args.push("--no-sandbox");
  const alwaysMatch = { browserName: "chrome", "goog:chromeOptions": { args } };
  const { sessionId } = await send("POST", "", { capabilities: { alwaysMatch } });
  session += `/${sessionId}`;
  // The page has the size, not the window around it.
  const params = { ...SIZE, deviceScaleFactor: 1, mobile: false };
  await send("POST", "/goog/cdp/execute", { cmd: "Emulation.setDeviceMetricsOverride", params });
  return send;
}

async function main() {
  const origin = await serve();
  const socket = path.join(folder, "socket");
  const port = await start(program, [
    "run", "--mock", "--realtime", ...PLACE, "--log", path.join(folder, "log"), "--socket", socket,
    "--set", "server.listen=127.0.0.1:0", "--set", "scanning.mode=on-request",
    "--set", "foxglove.enabled=true", "--set", `foxglove.origins=["${origin}"]`,
  ], /http:\/\/127.0.0.1:(\d+)/);
  const send = await browser();
  const source = new URLSearchParams({ ds: "foxglove-websocket", "ds.url": `ws://localhost:${port}/foxglove/` });
  await send("POST", "/url", { url: `${origin}/index.html?${source}` });
  // One: its paths are drawn at its end, slowly without a graphics card, and Studio places residuals, which have no stamps,
  // by when it gets to them.
  const scan = ["scan", "--daemon", "--socket", socket, ...PLACE, "--out", path.join(folder, "out")];
  await promisify(execFile)(program, scan);
  await sleep(5000);
  const shown = await send("POST", "/execute/sync", { script: "return document.body.innerText", args: [] });
  if (!/frame_id\s+"sonar"/.test(shown)) throw new Error(`Studio shows no reading, but:\n${shown}`);
  fs.writeFileSync(picture, Buffer.from(await send("GET", "/screenshot"), "base64"));
  await send("DELETE", "");
}

try {
  await main();
} finally {
  const running = started.filter((child) => child.exitCode === null);
  await Promise.all(running.map((child) => (child.kill(), once(child, "exit"))));
  fs.rmSync(folder, { recursive: true, force: true, maxRetries: 10 });
}
process.exit();
