// Compares the live messages of the daemon with its log of the same scans.
//
//   tests/peers/foxglove.sh [PROGRAM]        starts daemons and calls this script
//   foxglove.mjs watch ADDRESS TOKEN_FILE    subscribes to every topic until it is stopped
//
// Foxglove's client library subscribes to every topic, its decoders read the messages; the log is parsed here, without sonard.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

/** Number of compared scans; a preceding one makes the daemon advertise all topics. */
const SCANS = 2;
const [name, address, tokenFile, folder, program] = process.argv.slice(2);
const token = fs.readFileSync(tokenFile, "utf8");
const radians = (degrees) => (degrees * Math.PI) / 180;

/** Connects a viewer with a subprotocol and subscribes to every advertised topic. */
function connect(protocol) {
  const url = `ws://${address}/foxglove/?token=${token}`;
  const client = new FoxgloveClient({ ws: new WebSocket(url, [protocol]) });
  const viewer = { client, info: undefined, messages: new Map(), words: [], topics: new Map() };
  const readers = new Map();
  client.on("serverInfo", (info) => (viewer.info = info));
  client.on("status", (status) => viewer.words.push(status.message));
  client.on("error", (error) => assert.fail(String(error)));
  client.on("advertise", (channels) => {
    for (const channel of channels) {
      assert.deepEqual([channel.encoding, channel.schemaEncoding], ["cdr", "ros2msg"]);
      const definitions = parse(channel.schema, { ros2: true });
      readers.set(client.subscribe(channel.id), [channel.topic, new MessageReader(definitions)]);
      viewer.topics.set(channel.topic, channel.schemaName);
      viewer.messages.set(channel.topic, []);
    }
  });
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const [topic, reader] = readers.get(subscriptionId);
    viewer.messages.get(topic).push({ at: timestamp, message: reader.readMessage(data) });
  });
  return viewer;
}

async function until(what, is) {
  for (let waited = 0; waited < 60_000; waited += 50) {
    if (is()) return;
    await new Promise((done) => setTimeout(done, 50));
  }
  assert.fail(`timeout: no ${what}`);
}

async function request(method, route, body) {
  const headers = { Authorization: `Bearer ${token}`, "Content-Type": "application/json" };
  const answer = await fetch(`http://${address}${route}`, { method, headers, body });
  assert(answer.ok, `${route}: ${answer.status}`);
  return answer.json();
}

function readLog() {
  const log = { session: undefined, scans: [] };
  for (const file of fs.readdirSync(folder).filter((file) => file.endsWith(".jsonl")).sort()) {
    for (const line of fs.readFileSync(path.join(folder, file), "utf8").split("\n").filter(Boolean)) {
      const record = JSON.parse(line);
      // Only the first session of a log contains the scene's text.
      if (record.type === "session") log.session = { scene_text: log.session?.scene_text, ...record };
      if (record.type === "scan_start") log.scans.push({ start: record, pings: [] });
      if (record.type === "ping") log.scans.at(-1).pings.push(record);
    }
  }
  const { model, sensor, air } = log.session;
  log.max = model?.max_range_m ?? sensor.max_range_m;
  log.min = (air.sound_speed_m_s * sensor.blanking_us * 1e-6) / 2;
  log.window = (2 * log.max) / air.sound_speed_m_s;
  return log;
}

/** Rounds a number to 32-bit floating point. */
const single = (value) => Math.fround(value);

function near(value, expected, tolerance, what) {
  assert(value === expected || Math.abs(value - expected) <= tolerance, `${what}: ${value} is not ${expected}`);
}

/** Nanoseconds since 1970 of a log's time; Date has milliseconds only. */
function nanoseconds(time) {
  const [whole, fraction = ""] = time.replace("Z", "").split(".");
  return BigInt(Date.parse(`${whole}Z`)) * 1_000_000n + BigInt(fraction.padEnd(9, "0"));
}

const stampOf = ({ sec, nsec, nanosec }) => BigInt(sec) * 1_000_000_000n + BigInt(nsec ?? nanosec);

function expectedRange(reading) {
  return { echo: reading.range_m, no_echo: Infinity, min_range: -Infinity }[reading.status];
}

