// Drawing a room: corners and pillars as handles on the plan, walls by clicks.

import { Handle } from "../../crates/sonard-daemon/src/server/page/handles.js";
import { addPillar, addWall, cornersOf, emptyRoom, moveCorner, removeCorner } from "./room.js";
import { rounded } from "../../crates/sonard-daemon/src/server/page/ranger.js";

/** @param {string} id */
const byId = (id) => /** @type {HTMLButtonElement} */ (document.getElementById(id));

/** A click so near to a corner means the corner, pixels. */
const SNAP_PX = 14;
const MOST_UNDO = 50;

/** @typedef {import("./room.js").Point} Point */

export class Editor {
  /**
   * @param {HTMLElement} stage
   * @param {any} view of the plan
   * @param {(scene: import("./room.js").SceneFile, kept: boolean) => void} onScene
   * @param {(pose: import("./engine.js").Pose) => void} onPose
   */
  constructor(stage, view, onScene, onPose) {
    this.stage = stage;
    this.view = view;
    this.onScene = onScene;
    this.open = false;
    /** @type {import("./room.js").SceneFile} */
    this.scene = emptyRoom();
    /** @type {Handle[]} */
    this.handles = [];
    /** Where the next wall begins. @type {Point | null} */
    this.from = null;
    this.adding = false;
    /** @type {string[]} */
    this.before = [];
    /** The scene as it was when a handle was taken hold of: corners that meet while one passes are not joined. */
    this.grabbed = /** @type {import("./room.js").SceneFile | null} */ (null);
    byId("edit").addEventListener("click", () => this.toggle(!this.open));
    byId("add-wall").addEventListener("click", () => this.add(!this.adding));
    byId("add-pillar").addEventListener("click", () => this.change((scene) => addPillar(scene, this.middle())));
    byId("new-room").addEventListener("click", () => {
      const room = emptyRoom();
      this.remember();
      onPose(room.poses?.start ?? { x_m: 1, y_m: 1, heading_deg: 0 });
      this.onScene(room, true);
      this.view.show(this.view.what);
    });
    byId("undo").addEventListener("click", () => this.undo());
    stage.addEventListener("click", (event) => this.click(event), { capture: true });
    stage.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.add(false);
    });
  }

  /** @param {boolean} open */
  toggle(open) {
    this.open = open;
    byId("edit").ariaPressed = String(open);
    byId("drawing").hidden = !open;
    this.add(false);
    this.show(this.scene);
  }

  /** @param {boolean} adding */
  add(adding) {
    [this.adding, this.from] = [adding, null];
    byId("add-wall").ariaPressed = String(adding);
    this.stage.classList.toggle("adding", adding);
  }

  /** Sets the handles where corners and pillars are. @param {import("./room.js").SceneFile} scene */
  show(scene) {
    this.scene = scene;
    if (this.grabbed) return;
    const things = this.open ? this.things() : [];
    while (this.handles.length > things.length) this.handles.pop()?.remove();
    things.forEach((thing, i) => {
      const handle = (this.handles[i] ??= this.handle(i));
      handle.button.classList.toggle("corner", !thing.pillar);
      handle.button.classList.toggle("pillar", thing.pillar);
      handle.place(thing.at, `${thing.pillar ? "Pillar" : "Corner"} at ${thing.at.map((m) => m.toFixed(2)).join(", ")} m`);
    });
  }

  things() {
    const corners = cornersOf(this.scene).map((corner) => ({ at: corner.at, pillar: false, corner }));
    const pillars = (this.scene.cylinders ?? []).map((cylinder) => ({ at: cylinder.center, pillar: true, cylinder }));
    return [...corners, ...pillars];
  }

  /** @param {number} place among the things */
  handle(place) {
    return new Handle(
      this.stage,
      {
        name: "Corner",
        className: "",
        onMove: (at, handle) => {
          if (!this.grabbed) this.remember();
          this.grabbed ??= this.scene;
          handle.place(at);
          this.move(this.grabbed, place, at);
        },
        onDone: () => {
          this.grabbed = null;
          this.onScene(this.scene, true);
        },
        onKey: (key) => {
          if (key === "Escape") this.add(false);
          if (key !== "Delete" && key !== "Backspace") return false;
          this.remove(place);
          return true;
        },
      },
      this.view,
    );
  }

  /**
   * @param {import("./room.js").SceneFile} grabbed
   * @param {number} place
   * @param {Point} at
   */
  move(grabbed, place, at) {
    const scene = structuredClone(grabbed);
    const corners = cornersOf(scene);
    if (place < corners.length) moveCorner(corners[place], at);
    else {
      const cylinder = scene.cylinders?.[place - corners.length];
      if (cylinder) cylinder.center = [rounded(at[0], 2), rounded(at[1], 2)];
    }
    this.onScene(scene, false);
  }

  /** @param {number} place */
  remove(place) {
    this.change((scene) => {
      const corners = cornersOf(scene);
      if (place < corners.length) removeCorner(scene, corners[place]);
      else scene.cylinders?.splice(place - corners.length, 1);
    });
    (this.handles[place] ?? this.handles.at(-1))?.button.focus();
  }

  /** A click where a wall is to begin or end. @param {MouseEvent} event */
  click(event) {
    if (!this.adding) return;
    const box = this.stage.getBoundingClientRect();
    const at = this.nearCorner([event.clientX - box.left, event.clientY - box.top]);
    event.stopPropagation();
    event.preventDefault();
    const from = this.from;
    this.from = at;
    if (from && Math.hypot(at[0] - from[0], at[1] - from[1]) > 0.005) this.change((scene) => addWall(scene, from, at));
  }

  /** @param {Point} px @returns {Point} */
  nearCorner(px) {
    for (const { at } of cornersOf(this.scene)) {
      const [x, y] = this.view.px(at);
      if (Math.hypot(x - px[0], y - px[1]) < SNAP_PX) return [at[0], at[1]];
    }
    const [x, y] = this.view.world(px);
    return [rounded(x, 2), rounded(y, 2)];
  }

  /** @param {(scene: import("./room.js").SceneFile) => void} edit */
  change(edit) {
    this.remember();
    const scene = structuredClone(this.scene);
    edit(scene);
    this.onScene(scene, true);
  }

  remember() {
    this.before.push(JSON.stringify(this.scene));
    if (this.before.length > MOST_UNDO) this.before.shift();
    byId("undo").disabled = false;
  }

  undo() {
    const scene = this.before.pop();
    byId("undo").disabled = this.before.length === 0;
    if (scene) this.onScene(JSON.parse(scene), true);
  }

  /** @returns {Point} */
  middle() {
    return this.view.world([this.view.width / 2, this.view.height / 2]);
  }
}
