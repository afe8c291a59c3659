// Editing of a room in the project's scene format.

import { rounded } from "../../crates/sonard-daemon/src/server/page/ranger.js";

/**
 * @typedef {[number, number]} Point
 * @typedef {{id: string, from?: Point, to?: Point, polyline?: Point[], closed?: boolean, material: string,
 *   z_m?: [number, number]}} Wall
 * @typedef {{id: string, center: Point, radius_m: number, material: string, z_m?: [number, number]}} Cylinder
 * @typedef {{name: string, source?: string, materials: Record<string, import("./engine.js").Material>,
 *   walls?: Wall[], cylinders?: Cylinder[], poses?: Record<string, import("./engine.js").Pose>,
 *   floor_z_m?: number, ceiling_z_m?: number, robot?: object}} SceneFile
 * @typedef {{at: Point, vertices: Point[]}} Corner
 */

/** Rectangular room to start with. */
export function newRoom() {
  const corners = /** @type {Point[]} */ ([[0, 0], [3, 0], [3, 2], [0, 2]]);
  const names = ["south", "east", "north", "west"];
  /** @type {SceneFile} */
  const scene = {
    name: "my-room",
    materials: { plaster: { reflectance: 0.97, roughness: 0 } },
    walls: corners.map((from, i) => ({ id: names[i], from, to: /** @type {Point} */ ([...corners[(i + 1) % 4]]), material: "plaster" })),
    cylinders: [],
    poses: { start: { x_m: 1, y_m: 0.8, heading_deg: 0 } },
  };
  return scene;
}

/** Text of a scene file. @param {SceneFile} scene */
export const textOf = (scene) => `${JSON.stringify(scene, null, 2)}\n`;

/** Corners: vertices of walls, where vertices at the same position form one corner. @param {SceneFile} scene */
export function cornersOf(scene) {
  /** @type {Map<string, Corner>} */
  const corners = new Map();
  for (const wall of scene.walls ?? []) {
    const points = wall.polyline ?? [wall.from, wall.to];
    for (const point of points) {
      if (!point) continue;
      const name = point.map((value) => rounded(value, 4)).join();
      const corner = corners.get(name) ?? { at: point, vertices: [] };
      corner.vertices.push(point);
      corners.set(name, corner);
    }
  }
  return [...corners.values()];
}

/**
 * Moves a corner with all walls connected to it.
 * @param {Corner} corner
 * @param {Point} to
 */
export function moveCorner(corner, [x, y]) {
  for (const vertex of corner.vertices) [vertex[0], vertex[1]] = [rounded(x, 2), rounded(y, 2)];
}

/**
 * Removes a corner with all walls connected to it.
 * @param {SceneFile} scene
 * @param {Corner} corner
 */
export function removeCorner(scene, corner) {
  const own = (/** @type {Point | undefined} */ point) => point !== undefined && corner.vertices.includes(point);
  scene.walls = (scene.walls ?? []).filter((wall) => {
    if (!wall.polyline) return !own(wall.from) && !own(wall.to);
    wall.polyline = wall.polyline.filter((point) => !own(point));
    return wall.polyline.length >= 2;
  });
}

/**
 * @param {SceneFile} scene
 * @param {Point} from
 * @param {Point} to
 */
export function addWall(scene, from, to) {
  scene.walls ??= [];
  scene.walls.push({ id: newName(scene, "wall"), from: [...from], to: [...to], material: materialOf(scene) });
}

/**
 * @param {SceneFile} scene
 * @param {Point} center
 */
export function addPillar(scene, [x, y]) {
  scene.cylinders ??= [];
  const center = /** @type {Point} */ ([rounded(x, 2), rounded(y, 2)]);
  scene.cylinders.push({ id: newName(scene, "pillar"), center, radius_m: 0.05, material: materialOf(scene) });
}

/** @param {SceneFile} scene */
function materialOf(scene) {
  const [first] = Object.keys(scene.materials);
  if (first) return first;
  scene.materials.plaster = { reflectance: 0.97, roughness: 0 };
  return "plaster";
}

/**
 * @param {SceneFile} scene
 * @param {string} kind
 */
function newName(scene, kind) {
  const taken = new Set([...(scene.walls ?? []), ...(scene.cylinders ?? [])].map(({ id }) => id));
  let number = 1;
  while (taken.has(`${kind}-${number}`)) number++;
  return `${kind}-${number}`;
}