function compareRanges(messages, log) {
  let compared = 0;
  const expected = new Map();
  for (const ping of log.scans.flatMap((scan) => scan.pings)) {
    const above = ping.ranger ? `/sonar/${ping.ranger}` : "/sonar";
    const predicted = ping.ranger ? `/sonar/predicted/${ping.ranger}/range` : "/sonar/predicted/range";
    const frame = ping.ranger ? `sonar_${ping.ranger}` : "sonar";
    const readings = [[`${above}/range`, ping], [predicted, ping.sim]];
    for (const [topic, reading] of readings) {
      const range = reading && expectedRange(reading);
      if (range == null) continue;
      expected.set(topic, [...(expected.get(topic) ?? []), { range, frame, time: ping.time }]);
    }
    if (ping.residual_m != null) {
      const topic = `${above}/residual`;
      expected.set(topic, [...(expected.get(topic) ?? []), { residual: ping.residual_m, time: ping.time }]);
    }
  }
  for (const [topic, readings] of expected) {
    assert.equal(messages.get(topic)?.length, readings.length, topic);
    messages.get(topic).forEach(({ at, message }, place) => {
      const { range, residual, frame, time } = readings[place];
      // Told when its window ends, before the motor steps on.
      near(Number(at - nanoseconds(time)) * 1e-9, log.window, 2e-8, `${topic}: time`);
      compared += 1;
      if (residual !== undefined) {
        assert.deepEqual({ ...message }, { data: residual }, topic);
        return;
      }
      assert.equal(stampOf(message.header.stamp), nanoseconds(time), `${topic}: stamp`);
      assert.equal(message.header.frame_id, frame);
      assert.deepEqual([message.range, message.variance, message.radiation_type], [single(range), 0, 0], topic);
      near(message.min_range, log.min, 1e-6, "min_range");
      near(message.max_range, log.max, 1e-6, "max_range");
      assert(message.field_of_view > 0.05 && message.field_of_view < 1, `${message.field_of_view} rad`);
    });
  }
  return compared;
}

function compareScans(messages, log) {
  if (log.session.array) {
    assert(!messages.has("/sonar/scan"));
    return;
  }
  assert.equal(messages.get("/sonar/scan").length, log.scans.length);
  messages.get("/sonar/scan").forEach(({ message }, place) => {
    const { start, pings } = log.scans[place];
    const { from_deg: from, step_deg: step } = start.plan;
    near(message.angle_min, radians(from), 1e-6, "angle_min");
    near(message.angle_increment, radians(step), 1e-8, "angle_increment");
    near(message.angle_max, radians(from + step * (message.ranges.length - 1)), 1e-6, "angle_max");
    near(message.range_min, log.min, 1e-6, "range_min");
    near(message.range_max, log.max, 1e-6, "range_max");
    assert.equal(stampOf(message.header.stamp), nanoseconds(pings[0].time), "stamp");
    assert.equal(message.header.frame_id, "sonar_mount");
    const gone = Number(nanoseconds(pings.at(-1).time) - nanoseconds(pings[0].time)) * 1e-9;
    near(message.time_increment, gone / (pings.length - 1), 1e-5, "time_increment");
    near(message.scan_time, gone + log.window, 1e-4, "scan_time");
    assert.equal(message.ranges.length, pings.length);
    pings.forEach((ping) => assert.equal(message.ranges[ping.index], single(expectedRange(ping) ?? NaN)));
    assert.equal(message.intensities.length, 0);
  });
}

/** Where a ranger on its axis was and looked. */
function placeOf(ping, scan, log) {
  const { x_m: x, y_m: y, heading_deg: heading } = ping.pose ?? scan.start.pose;
  const ranger = log.session.array?.rangers.find(({ id }) => id === ping.ranger);
  const turn = radians(heading);
  const [ahead, left] = [ranger?.x_m ?? 0, ranger?.y_m ?? 0];
  return {
    x: x + ahead * Math.cos(turn) - left * Math.sin(turn),
    y: y + ahead * Math.sin(turn) + left * Math.cos(turn),
    direction: turn + radians(ranger?.bearing_deg ?? ping.azimuth_deg),
  };
}

function* pointsOf(message) {
  const view = new DataView(message.data.buffer, message.data.byteOffset, message.data.byteLength);
  const read = { 5: "getInt32", 6: "getUint32", 7: "getFloat32" };
  for (let at = 0; at < message.data.byteLength; at += message.point_step) {
    const fields = message.fields.map(({ name, offset, datatype }) => [name, view[read[datatype]](at + offset, true)]);
    yield Object.fromEntries(fields);
  }
}

function comparePoints(messages, log) {
  for (const [topic, reading] of [["/sonar/points", (ping) => ping], ["/sonar/predicted/points", (ping) => ping.sim]]) {
    const scans = log.scans.filter((scan) => scan.pings.some(reading));
    assert.equal(messages.get(topic)?.length ?? 0, scans.length, topic);
    (messages.get(topic) ?? []).forEach(({ message }, place) => {
      const scan = scans[place];
      assert.equal(message.header.frame_id, "map");
      assert.equal(stampOf(message.header.stamp), nanoseconds(scan.pings[0].time), topic);
      const points = [...pointsOf(message)];
      const echoes = scan.pings.filter((ping) => reading(ping)?.status === "echo");
      assert.deepEqual(points.map(({ index }) => index), echoes.map(({ index }) => index), topic);
      points.forEach((point, number) => {
        const ping = echoes[number];
        const { x, y, direction } = placeOf(ping, scan, log);
        const { range_m: range, margin_db: margin } = reading(ping);
        near(point.x, x + range * Math.cos(direction), 1e-5, `${topic}: x`);
        near(point.y, y + range * Math.sin(direction), 1e-5, `${topic}: y`);
        assert.equal(point.range, single(range));
        assert.equal(point.residual, single(ping.residual_m ?? NaN));
        assert.equal(point.intensity, single(margin ?? NaN));
        const since = Number(nanoseconds(ping.time) - nanoseconds(scan.pings[0].time)) * 1e-9;
        near(point.time, since, 1e-5, `${topic}: time`);
        assert.equal(point.order, (reading(ping).path ?? ping.sim?.path)?.order ?? -1, `${topic}: order`);
      });
    });
  }
}

const yaw = ({ z, w }) => 2 * Math.atan2(z, w);

/** From map to the face of each ranger at the stamp of each of its readings. */
function compareTransforms(messages, log) {
  const placed = new Map();
  for (const topic of ["/tf", "/tf_static"]) {
    for (const { header, child_frame_id: child, transform } of messages.get(topic).flatMap((one) => one.message.transforms)) {
      placed.set(topic === "/tf" ? `${child} ${stampOf(header.stamp)}` : child, { parent: header.frame_id, ...transform });
    }
  }
  for (const scan of log.scans) {
    for (const ping of scan.pings) {
      const at = nanoseconds(ping.time);
      const base = placed.get(`base_link ${at}`);
      const face = ping.ranger ? placed.get(`sonar_${ping.ranger}`) : placed.get(`sonar ${at}`);
      assert.deepEqual([base.parent, face.parent], ["map", ping.ranger ? "base_link" : "sonar_mount"]);
      const [turn, { x, y }] = [yaw(base.rotation), face.translation];
      const expected = placeOf(ping, scan, log);
      near(base.translation.x + x * Math.cos(turn) - y * Math.sin(turn), expected.x, 1e-9, "x");
      near(base.translation.y + x * Math.sin(turn) + y * Math.cos(turn), expected.y, 1e-9, "y");
      const off = turn + yaw(face.rotation) - expected.direction;
      near(Math.sin(off / 2), 0, 1e-9, "direction");
    }
  }
}

/** The length of a marker's lines. */
function length({ points }) {
  let sum = 0;
  for (let at = 0; at < points.length; at += 2) {
    const [a, b] = points.slice(at, at + 2);
    sum += Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  }
  return sum;
}

function compareMarkers(messages, log) {
  assert.equal(messages.get("/sonar/paths").length, log.scans.length);
  messages.get("/sonar/paths").forEach(({ message }, place) => {
    const lengths = { specular: 0, diffracted: 0, scattered: 0 };
    for (const ping of log.scans[place].pings) {
      const reading = [ping, ping.sim ?? {}].find(({ path, status }) => path && ["echo", "min_range"].includes(status));
      if (reading) lengths[reading.path.kind] += reading.path.length_m;
    }
    for (const marker of message.markers) {
      assert.deepEqual([marker.type, marker.header.frame_id], [5, "map"]);
      // The log rounds points to a micrometre.
      near(length(marker), lengths[marker.ns], 1e-5 * Math.max(1, marker.points.length), marker.ns);
      assert.equal(marker.action, marker.points.length > 0 ? 0 : 2);
    }
  });
  const scene = messages.get("/sonar/scene").at(-1).message.markers;
  const segments = JSON.parse(log.session.scene_text).walls.flatMap(({ from, to, polyline, closed }) => {
    const corners = polyline ? [...polyline, ...(closed ? [polyline[0]] : [])] : [from, to];
    return corners.slice(1).map((corner, place) => [corners[place], corner]);
  });
  const drawn = scene.find(({ ns }) => ns === "walls").points.map(({ x, y }) => [x, y]);
  assert.deepEqual(drawn, segments.flat());
}

/** Compares the last map with the files that `sonard map` writes for the log. */
function compareMap(messages) {
  const made = `${folder}-map`;
  execFileSync(program, ["map", folder, "--out", made], { stdio: "ignore" });
  const words = fs.readFileSync(path.join(made, "map.yaml"), "utf8");
  const [x, y] = words.match(/origin: \[(.*)\]/)[1].split(",").map(Number);
  const image = fs.readFileSync(path.join(made, "map.pgm"));
  const [head, width, height] = image.toString("latin1").match(/^P5\n(\d+) (\d+)\n255\n/).map((part, place) => (place ? Number(part) : part));
  const { header, info, data } = messages.get("/map").at(-1).message;
  assert.deepEqual([info.width, info.height, header.frame_id], [width, height, "map"]);
  assert.deepEqual([info.origin.position.x, info.origin.position.y, info.resolution], [x, y, single(0.05)]);
  assert.equal(data.length, width * height);
  let known = 0;
  data.forEach((percent, place) => {
    const pixel = image[head.length + (height - 1 - Math.floor(place / width)) * width + (place % width)];
    // Unknown cells are 128 in the image; the image rounds to 1/255, the message to 1/100.
    if (percent === -1) assert.equal(pixel, 128, `cell ${place}`);
    else near(percent / 100, 1 - pixel / 255, 0.5 / 100 + 0.5 / 255 + 1e-9, `cell ${place}`);
    known += percent === -1 ? 0 : 1;
  });
  assert(known > 50, `${known} cells are known`);
  return data.length;
}

if (name === "watch") {
  connect("foxglove.sdk.v1");
  await new Promise(() => {});
}
const viewers = ["foxglove.sdk.v1", "foxglove.websocket.v1"].map(connect);
await until("server information", () => viewers.every((viewer) => viewer.info));
for (let scan = 0; scan <= SCANS; scan += 1) {
  await request("POST", "/v1/start", JSON.stringify({ scans: 1 }));
  const whole = ({ messages }) => messages.get("/sonar/paths")?.length >= Math.max(1, scan);
  await until("paths of a scan", () => viewers.every(whole));
  // The viewers connect during the first scan and may miss readings of it; static topics are published once.
  const isOfScan = (topic) => !["/tf_static", "/sonar/scene"].includes(topic);
  for (const { messages } of scan === 0 ? viewers : []) {
    [...messages.keys()].filter(isOfScan).forEach((topic) => messages.set(topic, []));
  }
}
await until("logged scans", () => readLog().scans.length > SCANS);
const log = readLog();
log.scans.shift();
// The map of a scan is published after its paths.
const lastStart = nanoseconds(log.scans.at(-1).start.time);
const hasLastMap = ({ messages }) => messages.get("/map").some(({ message }) => stampOf(message.header.stamp) >= lastStart);
await until("map of the last scan", () => viewers.every(hasLastMap));
for (const viewer of viewers) {
  const { messages, info, words } = viewer;
  assert.deepEqual([info.capabilities, info.name.split(" ")[0]], [[], "sonard"]);
  assert(words.every((said) => !said.includes("left out")), words.join("; "));
  const ranges = compareRanges(messages, log);
  compareScans(messages, log);
  comparePoints(messages, log);
  compareTransforms(messages, log);
  compareMarkers(messages, log);
  const cells = compareMap(messages);
  const count = [...messages.values()].reduce((sum, of) => sum + of.length, 0);
  console.log(`${name}: ${count} messages of ${new Set(viewer.topics.values()).size} types, ${ranges} readings and a map of ${cells} cells, as the log`);
  viewer.client.close();
}
